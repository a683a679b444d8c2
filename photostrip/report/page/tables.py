"""Tables of a page: their columns described once, those of a result by ``result/quantities.txt``.

The form of a column is its unit and how its numbers are printed: ``"m 3"``; ``"m +3"`` with a sign, ``"mm g9"`` by
digits, ``"mm² e4"`` as a power, ``" %1"`` as percent; ``"ratio 2"`` has no unit; words have no form.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from heapq import nlargest
from math import isfinite
from typing import Any, NamedTuple

from photostrip.notes import Document, counted
from photostrip.report.page.parts import DASH, Column, Table

PRINTED = {"um": "µm", "arcsec": "″", "arcmin": "′", "percent": "%", "ratio": "", "1": ""}  # units
DECIMALS = {"": "2", "m": "3", "um": "1", "ppm": "0", "arcsec": "1"}  # of printed numbers, by their unit
DIGITS = "g4"  # of numbers without a natural size
BETWEEN = " – "  # of the photos of a pair
LEAST_PROBABILITY = 0.001  # smaller ones are all shown as smaller than this
Number = float | None
Rows = Any  # a table of a result, or dictionaries


class Cell(NamedTuple):
    """A value that is printed in its own way."""

    text: str
    value: Any  # in JSON and CSV


class AngleUnit(NamedTuple):
    """A unit of angles with one for small angles, and how they are written."""

    name: str
    per_degree: float
    more: int  # decimals more than degrees have
    small: str  # unit of small angles
    per_second: float  # its number in a second of arc

    def text(self, degrees: Number, decimals: int) -> str:
        """Return an angle without its unit; ``decimals`` are those of degrees."""
        return written(None if degrees is None else degrees * self.per_degree, f" {decimals + self.more}")


UNITS = {
    unit.name: unit
    for unit in (
        AngleUnit(name="deg", per_degree=1.0, more=0, small="″", per_second=1.0),
        AngleUnit(name="gon", per_degree=10 / 9, more=0, small="mgon", per_second=10 / 32.4),
        AngleUnit(name="rad", per_degree=0.017453292519943295, more=2, small="µrad", per_second=4.84813681109536),
    )
}


def angle_unit(document: Document) -> AngleUnit:
    """Return the unit of the angles of photos, in which a report prints all others, too."""
    return UNITS[document["angles"]["unit"]]


def written(value: Any, form: str = "") -> str:  # noqa: ANN401 (whatever stands in a cell)
    """Return a value as it is printed, without its unit; never -0, a dash where there is none."""
    if isinstance(value, Cell | str):
        return value if isinstance(value, str) else value.text
    value = value.tolist() if hasattr(value, "tolist") else value  # of numpy
    spec = form.rpartition(" ")[2] if " " in form else ""
    if not isinstance(value, list | tuple):
        return _scalar(value, spec)
    return str(len(value)) if spec == "#" else " ".join(written(each, form) for each in value)


def _scalar(value: Any, spec: str) -> str:  # noqa: ANN401 (a number, a flag or nothing)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or not isfinite(value):
        return DASH
    if spec == "p":
        return f"<{LEAST_PROBABILITY}" if value < LEAST_PROBABILITY else f"{value:.3f}"
    if spec[:1] == "%":
        return f"{100 * value:z.{spec[1:]}f}"
    if spec[:1] in {"e", "g"}:
        return f"{value:.{spec[1:]}{spec[0]}}"
    return f"{value:{spec.rstrip('0123456789')}z.{int(spec)}f}" if spec else str(value)


def fixed(value: Number, decimals: int) -> str:
    return written(value, f" {decimals}")


def metres(value: Number) -> str:
    return written(value, "m 3")


def signed(value: Number) -> str:
    return written(value, "m +3")


def micrometres(value: Number) -> str:
    return written(value, "um 1")


def short(value: Number, digits: int = 4) -> str:
    return written(value, f" g{digits}")


def percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:.1f} %" if whole else DASH


def unit_of(name: str) -> str:
    """Return a unit as it is printed."""
    return PRINTED.get(name, name)


def with_unit(value: Any, form: str) -> str:  # noqa: ANN401 (the same)
    """Return a number as it is printed, with its unit."""
    unit = unit_of(form.rpartition(" ")[0])
    return written(value, form) + (f" {unit}" if unit and unit not in "″′" else unit)


@dataclass(frozen=True)
class Field:
    """A column: its key in JSON and CSV, the form of its numbers, its head in print; empty for words."""

    key: str
    form: str = ""
    head: str | None = None  # None: the key
    below: str | None = None  # second line of the head; None: the unit
    rank: int = 0
    shown: bool = True
    of: str | Callable[[Any], Any] = ""  # what of an object stands in it, in a sheet; empty: what the key names

    @property
    def name(self) -> str:
        return self.key.replace("_", " ") if self.head is None else self.head

    @property
    def unit(self) -> str:
        return unit_of(self.form.rpartition(" ")[0])

    @property
    def column(self) -> Column:
        return Column(self.name, self.unit if self.below is None else self.below, left=not self.form, rank=self.rank)


def fields(keys: str, form: str, heads: str = "", below: str | None = None, rank: int = 0) -> tuple[Field, ...]:
    """Return columns of the same form; blanks between keys and heads, a low line within a head."""
    names: Sequence[str | None] = [each.replace("_", " ") for each in heads.split()] or [None] * len(keys.split())
    return tuple(Field(key, form, name, below, rank) for key, name in zip(keys.split(), names, strict=True))


def tabulated(columns: Sequence[Field], rows: Iterable[Sequence[Any]], note: str = "") -> Table:
    """Return a table of rows, each with a value for every column."""
    shown = [(place, each) for place, each in enumerate(columns) if each.shown]
    cells = tuple(tuple(written(row[place], each.form) for place, each in shown) for row in rows)
    return Table(tuple(each.column for _, each in shown), cells, note=note)


Foot = Sequence[Mapping[str, str]]  # texts of the last lines by the keys of their columns
Computed = tuple[Field, Sequence[Any]]  # a column that a result does not have, with its values


def keyed(
    rows: Rows,
    keys: str,
    note: str = "",
    *,
    foot: Foot = (),
    quantities: Mapping[str, Any] | None = None,
    **computed: Computed,
) -> Table:
    """Return a table of rows of a result; heads, units and decimals of its columns are those of their descriptions.

    keys: of the columns; ``strip:4`` has a rank, ``left+right`` stands in one column; ``elements_*`` are all columns
        whose names begin so, ``*`` all with a head that are not named. What no row has is left out.
    quantities: descriptions, where the rows are no table of a result.
    computed: other columns, by the keys under which they are called.
    """
    entries = rows.quantities if quantities is None else quantities
    present = getattr(rows, "columns", rows[0] if rows else entries)
    ranks = {key: int(rank or 0) for key, _, rank in (name.partition(":") for name in keys.split())}
    named = {part for key in ranks for part in key.split("+")}
    shown: dict[str, tuple[Column, list[str]]] = {}
    for key, rank in ranks.items():
        start = key.removesuffix("*")
        if key in computed:
            field, values = computed[key]
            shown[key] = field.column, [written(value, field.form) for value in values]
        elif start != key:
            others = (each for each in present if each.startswith(start) and each not in named and entries[each].head)
            shown |= {each: _described(rows, each, entries[each], rank) for each in others}
        elif parts := [_described(rows, each, entries[each], rank) for each in key.split("+") if each in present]:
            shown[key] = parts[0]
            if len(parts) > 1:
                pairs = zip(*(cells for _, cells in parts), strict=True)
                shown[key] = parts[0][0], [BETWEEN.join(each for each in pair if each != DASH) for pair in pairs]
    end = tuple(tuple(line.get(key, "") for key in shown) for line in foot)
    cells = tuple(zip(*(cells for _, cells in shown.values()), strict=True))
    return Table(tuple(column for column, _ in shown.values()), cells, end, note)


def _described(rows: Rows, key: str, entry: Any, rank: int) -> tuple[Column, list[str]]:  # noqa: ANN401 (a description)
    """Return a column of a result as its description says."""
    values, unit, spec, left = column_of(rows, key), entry.unit.replace("`unit`", ""), entry.shown, False
    if entry.kind == "flag":
        yes, no = (spec or "yes/no").split("/")
        values, left, spec = [yes if each else no for each in values], True, ""
    elif entry.many and spec != "#":
        values, left = [", ".join(map(written, each or ())) for each in values], True
    elif entry.kind in {"text", "word"} and spec != "#":
        values, left = [unit_of(each or "") if key == "unit" else each for each in values], True
    elif entry.unit_key and not spec:
        units = column_of(rows, entry.unit_key)
        values = [written(each, f" {DECIMALS.get(of, DIGITS)}") for each, of in zip(values, units, strict=True)]
    elif entry.kind == "number":
        spec = spec or (DIGITS if entry.digits else DECIMALS.get(unit, str(entry.decimals)))
        if entry.angles:
            angles, small = UNITS[entry.angles], unit == "arcsec"
            factor, unit = (angles.per_second, angles.small) if small else (angles.per_degree, angles.name)
            values = [None if each is None else each * factor for each in values]
            spec = str(int(spec) + angles.more) if spec.isdigit() and not small else spec
    below = entry.below or ("%" if spec.startswith("%") else unit_of(unit))
    return Column(entry.head, below, left, rank), [written(each, f" {spec}" if spec else "") for each in values]


def column_of(rows: Rows, key: str) -> list[Any]:
    """Return the values of a key; of a table without making its rows."""
    return list(rows.values(key)) if hasattr(rows, "values") else [row[key] for row in rows]


def elsewhere(rest: int, what: str, section: str, block: str) -> str:
    """Say how many things are not shown, and where they are."""
    many = what.replace("kind ", "kinds ") if what.startswith("kind ") else f"{what}s"
    return f"{counted(rest, f'more {what}', f'more {many}')}: --section {section}, or `{block}` in result.json"


def taken(rows: Rows, places: Sequence[int]) -> Rows:
    """Return the rows at some places."""
    return rows[list(places)] if hasattr(rows, "columns") else [rows[place] for place in places]


def largest_of(rows: Rows, key: str, most: int) -> list[int]:
    """Return the places of the rows with the largest values of a key, where it is known."""
    sizes = column_of(rows, key)
    known = (place for place, size in enumerate(sizes) if size is not None)
    return nlargest(most, known, key=lambda place: float(sizes[place]))


def worst_first(
    rows: Rows,
    by: str | Sequence[float],
    where: tuple[str, str, str],
    most: int | None,
) -> tuple[Any, str]:
    """Choose the rows of a table that are shown: all in their order, or the worst, and what to say of the others.

    by: a key, or a number for each row: how bad it is.
    where: what a row is, which section shows all of them and which block of the result holds them.
    most: how many rows are shown; None: all.
    """
    if most is None or len(rows) <= most:
        return rows, ""
    sizes = [abs(size or 0.0) for size in column_of(rows, by)] if isinstance(by, str) else by
    places = nlargest(most, range(len(rows)), key=sizes.__getitem__)
    return taken(rows, places), f"worst first; {elsewhere(len(rows) - len(places), *where)}"


def note_of(*notes: str) -> str:
    """Return notes below a table as one, without the empty ones."""
    return "; ".join(note for note in notes if note)
