"""Self-calibration: what the parameters of a camera change at an image point.

Misfits of rays, or of model coordinates, at one state, and their derivatives.

With the arm a = R^T (X - S) in photo axes, (u, v) = -(a_x, a_y) / a_z and the principal distance f, the image point is
f (u, v). A photo's six parameters are the shift of its perspective centre along its own axes and its rotation about
them: d(u, v) = 1/a_z (dx + u dz, dy + v dz) by the shift, (-u v, 1 + u^2, v) and (-1 - v^2, u v, -u) by the rotation.

A point of a model is a / k with its scale k; da = -dx - w x a by shift and rotation w, -a by the logarithm of k.
Source: derived.

Observations of photos other than rays: camera positions with lever arm, offset and drift; attitudes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.camera import Distortion
from photostrip.geometry.rotation import cross_matrix, to_vector
from photostrip.network.problem import (
    CALIBRATION,
    AttitudeObservations,
    BundleCameras,
    BundleProblem,
    ImageObservations,
    Parameters,
    PositionObservations,
)
from photostrip.strip.corrections import distortion_jacobian, distortion_shift

PRINCIPAL_DISTANCE = list(CALIBRATION).index("c")
STEPS_TO_IMAGE = 2  # a misfit is small, and each step leaves the square of what was left
POINT, K, P, AFFINE = [1, 2], [3, 4, 5], [6, 7], [8, 9]  # columns of parameters that belong together


def values_of(cameras: BundleCameras, common: Floats) -> Floats:
    """Calibration parameters camera by camera, (cameras, 10); 0 for what is not estimated."""
    place = cameras.unknown
    return np.where(place >= 0, np.append(common, 0.0)[place], 0.0)


def corrected(cameras: BundleCameras, values: Floats, xy: Floats, camera: Numbers) -> Floats:
    """Correct ideal image coordinates (n, 2) of photos of cameras (n,) by the values (cameras, 10) of parameters.

    With x, y from the corrected principal point, x0 and y0 from the given one, r2 = x^2 + y^2 and all parameters zero
    at the start, what a ray should have measured is found from

        X + Dx = -(f + c) u / w    Dx = -x0' + x (k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 x^2) + 2 p2 x y + b1 x + b2 y
        Y + Dy = -(f + c) v / w    Dy = -y0' + y (k1 r2 + k2 r2^2 + k3 r2^3) + p2 (r2 + 2 y^2) + 2 p1 x y

    so that c, x0, y0 (mm) are corrections of the principal distance and the principal point, k and p are those of
    Brown's model from image to ideal coordinates, b1 is the affinity and b2 the shear. Distortion has its centre in the
    principal point: that which is given moves with it, (x0', y0') = J (x0, y0) with J of ``by_image`` half way, right
    but for third powers of x0 and y0.
    """
    found = xy.copy()
    for number in np.unique(camera):
        some = camera == number
        own, center = values[number], values[number, POINT]
        shifted = by_image(cameras, number, xy[some], center / 2.0) @ center
        bends = corrections((xy[some] - center).T)
        found[some] += np.einsum("kan,k->na", bends[POINT[-1] + 1 :], own[POINT[-1] + 1 :]) - shifted
    return found


def uncorrected(
    cameras: BundleCameras, values: Floats, ideal: Floats, xy: Floats, camera: Numbers
) -> tuple[Floats, Floats]:
    """Find the image points that ``corrected`` takes to computed ones (n, 2), and their derivatives by these (n, 2, 2).

    xy: (n, 2), measured: where the step to each of them starts.

    The corrections have to be those at the computed points. At the measured ones they hold measuring errors, which the
    misfits hold as well: the products of both do not vanish in the mean, and thousands of rays make a distortion of
    them that is not there.
    """
    found, by_ideal = ideal.copy(), np.broadcast_to(np.eye(2), (len(xy), 2, 2)).copy()
    for number in np.flatnonzero((values != 0.0).any(axis=1)).tolist():
        some = camera == number
        own, at = camera[some], xy[some]
        for _ in range(STEPS_TO_IMAGE):
            off = ideal[some] - corrected(cameras, values, at, own)
            at = at + np.linalg.solve(_slope(values[number], at), off[..., None])[..., 0]
        found[some], by_ideal[some] = at, np.linalg.inv(_slope(values[number], at))
    return found, by_ideal


def _slope(own: Floats, xy: Floats) -> Floats:
    """Differentiate the image coordinates that values (10,) of parameters correct by what is corrected: (n, 2, 2)."""
    estimated = Distortion("brown", "image_to_ideal", k=tuple(own[K]), p=tuple(own[P]), b=tuple(own[AFFINE]))
    return distortion_jacobian(xy - own[POINT], estimated)


def by_image(cameras: BundleCameras, camera: int, xy: Floats, center: Floats) -> Floats:
    """Differentiate ideal image coordinates (n, 2) by measured ones: (n, 2, 2), the given distortion's part.

    It is that at the points once the principal point of their distortion has moved to ``center``.
    """
    given = cameras.distortion[camera] if cameras.distortion else None
    if given is None:
        return np.broadcast_to(np.eye(2), (len(xy), 2, 2))
    slope = distortion_jacobian(xy, given)
    if given.direction == "image_to_ideal":
        image = xy - np.linalg.solve(slope, distortion_shift(xy, given)[..., None])[..., 0]
        return distortion_jacobian(image - center, given)
    moved = xy - np.linalg.solve(slope, np.broadcast_to(center, xy.shape)[..., None])[..., 0]
    return np.asarray(np.linalg.inv(distortion_jacobian(moved, given)), float)


def partials(cameras: BundleCameras, values: Floats, camera: int, xy: Floats, ratio: Floats) -> Floats:
    """Differentiate computed minus corrected image coordinates (n, 2) of a camera by its parameters: (10, 2, n).

    ``ratio`` (n, 2) is the computed image point divided by the principal distance.
    """
    own, center = values[camera], values[camera, POINT]
    found = -corrections((xy - center).T)
    found[PRINCIPAL_DISTANCE] = ratio.T
    slope = _slope(own, xy) - np.eye(2)
    found[POINT] = (by_image(cameras, camera, xy, center) + slope).transpose(2, 1, 0)
    return found


def corrections(xy: Floats) -> Floats:
    """Corrections of image coordinates (2, ...) from the principal point in mm by each parameter at one: (10, 2, ...).

    As in ``corrected``; zero for the principal distance.
    """
    x, y = xy
    r2 = x * x + y * y
    one, zero = np.ones_like(x), np.zeros_like(x)
    return np.array(
        [
            [zero, zero],
            [-one, zero],
            [zero, -one],
            [x * r2, y * r2],
            [x * r2**2, y * r2**2],
            [x * r2**3, y * r2**3],
            [r2 + 2.0 * x * x, 2.0 * x * y],
            [2.0 * x * y, r2 + 2.0 * y * y],
            [x, zero],
            [y, zero],
        ]
    )


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
    if problem.of_models:
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


def in_models(measured: ImageObservations, rows: Numbers, state: Parameters, xyz: Floats) -> InModels:
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


def _models(measured: ImageObservations, state: Parameters) -> Rays:
    """Compute all model coordinates."""
    found = in_models(measured, np.arange(len(measured)), state, state.points[measured.point])
    turn = state.rotations[measured.photo]
    by_model = found.by_model
    by_model[:, :, :3], by_model[:, :, 3:6] = by_model[:, :, :3] @ turn, by_model[:, :, 3:6] @ turn
    return Rays(
        misfit=found.misfit, by_photo=by_model, by_point=found.by_point, by_common=csr_array((found.misfit.size, 0))
    )


def whitening(measured: ImageObservations) -> Floats:
    """Matrices W (n, c, c) with W' W the weights of the coordinates of a row."""
    white: Floats = np.eye(measured.sigma.shape[1]) / measured.sigma[:, None, :]
    if measured.correlation is not None:
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
    images: ImageObservations,
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


