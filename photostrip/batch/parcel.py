"""A project with all its files as bytes, so that another machine can compute it without a shared disk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from photostrip.errors import InputError
from photostrip.formats.text.files import LARGEST_FILE, from_disk, read_bytes
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.source import Source, reading_from
from photostrip.formats.text.table_text import LARGEST_TABLE
from photostrip.geodesy.crs import grid_names
from photostrip.project.reading import Node, override, path_of, read_tree


@dataclass(frozen=True)
class Parcel:
    """The files of a project."""

    # content of the project file, of what it extends and of its tables, by path as the user typed it
    files: dict[str, bytes]
    grids: dict[str, bytes]  # content of the grid files beside the project file, by name
    folder: str


def pack(path: Path, overrides: Sequence[str] = ()) -> Parcel:
    """Read all files of a project without looking into its tables."""
    findings, names = Findings(), list[str]()
    with reading_from(Source()):  # a separate account: what is read now is not what a result is made from
        root = read_tree(str(path), findings, names)
        if root is not None:
            root = override(root, overrides, findings)
            names += [path_of(node, str(path)) for node in _values(root, "file")]
        findings.stop()
        files = {name: read_bytes(name, LARGEST_TABLE) for name in dict.fromkeys(names)}
    if root is None:  # cannot be: read_tree() had a reason, and stop() raised it
        raise InputError(f"{path} cannot be read")
    grids = {name for node in _values(root, "crs") for name in grid_names(node.text)}
    # grids elsewhere than below the project's folder must be on every machine
    below = (name for name in sorted(grids) if not Path(name).is_absolute() and ".." not in Path(name).parts)
    found = {name: path.parent / name for name in below if (path.parent / name).is_file()}
    return Parcel(files, {name: from_disk(str(grid), LARGEST_FILE) for name, grid in found.items()}, str(Path.cwd()))


def unpack_grids(parcel: Parcel, folder: Path) -> None:
    """Write the grid files of a parcel, which PROJ reads by itself, into a folder."""
    for name, data in parcel.grids.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def _values(node: Node, key: str) -> Iterator[Node]:
    """Return every text of the project that stands under a key of this name, or in a list under it."""
    for name, inner in node.entries.items():
        if name == key:
            yield from (each for each in (inner, *inner.elements) if each.text)
        yield from _values(inner, key)
    for inner in node.elements:
        yield from _values(inner, key)
