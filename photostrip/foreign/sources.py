"""What a source is: known by what is in it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from photostrip.errors import Fault, InputError
from photostrip.foreign import colmap, historix, metashape, opensfm
from photostrip.foreign.tables import ForeignBlock, Wanted
from photostrip.formats.files import refuse

READ = f"a folder with cameras.bin or cameras.txt (COLMAP), reconstruction.json (OpenSfM) or {historix.INTRINSICS} \
(HISTORIX), or an .xml of cameras (Metashape)"


def read_source(source: Path, wanted: Wanted) -> ForeignBlock:
    """Read what another program wrote.

    Raises InputError for what is nothing of the kind, and for all that is wrong in it.
    """
    if historix.is_project(source):
        return historix.read(source, wanted)
    reader = _model_reader(source)
    if reader is not None:
        for option, value in (("--image-size", wanted.image_size), ("--positions-sigma", wanted.positions_sigma)):
            if value is not None:
                message = "is of no use here: it is for projects of HISTORIX"
                raise InputError(Fault(message, "option", key=option, fix="leave it out"))
        return reader(source)
    near = [source.parent] if source.is_file() else sorted([*source.glob("*"), *source.glob("*/*")])
    inside = next((each for each in near if historix.is_project(each) or _model_reader(each)), None)
    fix = f"did you mean `{inside}`?" if inside is not None else ""
    return refuse(str(source), "foreign", "is nothing that is read here", expected=READ, fix=fix)


def own_control(source: Path) -> Path | None:
    """Return the table of control that belongs to a source."""
    file = source / historix.CONTROL
    return file if historix.is_project(source) and file.is_file() else None


def _model_reader(source: Path) -> Callable[[Path], ForeignBlock] | None:
    if colmap.is_model(source):
        return colmap.read
    if metashape.is_file(source):
        return metashape.read
    return opensfm.read if opensfm.is_reconstruction(source) else None
