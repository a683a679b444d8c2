"""Ground coordinates of a result as a plan in metres, whatever their frame: for pictures, not for measuring."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from photostrip.notes import Document

Pair = tuple[float, float]
EARTH = 6_371_000.0  # m, for degrees of a body whose size is not said


def middle(places: Sequence[Pair]) -> Pair:
    return math.fsum(x for x, _ in places) / len(places), math.fsum(y for _, y in places) / len(places)


class Dot(NamedTuple):
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
    spots: list[Dot]
    strips: list[list[Dot]]
    north: Pair

    @property
    def everything(self) -> list[Dot]:
        return [*self.spots, *(spot for strip in self.strips for spot in strip)]

    def turned(self, east: float, north: float) -> Pair:
        """Return a vector along the first strip and to its left."""
        sine, cosine = self.north
        return east * cosine + north * sine, north * cosine - east * sine


class Course(NamedTuple):
    """A strip as an axis of its own, on the plan."""

    start: Pair
    direction: Pair  # of length 1

    def turned(self, vector: Pair) -> Pair:
        """Return a vector of the plan along the strip and to its left."""
        (x, y), (a, b) = vector, self.direction
        return x * a + y * b, y * a - x * b

    def along(self, place: Pair) -> float:
        """Return the distance of a place from the first photo, along the strip."""
        return self.turned((place[0] - self.start[0], place[1] - self.start[1]))[0]


def course_of(strip: list[Dot]) -> Course:
    first, last = strip[0], strip[-1]
    x, y = last.along - first.along, last.across - first.across
    length = math.hypot(x, y)
    return Course((first.along, first.across), (x / length, y / length) if length else (1.0, 0.0))


def plan_of(document: Document) -> Plan:
    """Return the plan of a result in metres, turned so that its first strip runs to the right."""
    grid = DrawnGrid(document)
    # centres of independent models need not be known
    photos = [photo for photo in document["photos"] if photo["x"] is not None]
    # ``strips`` holds the strips that were formed, which are drawn first; photos of others stand for themselves
    names = [strip["id"] for strip in document["strips"]]
    by_strip: dict[str, list[Document]] = {name: [] for name in names}
    for photo in photos:
        by_strip.setdefault(photo["strip"], []).append(photo)
    flown = [*by_strip.values()] if names else [photos]  # where all photos are single ones, they are drawn as one strip
    ends = [grid.place(photo) for photo in (flown[0][:1] + flown[0][-1:])] or [(0.0, 0.0)]
    start, end = ends[0], ends[-1]
    length = math.hypot(end[0] - start[0], end[1] - start[1])
    along = ((end[0] - start[0]) / length, (end[1] - start[1]) / length) if length else (1.0, 0.0)

    def turned(east: float, north: float) -> Pair:
        return east * along[0] + north * along[1], north * along[0] - east * along[1]

    def spot(row: Document, role: str, given: Document | None = None) -> Dot:
        east, north = grid.place(row)
        shift, up = grid.difference(given) if given else (None, None)
        place, side = turned(east - start[0], north - start[1])
        return Dot(
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


class DrawnGrid:
    """Metres to the east, to the north and up in the frame of a result."""

    def __init__(self, document: Document) -> None:
        frame = document["frame"]
        self._kind = frame["kind"]
        self._axes: list[str] = list(frame["axes"])
        self._factor = frame.get("plan_factor", 1.0)
        self._up_factor = frame.get("height_factor", 1.0)
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

    def up(self, row: Document) -> float:
        """Return metres above the middle of the points."""
        x, y, z = self._named([row[axis] - middle for axis, middle in zip("xyz", self._middle, strict=True)])
        if self._kind == "geocentric":
            up = self._turn[2]
            return x * up[0] + y * up[1] + z * up[2]
        return float(z * self._up_factor)

    def seen_from(self, photo: Document, row: Document) -> tuple[float, float, float]:
        """Return the way from a perspective centre to a point in metres, along the axes of the photo's rotation."""
        x, y, z = self._named([row[axis] - photo[axis] for axis in "xyz"])
        if self._kind == "geocentric":
            return x, y, z
        east, north = x * self._factor, y * self._factor
        if self._kind == "geographic":
            latitude = self._named([photo[axis] for axis in "xyz"])[1] * self._factor
            east, north = east * self._ellipsoid[0] * math.cos(latitude), north * self._ellipsoid[0]
        drop = 0.0 if self._kind == "local" else (east**2 + north**2) / (2.0 * self._ellipsoid[0])
        return east, north, z * self._up_factor - drop

    def plan_direction(self, vector: tuple[float, float, float]) -> tuple[float, float, float]:
        """Bring a vector along the axes of a photo's rotation to east, north and up."""
        if self._kind != "geocentric":
            return vector
        x, y, z = vector
        east, north, up = (x * axis[0] + y * axis[1] + z * axis[2] for axis in self._turn)
        return east, north, up

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
