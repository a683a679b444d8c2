"""What a source is: known by what is in it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from photostrip.foreign import colmap, opensfm
from photostrip.foreign.tables import ForeignBlock
from photostrip.formats.text.files import refuse

READ = "a folder with cameras.bin or cameras.txt (COLMAP), or with reconstruction.json (OpenSfM)"


def read_source(source: Path) -> ForeignBlock:
    """Read what another program wrote.

    Raises InputError for what is nothing of the kind, and for all that is wrong in it.
    """
    reader = _reader(source)
    if reader is not None:
        return reader(source)
    near = [source.parent] if source.is_file() else sorted([*source.glob("*"), *source.glob("*/*")])
    inside = next(filter(_reader, near), None)
    fix = f"did you mean `{inside}`?" if inside is not None else ""
    return refuse(str(source), "foreign", "is nothing that is read here", expected=READ, fix=fix)


def _reader(source: Path) -> Callable[[Path], ForeignBlock] | None:
    if colmap.is_model(source):
        return colmap.read
    return opensfm.read if opensfm.is_reconstruction(source) else None
