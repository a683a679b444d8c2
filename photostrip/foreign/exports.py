"""A result as files for other programs, by the ending of their name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath
from typing import NamedTuple

from photostrip.errors import Fault, InputError
from photostrip.foreign import cameras, colmap_model, geopackage, historix_submission, opensfm_model, orthority
from photostrip.foreign.adjusted import adjusted
from photostrip.notes import Document
from photostrip.project.keys import ENDINGS, form_of
from photostrip.strip.pixel_cameras import CONVENTIONS

WRITERS = {
    "geopackage": geopackage.write,
    "historix": historix_submission.write,
    "orthority": orthority.write,
    "orthority-geojson": orthority.write,
    "omega-phi-kappa": orthority.write,
    "colmap": colmap_model.write,
    "opensfm": opensfm_model.write,
    **dict.fromkeys(("cameras", *(f"cameras-{each}" for each in CONVENTIONS)), cameras.write),
}


class Exported(NamedTuple):
    """Files that are still to be written, by their place in a folder, and what is said about them."""

    files: dict[str, str | bytes]
    said: list[str]


def exported(document: Document, targets: Sequence[str], asked: str = "") -> Exported:
    """Make files of the content of result.json, the same bytes for the same content.

    targets: names of files; a folder ends with ``/``.
    asked: the form of all of them; else each has that of its ending.
    Raises InputError for a form that is not known, and for a result that cannot be written in it.
    """
    found = Exported({}, [])
    if not targets:
        return found
    block = adjusted(document)
    for target in targets:
        form = form_of(target, asked)
        if not block.points:
            raise InputError(Fault("the result has no points", "export"))
        files, said = WRITERS[form](block, target if ENDINGS[form] != "/" else f"{target.rstrip('/')}/", form)
        found.files.update(files)
        found.said.extend(f"{PurePath(target).name}: {each}" for each in said)
    return found
