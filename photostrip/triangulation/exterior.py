"""Exterior orientation of photos from points that are known: space resection, all photos in one batch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.rotation import from_vector

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

ITERATIONS = 20
CONVERGED = 1e-10  # rad, and of the distance to the points; the next step would be its square
UNKNOWNS = 6
UPPER = np.triu_indices(UNKNOWNS)
SINGULAR = 1e-12  # reciprocal condition of a scaled normal matrix


@dataclass(frozen=True, eq=False)
class Resection:
    """Orientation of photos on known points.

    Parameters
    ----------
    centers : ndarray, shape (n, 3)
        Perspective centres in the frame of the points.
    rotations : ndarray, shape (n, 3, 3)
        Photo to that frame.
    residuals : ndarray, shape (m, 2)
        Measured minus computed image coordinates in mm.
    rms : ndarray, shape (n,)
        Root mean square of a photo's residuals in mm.
    solved : ndarray of bool, shape (n,)
        False where a photo kept its start orientation: too few points, or a solution that does not settle.
    """

    centers: Floats
    rotations: Floats
    residuals: Floats
    rms: Floats
    solved: NDArray[np.bool_]


def project(points: Floats, centers: Floats, rotations: Floats, photo: Numbers, focal: Floats) -> Floats:
    """Image coordinates of points, one for each row.

    Parameters
    ----------
    points : ndarray, shape (m, 3)
        Points.
    centers : ndarray, shape (n, 3)
        Perspective centres in the same frame.
    rotations : ndarray, shape (n, 3, 3)
        Photo to that frame.
    photo : ndarray of int, shape (m,)
        Photo of each row.
    focal : ndarray, shape (n,)
        Principal distances in mm.

    Returns
    -------
    ndarray, shape (m, 2)
        Ideal image coordinates in mm, relative to the principal point.
    """
    ray = np.einsum("mi,mij->mj", points - centers[photo], rotations[photo])
    xy: Floats = -focal[photo, None] * ray[:, :2] / ray[:, 2:]
    return xy


def resect(xy: Floats, points: Floats, photo: Numbers, focal: Floats, start: tuple[Floats, Floats]) -> Resection:
    """Orient every photo on its points by least squares on the image coordinates.

    Parameters
    ----------
    xy : ndarray, shape (m, 2)
        Image coordinates in mm, reduced to the principal point; rows ordered by photo.
    points : ndarray, shape (m, 3)
        Known points of the rows.
    photo : ndarray of int, shape (m,)
        Photo of each row, ascending.
    focal : ndarray, shape (n,)
        Principal distances in mm.
    start : tuple of ndarray
        Centres (n, 3) and rotations (n, 3, 3) to start from.

    Returns
    -------
    Resection
        Orientations and image residuals. A photo with fewer than four points, or whose solution does
        not settle, keeps its start values.
    """
    centers, rotations = start[0].copy(), start[1].copy()
    counts = np.bincount(photo, minlength=len(centers))
    enough = counts >= UNKNOWNS // 2 + 1
    present = np.flatnonzero(counts)
    starts = np.searchsorted(photo, present)
    distance = np.ones(len(centers))
    distance[present] = np.add.reduceat(np.linalg.norm(points - centers[photo], axis=1), starts) / counts[present]
    settled = np.zeros(len(centers), bool)
    for _ in range(ITERATIONS):
        step = _steps(xy, points, photo, focal, (centers, rotations), distance, (present, starts))
        step[~enough] = 0.0
        centers = centers + step[:, :3] * distance[:, None]
        rotations = from_vector(step[:, 3:]) @ rotations
        settled = np.isfinite(step).all(axis=1) & (np.abs(step).max(axis=1) < CONVERGED)
        if settled.all():
            break
    solved = settled & enough
    centers, rotations = (
        np.where(solved[:, None], centers, start[0]),
        np.where(solved[:, None, None], rotations, start[1]),
    )
    residuals = xy - project(points, centers, rotations, photo, focal)
    squares = np.bincount(photo, (residuals**2).sum(axis=1), len(centers))
    rms = np.sqrt(squares / np.maximum(2 * counts, 1))
    return Resection(centers, rotations, residuals, rms, solved)


def _steps(
    xy: Floats,
    points: Floats,
    photo: Numbers,
    focal: Floats,
    orientation: tuple[Floats, Floats],
    distance: Floats,
    segments: tuple[Numbers, Numbers],
) -> Floats:
    """Gauss-Newton steps of all photos: shift in units of the distance, rotation in radians."""
    centers, rotations = orientation
    present, starts = segments
    arm = points - centers[photo]
    turn = rotations[photo]
    ray = np.einsum("mi,mij->mj", arm, turn)
    scale = -focal[photo] / ray[:, 2]
    computed = scale[:, None] * ray[:, :2]
    # d(xy)/d(arm) in the frame of the points: scale * (photo axis + xy/f * viewing axis)
    by_arm = (turn[:, :, :2] + computed[:, None, :] / focal[photo, None, None] * turn[:, :, 2:]) * scale[:, None, None]
    jacobian = np.empty((UNKNOWNS, len(xy), 2))
    jacobian[:3] = -by_arm.transpose(1, 0, 2) * distance[photo, None]
    # turning the camera by theta moves the arm by -theta x arm in the camera's eyes
    jacobian[3:] = -np.cross(arm[:, None, :], by_arm.transpose(0, 2, 1)).transpose(2, 0, 1)
    misfit = xy - computed
    sums = np.zeros((len(centers), len(UPPER[0]) + UNKNOWNS))
    products = np.concatenate([(jacobian[UPPER[0]] * jacobian[UPPER[1]]).sum(-1), (jacobian * misfit).sum(-1)])
    sums[present] = np.add.reduceat(products, starts, axis=1).T
    normal = np.zeros((len(centers), UNKNOWNS, UNKNOWNS))
    normal[:, UPPER[0], UPPER[1]] = sums[:, : len(UPPER[0])]
    normal[:, UPPER[1], UPPER[0]] = sums[:, : len(UPPER[0])]
    diagonal = np.arange(UNKNOWNS)
    normal[:, diagonal, diagonal] += SINGULAR * np.maximum(normal[:, diagonal, diagonal], 1e-9)
    return np.asarray(np.linalg.solve(normal, sums[:, len(UPPER[0]) :, None])[:, :, 0], float)
