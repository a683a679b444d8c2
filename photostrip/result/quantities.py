"""Every key of result.json described once, in ``quantities.txt``; the records of the document are rounded by it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise, product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.result.numbers import DEGREES, GEOGRAPHIC, GROUND, MICROMETRES, RADIANS, Plain, rounded, significant

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import ArrayLike

    from photostrip.result.numbers import Document

KINDS = {"text", "word", "count", "flag", "any"}
BRACES = re.compile(r"\{([^}]*)\}")
# Decimals of a value whose unit stands beside it; without a unit it is a ratio.
DECIMALS_BY_UNIT = {"": 2, "um": MICROMETRES, "ppm": 1, "m": GROUND, "deg": DEGREES}


@dataclass(frozen=True, slots=True)
class Quantity:
    """The value of a key, or each number of the list that stands there."""

    meaning: str
    kind: str  # text, word (one of a few), count, flag, number, any (described elsewhere)
    unit: str = ""  # m, um, deg, ...; empty for ratios; frame: that of its coordinates; angle: that of its angles
    decimals: int | None = None
    digits: int | None = None  # significant ones, where a number has no natural size
    unit_key: str = ""  # key of the same record that names the unit

    @classmethod
    def of(cls, form: str, meaning: str) -> Quantity:
        """Read a form, as ``um 2``, ``ratio 4 digits``, ``by unit``, ``any m`` or ``text``."""
        kind, *rest = form.split()
        if kind in KINDS:
            return cls(meaning, kind, "".join(rest))
        if kind == "by":
            return cls(meaning, "number", unit_key=rest[0])
        places, unit = int(rest[0]), "" if kind == "ratio" else kind
        if rest[1:]:
            return cls(meaning, "number", unit, digits=places)
        return cls(meaning, "number", unit, decimals=places)

    def rounded(self, value: ArrayLike, unit: str = "") -> Plain:
        """Return a value, or an array of them, as it is written; None for a number that is not finite."""
        decimals = DECIMALS_BY_UNIT[unit] if self.unit_key else self.decimals
        if decimals is not None:
            return rounded(value, decimals)
        if self.digits is not None:
            return significant(value, self.digits)
        return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


Table = dict[str, "Quantity | Table"]


@cache
def described() -> Table:
    """Read the description: what stands under each key of a result; the records of a list are described once."""
    found: Table = {}
    block = ""
    for line in Path(__file__).with_suffix(".txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            block = line[1:-1]
        elif line and not line.startswith("#"):
            key, form, meaning = line.split(" | ")
            for path in _expanded(f"{block}.{key}" if block else key):
                *above, last = path.split(".")
                table_at(".".join(above), found)[last] = Quantity.of(form, meaning)
    return found


def _expanded(path: str) -> Iterator[str]:
    """Write ``{a b}.c`` out as ``a.c`` and ``b.c``."""
    fixed = BRACES.split(path)
    for names in product(*(choice.split() for choice in fixed[1::2])):
        yield "".join(part for pair in zip(fixed[::2], (*names, ""), strict=True) for part in pair)


def table_at(path: str, within: Table | None = None) -> Table:
    """Return what is described below a block, as ``strips`` or ``precision.along``; empty when nothing is."""
    found = described() if within is None else within
    for key in path.split(".") if path else ():
        below = found.setdefault(key, {})
        if isinstance(below, Quantity):
            raise KeyError(path)
        found = below
    return found


def quantity_at(path: str) -> Quantity | None:
    """Find a key by the keys that lead to it; what stands below a key that is described as a whole belongs to it."""
    found: Quantity | Table | None = described()
    for key in path.split("."):
        found = found.get(key) if isinstance(found, dict) else found
    return found if isinstance(found, Quantity) else None


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
    if value is None:
        return None
    if isinstance(entry, Quantity):
        return entry.rounded(value, beside.get(entry.unit_key, ""))
    return [_record(entry, each) for each in value] if isinstance(value, list) else _record(entry, value)


def records(block: str, columns: Mapping[str, Any]) -> list[Document]:
    """Make the records of a block from its columns, rounded as their keys are described.

    A column is an array or a list, or a dictionary of columns where the record has parts; a text, a flag or None
    stands in every record.
    """
    size = next(len(column) for column in columns.values() if isinstance(column, list | tuple | np.ndarray))
    return as_records({key: _cells(table_at(block)[key], column, size) for key, column in columns.items()})


def as_records(columns: Mapping[str, Sequence[Plain]]) -> list[Document]:
    """Make records of columns of equal length."""
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _cells(entry: Quantity | Table, column: Any, size: int) -> Sequence[Plain]:  # noqa: ANN401 (any column)
    if isinstance(column, Mapping) and isinstance(entry, dict):
        return as_records({key: _cells(entry[key], part, size) for key, part in column.items()})
    if not isinstance(column, list | tuple | np.ndarray):
        return [column] * size
    if isinstance(entry, Quantity):
        cells: Sequence[Plain] = entry.rounded(column)
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
