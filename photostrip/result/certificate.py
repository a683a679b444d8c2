"""The certificate of a result: from which bytes and with what it was made; saved results that somebody edited."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip import __version__, number_columns
from photostrip.arrays import Floats, pieces
from photostrip.errors import Fault, InputError
from photostrip.geodesy.proj_operation import proj_versions
from photostrip.notes import Document
from photostrip.number_columns import Cells
from photostrip.result.table import Table
from photostrip.result.verdict import FAILED, LOOK

if TYPE_CHECKING:
    from photostrip.geodesy.frame_spec import FrameSpec


LIBRARIES = ("numpy", "scipy", "pyproj")  # whose version can change a number
WITHOUT_PROJ = {"local", "geocentric"}
METRES, DEGREES, ANGLES = 3, 8, {"deg": 4, "gon": 4, "rad": 6}
WORDS = {"message", "fix", "sentences", "remarks"}  # of the statement: they follow from its figures


def certificate_of(
    document: Document,
    frames: Sequence[FrameSpec],
    inputs: Mapping[str, str],
    grids: Mapping[str, str],
    settings: Document,
) -> Document:
    """Return the block ``certificate``.

    frames: those of the lists of given coordinates, and that of the result last.
    inputs, grids: SHA-256 of every file that was read, by its path from the project's folder, of grids by their name.
    settings: ``set``, what the command line overrode, and ``resolved_sha256``, the hash of the resolved project.
    """
    return {
        "result_sha256": result_hash(document),
        **settings,
        "epochs": [frame.epoch for frame in frames],
        "inputs": _hashes("inputs", inputs),
        "grids": _hashes("grids", grids),
        "versions": versions(with_proj=any(frame.crs.casefold() not in WITHOUT_PROJ for frame in frames)),
    }


def _hashes(name: str, files: Mapping[str, str]) -> Table:
    return Table.of(f"certificate.{name}", {"file": sorted(files), "sha256": [files[file] for file in sorted(files)]})


def result_hash(document: Document) -> str:
    """Return the hash of the numbers of a result as reports print them; the same on every machine."""
    found, before = hashlib.sha256(), ""
    for lines in _lines(document):
        found.update(f"{before}{lines}".encode())
        before = "\n"
    return found.hexdigest()


def _lines(document: Document) -> Iterator[str]:
    """Give the lines that are hashed, one or some together."""
    frame = document["frame"]
    yield f"{document['adjustment']} {frame['crs']} {' '.join(frame['axes'])}"
    places = [DEGREES if frame["kind"] == "geographic" and axis != "up" else METRES for axis in frame["axes"]]
    yield from _rows("point", document["points"], ("id", "role"), dict(zip("xyz", places, strict=True)))
    yield from _rows("photo", document["photos"], ("id",), dict(zip("xyz", places, strict=True)))
    unit = document["angles"]["unit"]
    yield from _rows("angles", document["photos"], (), dict.fromkeys(("angle_1", "angle_2", "angle_3"), ANGLES[unit]))
    yield from _rows("given", document["control"], ("id", "role", "use"), dict.fromkeys(("dx", "dy", "dz"), METRES))
    yield from _rows("rejected", document["rejected"], ("photo", "point", "stage"), {})
    yield f"verdict {document['status']}"
    yield from _figures(document.get("statement"))


def _figures(value: Any) -> Iterator[str]:  # noqa: ANN401 (any value)
    """Write a line for each figure of the statement, and for each reason that forbids it."""
    if isinstance(value, dict):
        for key in sorted(value.keys() - WORDS):
            yield key
            yield from _figures(value[key])
    elif isinstance(value, list | Table):
        for each in value:
            yield from _figures(each)
    elif isinstance(value, str):
        yield value
    else:
        yield "-" if value is None else f"{float(f'{value:.{METRES}f}') + 0.0:.{METRES}f}"


def _rows(what: str, table: Table, texts: Sequence[str], numbers: Mapping[str, int]) -> Iterator[str]:
    """Write a line for each row, with these texts and these numbers, ``-`` for those that do not exist."""
    for part in pieces(len(table)):
        size = part.stop - part.start
        cells = [number_columns.as_texts(list(map(str, table[key][part]))) for key in texts]
        cells += [_cells(table[key][part], places) for key, places in numbers.items()]
        first, between = (number_columns.repeated(text, size) for text in (what, " "))
        yield number_columns.joined([first, *(each for column in cells for each in (between, column))], "\n")


def _cells(values: Floats, decimals: int) -> Cells:
    """Write numbers with these decimals, ``-`` for those that do not exist, never ``-0``."""
    known = values.copy()
    for row in np.flatnonzero(np.abs(values) < 10.0**-decimals).tolist():
        known[row] = float(f"{values[row]:.{decimals}f}") + 0.0
    return number_columns.as_fixed(known, decimals, "-")


@cache
def versions(*, with_proj: bool) -> Document:
    """Return the versions of what computes; without PROJ where no frame asks for it."""
    proj = proj_versions() if with_proj else {"proj": None, "epsg": None}
    python = ".".join(map(str, sys.version_info[:3]))
    return {"photostrip": __version__, "python": python, **{name: _version(name) for name in LIBRARIES}, **proj}


def _version(package: str) -> str:
    """Return the version of a package from the name of its metadata, without importing either."""
    spec = find_spec(package)
    folder = Path(spec.origin).parents[1] if spec is not None and spec.origin else None
    names = sorted(os.listdir(folder)) if folder is not None else []  # noqa: PTH208 (a path of each takes longer)
    metadata = (each for each in names if each.startswith(f"{package}-") and each.endswith(("dist-info", "egg-info")))
    known = next((each.rpartition(".")[0].split("-")[1] for each in metadata), None)
    if known is None:
        from importlib.metadata import version

        known = version(package)
    return known


WITHOUT_PLACE: Document = {"strip": "", "photos": [], "points": [], "key": ""}
FIX = "run the project again"
EDITED = "its numbers are not those of its certificate: it was edited after it was written"
# what Python raises on a value that is not of the form that is expected there, and on a word that is none of a few
OF_VALUES: tuple[type[Exception], ...] = (ArithmeticError, AttributeError, IndexError, TypeError, ValueError)
OF_WORDS = (*OF_VALUES, KeyError)


def is_edited(document: Document) -> bool:
    """Whether a result has other numbers than when it was written; of one without a certificate nobody knows."""
    certificate = document.get("certificate")
    if not certificate:
        return False
    try:
        return bool(result_hash(document) != certificate["result_sha256"])
    except OF_WORDS:
        return True


def as_reported(document: Document, file: str) -> Document:
    """Return a saved result as it is reported: one that was edited says so, and is never GOOD."""
    if not is_edited(document):
        return document
    verdict, note = document["verdict"], f"{file}: {EDITED}"
    warning = {"code": "result-edited", "severity": "warning", "message": EDITED, "file": file, "line": 0, "column": 0}
    edited = {
        "status": document["status"] if document["status"] == FAILED else LOOK,
        "verdict": verdict | {"look_at": [f"{note}; {FIX}", *verdict["look_at"]]},
        "notes": Table.of_rows("notes", [warning | WITHOUT_PLACE, *document["notes"]]),
    }
    return {**document, **edited}


@contextmanager
def faults_of_edited(
    doing: str, *given: tuple[Document, str], errors: tuple[type[Exception], ...] = OF_WORDS
) -> Iterator[None]:
    """Turn what a document has in another form than it was written in into a fault of its file.

    A key that is missing has been told when it was read. Where the certificates vouch for all
    documents, an error is one of this program, and stays what it is.
    doing: ``reported`` or ``compared``.
    given: documents with their files, that which has no certificate last.
    errors: those that a document can be the cause of.
    """
    try:
        yield
    except errors as error:
        for document, file in given:
            if is_edited(document):
                raise InputError(Fault(f"cannot be {doing}: {EDITED}", "result-edited", file, fix=FIX)) from error
            if not document.get("certificate"):
                message = f"cannot be {doing}: a value is of another kind ({error})"
                raise InputError(
                    Fault(message, "result-incomplete", file, expected="a whole result.json", fix=FIX)
                ) from error
        raise
