"""The records of the document of a result, rounded as their keys are described."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from photostrip.notes import Document
from photostrip.result.description import Quantity, Table, table_at
from photostrip.result.numbers import (
    DEGREES,
    GEOGRAPHIC,
    GROUND,
    IMAGE,
    RADIANS,
    Plain,
    RoundedColumn,
    rounded,
    significant,
    to_decimals,
    to_digits,
)
from photostrip.result.records import Grouped, Named, Records

# Decimals of a value whose unit stands beside it; without a unit it is a ratio.
DECIMALS_BY_UNIT = {"": 2, "um": IMAGE, "ppm": 1, "m": GROUND, "deg": DEGREES, "gon": DEGREES, "rad": RADIANS}
COUNTS_AND_FLAGS = "iub"  # kinds of arrays


def rounded_as(entry: Quantity, value: ArrayLike, unit: str = "") -> Plain:
    """Return a value, or an array of them, as its key is written; None for a number that is not finite."""
    decimals = _decimals(entry, unit)
    if decimals is not None:
        return rounded(value, decimals)
    if entry.digits is not None:
        return significant(value, entry.digits)
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _decimals(entry: Quantity, unit: str) -> int | None:
    return DECIMALS_BY_UNIT[unit] if entry.unit_key else entry.decimals


def coordinate_decimals(kind: str, axes: Sequence[str], lengths: int = GROUND) -> list[int]:
    """Return the decimals of x, y, z in a frame with those of its lengths: angles have more."""
    return [GEOGRAPHIC if kind == "geographic" and axis != "up" else lengths for axis in axes]


def angle_decimals(unit: str) -> int:
    """Return the decimals of angles of photos in ``deg``, ``gon`` or ``rad``."""
    return RADIANS if unit == "rad" else DEGREES


def record(block: str, values: Mapping[str, Any]) -> Document:
    """Round the values of a record of a block, each as its key is described."""
    return _record(table_at(block), values)


def _record(table: Table, values: Mapping[str, Any]) -> Document:
    return {key: _written(table[key], value, values) for key, value in values.items()}


def _written(entry: Quantity | Table, value: Any, beside: Mapping[str, Any]) -> Plain:  # noqa: ANN401 (any value)
    if value is None or isinstance(value, str):
        return value
    if isinstance(entry, Quantity):
        return rounded_as(entry, value, beside.get(entry.unit_key, ""))
    if isinstance(value, Records):
        return value
    return [_record(entry, each) for each in value] if isinstance(value, list) else _record(entry, value)


def records(block: str, columns: Mapping[str, Any]) -> Records:
    """Make the records of a block from its columns, rounded as their keys are described.

    A column is an array or a list, or a dictionary of columns where the record has parts; a text, a flag or None
    stands in every record. All values of a column with a unit beside it have the same.
    """
    size = next(len(column) for column in columns.values() if isinstance(column, list | tuple | np.ndarray))
    table = table_at(block)
    return Records({key: _cells(table[key], column, size, columns) for key, column in columns.items()})


def _cells(
    entry: Quantity | Table,
    column: Any,  # noqa: ANN401 (any column)
    size: int,
    beside: Mapping[str, Any] = MappingProxyType({}),
) -> Sequence[Plain]:
    if isinstance(column, Mapping) and isinstance(entry, dict):
        return Records({key: _cells(entry[key], part, size) for key, part in column.items()})
    if not isinstance(column, list | tuple | np.ndarray):
        return column if isinstance(column, RoundedColumn | Named | Grouped) else [column] * size
    if isinstance(entry, Quantity):
        unit = next(iter(beside.get(entry.unit_key, ())), "")
        if isinstance(column, np.ndarray):
            decimals, digits = _decimals(entry, unit), entry.digits
            if decimals is not None:
                column = to_decimals(column, decimals)
            return RoundedColumn(column if decimals is not None or digits is None else to_digits(column, digits))
        cells: Sequence[Plain] = rounded_as(entry, column, unit)
        return cells
    return [None if each is None else _record(entry, each) for each in column]


def grouped(block: str, heads: Mapping[str, Any], columns: Mapping[str, Any], ends: Sequence[int]) -> Records:
    """Make records with a list in each column: one value of each head, and the rows between two `ends` of a column."""
    table = table_at(block)
    cells = {key: _cells(table[key], column, len(ends) - 1) for key, column in heads.items()}
    return Records(cells | {key: Grouped(_cells(table[key], column, 0), ends) for key, column in columns.items()})
