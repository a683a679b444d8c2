"""Tables made from rows of a document: a column's head, its unit and what it shows of a row stand together.

``number("base", "base", 2, "m")`` is a column of ``row["base"]`` in metres with two decimals;
``words("at", photos_of)`` one of what a function says of a row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from photostrip.report.page.numbers import fixed
from photostrip.report.page.parts import Column, Table

if TYPE_CHECKING:
    from photostrip.report.page.angles import AngleUnit

Row = Any  # of a document: a mapping, or whatever the functions of the columns know to read
Value = str | Callable[[Row], Any]  # key of a row, with dots where it lies deeper (``discrepancy.up``), or function


class Shown(NamedTuple):
    """A column with what it shows of a row."""

    column: Column
    cell: Callable[[Row], str]


def words(name: str, value: Value, unit: str = "", *, rank: int = 0) -> Shown:
    read = _reader(value)
    return Shown(Column(name, unit, left=True, rank=rank), lambda row: str(read(row)))


def number(name: str, value: Value, form: int | Callable[[Any], str] = str, unit: str = "", *, rank: int = 0) -> Shown:
    """Return a column of numbers, written with decimals or by a function; default: whole numbers."""
    read = _reader(value)
    if isinstance(form, int):
        return Shown(Column(name, unit, rank=rank), lambda row: fixed(read(row), form))
    return Shown(Column(name, unit, rank=rank), lambda row: form(read(row)))


def angle(name: str, value: Value, decimals: int, unit: AngleUnit, *, rank: int = 0) -> Shown:
    """Return a column of angles that the document has in degrees."""
    read = _reader(value)
    return Shown(Column(name, unit.name, rank=rank), lambda row: unit.text(read(row), decimals))


def tabulated(
    rows: Iterable[Row], columns: Sequence[Shown], foot: tuple[tuple[str, ...], ...] = (), note: str = ""
) -> Table:
    """Return a table of rows; the lines of the foot are given as they are printed."""
    cells = tuple(tuple(each.cell(row) for each in columns) for row in rows)
    return Table(columns=tuple(each.column for each in columns), rows=cells, foot=foot, note=note)


def _reader(value: Value) -> Callable[[Row], Any]:
    if not isinstance(value, str):
        return value
    first, *deeper = value.split(".")

    def read(row: Row) -> Any:  # noqa: ANN401 (what stands there)
        found = row[first]
        for key in deeper:
            found = found[key]
        return found

    return read
