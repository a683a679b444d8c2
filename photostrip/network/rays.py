"""Collinearity: misfits of the rays of a bundle at one state, and their derivatives.

With the arm a = R^T (X - S) in photo axes, (u, v) = -(a_x, a_y) / a_z and the principal distance f, the image point is
f (u, v). A photo's six parameters are the shift of its perspective centre along its own axes and its rotation about
them: d(u, v) = 1/a_z (dx + u dz, dy + v dz) by the shift, (-u v, 1 + u^2, v) and (-1 - v^2, u v, -u) by the rotation.
Source: derived.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array

from photostrip.arrays import Floats, distinct
from photostrip.network.calibration import (
    PRINCIPAL_DISTANCE,
    Calibrated,
    corrected,
    partials,
    values_of,
)
from photostrip.network.problem import BundleProblem

PHOTO = 6  # parameters of a photo


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays at one state, everything in units of sigma; derivatives are those of the computed image coordinates."""

    misfit: Floats  # (n, 2): measured minus computed
    by_photo: Floats  # (n, 2, 6): by shift (m) and rotation (rad) of the photo, in its own axes
    by_point: Floats  # (n, 2, 3): by the point, 1/m
    by_common: csr_array  # (2 n, c): by the calibration parameters


def view(
    problem: BundleProblem, calibrated: Calibrated, centers: Floats, rotations: Floats, points: Floats, common: Floats
) -> Rays:
    """Project the points of all rays; ``common`` (c,) are the values of the calibration parameters."""
    images, cameras = problem.images, problem.cameras
    photo, weight = images.photo, 1.0 / images.sigma
    distance = calibrated.kind == PRINCIPAL_DISTANCE
    focal = cameras.focal.astype(float)
    np.add.at(focal, calibrated.camera[distance], common[distance])
    pull = focal[cameras.of_photo[photo]][:, None] * weight
    back = np.ascontiguousarray(np.swapaxes(rotations, 1, 2))[photo]
    arm = np.einsum("nij,nj->ni", back, points[images.point] - centers[photo])
    depth = 1.0 / arm[:, 2:]
    ratio = -arm[:, :2] * depth
    u, v = ratio.T
    by_photo = np.zeros((len(arm), 2, PHOTO))
    by_photo[:, range(2), range(2)] = depth
    by_photo[:, :, 2] = ratio * depth
    by_photo[:, 0, 3], by_photo[:, 0, 4], by_photo[:, 0, 5] = -u * v, 1.0 + u * u, v
    by_photo[:, 1, 3], by_photo[:, 1, 4], by_photo[:, 1, 5] = -1.0 - v * v, u * v, -u
    by_photo *= pull[:, :, None]
    values = values_of(cameras, common)
    measured = images.xy if not len(calibrated) else corrected(cameras, values, images.xy, cameras.of_photo[photo])
    return Rays(
        misfit=measured * weight - ratio * pull,
        by_photo=by_photo,
        by_point=-by_photo[:, :, :3] @ back,
        by_common=_by_calibration(problem, calibrated, values, ratio, weight),
    )


def _by_calibration(
    problem: BundleProblem, calibrated: Calibrated, values: Floats, ratio: Floats, weight: Floats
) -> csr_array:
    """Differentiate computed minus corrected image coordinates by the calibration parameters: (2 n, c), in sigmas."""
    shape = (2 * len(ratio), len(calibrated))
    if not len(calibrated):
        return csr_array(shape)
    camera = problem.cameras.of_photo[problem.images.photo]
    entries, rows, columns = [], [], []
    for number in distinct(calibrated.camera).tolist():
        ray, column = np.flatnonzero(camera == number), np.flatnonzero(calibrated.camera == number)
        table = partials(problem.cameras, values, number, problem.images.xy[ray], ratio[ray])
        entries.append((table[calibrated.kind[column]] * weight[ray].T).ravel())
        places = np.broadcast_arrays(column[:, None, None], 2 * ray + np.arange(2)[:, None])
        columns.append(places[0].ravel())
        rows.append(places[1].ravel())
    place = (np.concatenate(rows), np.concatenate(columns))
    return csr_array(coo_array((np.concatenate(entries), place), shape=shape))
