"""The records of the document of a result, rounded as their keys are described."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from photostrip.result.description import Quantity, Table, table_at
from photostrip.result.numbers import DEGREES, GEOGRAPHIC, GROUND, IMAGE, RADIANS, Document, Plain, rounded, significant

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import ArrayLike

    from photostrip.arrays import Numbers

# Decimals of a value whose unit stands beside it; without a unit it is a ratio.
DECIMALS_BY_UNIT = {"": 2, "um": IMAGE, "ppm": 1, "m": GROUND, "deg": DEGREES, "gon": DEGREES, "rad": RADIANS}


class Records(Sequence[Document]):
    """Records as they are written, kept as columns of equal length: a record is made when it is asked for."""

    def __init__(self, columns: Mapping[str, Sequence[Plain]]) -> None:
        self.columns = dict(columns)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def __iter__(self) -> Iterator[Document]:
        return iter(as_records(self.columns))

    @overload
    def __getitem__(self, place: int) -> Document: ...
    @overload
    def __getitem__(self, place: slice) -> Records: ...
    def __getitem__(self, place: int | slice) -> Document | Records:
        found = {key: column[place] for key, column in self.columns.items()}
        return Records(found) if isinstance(place, slice) else found

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]

    def taken(self, order: Numbers) -> Records:
        """Return the records in another order."""
        places = order.tolist()
        return Records({key: [column[place] for place in places] for key, column in self.columns.items()})

    @classmethod
    def joined(cls, parts: Iterable[Records]) -> Records:
        """Return records of the same keys one after the other."""
        columns: dict[str, list[Plain]] = {}
        for part in parts:
            for key, column in part.columns.items():
                columns.setdefault(key, []).extend(column)
        return cls(columns)


def as_lists(value: Plain) -> Plain:
    """Return a document with lists of records in place of columns, as it is read again."""
    if isinstance(value, dict):
        return {key: as_lists(each) for key, each in value.items()}
    return list(value) if isinstance(value, Records) else value


def rounded_as(entry: Quantity, value: ArrayLike, unit: str = "") -> Plain:
    """Return a value, or an array of them, as its key is written; None for a number that is not finite."""
    decimals = DECIMALS_BY_UNIT[unit] if entry.unit_key else entry.decimals
    if decimals is not None:
        return rounded(value, decimals)
    if entry.digits is not None:
        return significant(value, entry.digits)
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def coordinate_decimals(kind: str, axes: Sequence[str]) -> list[int]:
    """Return the decimals of x, y, z in a frame: angles have more than metres."""
    return [GEOGRAPHIC if kind == "geographic" and axis != "up" else GROUND for axis in axes]


def angle_decimals(unit: str) -> int:
    """Return the decimals of angles of photos in ``deg``, ``gon`` or ``rad``."""
    return RADIANS if unit == "rad" else DEGREES


def record(block: str, values: Mapping[str, Any]) -> Document:
    """Round the values of a record of a block, each as its key is described."""
    return _record(table_at(block), values)


def _record(table: Table, values: Mapping[str, Any]) -> Document:
    return {key: _written(table[key], value, values) for key, value in values.items()}


def _written(entry: Quantity | Table, value: Any, beside: Mapping[str, Any]) -> Plain:  # noqa: ANN401 (any value)
    if value is None or isinstance(value, Records):
        return value
    if isinstance(entry, Quantity):
        return rounded_as(entry, value, beside.get(entry.unit_key, ""))
    return [_record(entry, each) for each in value] if isinstance(value, list) else _record(entry, value)


def records(block: str, columns: Mapping[str, Any]) -> Records:
    """Make the records of a block from its columns, rounded as their keys are described.

    A column is an array or a list, or a dictionary of columns where the record has parts; a text, a flag or None
    stands in every record.
    """
    size = next(len(column) for column in columns.values() if isinstance(column, list | tuple | np.ndarray))
    return Records({key: _cells(table_at(block)[key], column, size) for key, column in columns.items()})


def as_records(columns: Mapping[str, Sequence[Plain]]) -> list[Document]:
    """Make records of columns of equal length."""
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _cells(entry: Quantity | Table, column: Any, size: int) -> Sequence[Plain]:  # noqa: ANN401 (any column)
    if isinstance(column, Mapping) and isinstance(entry, dict):
        return as_records({key: _cells(entry[key], part, size) for key, part in column.items()})
    if not isinstance(column, list | tuple | np.ndarray):
        return [column] * size
    if isinstance(entry, Quantity):
        cells: Sequence[Plain] = rounded_as(entry, column)
        return cells
    return [None if each is None else _record(entry, each) for each in column]


def grouped(block: str, heads: Mapping[str, Any], columns: Mapping[str, Any], ends: Sequence[int]) -> list[Document]:
    """Make records with a list in each column: one value of each head, and the rows between two `ends` of a column."""
    table = table_at(block)
    cells = {key: _cells(table[key], column, len(ends) - 1) for key, column in heads.items()}
    for key, column in columns.items():
        values = _cells(table[key], column, 0)
        cells[key] = [values[start:end] for start, end in pairwise(ends)]
    return as_records(cells)