LITTLE = 1e-4  # radians: below it the series of the rotation's derivative is exact


@dataclass(frozen=True, eq=False)
class LinearisedOrientations:
    """Linearised observations of photos, three in each row."""

    photo: Numbers  # (g,): photo of each row
    residual: Floats  # (g, 3): computed minus given, metres or radians
    by_photo: Floats  # (g, 3, 6): partials by the photo's parameters, as ``rays`` counts them
    by_common: Floats  # (g, 3, p): partials by the common parameters
    weight: Floats  # (g, 3): reciprocal sigmas

    def scaled(self) -> tuple[Floats, Floats, Floats]:
        """Divide by sigma: partials by photo (g, 3, 6) and by common parameters (g, 3, p), misfits (g, 3)."""
        weight = self.weight[:, :, None]
        return self.by_photo * weight, self.by_common * weight, -self.residual * self.weight


def drift_columns(positions: PositionObservations, first: int) -> tuple[Numbers, Numbers]:
    """Columns of the components of offset and of drift of each group among the common parameters, each (groups + 1, 3).

    ``first`` common parameters stand before them; -1: not a parameter, as for the group -1 at the end.
    """
    columns = []
    for sigma in (positions.offset_sigma, positions.drift_sigma):
        used = sigma > 0.0
        number = np.where(used, first + np.cumsum(used).reshape(used.shape) - 1, -1)
        columns.append(np.concatenate([number, np.full((1, 3), -1)]))
        first += int(used.sum())
    return columns[0], columns[1]


