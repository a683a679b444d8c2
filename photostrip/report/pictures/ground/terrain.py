"""The ground under photos as adjusted points show it: for pictures, not for measuring; distortion is left aside.

Around each photo it is the plane through the points near by, and what these lie above it spread by distance.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from photostrip.notes import Document
from photostrip.report.pictures.ground.image_plane import frame_of, rotation_of
from photostrip.report.pictures.ground.plan_view import DrawnGrid, Pair, Plan
from photostrip.report.sections.project import cameras_of

Floats = NDArray[np.float64]

# lengths in rms distances from the perspective centre to the photo's points. In simulated relief the rms errors at the
# borders of photos, in percent of their sides, are 0.5 (on level ground 0.8) with hills of 60 m from 1530 m, 1.7 (2.7)
# with hills of 200 m, 0.7 (7.4) on a slope of 18 %
NEAR = 1.5  # points that tell of the ground
STEADY = 0.15  # extent of the points from which their plane may slope; those of less tell of its height only
SPREAD = 0.3  # from where what a point lies above the plane counts for less than half
POINT_RADIUS = 0.02  # from where its own height counts alone
LOWEST_RAY = 0.1  # descent towards the plane, in principal distances, from which a ray meets the ground
PIECES = 4  # of each side of a photo


class TerrainModel(NamedTuple):
    """The ground around a photo: along, across, up."""

    slope: Floats  # (2,): rise of the plane
    foot: float  # height of the plane at the origin
    points: Floats  # (n, 2)
    rest: Floats  # (n,): what the points lie above the plane
    reach: float

    @classmethod
    def around(cls, middle: Floats, reach: float, points: Floats) -> TerrainModel:
        """Take the ground from points in the order of their first coordinate."""
        first, last = np.searchsorted(points[:, 0], (middle[0] - NEAR * reach, middle[0] + NEAR * reach))
        band = points[first:last]
        near = band[np.abs(band[:, 1] - middle[1]) <= NEAR * reach]
        centre = near.mean(axis=0)
        off = near - centre
        spread = off[:, :2].T @ off[:, :2] / len(near) + np.eye(2) * (STEADY * reach) ** 2
        slope = np.linalg.solve(spread, off[:, :2].T @ off[:, 2] / len(near))
        foot = float(centre[2] - centre[:2] @ slope)
        rest = near[:, 2] - foot - near[:, :2] @ slope
        return cls(slope=slope, foot=foot, points=near[:, :2], rest=rest, reach=reach)

    def above_plane(self, places: Floats) -> Floats:
        """Return heights of the ground above the plane."""
        squares = np.subtract.outer(places[:, 0], self.points[:, 0]) ** 2 + (POINT_RADIUS * self.reach) ** 2
        squares += np.subtract.outer(places[:, 1], self.points[:, 1]) ** 2
        weight = 1.0 / squares**2
        found: Floats = weight @ self.rest / (weight.sum(axis=1) + (SPREAD * self.reach) ** -4.0)
        return found

    def met(self, centre: Floats, rays: Floats) -> Floats:
        """Return where rays that descend towards the plane meet the ground, (n, 2).

        They go from the plane to the ground in one step; further ones changed the errors above by 0.04 at most.
        """
        height = self.height_of(centre)
        steps = rays[:, :2] / self.descent(rays)[:, None]
        above = self.above_plane(centre[:2] + steps * height)
        return np.asarray(centre[:2] + steps * (height - above)[:, None])

    def height_of(self, centre: Floats) -> float:
        """Return the height of a perspective centre above the plane."""
        return float(centre[2] - self.foot - centre[:2] @ self.slope)

    def descent(self, rays: Floats) -> Floats:
        """Return how far rays come towards the plane over their length."""
        found: Floats = rays[:, :2] @ self.slope - rays[:, 2]
        return found


def footprints(document: Document, plan: Plan) -> dict[str, list[Pair]]:
    """Return what each photo shows of the ground on the plan, from one corner to the next.

    What looks at the sky or hardly down is cut off; a photo that shows nothing else, or has no points, has none.
    """
    grid, cameras = DrawnGrid(document), cameras_of(document)
    heights = {row["id"]: grid.up(row) for row in document["points"]}
    places = {spot.id: (spot.along, spot.across, heights[spot.id]) for spot in plan.spots}
    spots = {spot.id: spot for strip in plan.strips for spot in strip}
    seen: dict[str, list[tuple[float, float, float]]] = {}
    for row in document["residuals"]:
        if row["point"] in places:
            seen.setdefault(row["photo"], []).append(places[row["point"]])
    points, found = np.array(sorted(places.values())), {}
    for photo in document["photos"]:
        camera, own = cameras.get(photo["id"]), seen.get(photo["id"])
        frame = frame_of(camera) if camera else None
        rotation = rotation_of(photo)
        if camera is None or frame is None or not own or rotation is None:
            continue
        centre = np.array((spots[photo["id"]].along, spots[photo["id"]].across, grid.up(photo)))
        # the rms distance, not that of the middle: some point always is that near to it
        reach = math.sqrt(np.mean(np.sum((np.array(own) - centre) ** 2, axis=1)))
        terrain = TerrainModel.around(np.mean(own, axis=0), reach, points)
        distance = camera["principal_distance_mm"]
        axes = _image_axes(grid, plan, rotation)
        rays = np.array([(*corner, -distance) for corner in frame.corners]) @ axes
        border = _divided(_descending(terrain, rays, LOWEST_RAY * distance))
        if len(border) and terrain.height_of(centre) > 0:
            found[photo["id"]] = [(along, across) for along, across in terrain.met(centre, border).tolist()]
    return found


def _image_axes(grid: DrawnGrid, plan: Plan, m: list[float]) -> Floats:
    """Return the axes of an image along, across and up, by rows."""
    axes = [grid.plan_direction((m[n], m[n + 3], m[n + 6])) for n in range(3)]
    return np.array([(*plan.turned(east, north), up) for east, north, up in axes])


def _descending(terrain: TerrainModel, corners: Floats, least: float) -> Floats:
    """Cut off what does not descend towards the plane."""
    over = terrain.descent(corners) - least
    kept: list[Floats] = []
    for n, (corner, value) in enumerate(zip(corners, over.tolist(), strict=True)):
        last = float(over[n - 1])
        if (value < 0) != (last < 0):
            kept.append(corner + (corners[n - 1] - corner) * (value / (value - last)))
        if value >= 0:
            kept.append(corner)
    return np.array(kept).reshape(-1, 3)


def _divided(corners: Floats) -> Floats:
    """Divide the sides of an outline."""
    share = np.arange(PIECES)[:, None, None] / PIECES
    sides = corners + share * (np.concatenate([corners[1:], corners[:1]]) - corners)
    return np.asarray(sides.swapaxes(0, 1).reshape(-1, 3))


def straightened(outline: Iterable[Pair], off: float) -> list[Pair]:
    """Leave out corners that lie on the line of their neighbours."""
    kept: list[Pair] = []
    ahead = list(outline)
    for n, (x, y) in enumerate(ahead):
        (a, b), (c, d) = (kept or ahead)[-1], ahead[(n + 1) % len(ahead)]
        length = math.hypot(c - a, d - b)
        if abs((c - a) * (y - b) - (d - b) * (x - a)) > off * length:
            kept.append((x, y))
    return kept
