"""Photos of a result as their cameras saw the ground: image points from adjusted points.

For pictures, not for measuring: distortion is left aside.
"""

from __future__ import annotations

from typing import NamedTuple

from photostrip.notes import Document
from photostrip.report.pictures.ground.plan_view import DrawnGrid, Pair
from photostrip.report.sections.project import cameras_of


class Residual(NamedTuple):
    """A residual at its place in the photo."""

    photo: str
    point: str
    place: Pair  # mm from the principal point, x right, y up
    size: Pair  # µm, measured minus computed
    used: bool
    test: Pair | None  # standardised, where a bundle adjustment knows it


class Frame(NamedTuple):
    """The format of a camera around its principal point, mm."""

    low: Pair
    high: Pair

    @property
    def corners(self) -> list[Pair]:
        (a, b), (c, d) = self.low, self.high
        return [(a, b), (c, b), (c, d), (a, d)]


def frame_of(camera: Document) -> Frame | None:
    """Return the frame of a camera; None where its format is not known."""
    if not camera["format_mm"]:
        return None
    (width, height), (x, y) = camera["format_mm"], camera["principal_point_mm"] or (0.0, 0.0)
    return Frame((-width / 2 - x, -height / 2 - y), (width / 2 - x, height / 2 - y))


def residuals_of(document: Document) -> list[Residual]:
    """Return the image residuals with their places, photo by photo."""
    grid, cameras = DrawnGrid(document), cameras_of(document)
    photos = {photo["id"]: photo for photo in document["photos"] if photo["rotation"]}
    points = {point["id"]: point for point in document["points"]}
    found: list[Residual] = []
    for row in document["residuals"]:
        photo, camera = photos.get(row["photo"]), cameras.get(row["photo"])
        if photo is None or camera is None:
            continue
        unknown = [None] * len(row["points"])
        tests = row.get("test_x") or unknown, row.get("test_y") or unknown
        columns = row["points"], row["vx_um"], row["vy_um"], row["used"], *tests
        for name, vx, vy, used, test_x, test_y in zip(*columns, strict=True):
            place = _image_of(grid, photo, points.get(name), camera["principal_distance_mm"])
            if place is None or vx is None or vy is None:
                continue
            test = None if test_x is None or test_y is None else (test_x, test_y)
            found.append(Residual(photo=row["photo"], point=name, place=place, size=(vx, vy), used=used, test=test))
    return found


def _image_of(grid: DrawnGrid, photo: Document, point: Document | None, distance: float) -> Pair | None:
    """Return the image of a point; None for one that is not before the camera."""
    if point is None:
        return None
    m, (x, y, z) = photo["rotation"], grid.seen_from(photo, point)
    right, up, back = (m[n] * x + m[n + 3] * y + m[n + 6] * z for n in range(3))
    return (-distance * right / back, -distance * up / back) if back < 0 else None
