"""A CSV table: its columns as the format defines them and, as arrays and numbers of ids, as they were read."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault
from photostrip.notes import Note
from photostrip.points import locate

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
    """What a CSV file holds, or several below each other."""

    file: str  # several: their names with commas between
    lines: Numbers  # (n,): line of each row in its file, counted from 1
    numbers: dict[str, Floats]  # (n,): columns of numbers; NaN where a cell is empty or wrong
    codes: dict[str, Numbers]  # (n,): columns of ids, as numbers that count in ``ids``
    ids: dict[str, tuple[str, ...]]  # the different ids of a column in order of first appearance
    texts: tuple[TableText, ...] = field(repr=False)
    _source: Numbers | None = field(default=None, repr=False)  # (n,): number of the file of each row; None: the first

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
        source = None if self._source is None else self._source[rows]
        return replace(self, lines=self.lines[rows], numbers=numbers, codes=codes, _source=source)

    def placed_as(self, column: str, where: str) -> Table:
        """Return the table with the faults of a column that it does not have placed at one that it has."""
        return replace(self, texts=tuple(each.placed_as(column, where) for each in self.texts))

    @property
    def files(self) -> tuple[tuple[str, Flags], ...]:
        """The files, each with its rows."""
        number = np.zeros(len(self), np.intp) if self._source is None else self._source
        return tuple((each.file, number == place) for place, each in enumerate(self.texts))

    def _text_of(self, row: int) -> TableText:
        return self.texts[0 if self._source is None else int(self._source[row])]

    def file_of(self, row: int) -> str:
        return self._text_of(row).file

    def lines_of(self, *rows: int) -> str:
        """Say in which lines rows stand, as ``lines 7, 9``, or ``line 7 of a.csv, line 9 of b.csv``."""
        if self._source is None:
            return f"line{'s' * (len(rows) > 1)} {', '.join(str(self.lines[row]) for row in rows)}"
        return ", ".join(f"line {self.lines[row]} of {self.file_of(row)}" for row in rows)

    def note(
        self, row: int, code: str, message: str, severity: str = "warning", *, key: str, points: Sequence[str] = ()
    ) -> Note:
        line, file = int(self.lines[row]), self.file_of(row)
        return Note(code, message, severity, points=tuple(points), file=file, line=line, key=key)

    def fault(self, row: int, column: str, message: str, code: str, *, expected: str = "", fix: str = "") -> Fault:
        """Make a fault with the place of a cell."""
        return self._text_of(row).fault(int(self.lines[row]), column, message, code, expected=expected, fix=fix)


def joined(tables: Sequence[Table]) -> Table:
    """Put tables with the same columns of ids below each other; numbers that one lacks are NaN in its rows."""
    if len(tables) == 1:
        return tables[0]
    numbers = dict.fromkeys(name for each in tables for name in each.numbers)
    codes, ids = {}, {}
    for name in tables[0].ids:
        ids[name] = tuple(dict.fromkeys(each for table in tables for each in table.ids[name]))
        codes[name] = np.concatenate([locate(table.ids[name], ids[name])[table.codes[name]] for table in tables])
    return Table(
        file=", ".join(each.file for each in tables),
        lines=np.concatenate([each.lines for each in tables]),
        numbers={name: np.concatenate([each.column(name) for each in tables]) for name in numbers},
        codes=codes,
        ids=ids,
        texts=tuple(text for each in tables for text in each.texts),
        _source=np.repeat(np.arange(len(tables)), [len(each) for each in tables]),
    )
