"""Observations of photos other than rays: camera positions with lever arm, offset and drift; attitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.rotation import cross_matrix, to_vector
from photostrip.network.problem import AttitudeObservations, PositionObservations

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
