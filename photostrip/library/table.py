"""A table with named columns: numpy arrays that know their units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from photostrip.errors import Fault, InputError

if TYPE_CHECKING:
    from photostrip.notes import Document
    from photostrip.result.tables import ResultColumn

SHOWN = 10  # rows in a notebook
TEXTS = {"text", "word"}  # kinds of columns


class Table:
    """Columns of equal length by name: ``table["x"]`` is an array, ``len(table)`` the number of rows.

    Numbers are arrays of float, NaN where there is no value; counts without gaps are int, flags without gaps bool; all
    else are arrays of objects, None where there is none. Arrays cannot be written to: a copy can.
    """

    def __init__(self, name: str, columns: Sequence[ResultColumn], frame: Document | None = None) -> None:
        self.name = name
        self._frame = frame  # of its coordinates
        self.units: Mapping[str, str] = {each.name: each.quantity.unit for each in columns}
        """The unit of each column: m, um, deg, ...; empty for ratios, counts and texts."""
        self.meanings: Mapping[str, str] = {each.name: each.quantity.meaning for each in columns}
        """What stands in each column."""
        self._texts = {each.name for each in columns if each.quantity.kind in TEXTS and not each.quantity.many}
        self._columns = {each.name: _fixed(_array(each)) for each in columns}

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns."""
        return tuple(self._columns)

    @overload
    def __getitem__(self, key: str) -> np.ndarray[Any, Any]: ...
    @overload
    def __getitem__(self, key: int) -> dict[str, Any]: ...
    @overload
    def __getitem__(self, key: slice | list[int] | list[bool] | np.ndarray[Any, Any]) -> Table: ...
    def __getitem__(self, key: Any) -> Any:
        """Return a column by its name, a row by its number, or the rows of a slice, of numbers or of a mask."""
        if isinstance(key, str):
            if key not in self._columns:
                raise _unknown(self.name, key, self.columns)
            return self._columns[key]
        if isinstance(key, int | np.integer):
            return {name: column[key : key + 1 or None].tolist()[0] for name, column in self._columns.items()}
        rows = key if isinstance(key, slice) else np.asarray(key)
        if not isinstance(rows, slice) and not rows.size:
            rows = np.zeros(0, np.intp)
        part = Table(self.name, (), self._frame)
        part.units, part.meanings, part._texts = dict(self.units), dict(self.meanings), self._texts
        part._columns = {name: _fixed(column[rows]) for name, column in self._columns.items()}
        return part

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(next(iter(self._columns.values()), ()))

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Return the rows, each a dictionary."""
        for row in zip(*(column.tolist() for column in self._columns.values()), strict=True):
            yield dict(zip(self._columns, row, strict=True))

    def where(self, **values: object) -> Table:
        """Return the rows that have these values: ``points.where(role="check")``; of several values one of them."""
        keep = np.ones(len(self), bool)
        for name, value in values.items():
            wanted = value if isinstance(value, list | tuple | set | frozenset | np.ndarray) else [value]
            found = self[name].tolist()
            keep &= np.fromiter((any(each == one for one in wanted) for each in found), bool, len(found))
        return self[keep]

    def to_pandas(self) -> Any:  # noqa: ANN401 (a library that need not be there)
        """Return a ``pandas.DataFrame``; its ``attrs["units"]`` are the units. Needs pandas."""
        frame = import_module("pandas").DataFrame({name: column.copy() for name, column in self._columns.items()})
        frame.attrs["units"] = dict(self.units)
        return frame

    def to_geopandas(self) -> Any:  # noqa: ANN401 (a library that need not be there)
        """Return points and photos as a ``geopandas.GeoDataFrame``: the data frame with a place on the map in each row.

        East, north, up in the reference system of the result; of geocentric coordinates longitude, latitude, height,
        of local ones without a system. Rows without coordinates have no place. Needs geopandas.
        Raises InputError for a table without coordinates, and ImportError where geopandas is not installed.
        """
        if self._frame is None or not {"x", "y", "z"} <= self._columns.keys():
            message = f"the table {self.name} has no coordinates"
            raise InputError(Fault(message, "no-coordinate", fix="take result.points or result.photos"))
        try:
            geopandas = import_module("geopandas")
        except ModuleNotFoundError as error:
            if error.name != "geopandas":
                raise
            message = "to_geopandas() needs the package geopandas, which is not installed: pip install geopandas"
            raise ImportError(message, name="geopandas") from None
        from photostrip.foreign.adjusted import places_on_map

        places = np.column_stack([np.asarray(self._columns[each], float) for each in "xyz"])
        known = np.isfinite(places).all(axis=1)
        places[known], crs = places_on_map(self._frame, places[known])
        points = np.where(known, geopandas.points_from_xy(*places.T), None)
        frame = geopandas.GeoDataFrame(self.to_pandas(), geometry=points, crs=crs)
        frame.attrs["units"] = dict(self.units)
        return frame

    def to_arrow(self) -> Any:  # noqa: ANN401 (a library that need not be there)
        """Return a ``pyarrow.Table``; unit and meaning are the metadata of its fields. Needs pyarrow."""
        pa = import_module("pyarrow")
        arrays = [
            pa.array(column, from_pandas=True, type=pa.string() if name in self._texts else None)
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


def _unknown(table: str, name: str, known: Sequence[str]) -> KeyError:
    from photostrip.formats.text.findings import suggestion

    return KeyError(f"{table} has no column {name!r}; {suggestion(name, known) or 'it has ' + ', '.join(known)}")


def _array(column: ResultColumn) -> np.ndarray[Any, Any]:
    """Return a column as the narrowest of bool, int, float and object; without values as it is described."""
    values, quantity = column.values, column.quantity
    kinds = {type(value) for value in values if value is not None}
    described = {"flag": bool, "count": int, "number": float}.get(quantity.kind)
    if not kinds and described is not None and not quantity.many:
        kinds = {float if values else described}
    if kinds == {bool} and None not in values:
        return np.array(values, bool)
    if kinds == {int} and None not in values:
        return np.array(values, np.int64)
    if kinds and kinds <= {int, float}:
        return np.array(values, float)  # None becomes NaN
    found = np.empty(len(values), object)
    found[:] = values
    return found


def _fixed(column: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    column.setflags(write=False)
    return column


def _shown(value: object) -> str:
    if value is None or value != value:  # noqa: PLR0124 (NaN)
        return ""
    return f"{value:.10g}" if isinstance(value, float) else str(value)
