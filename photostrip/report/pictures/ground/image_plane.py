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
    photos = {photo["id"]: photo for photo in document["photos"] if rotation_of(photo)}
    points = {point["id"]: point for point in document["points"]}
    found: list[Residual] = []
    for row in document["residuals"]:
        photo, camera = photos.get(row["photo"]), cameras.get(row["photo"])
        if photo is None or camera is None:
            continue
        place = _image_of(grid, photo, points.get(row["point"]), camera["principal_distance_mm"])
        if place is None or row["vx_um"] is None or row["vy_um"] is None:
            continue
        tests = row.get("test_x"), row.get("test_y")
        found.append(
            Residual(
                photo=row["photo"],
                point=row["point"],
                place=place,
                size=(row["vx_um"], row["vy_um"]),
                used=row["used"],
                test=None if None in tests else tests,
            )
        )
    return found


def rotation_of(photo: Document) -> list[float] | None:
    """Return the rotation of a photo by rows; None where it is not known."""
    matrix = [photo[f"r{row}{column}"] for row in (1, 2, 3) for column in (1, 2, 3)]
    return None if None in matrix else matrix


def _image_of(grid: DrawnGrid, photo: Document, point: Document | None, distance: float) -> Pair | None:
    """Return the image of a point; None for one that is not before the camera."""
    if point is None:
        return None
    m, (x, y, z) = rotation_of(photo) or [], grid.seen_from(photo, point)
    right, up, back = (m[n] * x + m[n + 3] * y + m[n + 6] * z for n in range(3))
    return (-distance * right / back, -distance * up / back) if back < 0 else None
