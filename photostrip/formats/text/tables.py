"""A CSV table: its columns as the format defines them and, as arrays and numbers of ids, as they were read."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault
from photostrip.notes import Note

if TYPE_CHECKING:
    from photostrip.formats.text.table_text import TableText

CONTROL_CHARACTER = re.compile(r"[\x00-\x1f\x7f]")


@dataclass(frozen=True)
class Column:
    name: str
    number: bool = False  # whether its cells are numbers; otherwise they are ids
    required: bool = True
    filled: bool = True
    positive: bool = False
    words: tuple[str, ...] = ()  # the only values allowed, the first being that of an empty cell
    aliases: tuple[str, ...] = ()
    header: str = ""  # the only name for it in this table, in lower case; empty: its name and its aliases

    @property
    def accepted(self) -> tuple[str, ...]:
        """Names in the header that mean this column, in lower case."""
        return (self.header,) if self.header else (self.name, *self.aliases)


@dataclass(frozen=True, eq=False)
class Table:
    """What a CSV file holds."""

    file: str
    lines: Numbers  # (n,): line of each row, counted from 1
    numbers: dict[str, Floats]  # (n,): columns of numbers; NaN where a cell is empty or wrong
    codes: dict[str, Numbers]  # (n,): columns of ids, as numbers that count in ``ids``
    ids: dict[str, tuple[str, ...]]  # the different ids of a column in order of first appearance
    _source: TableText = field(repr=False)

    def __len__(self) -> int:
        return len(self.lines)

    def column(self, name: str) -> Floats:
        """Return a column of numbers; NaN in every row when the table has no such column."""
        return self.numbers[name] if name in self.numbers else np.full(len(self), np.nan)

    def columns(self, *names: str) -> Floats:
        """Return columns of numbers side by side, shape (n, number of names); not to be written into."""
        if self.numbers.keys().isdisjoint(names):
            return np.broadcast_to(np.nan, (len(self), len(names)))
        return np.column_stack([self.column(name) for name in names])

    def cells(self, name: str) -> list[str]:
        """Return a column of ids, or of words, row by row."""
        ids = self.ids[name]
        return [ids[code] for code in self.codes[name].tolist()]

    def without_numbers(self) -> Table:
        """Return the table without its numbers, where they are kept elsewhere."""
        return replace(self, numbers={})

    def take(self, rows: Numbers) -> Table:
        numbers = {name: each[rows] for name, each in self.numbers.items()}
        codes = {name: each[rows] for name, each in self.codes.items()}
        return replace(self, lines=self.lines[rows], numbers=numbers, codes=codes)

    def placed_as(self, column: str, where: str) -> Table:
        """Return the table with the faults of a column that it does not have placed at one that it has."""
        return replace(self, _source=self._source.placed_as(column, where))

    def note(
        self, row: int, code: str, message: str, severity: str = "warning", *, key: str, points: Sequence[str] = ()
    ) -> Note:
        line = int(self.lines[row])
        return Note(code, message, severity, points=tuple(points), file=self.file, line=line, key=key)

    def fault(self, row: int, column: str, message: str, code: str, *, expected: str = "", fix: str = "") -> Fault:
        """Make a fault with the place of a cell."""
        return self._source.fault(int(self.lines[row]), column, message, code, expected=expected, fix=fix)
