"""A sheet: what a computation answers, described once; text, Markdown, HTML, JSON and CSV follow from it.

The form of a number says its unit and its decimals: ``"m 3"``, with a sign ``"m +3"``, by digits ``"mm g9"``, as a
power ``"mm² e4"``; ``"ratio 2"`` has no unit. JSON and CSV have a few more than print.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.formats.result_files import to_csv
from photostrip.notes import Document
from photostrip.report.page.layout import USUAL, to_markdown, to_text
from photostrip.report.page.parts import Column, Facts, Part, Section, Table, Words
from photostrip.report.page.tables import Cell, Field, tabulated, with_unit, written

if TYPE_CHECKING:
    from photostrip.report.pictures.svg import Picture

Filled = tuple[Field, Any]  # a column with its values; what is no sequence of them stands in every row
MORE_DECIMALS, MORE_DIGITS = 3, 4  # of JSON and CSV, that are not printed


def plain(value: Any, form: str = "") -> Any:  # noqa: ANN401 (the same)
    """Return a value as JSON has it: rounded, None for what is no number."""
    if isinstance(value, Cell):
        value = value.value
    if isinstance(value, dict):
        return {key: plain(each, form) for key, each in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(each, form) for each in value]
    number = value.item() if isinstance(value, np.generic) else value
    if not isinstance(number, float) or " " not in form:
        return None if isinstance(number, float) and not isfinite(number) else number
    spec = form.rpartition(" ")[2]
    found = (
        float(f"{number:.{int(spec[1:]) + MORE_DIGITS}{spec[0]}}")
        if spec[0] in "eg"
        else round(number, int(spec) + MORE_DECIMALS)
    )
    return found + 0.0 if isfinite(found) else None


@dataclass(frozen=True)
class Fact:
    """A label with its value; without a form or a text of its own it stands in JSON alone."""

    key: str
    value: Any
    form: str = ""
    text: str = ""
    label: str = ""

    @property
    def shown(self) -> str:
        return self.text or (with_unit(self.value, self.form) if self.form else "")


def hidden(*keys: str, form: str = "") -> tuple[Field, ...]:
    """Return columns that stand in JSON and CSV alone."""
    return tuple(Field(key, form, shown=False) for key in keys)


@dataclass(frozen=True)
class Rows:
    """A table; without a title it goes on with the section before. Tables of one key are one table in JSON and CSV."""

    key: str  # empty: printed only
    title: str
    fields: Sequence[Field]
    rows: Sequence[Sequence[Any]]
    note: str = ""
    above: Sequence[str | Part] = ()  # what stands above the table, and below it
    below: Sequence[str | Part] = ()
    # a column whose values become columns, and those that become a table each, their heads the titles; a single column
    # of numbers that is left runs upwards
    across: str = ""
    tables: Sequence[str] = ()
    most: int = 0  # columns that are shown of many, evenly
    exact: bool = False  # whether JSON and CSV have all digits

    def sections(self) -> Iterator[Section]:
        if self.across:
            yield from map(self._turned, self.tables)
            return
        table: list[Part] = []
        if len(self.rows) and any(each.shown for each in self.fields):
            table = [tabulated(self.fields, self.rows, self.note)]
        said = [
            tuple(Words(each) if isinstance(each, str) else each for each in one) for one in (self.above, self.below)
        ]
        if table or any(said):
            yield Section(self.title, (*said[0], *table, *said[1]))

    def _turned(self, name: str) -> Section:
        """Arrange the values of a column as they lie in a plane."""
        place = {each.key: number for number, each in enumerate(self.fields)}
        value, across = self.fields[place[name]], self.fields[place[self.across]]
        index = [each for each in self.fields if each.shown and each.key not in {*self.tables, self.across}]
        heads = list(dict.fromkeys(row[place[self.across]] for row in self.rows))
        lines: dict[tuple[Any, ...], dict[Any, str]] = {}
        for row in self.rows:
            line = lines.setdefault(tuple(row[place[each.key]] for each in index), {})
            line[row[place[self.across]]] = written(row[place[name]], value.form)
        if self.most and heads:
            heads = [*heads[: -1 : -(-len(heads) // self.most)], *heads[-1:]]
        order = sorted(lines, reverse=True) if len(index) == 1 and index[0].form else lines
        cells = tuple(
            (*(written(at, each.form) for at, each in zip(key, index, strict=True)), *(lines[key][at] for at in heads))
            for key in order
        )
        columns = (*(each.column for each in index), *(Column(written(at, across.form)) for at in heads))
        return Section(value.name, (Table(columns, cells, note=self.note),))

    def plain(self) -> list[Document]:
        return [
            {
                each.key: plain(value, "" if self.exact else each.form)
                for each, value in zip(self.fields, row, strict=True)
                if each.key
            }
            for row in self.rows
        ]


@dataclass(frozen=True)
class Sheet:
    """Facts and tables under a title."""

    kind: str
    title: str
    facts: Sequence[Fact]
    tables: Sequence[Rows]
    main: str = ""  # key of the table that is the CSV; empty: the first
    words: Sequence[Words] = ()  # before the facts

    def sections(self) -> tuple[Section, ...]:
        """Return the sheet as it is printed."""
        facts = tuple((each.label or each.key.replace("_", " "), each.shown) for each in self.facts if each.shown)
        first: list[Part] = [*self.words, Facts(facts)] if facts else [*self.words]
        found = [Section("", tuple(first))]
        for section in (each for rows in self.tables for each in rows.sections()):
            if section.title:
                found.append(section)
            else:
                found[-1] = Section(found[-1].title, (*found[-1].parts, *section.parts))
        return tuple(each for each in found if each.parts)

    def document(self) -> Document:
        """Return the sheet as JSON has it: facts by their keys, tables as lists of records, units of their columns."""
        found: Document = {"kind": self.kind} | {each.key: plain(each.value, each.form) for each in self.facts}
        units: Document = {}
        for table in self.tables:
            if table.key:
                found.setdefault(table.key, []).extend(table.plain())
                units |= {table.key: {each.key: each.unit for each in table.fields if each.unit}}
        return found | {"units": {key: value for key, value in units.items() if value}}

    def csv(self) -> str:
        """Return the main table as CSV."""
        parts = [each for each in self.tables if each.key == (self.main or self.tables[0].key)]
        names = [each.key for each in parts[0].fields if each.key]
        return to_csv(names, (row.values() for each in parts for row in each.plain()))

    def rendered(self, form: str, width: int = USUAL, draw: Callable[[Document], Picture] | None = None) -> str:
        """Return the sheet as a file holds it: ``text`` so wide, ``md``, ``html``, ``json`` or ``csv``."""
        if form == "csv":
            return self.csv()
        if form == "html" and draw is not None:
            from photostrip import __version__
            from photostrip.report.html import sections_html

            return sections_html(self.title, __version__, self.sections(), [draw(self.document())])
        return rendered(form, self.title, self.sections(), self.document() if form == "json" else {}, width)


def rendered(form: str, title: str, sections: Iterable[Section], document: Document, width: int | None = None) -> str:
    """Return sections as a file holds them: ``text`` so wide, ``md``, ``html``, or their document as ``json``."""
    match form:
        case "json":
            from photostrip.formats.result_json import to_json

            return to_json(document)
        case "html":
            from photostrip import __version__
            from photostrip.report.html import sections_html

            return sections_html(title, __version__, sections)
        case "md":
            return to_markdown(title, sections)
    return to_text(title, sections, width or USUAL)


def same(**values: Any) -> list[Filled]:  # noqa: ANN401 (whatever stands in a cell)
    """Return columns that stand in JSON and CSV alone, with the same value in every row."""
    return [(Field(key, shown=False), value) for key, value in values.items()]


def filled(columns: Sequence[Field], rows: Floats | Sequence[Any]) -> list[Filled]:
    """Return columns with the values of an array (n, k), or of n rows."""
    return [(column, [row[number] for row in rows]) for number, column in enumerate(columns)]


def taken(columns: Sequence[Field], objects: Iterable[Any]) -> list[Filled]:
    """Return columns with what they name of each object."""
    named = [(each, attrgetter(each.of or each.key) if isinstance(each.of, str) else each.of) for each in columns]
    rows = list(objects)
    return [(column, [value(each) for each in rows]) for column, value in named]


def table(key: str, title: str, columns: Sequence[Filled], **more: Any) -> Rows:  # noqa: ANN401 (of rows)
    """Return a table of columns with their values; where none has a list of them it is a single row."""
    several = [isinstance(values, list | tuple | np.ndarray) and not isinstance(values, Cell) for _, values in columns]
    count = next((len(values) for (_, values), many in zip(columns, several, strict=True) if many), 1)
    lists = [values if many else [values] * count for (_, values), many in zip(columns, several, strict=True)]
    return Rows(key, title, [column for column, _ in columns], list(zip(*lists, strict=True)), **more)


def listed(key: str, title: str, columns: Sequence[Field], objects: Iterable[Any], **more: Any) -> Rows:  # noqa: ANN401
    """Return a table with a row for each object."""
    return table(key, title, taken(columns, objects), **more)


def by_columns(ids: Iterable[Any], *columns: ArrayLike) -> list[tuple[Any, ...]]:
    """Return the rows of columns; a column of two dimensions counts as several."""
    arrays = [np.asarray(each) for each in columns]
    flat = [part.tolist() for each in arrays for part in (each.T if each.ndim > 1 else [each])]
    return list(zip(ids, *flat, strict=True))
