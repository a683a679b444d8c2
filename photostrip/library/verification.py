"""A result made again from its certificate: whether the files, the versions and the numbers are still the same."""

from __future__ import annotations

from collections.abc import Iterator
from math import isclose
from os.path import normpath
from pathlib import Path
from typing import Any

from photostrip.errors import Fault, GeometryError, InputError
from photostrip.formats.output.result_json import read_result
from photostrip.formats.text.source import digest
from photostrip.library.project import loaded_from
from photostrip.notes import Document
from photostrip.result.statement.certificate import result_hash

SCHEMA = 1
SAME, DIFFERENT = "same", "different"
PROJECT = "project.yaml"
LEFT_OUT = {"version", "certificate"}  # what does not come from the project
# Differences that another machine makes: of a number in a block that `compare` does not look at.
RELATIVE, ABSOLUTE = 1e-3, 2e-4


def verify(result: Path, project: Path | None = None) -> Document:
    """Make a result again, and return the document of ``photostrip verify``.

    project: the project file; without one it is looked for beside the result and in the working folder, by its hash.
    Raises InputError when the result cannot be read, has no certificate, or its project is not found.
    """
    file = str(result / "result.json" if result.is_dir() else result)
    document = read_result(file)
    certificate = document.get("certificate")
    if certificate is None:
        fix = "run the project again with this version of photostrip"
        raise InputError(Fault("has no certificate", "no-certificate", file, fix=fix))
    place = project or _found(Path(file).parent, certificate)
    if place is None:
        fix = "name it with --project"
        raise InputError(Fault("its project is not found beside it", "no-project", file, fix=fix))
    found: Document = {
        "photostrip_verify": SCHEMA,
        "result": file,
        "project": str(place),
        "name": document["name"],
        "edited": result_hash(document) != certificate["result_sha256"],
        "inputs": list(_inputs(certificate, place)),
        "grids": [],
        "versions": [],
        "refused": "",
        "numbers": None,
        "words": [],
        "result_sha256": {"certificate": certificate["result_sha256"], "now": None},
    }
    try:
        again = loaded_from(place, certificate["set"]).run(joint=False).document
    except (InputError, GeometryError) as error:
        found["refused"] = str(error)
    else:
        found |= _compared(document, again, file)
    found["status"] = SAME if _same(found) else DIFFERENT
    return found


def _found(folder: Path, certificate: Document) -> Path | None:
    """Return the project file that has the content which the certificate gives."""
    wanted = {each["sha256"]: each["file"] for each in certificate["inputs"]}
    above = [Path(normpath(folder / up)) for up in ("..", "../..")]  # methods side by side have folders of their own
    for place in (folder, *above, Path()):
        for path in sorted(place.glob("*.yaml")):
            content = path.read_bytes() if path.is_file() else b""
            if "/" not in wanted.get(digest(content), "/") and path.name in wanted.values():
                return path
    return None


def _inputs(certificate: Document, project: Path) -> Iterator[Document]:
    """Compare every file that was read with what stands there now; the project file may have another name."""
    for each in certificate["inputs"]:
        path = project.parent / each["file"]
        yield {"file": each["file"], "state": _state(path, each["sha256"])}


def _state(path: Path, content: str) -> str:
    try:
        return SAME if digest(path.read_bytes()) == content else "changed"
    except OSError:
        return "missing"


def _compared(document: Document, again: Document, file: str) -> Document:
    """Return what is different between a result and the same made again."""
    from photostrip.comparison import compare_results

    before, now = document["certificate"], again["certificate"]
    versions = [
        {"name": name, "certificate": before["versions"].get(name), "now": version}
        for name, version in now["versions"].items()
        if before["versions"].get(name) != version
    ]
    grids = {each["file"]: each["sha256"] for each in now["grids"]}
    changed = [
        {"file": each["file"], "state": SAME if grids.get(each["file"]) == each["sha256"] else "changed"}
        for each in before["grids"]
    ]
    others = [key for key in again if key not in LEFT_OUT and _other(document.get(key), again[key])]
    return {
        "versions": versions,
        "grids": changed,
        "numbers": compare_results(again, document, None, ("the result made again", file)),
        "words": [] if versions else others,
        "result_sha256": {"certificate": before["result_sha256"], "now": now["result_sha256"]},
    }


def _other(one: Any, two: Any) -> bool:  # noqa: ANN401 (any part of a document)
    """Whether two parts differ by more than another processor makes them differ."""
    if isinstance(one, dict) and isinstance(two, dict):
        return one.keys() != two.keys() or any(_other(one[key], two[key]) for key in one)
    if isinstance(one, list) and isinstance(two, list | tuple):  # a tuple is read again as a list
        return len(one) != len(two) or any(map(_other, one, two))
    if isinstance(one, float) and isinstance(two, float | int) and not isinstance(two, bool):
        return not isclose(one, two, rel_tol=RELATIVE, abs_tol=ABSOLUTE)
    return bool(one != two)


def _same(found: Document) -> bool:
    files = [*found["inputs"], *found["grids"]]
    return (
        not found["edited"]
        and not found["refused"]
        and all(each["state"] == SAME for each in files)
        and found["numbers"]["status"] == SAME
        and not found["words"]
    )
