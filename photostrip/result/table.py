"""A table of a result: numpy columns of equal length, each described once in ``quantities.txt``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from photostrip.notes import Document
from photostrip.result.description import Quantity, block_at
from photostrip.result.numbers import angle_decimals, coordinate_decimals, plain, rounded_column

SHOWN = 10  # rows in a notebook
TEXTS = {"text", "word"}
UNITS = {"metre": "m", "degree": "deg"}
TYPES: dict[str, type] = {"number": float, "count": int, "flag": bool}


class Table:
    """Columns of equal length by name: ``table["x"]`` is an array, ``len(table)`` the number of rows.

    Numbers are arrays of float, NaN where there is no value; counts without gaps are int, flags without gaps bool; all
    else are arrays of objects, None where there is none. Rows are dictionaries, with None where there is no value.
    Arrays cannot be written to: a copy can.
    """

    def __init__(self, name: str, columns: Mapping[str, NDArray[Any]], quantities: Mapping[str, Quantity]) -> None:
        self.name = name
        self.quantities = quantities
        self._columns: dict[str, NDArray[Any]] = {}
        for key, column in columns.items():
            self._columns[key] = column.view()
            self._columns[key].setflags(write=False)

    @classmethod
    def of(cls, name: str, columns: Mapping[str, Any]) -> Self:
        """Make a table of a result, its numbers rounded as they are described.

        A column is an array or a list; a text, a flag, a number or None stands in every row.
        """
        entries = block_at(name)
        size = next((len(column) for column in columns.values() if _is_column(column)), 0)
        values = {key: column if _is_column(column) else [column] * size for key, column in columns.items()}
        arrays = {
            key: rounded_column(entries[key], as_array(entries[key], column), values.get(entries[key].unit_key))
            for key, column in values.items()
        }
        return cls(name, arrays, entries)

    @classmethod
    def of_rows(cls, name: str, rows: Iterable[Mapping[str, Any]]) -> Self:
        """Make a table of a result from its rows; those of none have all columns that a table must have."""
        listed = list(rows)
        keys = listed[0] if listed else [key for key, entry in block_at(name).items() if not entry.optional]
        return cls.of(name, {key: [row[key] for row in listed] for key in keys})

    @classmethod
    def joined(cls, name: str, parts: Iterable[Table]) -> Self:
        """Put tables of the same columns below each other."""
        tables = list(parts)
        if not tables:
            return cls.of_rows(name, ())
        columns = {key: np.concatenate([each[key] for each in tables]) for key in tables[0].columns}
        return cls(name, columns, tables[0].quantities)

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns."""
        return tuple(self._columns)

    @property
    def units(self) -> dict[str, str]:
        """The unit of each column: m, um, deg, ...; empty for ratios, counts and texts."""
        return {name: self.quantities[name].unit for name in self._columns}

    @property
    def meanings(self) -> dict[str, str]:
        """What stands in each column."""
        return {name: self.quantities[name].meaning for name in self._columns}

    @overload
    def __getitem__(self, key: str) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, key: int) -> dict[str, Any]: ...
    @overload
    def __getitem__(self, key: slice | list[int] | list[bool] | NDArray[Any]) -> Self: ...
    def __getitem__(self, key: Any) -> Any:
        """Return a column by its name, a row by its number, or the rows of a slice, of numbers or of a mask."""
        if isinstance(key, str):
            if key not in self._columns:
                raise _unknown(self.name, key, self.columns)
            return self._columns[key]
        if isinstance(key, int | np.integer):
            place = range(len(self))[key]
            return {name: self.values(name, slice(place, place + 1))[0] for name in self._columns}
        rows = key if isinstance(key, slice) else np.asarray(key)
        if not isinstance(rows, slice) and not rows.size:
            rows = np.zeros(0, np.intp)
        return self._with({name: column[rows] for name, column in self._columns.items()})

    def _with(self, columns: Mapping[str, NDArray[Any]]) -> Self:
        return type(self)(self.name, columns, self.quantities)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(next(iter(self._columns.values()), ()))

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Return the rows, each a dictionary."""
        for row in zip(*map(self.values, self._columns), strict=True):
            yield dict(zip(self._columns, row, strict=True))

    def __eq__(self, other: object) -> bool:
        """Say whether the rows are the same, as those of a table or of a list."""
        return isinstance(other, Table | list) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]

    def values(self, name: str, rows: slice = slice(None)) -> list[Any]:
        """Return a column as a list, None where there is no value."""
        column = self[name][rows]
        if column.dtype.kind != "f":
            return list(column.tolist())
        values = plain(column)
        if self.quantities[name].kind == "count":
            return [None if value is None else int(value) for value in values]
        return list(values)

    def where(self, **values: object) -> Self:
        """Return the rows that have these values: ``points.where(role="check")``; of several values one of them."""
        keep = np.ones(len(self), bool)
        for name, value in values.items():
            allowed = value if isinstance(value, list | tuple | set | frozenset | np.ndarray) else [value]
            column = self[name].tolist()
            keep &= np.fromiter((each in allowed for each in column), bool, len(column))
        return self[keep]

    def with_columns(self, **columns: ArrayLike | None) -> Self:
        """Return the table with other columns in place of its own, or beside them."""
        others = Table.of(self.name, columns)
        return self._with(self._columns | {key: others[key] for key in others.columns})

    def in_frame(self, frame: Document, angles: Document) -> Self:
        """Return the table with the units, decimals and axes of coordinates and angles that its result has."""
        lengths = dict(zip("xyz", coordinate_decimals(frame), strict=True))
        known = dict(zip("xyz", (frame["plan_unit"], frame["plan_unit"], frame["height_unit"]), strict=True))
        axes = dict(zip("xyz123", (*frame["axes"], *frame["axes"]), strict=True))
        entries = dict(self.quantities)
        for name, entry in entries.items():
            if "*" in entry.head:
                entries[name] = replace(entry, head=entry.head.replace("*", axes[name[-1]]))
            elif entry.unit in {"deg", "arcsec"}:
                entries[name] = replace(entry, angles=angles["unit"])
            elif entry.unit == "frame":
                entries[name] = replace(entry, unit=UNITS.get(known[name], known[name]), decimals=lengths[name])
            elif entry.unit == "angle":
                decimals = angle_decimals(angles["unit"]) if entry.digits is None else None
                entries[name] = replace(entry, unit=angles["unit"], decimals=decimals)
        return type(self)(self.name, self._columns, entries)

    def to_pandas(self) -> Any:  # noqa: ANN401 (a library that need not be there)
        """Return a ``pandas.DataFrame``; its ``attrs["units"]`` are the units. Needs pandas."""
        frame = import_module("pandas").DataFrame({name: column.copy() for name, column in self._columns.items()})
        frame.attrs["units"] = self.units
        return frame

    def to_arrow(self) -> Any:  # noqa: ANN401 (a library that need not be there)
        """Return a ``pyarrow.Table``; unit and meaning are the metadata of its fields. Needs pyarrow."""
        pa = import_module("pyarrow")
        texts = {name for name, entry in self.quantities.items() if entry.kind in TEXTS and not entry.many}
        arrays = [
            pa.array(column, from_pandas=True, type=pa.string() if name in texts else None)
            for name, column in self._columns.items()
        ]
        fields = [
            pa.field(name, array.type, metadata={"unit": self.units[name], "meaning": self.meanings[name]})
            for name, array in zip(self._columns, arrays, strict=True)
        ]
        return pa.Table.from_arrays(arrays, schema=pa.schema(fields))

    def __repr__(self) -> str:
        """Name the table, the number of its rows, and its columns with units."""
        named = (f"{name} [{unit}]" if unit else name for name, unit in self.units.items())
        return f"<{self.name}: {len(self)} rows; {', '.join(named)}>"

    def _repr_html_(self) -> str:
        """Return the first rows for a notebook."""
        from html import escape

        heads = "".join(
            f'<th title="{escape(self.meanings[name])}">{escape(name)}{f"<br>{escape(unit)}" if unit else ""}</th>'
            for name, unit in self.units.items()
        )
        rows = [
            "<tr>" + "".join(f"<td>{escape(_shown(value))}</td>" for value in row.values()) + "</tr>"
            for row in self[:SHOWN]
        ]
        more = f"<p>{len(self)} rows, the first {SHOWN} shown</p>" if len(self) > SHOWN else ""
        return f"<table><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>{more}"


def as_array(entry: Quantity, values: Sequence[Any] | NDArray[Any]) -> NDArray[Any]:
    """Return a column as the narrowest of bool, int, float and object that holds its values.

    Raises TypeError or ValueError where they are not of the kind that is described.
    """
    if isinstance(values, np.ndarray) and (values.dtype.kind != "O" or not entry.many):
        return values
    kind = None if entry.many else TYPES.get(entry.kind)
    if kind is not None and (kind is float or None not in values):
        return np.array(values, kind)  # None becomes NaN
    if kind is int:
        return np.array(values, float)
    if kind is bool:
        return np.fromiter((None if value is None else bool(value) for value in values), object, len(values))
    return np.fromiter(values, object, len(values))


def in_frame(document: Document) -> Document:
    """Give the tables of a document the units and decimals of its coordinates and angles."""
    frame, angles = document["frame"], document["angles"]

    def placed(value: Any) -> Any:  # noqa: ANN401 (any part of a document)
        if isinstance(value, Table):
            return value.in_frame(frame, angles)
        return {key: placed(each) for key, each in value.items()} if isinstance(value, dict) else value

    return {key: placed(value) for key, value in document.items()}


def _is_column(value: object) -> bool:
    return isinstance(value, list | tuple | np.ndarray) and not (isinstance(value, np.ndarray) and not value.ndim)


def _unknown(table: str, name: str, known: Sequence[str]) -> KeyError:
    from difflib import get_close_matches

    near = get_close_matches(name, known, 1)
    return KeyError(
        f"{table} has no column {name!r}; " + (f"did you mean {near[0]!r}?" if near else "it has " + ", ".join(known))
    )


def _shown(value: object) -> str:
    return "" if value is None else f"{value:.10g}" if isinstance(value, float) else str(value)


def rows_of(columns: Mapping[str, Iterable[Any]]) -> list[Document]:
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def stored(table: Table) -> dict[str, list[Any]]:
    """Return the columns of a table that stand in result.json, flags as 1 and 0."""
    found = {}
    for name in table.columns:
        entry, column = table.quantities[name], table.values(name)
        if not entry.derived:
            is_flag = entry.kind == "flag"
            found[name] = [None if value is None else int(value) for value in column] if is_flag else column
    return found


def plain_of(value: Any) -> Any:  # noqa: ANN401 (any part of a document)
    """Return a document as JSON has it: its tables as blocks of lists."""
    if isinstance(value, dict):
        return {key: plain_of(each) for key, each in value.items()}
    return stored(value) if isinstance(value, Table) else value
