"""Ground coordinates of a result as a plan in metres, whatever their frame: for pictures, not for measuring."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from photostrip.report.page.parts import Document

Pair = tuple[float, float]
EARTH = 6_371_000.0  # m, for degrees of a body whose size is not said


class Spot(NamedTuple):
    """A point or photo on the plan."""

    id: str
    role: str  # ``photo``, ``new``, ``control`` or ``check``
    # along, across: place along the first strip, from its first photo, and to the left of it, metres
    along: float
    across: float
    shift: Pair | None = None  # adjusted minus given, along and across, metres
    up: float | None = None  # adjusted minus given in height, metres
    # axes a and b of the standard ellipse in metres, and the direction of a counter-clockwise from along, radians
    ellipse: tuple[float, float, float] | None = None


class Plan(NamedTuple):
    spots: list[Spot]
    strips: list[list[Spot]]
    north: Pair


def plan_of(document: Document) -> Plan:
    """Return the plan of a result in metres, turned so that its first strip runs to the right."""
    grid = _Grid(document)
    photos = document["photos"]
    # single photos are strips of their own, which ``strips`` does not hold: they are drawn as one
    names = [strip["id"] for strip in document["strips"]]
    flown = [[photo for photo in photos if photo["strip"] == name] for name in names] or [photos]
    first = flown[0]
    start, end = grid.place(first[0]), grid.place(first[-1])
    length = math.hypot(end[0] - start[0], end[1] - start[1]) or 1.0
    along = ((end[0] - start[0]) / length, (end[1] - start[1]) / length)

    def turned(east: float, north: float) -> Pair:
        return east * along[0] + north * along[1], north * along[0] - east * along[1]

    def spot(row: Document, role: str, given: Document | None = None) -> Spot:
        east, north = grid.place(row)
        shift, up = grid.difference(given) if given else (None, None)
        place, side = turned(east - start[0], north - start[1])
        return Spot(
            id=row["id"],
            role=role,
            along=place,
            across=side,
            shift=None if shift is None else turned(*shift),
            up=up,
            ellipse=_ellipse(row, turned),
        )

    given = {row["id"]: row for row in document["control"] if row["measured"]}
    spots = [spot(row, row["role"], given.get(row["id"])) for row in document["points"]]
    spots.sort(key=lambda each: ("new", "check", "control").index(each.role))
    return Plan(spots, [[spot(photo, "photo") for photo in each] for each in flown], turned(0.0, 1.0))


def _ellipse(row: Document, turned: Any) -> tuple[float, float, float] | None:  # noqa: ANN401 (a function)
    """Return the ellipse of a point, where the result has one."""
    a, b, azimuth = (row.get(key) for key in ("ellipse_a", "ellipse_b", "ellipse_azimuth_deg"))
    if a is None or b is None or azimuth is None:
        return None
    x, y = turned(math.sin(math.radians(azimuth)), math.cos(math.radians(azimuth)))
    return a, b, math.atan2(y, x)


class _Grid:
    """Metres to the east and to the north in the frame of a result."""

    def __init__(self, document: Document) -> None:
        frame = document["frame"]
        self._kind = frame["kind"]
        self._axes: list[str] = list(frame["axes"])
        self._factor = frame.get("plan_factor", 1.0)
        rows = document["points"]
        self._ellipsoid: list[float] = frame.get("ellipsoid") or [EARTH, EARTH]
        self._middle = [math.fsum(row[axis] for row in rows) / max(len(rows), 1) for axis in "xyz"]
        if self._kind == "geographic":
            self._factor = frame.get("plan_factor", math.radians(1.0))
        if self._kind == "geocentric":
            self._turn = self._east_north_up()

    def _named(self, values: Any) -> tuple[float, float, float]:  # noqa: ANN401 (three numbers)
        """Bring three numbers from the order of the axes to east, north, up, or X, Y, Z."""
        names = ("east", "north", "up") if "east" in self._axes else ("x", "y", "z")
        first, second, third = (values[self._axes.index(name)] for name in names)
        return first, second, third

    def _east_north_up(self) -> list[tuple[float, float, float]]:
        """Return the axes at the middle of the points, up along the normal of the ellipsoid."""
        x, y, z = self._named(self._middle)
        a, b = self._ellipsoid
        latitude, longitude = math.atan2(z * a * a, math.hypot(x, y) * b * b), math.atan2(y, x)
        sine, cosine = math.sin(latitude), math.cos(latitude)
        east = (-math.sin(longitude), math.cos(longitude), 0.0)
        north = (-sine * math.cos(longitude), -sine * math.sin(longitude), cosine)
        return [east, north, (cosine * math.cos(longitude), cosine * math.sin(longitude), sine)]

    def place(self, row: Document) -> Pair:
        """Give metres to the east and north of the middle of the points."""
        x, y, z = self._named([row[axis] - middle for axis, middle in zip("xyz", self._middle, strict=True)])
        if self._kind == "geocentric":
            east, north = self._turn[:2]
            return x * east[0] + y * east[1] + z * east[2], x * north[0] + y * north[1] + z * north[2]
        if self._kind == "geographic":
            latitude = self._named(self._middle)[1] * self._factor
            radius = self._factor * self._ellipsoid[0]
            return x * radius * math.cos(latitude), y * radius
        return x * self._factor, y * self._factor

    def difference(self, row: Document) -> tuple[Pair | None, float | None]:
        """Return a difference in metres: to the east and north, and in height."""
        values = [row[key] for key in ("dx", "dy", "dz")]
        if self._kind != "geocentric":
            east, north = (values[self._axes.index(name)] for name in ("east", "north"))
            return (None if east is None or north is None else (east, north)), row["height"]
        if any(value is None for value in values):
            return None, row["height"]
        x, y, z = self._named(values)
        parts = [x * axis[0] + y * axis[1] + z * axis[2] for axis in self._turn]
        return (parts[0], parts[1]), row["height"]
