"""Misfits of rays, or of model coordinates, at one state, and their derivatives.

With the arm a = R^T (X - S) in photo axes, (u, v) = -(a_x, a_y) / a_z and the principal distance f, the image point is
f (u, v). A photo's six parameters are the shift of its perspective centre along its own axes and its rotation about
them: d(u, v) = 1/a_z (dx + u dz, dy + v dz) by the shift, (-u v, 1 + u^2, v) and (-1 - v^2, u v, -u) by the rotation.

A point of a model is a / k with its scale k; da = -dx - w x a by shift and rotation w, -a by the logarithm of k.
Source: derived.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.geometry.rotation import cross_matrix
from photostrip.network.calibration import (
    PRINCIPAL_DISTANCE,
    corrected,
    partials,
    values_of,
)
from photostrip.network.problem import BundleProblem, ImageObservations, ModelObservations, Parameters


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays at one state, everything in units of sigma; derivatives are those of the computed coordinates.

    Of image coordinates c = 2 stand for each ray and u = 6 unknowns for each photo, of model coordinates 3 and 7.
    """

    misfit: Floats  # (n, c): measured minus computed
    by_photo: (
        Floats  # (n, c, u): by shift (m) and rotation (rad) of the unit, in its own axes, and logarithm of a scale
    )
    by_point: Floats  # (n, c, 3): by the point, 1/m
    by_common: csr_array  # (c n, p): by the calibration parameters


def view(problem: BundleProblem, state: Parameters) -> Rays:
    """Compute what all rays, or all model coordinates, should have measured."""
    if isinstance(problem.images, ModelObservations):
        return _models(problem.images, state)
    images, cameras = problem.images, problem.cameras
    photo, weight, unknown = images.photo, 1.0 / images.sigma, cameras.unknown
    values = values_of(cameras, state.common)
    focal = cameras.focal + values[:, PRINCIPAL_DISTANCE]
    pull = focal[cameras.of_photo[photo]][:, None] * weight
    back = np.ascontiguousarray(np.swapaxes(state.rotations, 1, 2))[photo]
    arm = np.einsum("nij,nj->ni", back, state.points[images.point] - state.centers[photo])
    depth = 1.0 / arm[:, 2:]
    ratio = -arm[:, :2] * depth
    u, v = ratio.T
    by_photo = np.zeros((len(arm), 2, problem.unknowns))
    by_photo[:, range(2), range(2)] = depth
    by_photo[:, :, 2] = ratio * depth
    by_photo[:, 0, 3], by_photo[:, 0, 4], by_photo[:, 0, 5] = -u * v, 1.0 + u * u, v
    by_photo[:, 1, 3], by_photo[:, 1, 4], by_photo[:, 1, 5] = -1.0 - v * v, u * v, -u
    by_photo *= pull[:, :, None]
    measured = images.xy if (unknown < 0).all() else corrected(cameras, values, images.xy, cameras.of_photo[photo])
    return Rays(
        misfit=measured * weight - ratio * pull,
        by_photo=by_photo,
        by_point=-by_photo[:, :, :3] @ back,
        by_common=_by_calibration(problem, unknown, values, ratio, weight),
    )


class InModels(NamedTuple):
    """Model coordinates in units of their standard deviations."""

    misfit: Floats  # (n, 3): measured minus computed
    by_model: Floats  # (n, 3, 7): by shift and rotation of the model, and the logarithm of its scale
    by_point: Floats  # (n, 3, 3)


def in_models(measured: ModelObservations, rows: Numbers, state: Parameters, xyz: Floats) -> InModels:
    """Compare some rows (n,) of model coordinates with points that lie at ``xyz`` (n, 3).

    Shift and rotation count in the Cartesian frame.
    """
    model = measured.photo[rows]
    scale, turn = state.scales[model][:, None, None], np.swapaxes(state.rotations, 1, 2)[model]
    back = turn / scale
    computed = np.einsum("nij,nj->ni", back, xyz - state.centers[model])
    white = whitening(measured)[rows]
    by_model = np.concatenate([-back, cross_matrix(computed) @ turn, -computed[:, :, None]], axis=2)
    misfit = np.einsum("nij,nj->ni", white, measured.xy[rows] - computed)
    return InModels(misfit, white @ by_model, white @ back)


def _models(measured: ModelObservations, state: Parameters) -> Rays:
    """Compute all model coordinates."""
    found = in_models(measured, np.arange(len(measured)), state, state.points[measured.point])
    turn = state.rotations[measured.photo]
    by_model = found.by_model
    by_model[:, :, :3], by_model[:, :, 3:6] = by_model[:, :, :3] @ turn, by_model[:, :, 3:6] @ turn
    return Rays(
        misfit=found.misfit, by_photo=by_model, by_point=found.by_point, by_common=csr_array((found.misfit.size, 0))
    )


def whitening(measured: ImageObservations | ModelObservations) -> Floats:
    """Matrices W (n, c, c) with W' W the weights of the coordinates of a row."""
    white: Floats = np.eye(measured.sigma.shape[1]) / measured.sigma[:, None, :]
    if isinstance(measured, ModelObservations) and measured.correlation is not None:
        white = np.linalg.inv(np.linalg.cholesky(measured.correlation)) @ white
    return white


def by_calibration(problem: BundleProblem, camera: int, rays: Flags, kinds: Sequence[int], state: Parameters) -> Floats:
    """Differentiate computed minus corrected image coordinates of some rays (n,) of a camera by calibration parameters.

    kinds: (k,): their columns in ``CALIBRATION``. Returns (r, 2, k), in units of sigma.
    """
    images = problem.images.take(rays)
    back = np.swapaxes(state.rotations, 1, 2)[images.photo]
    arm = np.einsum("nij,nj->ni", back, state.points[images.point] - state.centers[images.photo])
    values = values_of(problem.cameras, state.common)
    table = partials(problem.cameras, values, camera, images.xy, -arm[:, :2] / arm[:, 2:])
    return np.asarray(table[list(kinds)].transpose(2, 1, 0) / images.sigma[:, :, None])


def _by_calibration(
    problem: BundleProblem, unknown: Numbers, values: Floats, ratio: Floats, weight: Floats
) -> csr_array:
    """Differentiate computed minus corrected image coordinates by the calibration parameters: (2 n, c), in sigmas."""
    shape = (2 * len(ratio), int(unknown.max(initial=-1)) + 1)
    if not shape[1]:
        return csr_array(shape)
    camera = problem.cameras.of_photo[problem.images.photo]
    entries, rows, columns = [], [], []
    for number in np.flatnonzero((unknown >= 0).any(axis=1)).tolist():
        ray, kind = np.flatnonzero(camera == number), np.flatnonzero(unknown[number] >= 0)
        table = partials(problem.cameras, values, number, problem.images.xy[ray], ratio[ray])
        entries.append((table[kind] * weight[ray].T).ravel())
        places = np.broadcast_arrays(unknown[number, kind][:, None, None], 2 * ray + np.arange(2)[:, None])
        columns.append(places[0].ravel())
        rows.append(places[1].ravel())
    place = (np.concatenate(rows), np.concatenate(columns))
    return csr_array(coo_array((np.concatenate(entries), place), shape=shape))
