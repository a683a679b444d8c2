"""Operations of PROJ between coordinate reference systems, chosen once for all points, and the datum shifts they make.

With ``crs`` the only module that uses pyproj; it loads it with the first CRS that needs it. PROJ's network access
stays off.
"""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.arrays import Floats
from photostrip.geodesy.local_frame import EARTH_RADIUS

if TYPE_CHECKING:
    from pyproj import CRS, Transformer


DECADE = 10.0  # years


@cache
def load_pyproj() -> Any:  # noqa: ANN401 (a module; pyproj does not say what it exports)
    """Load pyproj at first need, its network access off: a run must not depend on what a server sends."""
    import pyproj
    import pyproj.network

    network: Any = pyproj.network
    network.set_network_enabled(active=False)
    return pyproj


def proj_versions() -> dict[str, str | None]:
    """Return the version of PROJ, and that of the EPSG data set that it knows."""
    from pyproj.database import get_database_metadata

    return {"proj": load_pyproj().proj_version_str, "epsg": get_database_metadata("EPSG.VERSION")}


class ProjOperation:
    """One PROJ operation between two CRSs, chosen once and then kept for all points.

    PROJ often knows several operations between two datums, each for a country, and picks one for each point. Two
    points of one strip must not be shifted by different operations, so the one that PROJ picks for the middle row
    of the first points is kept.
    """

    def __init__(self, source: CRS, target: CRS, epoch: float | None = None) -> None:
        self._ends = (source, target)
        self.epoch = epoch  # decimal year of the coordinates; None: that to which the operation refers
        self._decided_by: tuple[Floats, bool] | None = None  # the point, and whether it went the inverse way

    def __getstate__(self) -> dict[str, Any]:
        """Keep what the operation is made from: PROJ's own object cannot be sent to another process."""
        return {"_ends": self._ends, "_decided_by": self._decided_by, "epoch": self.epoch}

    @cached_property
    def transformer(self) -> Transformer:
        """The PROJ object; making it takes 1 to 100 ms. Raises ProjError where no sound operation exists."""
        made: Transformer = load_pyproj().Transformer.from_crs(*self._ends, always_xy=True, allow_ballpark=False)
        if self._decided_by is not None:  # in another process
            point, inverse = self._decided_by
            made = _used(made, point, inverse=inverse)
        return made

    @property
    def idle(self) -> bool:
        """Whether coordinates pass unchanged, as between ETRS89 and WGS 84."""
        return self.transformer.definition.startswith("proj=noop")

    def apply(self, columns: Floats, *, inverse: bool = False) -> Floats:
        """Transform rows of coordinates; what lies outside the domain becomes infinite."""
        if self._decided_by is None and len(columns):
            self._decided_by = columns[len(columns) // 2], inverse
            self.transformer = _used(self.transformer, columns[len(columns) // 2], inverse=inverse)
        rows = np.repeat(columns, 2, axis=0) if len(columns) == 1 else columns  # pyproj 3.6 takes one row for numbers
        return self._run(rows, self.epoch, inverse=inverse)[: len(columns)]

    def _run(self, rows: Floats, epoch: float | None, *, inverse: bool) -> Floats:
        """Transform rows with the coordinates of an epoch."""
        dated = rows if epoch is None else np.column_stack([rows, np.full(len(rows), epoch)])
        return np.stack(_run(self.transformer, dated.T, inverse=inverse)).T[:, : rows.shape[1]]

    @property
    def area(self) -> str:
        """Where the operation is made for, in PROJ's words; empty when it does not say."""
        return str(getattr(self.transformer.area_of_use, "name", "") or "").partition(":")[0].rstrip(".")

    @property
    def reference_epoch(self) -> float | None:
        """Epoch to which a time-dependent operation refers; None where time changes nothing."""
        stated = re.findall(r"\bt_epoch=(\S+)", self.transformer.definition)
        return float(stated[-1]) if stated else None

    def moved_per_year(self) -> Floats:
        """By how much the result moves in a year at the first point, in the units of the CRS it leads to."""
        reference = self.reference_epoch
        if reference is None or self._decided_by is None:
            return np.zeros(3)
        point, inverse = self._decided_by
        rows = np.tile(point, (2, 1))
        first, last = (self._run(rows, epoch, inverse=inverse)[0] for epoch in (reference, reference + DECADE))
        return np.asarray((last - first) / DECADE, float)

    @property
    def accuracy(self) -> float | None:
        """Accuracy that PROJ states, metres; None when it states none, or has not chosen yet."""
        stated = float(self.transformer.accuracy)
        return stated if stated >= 0.0 else None

    @property
    def grids(self) -> tuple[str, ...]:
        """Paths of the grid files that the operation reads."""
        steps = self.transformer.operations or ()
        named = re.findall(r"\bgrids=(\S+)", self.transformer.definition)
        paths = [name for names in named for name in names.split(",") if Path(name).is_file()]
        paths += [grid.full_name for step in steps for grid in step.grids if grid.available]
        return tuple(dict.fromkeys(paths))

    def __str__(self) -> str:
        if not self.idle and self._decided_by is None:
            return "chosen by PROJ at the first point"
        steps = [step for step in self.transformer.description.split(" + ") if not step.startswith("axis order change")]
        accuracy = "accuracy not known" if self.accuracy is None else f"accuracy {self.accuracy:g} m"
        return f"{' + '.join(steps)}, {accuracy}"


def _run(transformer: Transformer, columns: Floats, *, inverse: bool) -> Any:  # noqa: ANN401 (arrays or numbers)
    """Hand columns to PROJ and get columns back."""
    transform: Any = transformer.transform
    return transform(*columns, direction="INVERSE" if inverse else "FORWARD", errcheck=False)


def _used(transformer: Transformer, point: Floats, *, inverse: bool) -> Transformer:
    """Single out the operation that PROJ uses for one point."""
    _run(transformer, point, inverse=inverse)
    try:
        return transformer.get_last_used_operation()
    except load_pyproj().exceptions.ProjError:
        return transformer  # nothing is valid at this point, or nothing is to be done


def trouble_with(operation: ProjOperation) -> str:
    """Make an operation; give what PROJ says against it, nothing when it is sound."""
    try:
        operation.transformer  # noqa: B018 (made here, so that a refusal comes before any computing)
    except load_pyproj().exceptions.ProjError as error:
        return str(error) or "no operation"
    return ""


def missing_grids(source: CRS, target: CRS) -> str:
    """Name the grids that PROJ would use between two CRSs if they were there."""
    from pyproj.transformer import TransformerGroup

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of what is asked here
        try:
            group = TransformerGroup(source, target, always_xy=True, allow_ballpark=False)
        except load_pyproj().exceptions.ProjError:
            return ""
    missing = ([g.short_name for g in best.grids if not g.available] for best in group.unavailable_operations)
    return " and ".join(next(filter(None, missing), []))  # of the best operation: PROJ lists it first


@dataclass(frozen=True, eq=False)
class DatumShift:
    """Longitude, latitude (radians) and height of one datum into those of another, and back."""

    operation: ProjOperation
    source_unit: float  # radians per unit of the geographic CRS
    target_unit: float

    def _apply(self, geodetic: Floats, *, inverse: bool) -> Floats:
        """Run the operation in the units of the two CRSs."""
        units = (self.source_unit, self.target_unit)
        given, wanted = units[::-1] if inverse else units
        moved = self.operation.apply(geodetic / (given, given, 1.0), inverse=inverse)
        return moved * (wanted, wanted, 1.0)

    def forward(self, geodetic: Floats) -> Floats:
        """From the frame's own datum to that of the Cartesian frame."""
        return geodetic if self.operation.idle else self._apply(geodetic, inverse=False)

    @property
    def moved_per_year(self) -> float:
        """By how much the result moves in a year, metres, about."""
        east, north, up = self.operation.moved_per_year()
        return float(np.hypot(np.hypot(east, north) * self.target_unit * EARTH_RADIUS, up))

    def inverse(self, geodetic: Floats) -> Floats:
        """Undo ``forward``.

        PROJ inverts a seven-parameter shift to first order in its angles, 0.1 mm for one arc second and centimetres
        for ten; one step of iteration makes the way back exact.
        """
        if self.operation.idle:
            return geodetic
        first = self._apply(geodetic, inverse=True)
        miss = first - self._apply(self._apply(first, inverse=False), inverse=True)
        miss[:, 0] = wrapped_longitude(miss[:, 0])
        return first + miss


def wrapped_longitude(angle: Floats) -> Floats:
    """Bring differences of longitude into [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
