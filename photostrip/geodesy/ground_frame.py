"""A frame of ground coordinates, tied to the one Cartesian frame of a project.

Coordinates are always in the internal order east, north, up (longitude, latitude, height; X, Y, Z). The user's order
of columns is an attribute of the frame and is applied at the rim. Directions of ground axes are orthogonal,
right-handed unit vectors, rows of (n, 3, 3): east, north, up. What lies outside the domain of a projection, a geoid
grid or a datum shift is named in messages.

Source: [001] eq. 152, 153; directions of grid axes are derived.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Flags, Floats, pieces
from photostrip.errors import Fault, GeometryError, InputError, PhotostripError
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES, FrameSpec, Kind
from photostrip.geodesy.local_frame import (
    Ellipsoid,
    curvature_correction,
    geocentric_columns,
    geocentric_from_geodetic,
    geodetic_from_geocentric,
    meridian_radius,
    prime_vertical_radius,
)
from photostrip.geodesy.proj_operation import DatumShift, ProjOperation, wrapped_longitude
from photostrip.notes import named

WGS84: Ellipsoid = (6378137.0, 6356752.314245179)
"""Semi-axes of WGS 84, metres: by definition a = 6378137 m, 1/f = 298.257223563 (NIMA TR8350.2)."""

_DERIVATIVE_STEP = 1e-4  # of the radius: 640 m on the Earth; truncation and rounding stay below 1e-11 rad
_EXACT = 1e-7  # metres: some projections of PROJ (equal-area ones) come back to a millimetre only
_COMES_BACK = 1.0  # metres: a point that misses itself by more was never in the domain of the projection
_CENTRE = 0.1  # of the radius: nearer to the centre of the body, latitude means nothing
_POLE = 1e-9  # radians: nearer to a pole, east and north are not defined
_ROWS_NAMED = 8


def plural(unit: str) -> str:
    """Return the name of a unit for several: ``metres``, ``US survey feet``."""
    return f"{unit.removesuffix('foot')}feet" if unit.endswith("foot") else f"{unit}s"


@dataclass(frozen=True, eq=False)
class GroundFrame:
    """One frame of ground coordinates, in the CRS's own units; made by ``tie_frames``."""

    spec: FrameSpec
    kind: Kind  # ``projected``, ``geographic``, ``geocentric`` or ``local``
    title: str
    # plan_unit, height_unit: names of the units (``metre``, ``US survey foot``, ``degree``)
    plan_unit: str
    height_unit: str
    # plan_factor, height_factor: metres per unit (radians per unit for the plan of a geographic frame)
    plan_factor: float
    height_factor: float
    ellipsoid: Ellipsoid | None  # semi-axes (a, b) of the frame's own datum, metres; None for a local frame
    # point of tangency (east, north) of the curvature correction of a local frame, metres
    origin: tuple[float, float] | None = None
    _angle: float = 1.0  # radians per unit of what the projection gives
    _plane: ProjOperation | None = None  # grid -> longitude, latitude of the same datum
    _vertical: ProjOperation | None = None  # heights above the geoid -> above the ellipsoid
    _geoid: str = ""  # what these heights refer to
    shift: DatumShift | None = None  # own datum -> datum of the Cartesian frame
    _cartesian: Ellipsoid = WGS84  # ellipsoid of the Cartesian frame

    @property
    def axes(self) -> tuple[str, str, str]:
        """The user's order of columns."""
        return self.spec.axes

    @cached_property
    def order(self) -> tuple[int, int, int]:
        """Columns of the internal order in the user's order: ``user[:, i] = enu[:, order[i]]``."""
        names = GROUND_AXES if "east" in self.axes else CARTESIAN_AXES
        first, second, third = (names.index(axis) for axis in self.axes)
        return first, second, third

    def user_from_internal(self, columns: ArrayLike) -> Floats:
        """Bring columns (coordinates or sigmas) in the internal order into the order of ``axes``."""
        return np.asarray(columns, dtype=np.float64)[..., list(self.order)]

    def with_origin(self, origin: ArrayLike) -> GroundFrame:
        """Set the point of tangency of the curvature correction, east and north: one for all frames of a project."""
        if self.spec.curvature_radius is None:
            return self
        east, north = np.asarray(origin, dtype=np.float64)[:2]
        return replace(self, origin=(float(east), float(north)))

    def cartesian_from_ground(self, enu: ArrayLike, *, ids: Sequence[str] | None = None) -> Floats:
        """Cartesian coordinates (n, 3), metres, of ground points (n, 3) in the CRS's own units.

        They are geocentric; in a local world they are east, north, up in metres above the tangent plane.

        Raises InputError if a coordinate is not a number, lies outside the domain of the projection or outside a grid.

        Source: [001] eq. 153 for a local frame with a radius.
        """
        points = np.array(enu, dtype=np.float64).reshape(-1, 3)
        require_rows(finite_rows(points), "a coordinate is not a number", ids)
        if self.kind == "local":
            return self._bent(points, -1.0)
        if self.kind == "geocentric":
            xyz = points * self.plan_factor
            if self.shift is None:
                return xyz
            return self._cartesian_from_geodetic(geodetic_from_geocentric(xyz, self._datum_ellipsoid), ids)
        plan = self._lonlat(points[:, :2], ids)
        height = self._ellipsoidal(points, ids)
        return self._cartesian_from_geodetic(np.column_stack([plan, height]), ids)

    def ground_from_cartesian(self, xyz: ArrayLike, *, ids: Sequence[str] | None = None) -> Floats:
        """Ground coordinates (n, 3), in the CRS's own units, of points (n, 3) in the Cartesian frame, metres.

        Longitudes are in (-180, 180] degrees.

        Raises GeometryError if a point lies where the projection or a grid does not reach.

        Source: [001] eq. 152, 153.
        """
        points = np.array(xyz, dtype=np.float64).reshape(-1, 3)
        if self.kind == "local":
            return self._bent(points, 1.0)
        if self.kind == "geocentric" and self.shift is None:
            return points / self.plan_factor
        geodetic = self.geodetic(points)
        if self.kind == "geocentric":
            return geocentric_from_geodetic(geodetic, self._datum_ellipsoid) / self.plan_factor
        plan = self._plan(geodetic)
        require_reached(finite_rows(plan), f"outside the domain of {self.spec.name}", ids)
        return np.column_stack([plan, self._from_ellipsoidal(plan, geodetic[:, 2], ids)])

    def geodetic(self, xyz: ArrayLike) -> Floats:
        """Longitude, latitude (radians) and ellipsoidal height of Cartesian points, on the frame's own datum.

        Longitudes are in (-pi, pi] from the datum's zero meridian, and 0 at a pole.

        Raises GeometryError for a local frame, and for points near the centre of the body.
        """
        if self.kind == "local":
            raise GeometryError("a local frame has no longitude and latitude", code="local-geodetic")
        points = np.asarray(xyz, dtype=np.float64).reshape(-1, 3)
        deep = ~(np.linalg.norm(points, axis=1) > _CENTRE * self._cartesian[0])
        if deep.any():
            raise GeometryError(
                f"{named_rows(deep, None)}: not a point near the surface; are these geocentric coordinates in metres?",
                code="ground-domain",
            )
        geodetic = geodetic_from_geocentric(points, self._cartesian)
        if self.shift is not None:
            geodetic = self.shift.inverse(geodetic)
            require_reached(finite_rows(geodetic), f"no datum shift is known there to {self.spec.name}", None)
        return geodetic

    def axes_at(self, xyz: ArrayLike, ground: Floats | None = None) -> Floats:
        """Directions (n, 3, 3) of the ground axes at Cartesian points; rows are unit vectors in the Cartesian frame.

        They are orthogonal and right-handed: grid east, grid north and the ellipsoid's normal of a projected frame;
        true east, north and the normal of a geographic one; the identity for ``geocentric`` and ``local``. Where the
        lines of a grid do not cross at right angles (a projection that is not conformal), the right angle lies evenly
        between them.

        ground: (n, 3), optional, coordinates of the same points in this frame.
        Raises GeometryError for a geographic frame at a pole, where there is no east, and outside the domain of a
            projection.
        """
        points = np.asarray(xyz, dtype=np.float64).reshape(-1, 3)
        if self.kind in {"geocentric", "local"}:
            return np.broadcast_to(np.eye(3), (len(points), 3, 3)).copy()
        if ground is not None and self.kind == "projected" and self.shift is None:
            return self._grid_axes(ground[:, :2])
        geodetic = self.geodetic(points)
        axes = true_axes(geodetic) if self.kind == "geographic" else self._grid_axes(self._plan(geodetic))
        return axes if self.shift is None else self._shifted_axes(geodetic, axes)

    def level_axes_at(self, xyz: ArrayLike, ground: Floats | None = None) -> Floats:
        """Directions as ``axes_at`` gives them, but true east, north and the normal for ``geocentric``."""
        return true_axes(self.geodetic(xyz)) if self.kind == "geocentric" else self.axes_at(xyz, ground)

    def convergence(self, xyz: ArrayLike) -> Floats:
        """Meridian convergence at Cartesian points: the azimuth of grid north, radians in (-pi, pi], shape (n,).

        In the northern hemisphere it is positive east of the central meridian. 0 for frames without a grid.

        Raises GeometryError at a pole, where there is no true north, and outside the domain of the projection.
        """
        points = np.asarray(xyz, dtype=np.float64).reshape(-1, 3)
        if self.kind != "projected":
            return np.zeros(len(points))
        geodetic = self.geodetic(points)
        true, grid_north = true_axes(geodetic), self._grid_axes(self._plan(geodetic))[:, 1]
        east, north = np.einsum("nij,nj->in", true[:, :2], grid_north)
        return np.asarray(np.arctan2(east, north))

    def difference(self, enu_a: ArrayLike, enu_b: ArrayLike) -> Floats:
        """Difference of ground coordinates (n, 3), a minus b, in metres along east, north, up (X, Y, Z).

        For a projected frame it is the difference of coordinates times the unit; for a geographic one metres on the
        ground, the short way across the meridian of 180 degrees.
        """
        a, b = (np.asarray(enu, dtype=np.float64).reshape(-1, 3) for enu in (enu_a, enu_b))
        delta = (a - b) * (self.plan_factor, self.plan_factor, self.height_factor)
        if self.kind != "geographic" or self.ellipsoid is None:
            return delta
        lat = (a[:, 1] + b[:, 1]) / 2.0 * self.plan_factor
        height = (a[:, 2] + b[:, 2]) / 2.0 * self.height_factor
        across = prime_vertical_radius(lat, self.ellipsoid) + height
        delta[:, 0] = wrapped_longitude(delta[:, 0]) * across * np.cos(lat)
        delta[:, 1] *= meridian_radius(lat, self.ellipsoid) + height
        return delta

    @property
    def datum_shift(self) -> str:
        """Datum shift between the frame and the Cartesian frame, in PROJ's words; empty where there is none."""
        return "" if self.shift is None else str(self.shift.operation)

    @property
    def datum_accuracy(self) -> float | None:
        """Accuracy that is stated for the datum shift, metres: 0 without one, None when it is not known."""
        return 0.0 if self.shift is None else self.shift.operation.accuracy

    @property
    def grids(self) -> tuple[str, ...]:
        """Paths of the grid files that are read for the heights and the datum shift; known after the first use."""
        shift = None if self.shift is None else self.shift.operation
        operations = [each for each in (self._plane, self._vertical, shift) if each is not None]
        return tuple(dict.fromkeys(grid for operation in operations for grid in operation.grids))

    def describe(self) -> str:
        """Say in one line what the frame is: CRS, order of columns, units, heights, datum shift."""
        named = self.title not in {"unknown", self.spec.crs}
        text = f"{self.spec.name} ({self.title})" if named else self.spec.name
        text += f": {', '.join(self.axes)}"
        plan, height = plural(self.plan_unit), plural(self.height_unit)
        text += f"; plan in {plan}, " if self.kind in {"projected", "geographic"} else f"; {plan}"
        if self.kind in {"projected", "geographic"}:
            text += f"{self.spec.height} heights in {height}"
        if self.spec.geoid_undulation is not None:
            text += f", geoid undulation {self.spec.geoid_undulation:+.3f} m"
        if self._geoid:
            text += f" ({self._geoid})"
        if self.spec.curvature_radius is not None:
            text += f", curvature correction with R = {self.spec.curvature_radius:.0f} m"
        if self.shift is not None and self.datum_accuracy != 0.0:
            text += f"; datum shift: {self.datum_shift}"
        return text

    @property
    def _datum_ellipsoid(self) -> Ellipsoid:
        return self.ellipsoid or WGS84

    def _bent(self, points: Floats, sign: float) -> Floats:
        """Heights of a local frame from (+1) or to (-1) the tangent plane, where a radius is given."""
        radius = self.spec.curvature_radius
        if radius is None:
            return points
        if self.origin is None:
            raise PhotostripError("the curvature correction of a local frame has no origin: call with_origin first")
        distance = np.hypot(points[:, 0] - self.origin[0], points[:, 1] - self.origin[1])
        points[:, 2] += sign * curvature_correction(distance, radius)  # eq. 153
        return points

    def _lonlat(self, plan: Floats, ids: Sequence[str] | None) -> Floats:
        """Longitude and latitude, radians, of plan coordinates."""
        if self._plane is not None:
            lonlat = self._plane.apply(plan)
            miss = plan - self._plane.apply(lonlat, inverse=True)
            # PROJ gives some points outside the domain a place inside: they do not come back. East may: some grids
            # go round the globe, and a coordinate beyond 180 degrees comes back as one before it.
            good = finite_rows(lonlat) & (np.abs(miss[:, 1]) * self.plan_factor < _COMES_BACK)
            require_rows(good, f"outside the domain of {self.spec.name}", ids)
            if np.abs(miss).max(initial=0.0) * self.plan_factor > _EXACT:  # an inverse by a short series
                near = (np.abs(miss[:, 0]) * self.plan_factor < _COMES_BACK)[:, None]
                lonlat = self._plane.apply(plan + np.where(near, miss, 0.0))
            return lonlat * self._angle
        lonlat = plan * self._angle
        inside = (np.abs(lonlat[:, 0]) <= 2.0 * math.pi) & (np.abs(lonlat[:, 1]) <= math.pi / 2.0)
        require_rows(inside, "no such longitude and latitude (are the axes in the right order?)", ids)
        return lonlat

    def _ellipsoidal(self, points: Floats, ids: Sequence[str] | None) -> Floats:
        """Heights above the frame's own ellipsoid, metres."""
        if self._vertical is None:
            return points[:, 2] * self.height_factor + (self.spec.geoid_undulation or 0.0)
        height = self._vertical.apply(points)[:, 2]
        require_rows(np.isfinite(height), f"outside the geoid grid of {self.spec.name}", ids)
        return height

    def _from_ellipsoidal(self, plan: Floats, ellipsoidal: Floats, ids: Sequence[str] | None) -> Floats:
        """Heights in the user's sense and unit from heights above the frame's own ellipsoid."""
        if self._vertical is None:
            return (ellipsoidal - (self.spec.geoid_undulation or 0.0)) / self.height_factor
        first = self._vertical.apply(np.column_stack([plan, ellipsoidal]), inverse=True)[:, 2]
        require_reached(finite_rows(first[:, None]), f"outside the geoid grid of {self.spec.name}", ids)
        # A geoid on a shifted datum is inverted by PROJ to 0.1 mm only; one step of iteration makes it exact.
        again = self._vertical.apply(np.column_stack([plan, first]))[:, 2]
        return first + (ellipsoidal - again) / self.height_factor

    def _cartesian_from_geodetic(self, geodetic: Floats, ids: Sequence[str] | None) -> Floats:
        """Cartesian coordinates from longitude, latitude (radians) and height of the frame's own datum."""
        if self.shift is not None:
            geodetic = self.shift.forward(geodetic)
            require_rows(finite_rows(geodetic), f"no datum shift from {self.spec.name} is known there", ids)
        return geocentric_from_geodetic(geodetic, self._cartesian)

    def _plan(self, geodetic: Floats) -> Floats:
        """Plan coordinates (n, 2) of longitudes and latitudes, radians."""
        plan = geodetic[:, :2] / self._angle
        return plan if self._plane is None else self._plane.apply(plan, inverse=True)

    def _grid_axes(self, plan: Floats) -> Floats:
        """Rows grid east, grid north, normal in the geocentric frame of the own datum at plan coordinates (n, 2).

        Where one gets when the grid coordinate grows, by central differences of fourth order: that needs nothing of
        the projection and works at poles and at the meridian of 180 degrees.
        """
        if self._plane is None or self.ellipsoid is None:
            raise PhotostripError(f"{self.spec.name} has no grid")
        step = _DERIVATIVE_STEP * self.ellipsoid[0] / self.plan_factor
        offsets = step * np.array([[2, 0], [1, 0], [-1, 0], [-2, 0], [0, 2], [0, 1], [0, -1], [0, -2]])
        weights = np.array([-1.0, 8.0, -8.0, 1.0])
        axes, reached = np.empty((len(plan), 3, 3)), np.zeros(len(plan), bool)
        for rows in pieces(len(plan)):
            ends = plan[rows].T[:, None, :] + offsets.T[:, :, None]
            lonlat = self._plane.apply(ends.reshape(2, -1).T) * self._angle
            reached[rows] = finite_rows(lonlat).reshape(8, -1).all(axis=0)
            if reached[rows].all():
                # On the ellipsoid: with the height of the point, lines that cross at right angles there would not here.
                lon, lat = lonlat.T
                xyz = geocentric_columns(lon, lat, 0.0, self.ellipsoid)
                east, north = np.einsum("k,cakn->acn", weights, np.reshape(xyz, (3, 2, 4, -1)))
                axes[rows] = axes_between(east.T, north.T)
        require_reached(reached, f"outside, or at the edge of, the domain of {self.spec.name}", None)
        return axes

    def _shifted_axes(self, geodetic: Floats, axes: Floats) -> Floats:
        """Axes of the own datum, carried into the Cartesian frame through the datum shift."""
        step = _DERIVATIVE_STEP * self._datum_ellipsoid[0]
        centre = geocentric_from_geodetic(geodetic, self._datum_ellipsoid)
        ends = []
        for sign in (1.0, -1.0):
            moved = centre[:, None, :] + sign * step * axes
            there = geodetic_from_geocentric(moved.reshape(-1, 3), self._datum_ellipsoid)
            ends.append(self._cartesian_from_geodetic(there, None).reshape(-1, 3, 3))
        east, north, _ = np.moveaxis(ends[0] - ends[1], 1, 0)
        return axes_along_north(east, north)