def positions_at(
    positions: PositionObservations, centers: Floats, rotations: Floats, common: Floats, calibrated: int
) -> LinearisedOrientations:
    """Linearise camera positions: A (S + R l - X) - offset - drift t.

    The first ``calibrated`` of the common parameters are those of cameras.
    """
    turn = positions.axes @ rotations[positions.photo]
    arm = np.einsum("gij,gj->gi", turn, positions.lever)
    residual = np.einsum("gij,gj->gi", positions.axes, centers[positions.photo] - positions.xyz) + arm
    by_photo = np.concatenate([turn, -turn @ cross_matrix(positions.lever)], axis=2)
    by_common = np.zeros((len(positions), 3, len(common)))
    factors = (np.ones(len(positions)), positions.time)
    for columns, factor in zip(drift_columns(positions, calibrated), factors, strict=True):
        column = columns[positions.group]
        rows, axis = np.nonzero(column >= 0)
        by_common[rows, axis, column[rows, axis]] = -factor[rows]
    residual += by_common @ common
    return LinearisedOrientations(
        photo=positions.photo, residual=residual, by_photo=by_photo, by_common=by_common, weight=1.0 / positions.sigma
    )


def attitudes_at(attitudes: AttitudeObservations, rotations: Floats, common: int) -> LinearisedOrientations:
    """Linearise given attitudes: the rotation vector of R_given^T R. They do not depend on common parameters."""
    turn = to_vector(np.swapaxes(attitudes.rotations, 1, 2) @ rotations[attitudes.photo])
    by_photo = np.zeros((len(attitudes), 3, 6))
    by_photo[:, :, 3:] = _vector_by_turn(turn)
    return LinearisedOrientations(
        photo=attitudes.photo,
        residual=turn,
        by_photo=by_photo,
        by_common=np.zeros((len(attitudes), 3, common)),
        weight=1.0 / attitudes.sigma,
    )


def _vector_by_turn(vector: Floats) -> Floats:
    """Differentiate a rotation vector v by a further small rotation about the turned axes, shape (n, 3, 3).

    I + [v]/2 + (1/a^2 - (1 + cos a) / (2 a sin a)) [v]^2 with the angle a = |v|.
    """
    angle = np.linalg.norm(vector, axis=1)
    safe = np.where(angle < LITTLE, 1.0, angle)
    factor = np.where(angle < LITTLE, 1.0 / 12.0, 1.0 / safe**2 - (1.0 + np.cos(safe)) / (2.0 * safe * np.sin(safe)))
    cross = cross_matrix(vector)
    return np.asarray(np.eye(3) + 0.5 * cross + factor[:, None, None] * (cross @ cross))
