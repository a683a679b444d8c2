"""The collinearity condition: image coordinates of points on photos, and their derivatives.

With (u, v, w) = R^T (X - S): x = -f u / w, y = -f v / w. Source: derived.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers, pieces


class KnownPhotos(NamedTuple):
    centers: Floats  # (m, 3): perspective centres
    rotations: Floats  # (m, 3, 3): photo to the frame of the centres
    focal: Floats  # (m,): principal distances, mm


class PhotoPartials(NamedTuple):
    """Image coordinates and their derivatives by the orientation of the photo along its own axes."""

    # by_x, by_y: (6, m): derivatives of x and y by a shift of the centre and a small rotation
    by_x: Floats
    by_y: Floats
    xy: Floats  # (2, m): image coordinates in mm


def project(points: Floats, photos: KnownPhotos, photo: Numbers) -> Floats:
    """Ideal image coordinates (m, 2), relative to the principal point, of a point and a photo in each row."""
    found = np.empty((len(photo), 2))
    for rows in pieces(len(photo)):
        some = photo[rows]
        ray = np.einsum("mi,mij->mj", points[rows] - photos.centers[some], photos.rotations[some])
        found[rows] = -photos.focal[some, None] * ray[:, :2] / ray[:, 2:]
    return found


def distances(points: Floats, centers: Floats, photo: Numbers) -> Floats:
    """Distances (m,) of points (m, 3) from the perspective centre of the photo in each row."""
    found = np.empty(len(photo))
    for rows in pieces(len(photo)):
        found[rows] = np.linalg.norm(points[rows] - centers[photo[rows]], axis=1)
    return found


def depths(xyz: Floats, point: Numbers, centers: Floats, rotations: Floats, photo: Numbers) -> Floats:
    """Depths (m,) of points before photos, along their viewing direction; point, photo: (m,), which of each."""
    axes, found = rotations[:, :, 2], np.empty(len(photo))
    for rows in pieces(len(photo)):  # all at once take 100 bytes an image point
        some = photo[rows]
        found[rows] = ((centers[some] - xyz[point[rows]]) * axes[some]).sum(axis=1)
    return found


def derivatives(points: Floats, photos: KnownPhotos, photo: Numbers) -> tuple[Floats, Floats]:
    """Differentiate the image coordinates of rows, each of a point on a photo.

    Returns by_photo: (n, 2, 6), by the centre (mm/m) and by a small rotation of the photo about the axes of the frame
        (mm/rad).
    Returns by_point: (n, 2, 3), by the point (mm/m).
    """
    by_point = derivatives_by_point(points, photos, photo)
    # a small rotation theta about the axes of the frame turns the arm by -theta, seen from the photo
    by_turn = -np.cross((points - photos.centers[photo])[:, None, :], by_point)
    return np.concatenate([-by_point, by_turn], axis=2), by_point


def derivatives_by_point(points: Floats, photos: KnownPhotos, photo: Numbers) -> Floats:
    """Differentiate the image coordinates of rows by the point of each, (n, 2, 3), mm/m."""
    turn = photos.rotations[photo].transpose(0, 2, 1)
    sight = np.einsum("nij,nj->ni", turn, points - photos.centers[photo])
    f, w = photos.focal[photo], sight[:, 2]
    by_sight = np.zeros((len(points), 2, 3))
    by_sight[:, 0, 0] = by_sight[:, 1, 1] = -f / w
    by_sight[:, :, 2] = f[:, None] * sight[:, :2] / w[:, None] ** 2
    return np.asarray(by_sight @ turn)


def partials(arm: Floats, rotations: Floats, focal: Floats, distance: Floats) -> PhotoPartials:
    """Image coordinates of points, and their derivatives by the orientation of the photo along its own axes.

    arm: (m, 3), points from the perspective centre of their photo.
    rotations: (m, 3, 3), photo to the frame of the points.
    focal: (m,), principal distances in mm.
    distance: (m,), unit in which the centre moves.
    """
    u, v, w = np.einsum("mi,mij->jm", arm, rotations)
    x, y = -focal * u / w, -focal * v / w
    unit = focal * distance / w  # image shift by moving the centre one distance, at this depth
    zero = np.zeros_like(x)
    by_x = np.stack([unit, zero, unit * x / focal, -x * y / focal, focal + x * x / focal, y])
    by_y = np.stack([zero, unit, unit * y / focal, -(focal + y * y / focal), x * y / focal, -x])
    return PhotoPartials(by_x, by_y, np.stack([x, y]))
