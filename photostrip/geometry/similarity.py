"""The similarity in space: rotation, one scale, shift."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.rotation import cross_matrix

SIMILARITY_PARAMETERS = 7  # shift, rotation, logarithm of the scale


@dataclass(frozen=True, eq=False)
class Similarity:
    """Similarity ``target = scale * rotation @ source + shift``."""

    scale: float  # scale, positive
    rotation: Floats  # (3, 3): rotation, determinant +1
    shift: Floats  # (3,): shift in the unit of the target

    def __call__(self, points: ArrayLike) -> Floats:
        """Transform points (n, 3)."""
        return self.scale * np.asarray(points, float) @ self.rotation.T + self.shift

    @property
    def inverse(self) -> Similarity:
        """The similarity from target to source."""
        back = self.rotation.T
        return Similarity(1 / self.scale, back, -back @ self.shift / self.scale)

    def residuals(self, source: ArrayLike, target: ArrayLike) -> Floats:
        return np.asarray(self(source) - np.asarray(target, float), float)

    @classmethod
    def from_points(cls, source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None) -> Self:
        """Least-squares similarity of corresponding points (n, 3), in closed form.

        Reduced to centroids, R = U D V^T of the singular values of sum(w b a^T), the scale trace(S D) / sum(w |a|^2);
        the determinant factor D keeps a reflection out. At least three points that are not on one line; on a line the
        rotation about it is arbitrary, and ``collinearity`` tells.

        Source: [001] eq. 145-149; closed form by singular values.
        """
        a, b = np.asarray(source, float), np.asarray(target, float)
        w = np.ones(len(a)) if weights is None else np.asarray(weights, float)
        center_a, center_b = (np.average(points, axis=0, weights=w) for points in (a, b))
        da, db = a - center_a, b - center_b
        u, values, vt = np.linalg.svd((db * w[:, None]).T @ da)
        sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
        rotation = (u * sign) @ vt
        scale = float((values * sign).sum() / (w[:, None] * da**2).sum())
        return cls(scale, rotation, center_b - scale * rotation @ center_a)


def similar(source: Floats, target: Floats, points: Floats) -> Floats:
    """Move points (n, 3) by each of t least-squares similarities of k corresponding points (t, k, 3); (t, n, 3).

    Source: [001] eq. 145-149; closed form by singular values, as ``Similarity.from_points``.
    """
    center_a, center_b = source.mean(axis=1, keepdims=True), target.mean(axis=1, keepdims=True)
    da, db = source - center_a, target - center_b
    u, values, vt = np.linalg.svd(db.transpose(0, 2, 1) @ da)
    sign = np.ones((len(source), 3))
    sign[:, 2] = np.sign(np.linalg.det(u @ vt))
    rotation = (u * sign[:, None]) @ vt
    size = np.maximum((da**2).sum(axis=(1, 2)), np.finfo(float).tiny)
    scale = (values * sign).sum(axis=1) / size
    return center_b + scale[:, None, None] * (points - center_a) @ rotation.transpose(0, 2, 1)


class PairScales(NamedTuple):
    """Scales between two systems from the distances of all pairs of points."""

    # first, second: (k,): rows of the two points of a pair
    first: Numbers
    second: Numbers
    # source, target: (k,): their distance in each system
    source: Floats
    target: Floats

    @property
    def mean(self) -> float:
        """The scale r of all: sum of the target's distances over sum of the source's."""
        return float(self.target.sum() / self.source.sum())


def pair_scales(source: Floats, target: Floats) -> PairScales:
    """Compare the distances of corresponding points (n, 3) in two systems; a first look at control. [001] eq. 147."""
    first, second = np.triu_indices(len(source), 1)
    in_source, in_target = (np.linalg.norm(xyz[second] - xyz[first], axis=1) for xyz in (source, target))
    return PairScales(first=first, second=second, source=in_source, target=in_target)


def collinearity(points: ArrayLike) -> float:
    """How far points (n, 3) are from a line: second over first singular value of their scatter.

    0 for points on a line and for fewer than three, 1 for points spread alike in two directions.
    """
    p = np.asarray(points, float)
    if len(p) < 3:
        return 0.0
    d = p - p.mean(axis=0)
    values = np.linalg.svd(d.T @ d, compute_uv=False)
    return float(values[1] / values[0]) if values[0] > 0 else 0.0


def similarity_derivatives(xyz: Floats, origin: Floats) -> Floats:
    """Displacements by an infinitesimal similarity about an origin: dX = t + theta x (X - O) + lambda (X - O).

    Returns (n, 3, 7), derivatives by shift t, rotation theta (radians) and logarithm of the scale lambda.
    """
    arm = xyz - origin
    x, y, z = arm.T
    derivatives = np.zeros((len(arm), 3, SIMILARITY_PARAMETERS))
    derivatives[:, range(3), range(3)] = 1.0
    derivatives[:, 0, 4], derivatives[:, 0, 5] = z, -y
    derivatives[:, 1, 3], derivatives[:, 1, 5] = -z, x
    derivatives[:, 2, 3], derivatives[:, 2, 4] = y, -x
    derivatives[:, :, 6] = arm
    return derivatives


class Spread(NamedTuple):
    """How points lie in the source system of similarities."""

    middle: Floats  # (3,)
    moments: Floats  # (3, 3): mean products of the coordinates about it

    @classmethod
    def of(cls, points: Floats) -> Spread:
        """Sum up points (n, 3)."""
        arm = points - (middle := points.mean(axis=0))
        return cls(middle, arm.T @ arm / len(arm))

    def motion(self, similarity: Similarity, center: Floats, unit: float) -> Floats:
        """Triangular root (7, 7) of the matrix that gives the mean square motion of the points from seven parameters.

        center, unit: of a small similarity after the one given: its centre, and the length in which arms are counted.
        """
        middle, turn = (similarity(self.middle) - center) / unit, similarity.scale / unit * similarity.rotation
        moments = turn @ self.moments @ turn.T + np.outer(middle, middle)
        square = np.eye(SIMILARITY_PARAMETERS)  # of the derivatives by shift, rotation and scale: 1, -[a], a
        square[3:6, :3], square[6, :3] = cross_matrix(middle), middle
        square[3:, 3:] *= np.trace(moments)
        square[3:6, 3:6] -= moments
        # takes what lies below the diagonal
        return np.asarray(np.linalg.cholesky(square + 1e-15 * np.eye(SIMILARITY_PARAMETERS)), float)
