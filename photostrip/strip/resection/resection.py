"""Exterior orientation of photos from points that are known: space resection, all photos in one batch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers, pieces
from photostrip.geometry.rotation import from_vector
from photostrip.strip.resection.collinearity import KnownPhotos, distances, partials, project

ITERATIONS = 20
CONVERGED = 1e-10  # rad, and of the distance to the points; the next step would be its square
UNKNOWNS = 6
AT_A_TIME = 8192  # image points worked on together: what fits into the processor's cache
SINGULAR = 1e-12  # reciprocal condition of a scaled normal matrix


@dataclass(frozen=True, eq=False)
class Resection:
    """Orientation of photos on known points."""

    centers: Floats  # (n, 3): perspective centres in the frame of the points
    rotations: Floats  # (n, 3, 3): photo to that frame
    residuals: Floats  # (m, 2): measured minus computed image coordinates in mm
    rms: Floats  # (n,): root mean square of a photo's residuals in mm
    # (n,): false where a photo kept its start orientation: too few points, or an iteration that does not converge
    solved: Flags


def runs(ends: Numbers, most: int) -> list[tuple[int, int]]:
    """Cut photos, whose rows end where ``ends`` says after a 0, into runs of about `most` rows: first, last + 1."""
    first = np.searchsorted(ends, np.append(np.arange(0, ends[-1], most), ends[-1]))
    return list(pairwise(np.unique(first).tolist()))


def of_known_photos(
    xy: Floats, points: Floats, photo: Numbers, photos: KnownPhotos, image: Numbers, point: Numbers
) -> Resection:
    """Image residuals of photos whose orientation is known already, as a resection.

    xy, points: (k, 2), (q, 3), image coordinates in mm, and points.
    photo, image, point: (m,), the photo of each residual, and its rows in these.
    """
    residuals = np.empty((len(photo), 2))
    for rows in pieces(len(photo)):  # to gather all of them takes as much again
        residuals[rows] = xy[image[rows]] - project(points[point[rows]], photos, photo[rows])
    return _with_residuals(residuals, photo, photos, np.ones(len(photos.centers), bool))


def _with_residuals(residuals: Floats, photo: Numbers, photos: KnownPhotos, solved: Flags) -> Resection:
    centers, rotations, _ = photos
    count = len(centers)
    squares = np.bincount(photo, residuals[:, 0] ** 2 + residuals[:, 1] ** 2, count)
    rms = np.sqrt(squares / np.maximum(2 * np.bincount(photo, minlength=count), 1))
    return Resection(centers=centers, rotations=rotations, residuals=residuals, rms=rms, solved=solved)


def resect(
    xy: Floats,
    points: Floats,
    photo: Numbers,
    start: KnownPhotos,
    watch: Callable[[KnownPhotos, Floats], None] | None = None,
) -> Resection:
    """Orient every photo on its points by least squares on the image coordinates.

    xy: (m, 2), image coordinates in mm, reduced to the principal point; rows ordered by photo.
    points: (m, 3), known points of the rows.
    start: orientations to start from. They stay for a photo with fewer than four points, or whose iteration does not
        converge.
    watch: called at every step with the orientations before it, and what is added to them (n, 6): shifts in the frame
        of the points, and small rotations about its axes.
    """
    centers, rotations, focal = start
    counts = np.bincount(photo, minlength=len(centers))
    enough = counts >= UNKNOWNS // 2 + 1
    present = np.flatnonzero(counts)
    starts = np.searchsorted(photo, present)
    distance = np.ones(len(centers))
    distance[present] = np.add.reduceat(distances(points, centers, photo), starts) / counts[present]
    converged = np.zeros(len(centers), bool)
    for _ in range(ITERATIONS):
        step = _steps(xy, points, photo, KnownPhotos(centers, rotations, focal), distance, (present, starts))
        step[~enough] = 0.0
        if watch is not None:
            watch(KnownPhotos(centers, rotations, focal), step * np.repeat([distance, distance**0], 3, axis=0).T)
        centers = centers + step[:, :3] * distance[:, None]
        rotations = from_vector(step[:, 3:]) @ rotations
        converged = np.isfinite(step).all(axis=1) & (np.abs(step).max(axis=1) < CONVERGED)
        if converged.all():
            break
    solved = converged & enough
    centers = np.where(solved[:, None], centers, start.centers)
    rotations = np.where(solved[:, None, None], rotations, start.rotations)
    photos = KnownPhotos(centers, rotations, focal)
    residuals = project(points, photos, photo)
    np.subtract(xy, residuals, out=residuals)
    return _with_residuals(residuals, photo, photos, solved)


def _steps(
    xy: Floats,
    points: Floats,
    photo: Numbers,
    photos: KnownPhotos,
    distance: Floats,
    segments: tuple[Numbers, Numbers],
) -> Floats:
    """Gauss-Newton steps of all photos: shift in units of the distance, rotation in radians, in the points' frame.

    The partials are taken along the photo's own axes, where they are functions of the image point and its depth alone.
    """
    centers, rotations, focal = photos
    present, starts = segments
    ends = np.append(starts, len(photo))
    normal, right = np.zeros((len(centers), UNKNOWNS, UNKNOWNS)), np.zeros((len(centers), UNKNOWNS, 1))
    for low, high in runs(ends, AT_A_TIME):
        rows, some, first = slice(ends[low], ends[high]), present[low:high], starts[low:high] - ends[low]
        number = photo[rows]
        by_x, by_y, computed = partials(
            points[rows] - centers[number], rotations[number], focal[number], distance[number]
        )
        misfit_x, misfit_y = xy[rows].T - computed
        right[some, :, 0] = np.add.reduceat(by_x * misfit_x + by_y * misfit_y, first, axis=1).T
        normal[some, 0] = np.add.reduceat(by_x[0] * by_x, first, axis=1).T  # a shift along x moves x alone
        normal[some, 1, 1:] = np.add.reduceat(by_y[1] * by_y[1:], first, axis=1).T
        for row in range(2, UNKNOWNS):
            products = by_x[row] * by_x[row:]
            products += by_y[row] * by_y[row:]
            normal[some, row, row:] = np.add.reduceat(products, first, axis=1).T
    for row in range(UNKNOWNS):
        normal[:, row:, row] = normal[:, row, row:]
    diagonal = np.arange(UNKNOWNS)
    normal[:, diagonal, diagonal] += SINGULAR * np.maximum(normal[:, diagonal, diagonal], 1e-9)
    along_axes = np.linalg.solve(normal, right)[:, :, 0]
    turned = np.einsum("nij,nkj->nki", rotations, along_axes.reshape(-1, 2, 3))
    return np.asarray(turned.reshape(-1, UNKNOWNS), float)
