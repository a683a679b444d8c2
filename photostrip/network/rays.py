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
    partials,
    uncorrected,
    values_of,
)
from photostrip.network.problem import BundleCameras, BundleProblem, ImageObservations, ModelObservations, Parameters


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
    camera = cameras.of_photo[photo]
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
    by_photo *= focal[camera][:, None, None]
    computed = ratio * focal[camera][:, None]
    if (unknown >= 0).any():
        computed, by_ideal = uncorrected(cameras, values, computed, images.xy, camera)
        by_photo = by_ideal @ by_photo
    by_photo *= weight[:, :, None]
    return Rays(
        misfit=(images.xy - computed) * weight,
        by_photo=by_photo,
        by_point=-by_photo[:, :, :3] @ back,
        by_common=_by_calibration(problem, values, ratio),
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
    """Differentiate computed image coordinates of some rays (n,) of a camera by calibration parameters.

    kinds: (k,): their columns in ``CALIBRATION``. Returns (r, 2, k), in units of sigma.
    """
    images = problem.images.take(rays)
    back = np.swapaxes(state.rotations, 1, 2)[images.photo]
    arm = np.einsum("nij,nj->ni", back, state.points[images.point] - state.centers[images.photo])
    values = values_of(problem.cameras, state.common)
    return _by_parameters(problem.cameras, values, camera, images, -arm[:, :2] / arm[:, 2:])[:, :, list(kinds)]


def _by_parameters(
    cameras: BundleCameras,
    values: Floats,
    camera: int,
    images: ImageObservations | ModelObservations,
    ratio: Floats,
) -> Floats:
    """Differentiate computed image coordinates of rays of a camera by all its parameters: (n, 2, 10), in sigmas."""
    computed = ratio * (cameras.focal[camera] + values[camera, PRINCIPAL_DISTANCE])
    image, by_ideal = uncorrected(cameras, values, computed, images.xy, np.full(len(ratio), camera))
    table = partials(cameras, values, camera, image, ratio).transpose(2, 1, 0)
    return np.asarray(by_ideal @ table / images.sigma[:, :, None])


def _by_calibration(problem: BundleProblem, values: Floats, ratio: Floats) -> csr_array:
    """Differentiate computed image coordinates by the calibration parameters: (2 n, c), in sigmas."""
    unknown = problem.cameras.unknown
    shape = (2 * len(ratio), int(unknown.max(initial=-1)) + 1)
    if not shape[1]:
        return csr_array(shape)
    camera = problem.cameras.of_photo[problem.images.photo]
    entries, rows, columns = [], [], []
    for number in np.flatnonzero((unknown >= 0).any(axis=1)).tolist():
        of_camera = camera == number
        ray, kind = np.flatnonzero(of_camera), np.flatnonzero(unknown[number] >= 0)
        table = _by_parameters(problem.cameras, values, number, problem.images.take(of_camera), ratio[ray])
        entries.append(table[:, :, kind].ravel())
        places = np.broadcast_arrays(unknown[number, kind], 2 * ray[:, None, None] + np.arange(2)[:, None])
        columns.append(places[0].ravel())
        rows.append(places[1].ravel())
    place = (np.concatenate(rows), np.concatenate(columns))
    return csr_array(coo_array((np.concatenate(entries), place), shape=shape))
