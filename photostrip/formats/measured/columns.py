"""Columns that several tables share, and what is refused in all of them alike."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from photostrip.arrays import Flags
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.tables import Column, Table
from photostrip.notes import counted

AXES = ("x", "y", "z")
PHOTO = Column("photo", aliases=("photo_id", "image", "image_id"))
POINT = Column("point", aliases=("point_id", "id"))
SIGMAS = tuple(f"s{axis}" for axis in AXES)


def numbers(*names: str, filled: bool = True) -> tuple[Column, ...]:
    """Return columns of numbers that a table must have."""
    return tuple(Column(name, number=True, filled=filled) for name in names)


def sigmas(*axes: str) -> tuple[Column, ...]:
    """Return columns of standard deviations that a table may have."""
    return tuple(
        Column(f"s{axis}", number=True, required=False, filled=False, positive=True, aliases=(f"sigma_{axis}",))
        for axis in axes
    )


def refuse_without_sigma(table: Table, missing: Flags, columns: Sequence[str], fix: str, findings: Findings) -> None:
    """Ask for the standard deviations that neither rows nor project give; `missing` marks their cells."""
    rows, places = np.nonzero(missing)
    if len(rows):
        number = counted(len(np.unique(rows)), "row has no standard deviation", "rows have no standard deviation")
        message = f"{number} ({', '.join(columns)}), and the project file gives none"
        findings.add(table.fault(int(rows[0]), columns[int(places[0])], message, "no-sigma", fix=fix))


def repeated_rows(keys: Iterable[object]) -> Iterator[tuple[int, int]]:
    """Yield the number of each row whose key stands in a row before, and of the first such row."""
    first: dict[object, int] = {}
    for row, key in enumerate(keys):
        before = first.setdefault(key, row)
        if before != row:
            yield row, before