def true_axes(geodetic: Floats) -> Floats:
    """East, north and the ellipsoid's normal at longitude, latitude (radians), in the geocentric frame."""
    lon, lat = geodetic[:, 0], geodetic[:, 1]
    pole = np.abs(lat) > math.pi / 2.0 - _POLE
    if pole.any():
        raise GeometryError(f"{named_rows(pole, None)}: at a pole there is no east and no north", code="pole")
    (sin_l, cos_l), (sin_b, cos_b) = ((np.sin(angle), np.cos(angle)) for angle in (lon, lat))
    east = np.stack([-sin_l, cos_l, np.zeros_like(lon)], axis=-1)
    north = np.stack([-sin_b * cos_l, -sin_b * sin_l, cos_b], axis=-1)
    up = np.stack([cos_b * cos_l, cos_b * sin_l, sin_b], axis=-1)
    return np.stack([east, north, up], axis=1)


def axes_between(east: Floats, north: Floats) -> Floats:
    """Right angles, shared evenly between two directions; nothing moves where they cross at right angles."""
    east, north = _unit(east), _unit(north)
    up = _unit(np.cross(east, north))
    east = _unit(east + np.cross(north, up))
    return np.stack([east, np.cross(up, east), up], axis=1)


def axes_along_north(east: Floats, north: Floats) -> Floats:
    """Right angles, the second axis along a direction in the plane of two."""
    up = _unit(np.cross(east, north))
    north = _unit(north - np.einsum("nc,nc->n", north, up)[:, None] * up)
    return np.stack([np.cross(north, up), north, up], axis=1)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def finite_rows(rows: Floats) -> Flags:
    """Rows without an infinite number: PROJ marks what it cannot transform by infinity."""
    return np.asarray(np.isfinite(rows).all(axis=1))


def named_rows(bad: Flags, ids: Sequence[str] | None) -> str:
    """Say which rows are meant, the first of them by name; without ids by number, counted from 0."""
    rows = np.flatnonzero(bad)
    if ids is None:
        return named("row", [str(row) for row in rows], _ROWS_NAMED)
    return named("point", [ids[int(row)] for row in rows], _ROWS_NAMED)


def require_rows(good: Flags, trouble: str, ids: Sequence[str] | None) -> None:
    """Refuse coordinates given by the user that cannot be used."""
    if not good.all():
        raise InputError(Fault(f"{named_rows(~good, ids)}: {trouble}", code="ground-domain", points=_ids(~good, ids)))


def require_reached(good: Flags, trouble: str, ids: Sequence[str] | None) -> None:
    """Refuse computed points that cannot be expressed in a frame."""
    if not good.all():
        raise GeometryError(f"{named_rows(~good, ids)}: {trouble}", points=_ids(~good, ids), code="ground-domain")


def _ids(bad: Flags, ids: Sequence[str] | None) -> tuple[str, ...]:
    return () if ids is None else tuple(ids[int(row)] for row in np.flatnonzero(bad))
