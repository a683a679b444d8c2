"""A result as arrays of metres on its plan and millimetres in its photos: for pictures, not for measuring.

The plan is turned so that the first strip runs to the right from its first photo: along, across to its left, up.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from os.path import commonprefix
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from photostrip.notes import Document
from photostrip.report.pictures.chart import rows_of
from photostrip.report.sections.project import cameras_of

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

EARTH = 6_371_000.0  # m, for degrees of a body whose size is not said
SHORT = 8  # letters that a name may have
MATRIX = tuple(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3))  # of a rotation, by rows


def shortened(names: Sequence[str]) -> tuple[dict[str, str], str]:
    """Return long names of photos without what all of them begin and end with, and a sentence that says so."""
    ending = re.fullmatch(r".*?(\.\w+)?", names[0] if names else "")
    end = (ending and ending[1]) or ""
    end = end if all(name.endswith(end) for name in names) else ""
    start = commonprefix([name.removesuffix(end)[:-1] for name in names])  # noqa: RUF071 (names, not paths)
    if max(map(len, names), default=0) <= SHORT or not start + end:
        return dict(zip(names, names, strict=True)), ""
    parts = [f"“{start}” before"] * bool(start) + [f"“{end}” after"] * bool(end)
    short = {name: name.removesuffix(end)[len(start) :] for name in names}
    return short, f" Photos stand without {' and '.join(parts)} their names."


def numbers(rows: Sequence[Document], *keys: str) -> Floats:
    """Return columns of a table, NaN where there is none."""
    cells = [[row.get(key) for key in keys] for row in rows]
    return np.array(cells, np.float64).reshape(len(rows), len(keys))


def grouped(pairs: Iterable[tuple[str, int]]) -> dict[str, list[int]]:
    """Return the numbers that go with each name, in the order of the names."""
    groups: dict[str, list[int]] = {}
    for name, number in pairs:
        groups.setdefault(name, []).append(number)
    return groups


class Rays(NamedTuple):
    """Image residuals, a row for each."""

    photo: list[str]
    point: list[str]
    v: Floats  # (n, 2), µm, measured minus computed
    used: Flags
    test: Floats  # (n, 2), standardised residuals, NaN where a bundle adjustment does not know them


def rays_of(document: Document) -> Rays:
    rays = document["residuals"]
    tests = [rays[key] for key in ("test_x", "test_y") if key in rays.columns]
    return Rays(
        photo=rays.values("photo"),
        point=rays.values("point"),
        v=np.column_stack([rays["vx_um"], rays["vy_um"]]),
        used=rays["used"],
        test=np.column_stack(tests) if tests else np.full((len(rays), 2), np.nan),
    )


class Course(NamedTuple):
    """A strip as an axis of its own, on the plan."""

    start: Floats
    direction: Floats  # of length 1

    def turned(self, vectors: Floats) -> Floats:
        """Return vectors of the plan along the strip, to its left and up."""
        a, b = self.direction
        x, y, up = np.moveaxis(np.asarray(vectors), -1, 0)  # what is not known of the plan leaves the height alone
        return np.stack([x * a + y * b, y * a - x * b, up], axis=-1)

    def along(self, places: Floats) -> Floats:
        """Return distances from the first photo along the strip, km."""
        return np.asarray((places[:, :2] - self.start) @ self.direction) / 1000.0


def course_of(photos: Floats) -> Course:
    """Return the axis of a strip from its first to its last photo."""
    way = photos[-1, :2] - photos[0, :2]
    length = float(np.linalg.norm(way))
    return Course(photos[0, :2], way / length if length else np.array([1.0, 0.0]))


@dataclass(frozen=True)
class Plan:
    """Points and photos of a result on its plan; ``shift`` is adjusted minus given, NaN where that is not known."""

    document: Document
    ids: list[str]  # of points
    role: NDArray[np.str_]  # ``new``, ``control`` or ``check``
    points: Floats  # (n, 3): along, across, up, metres
    shift: Floats  # (n, 3), along, across, up, metres
    ellipse: Floats  # (n, 3): axes a and b of the standard ellipse in metres, direction of a from along, radians
    photo_ids: list[str]
    photos: Floats  # (m, 3): perspective centres, NaN where not known
    axes: Floats  # (m, 3, 3): rows are the axes of the image along, across, up; NaN where not known
    strips: dict[str, list[int]]  # numbers of the photos whose centres are known; "": photos without strips
    north: Floats
    radius: float  # of the body where rays bend away from the plan, m; infinite where they do not

    @cached_property
    def row(self) -> dict[str, int]:
        return {name: n for n, name in enumerate(self.ids)}

    @cached_property
    def photo_row(self) -> dict[str, int]:
        return {name: n for n, name in enumerate(self.photo_ids)}

    def rows(self, ids: Iterable[str]) -> NDArray[np.intp]:
        """Return the numbers of points; -1 for one that the result does not have."""
        return np.array([self.row.get(name, -1) for name in ids], np.intp)

    @cached_property
    def everything(self) -> Floats:
        """Return points and known perspective centres, in plan."""
        return np.concatenate([self.points[:, :2], self.photos[np.isfinite(self.photos).all(axis=1), :2]])

    @cached_property
    def map_rows(self) -> int:
        """Return into how many rows a map of all is cut."""
        return rows_of(self.everything)

    def course(self, strip: str) -> Course:
        return course_of(self.photos[self.strips[strip]])

    def images(self, photo: Sequence[str], point: Sequence[str]) -> Floats:
        """Return where points are seen, mm from the principal point, x right, y up; NaN for what is not known."""
        cameras = cameras_of(self.document)
        distance = np.array([cameras[name]["principal_distance_mm"] if name in cameras else np.nan for name in photo])
        m, rows = np.array([self.photo_row[name] for name in photo], np.intp), self.rows(point)
        way = self.points[rows] - self.photos[m]
        way[:, 2] -= (way[:, 0] ** 2 + way[:, 1] ** 2) / (2.0 * self.radius)
        x, y, back = np.einsum("nij,nj->in", self.axes[m], way)
        back = np.where((back < 0) & (rows >= 0), back, np.nan)
        return np.column_stack([x, y]) * (-distance / back)[:, None]


def plan_of(document: Document) -> Plan:
    """Return the plan of a result, whatever its frame."""
    frame, points, photos = document["frame"], document["points"], document["photos"]
    names = ("east", "north", "up") if "east" in frame["axes"] else ("x", "y", "z")
    order = [list(frame["axes"]).index(name) for name in names]
    xyz, centres = numbers(points, "x", "y", "z")[:, order], numbers(photos, "x", "y", "z")[:, order]
    middle = xyz.mean(axis=0) if len(xyz) else np.zeros(3)
    a, b = frame.get("ellipsoid") or (EARTH, EARTH)
    factor = np.array([frame.get("plan_factor", 1.0)] * 2 + [frame.get("height_factor", 1.0)])
    turn = np.eye(3)  # of the frame's axes to the rows east, north, up
    if frame["kind"] == "geocentric":
        factor[:] = 1.0
        x, y, z = middle
        latitude, longitude = math.atan2(z * a * a, math.hypot(x, y) * b * b), math.atan2(y, x)
        sine, cosine = math.sin(latitude), math.cos(latitude)
        east = -math.sin(longitude), math.cos(longitude), 0.0
        north = -sine * math.cos(longitude), -sine * math.sin(longitude), cosine
        turn = np.array([east, north, np.cross(east, north)])
    elif frame["kind"] == "geographic":
        radian = frame.get("plan_factor", math.radians(1.0))
        factor[:2] = radian * a * math.cos(middle[1] * radian), radian * a
    strips: dict[str, list[int]] = {strip["id"]: [] for strip in document["strips"]}
    for n, photo in enumerate(photos):
        if photo["x"] is not None:  # centres of independent models need not be known
            strips.setdefault(photo["strip"] if document["strips"] else "", []).append(n)
    centres = ((centres - middle) * factor) @ turn.T
    first = next(iter(strips.values()), []) or [0]
    start = centres[first[0]] if len(centres) and np.isfinite(centres[first[0]]).all() else np.zeros(3)
    course = course_of(centres[first]) if len(first) > 1 else Course(start[:2], np.array([1.0, 0.0]))

    def placed(metres: Floats) -> Floats:
        return course.turned(metres - [*course.start, 0.0])

    given = {row["id"]: row for row in document["control"] if row["measured"]}
    about = numbers(photos, *MATRIX).reshape(-1, 3, 3).swapaxes(1, 2)  # rows: image axes in the axes of the rotation
    azimuth = np.radians(numbers(points, "ellipse_azimuth_deg")[:, 0])
    towards = course.turned(np.column_stack([np.sin(azimuth), np.cos(azimuth), 0.0 * azimuth]))
    curved = frame["kind"] not in ("local", "geocentric")
    return Plan(
        document=document,
        ids=[row["id"] for row in points],
        role=np.array([row["role"] for row in points], np.str_),
        points=placed(((xyz - middle) * factor) @ turn.T),
        shift=course.turned(_shifts(frame, [given.get(row["id"], {}) for row in points], order, turn)),
        ellipse=np.column_stack([numbers(points, "ellipse_a", "ellipse_b"), np.arctan2(towards[:, 1], towards[:, 0])]),
        photo_ids=[photo["id"] for photo in photos],
        photos=placed(centres),
        axes=course.turned(about @ turn.T),
        strips=strips,
        north=course.turned(np.array([0.0, 1.0, 0.0]))[:2],
        radius=a if curved else math.inf,
    )


def _shifts(frame: Document, given: Sequence[Document], order: list[int], turn: Floats) -> Floats:
    """Return adjusted minus given along east, north and up, metres; NaN where one part is not known."""
    shift = numbers(given, "dx", "dy", "dz")[:, order] @ turn.T
    if frame["kind"] != "geocentric":
        shift[np.isnan(shift[:, :2]).any(axis=1), :2] = np.nan
    return np.column_stack([shift[:, :2], numbers(given, "height")])


def format_of(camera: Document) -> tuple[Floats, Floats] | None:
    """Return two corners of a photo from its principal point, mm; None where the camera's format is not known."""
    if not camera["format_mm"]:
        return None
    half, principal = np.array(camera["format_mm"]) / 2, np.array(camera["principal_point_mm"] or (0.0, 0.0))
    return -half - principal, half - principal
