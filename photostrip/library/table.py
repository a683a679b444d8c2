"""A table of a result that knows its frame: what Python scripts get."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.result import table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.notes import Document
    from photostrip.result.description import Quantity


class Table(table.Table):
    """Columns of equal length by name: ``table["x"]`` is an array, ``len(table)`` the number of rows.

    Numbers are arrays of float, NaN where there is no value; counts without gaps are int, flags without gaps bool; all
    else are arrays of objects, None where there is none. Rows are dictionaries, with None where there is no value.
    Arrays cannot be written to: a copy can.
    """

    def __init__(
        self,
        name: str,
        columns: Mapping[str, NDArray[Any]],
        quantities: Mapping[str, Quantity],
        frame: Document | None = None,
    ) -> None:
        super().__init__(name, columns, quantities)
        self._frame = frame  # of its coordinates

    def _with(self, columns: Mapping[str, NDArray[Any]]) -> Table:
        return Table(self.name, columns, self.quantities, self._frame)

    def to_geopandas(self) -> Any:  # noqa: ANN401 (a library that need not be there)
        """Return points and photos as a ``geopandas.GeoDataFrame``: the data frame with a place on the map in each row.

        East, north, up in the reference system of the result; of geocentric coordinates longitude, latitude, height,
        of local ones without a system. Rows without coordinates have no place. Needs geopandas.
        Raises InputError for a table without coordinates, and ImportError where geopandas is not installed.
        """
        if self._frame is None or not {"x", "y", "z"} <= set(self.columns):
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

        places = np.column_stack([self[each] for each in "xyz"])
        known = np.isfinite(places).all(axis=1)
        places[known], crs = places_on_map(self._frame, places[known])
        points = np.where(known, geopandas.points_from_xy(*places.T), None)
        frame = geopandas.GeoDataFrame(self.to_pandas(), geometry=points, crs=crs)
        frame.attrs["units"] = self.units
        return frame
