"""Values of the document of a result, rounded as their keys are described."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from photostrip.notes import Document
from photostrip.result.description import Block, Quantity, block_at
from photostrip.result.numbers import (
    DEGREES,
    GEOGRAPHIC,
    GROUND,
    IMAGE,
    RADIANS,
    Plain,
    rounded,
    significant,
    to_decimals,
    to_digits,
)

MATRIX = tuple(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3))  # of a rotation, by rows
# Decimals of a value whose unit stands beside it; without a unit it is a ratio.
DECIMALS_BY_UNIT = {"": 2, "um": IMAGE, "ppm": 1, "m": GROUND, "deg": DEGREES, "gon": DEGREES, "rad": RADIANS}


def coordinate_decimals(frame: Document) -> list[int]:
    """Return the decimals of x, y, z in a frame, the block of a result: angles have more than lengths."""
    lengths = frame.get("decimals") or GROUND
    return [GEOGRAPHIC if frame["kind"] == "geographic" and axis != "up" else lengths for axis in frame["axes"]]


def angle_decimals(unit: str) -> int:
    """Return the decimals of angles of photos in ``deg``, ``gon`` or ``rad``."""
    return RADIANS if unit == "rad" else DEGREES


def rounded_column(entry: Quantity, column: NDArray[Any], units: Sequence[str] | None) -> NDArray[Any]:
    """Round the numbers of a column; units: those of its rows where they stand in a column beside it."""
    if entry.many and entry.kind == "number":
        return np.fromiter((None if each is None else rounded_as(entry, each) for each in column), object, len(column))
    if units is not None:
        column = np.array(column, float)
        for unit in set(units):
            rows = np.array([each == unit for each in units], bool)
            column[rows] = to_decimals(column[rows], DECIMALS_BY_UNIT[unit])
        return column
    if entry.decimals is not None:
        return to_decimals(column, entry.decimals)
    return column if entry.digits is None else to_digits(column, entry.digits)


def rounded_as(entry: Quantity, value: Any, unit: str = "") -> Plain:  # noqa: ANN401 (any value)
    """Return a value, or a list of numbers, as its key is written; None for a number that is not finite."""
    decimals = DECIMALS_BY_UNIT[unit] if entry.unit_key else entry.decimals
    if decimals is not None:
        return rounded(value, decimals)
    if entry.digits is not None:
        return significant(value, entry.digits)
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def record(path: str, values: Mapping[str, Any]) -> Document:
    """Round the values of a block, each as its key is described; its tables are rounded already."""
    return _record(block_at(path), values)


def _record(block: Block, values: Mapping[str, Any]) -> Document:
    return {key: _written(block[key], value, values) for key, value in values.items()}


def _written(entry: Quantity | Block, value: Any, beside: Mapping[str, Any]) -> Plain:  # noqa: ANN401 (any value)
    if value is None or isinstance(value, str):
        return value
    if isinstance(entry, Quantity):
        return rounded_as(entry, value, beside.get(entry.unit_key, ""))
    return _record(entry, value) if isinstance(value, Mapping) else value
