"""The fit to the control as a linear operator: parameters of similarity and polynomials by misclosures.

Every control coordinate that counts gives one misclosure, along its own ground axis, so that points in plan only and
in height only come in by the same rule as full ones. The operator holds the weights of the fit and the terms of the
polynomials as they were used.

Source: derived, docs/precision.md, eq. 5; [001] eq. 145-151 for the fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.points import ControlPoints
from photostrip.strip.polynomial.terms import columns


@dataclass(frozen=True, eq=False)
class Misclosures:
    """Control coordinates that count, one row each."""

    point: Numbers  # (w,): control point of each
    row: Numbers  # (w,): its row in the points of the strip
    axis: Numbers  # (w,): 0, 1, 2: along its first, second, third ground axis
    direction: Floats  # (w, 3): that axis as a unit vector in the intermediate frame
    variance: Floats  # (w,): variance of the given coordinate, metres^2

    def take(self, some: Numbers) -> Misclosures:
        return Misclosures(
            point=self.point[some],
            row=self.row[some],
            axis=self.axis[some],
            direction=self.direction[some],
            variance=self.variance[some],
        )


@dataclass(frozen=True, eq=False)
class FitOperator:
    """Subtracted from the strip (eq. 5): ``X - Phi theta``, ``theta = M w``, w the misclosures strip minus given."""

    operator: Floats  # (t, w): M: seven parameters of the similarity, then those of the polynomials
    terms: tuple[tuple[str, ...], ...]  # terms of the polynomials of X, Y, Z
    # reach, breadth: lengths by which X and Y are divided in the terms, metres
    reach: float
    breadth: float
    origin: Floats  # (3,): origin of the similarity

    def influence(self, xyz: Floats) -> Floats:
        """Phi: displacement of points (n, 3) after the similarity by the parameters, shape (n, 3, t)."""
        result = np.zeros((len(xyz), 3, len(self.operator)))
        result[:, :, :SIMILARITY_PARAMETERS] = similarity_derivatives(xyz, self.origin)
        start = SIMILARITY_PARAMETERS
        for axis, values in enumerate(self.polynomial_columns(xyz)):
            result[:, axis, start : start + values.shape[1]] = values
            start += values.shape[1]
        return result

    def polynomial_columns(self, xyz: Floats) -> list[Floats]:
        """Terms of the three polynomials at points, scaled to about one."""
        plan = xyz[:, :2] / (self.reach, self.breadth)
        found = {terms: columns(plan, terms) for terms in set(self.terms)}
        return [found[terms] for terms in self.terms]


def misclosures(control: ControlPoints, rows: Numbers, axes: Floats) -> Misclosures:
    """Control coordinates that count, in the order of the points.

    control: the control, with standard deviations along `axes`.
    rows: (c,), its rows in the points of the strip.
    axes: (c, 3, 3), directions along which it is compared, rows, in the intermediate frame.
    """
    point, axis = np.nonzero(control.use)
    return Misclosures(
        point=point,
        row=rows[point],
        axis=axis,
        direction=axes[point, axis],
        variance=control.sigma[point, axis] ** 2,
    )


def fit_operator(
    found: Misclosures, weight: Floats, xyz: Floats, terms: Sequence[tuple[str, ...]], origin: Floats
) -> FitOperator:
    """Operator of the similarity and the polynomials, M = [M_s; M_p (I - A M_s)], A the design of the similarity.

    weight: (c, 3), weights of the control coordinates in the fit, as ``absolute_orientation.weights`` gives them.
    xyz: (c, 3), control points after the similarity, intermediate frame, metres.
    terms: terms of the polynomials of X, Y, Z; all empty without.
    """
    design = np.einsum("wi,wij->wj", found.direction, similarity_derivatives(xyz[found.point], origin))
    share = np.sqrt(weight[found.point, found.axis])
    size = np.abs(design).max(axis=0)
    size = np.where(size > 0, size, 1.0)
    similarity = np.linalg.pinv(design / size * share[:, None]) * share / size[:, None]
    reach, breadth = (max(float(np.abs(xyz[:, k]).max()), 1e-6) for k in (0, 1))
    result = FitOperator(operator=similarity, terms=tuple(terms), reach=reach, breadth=breadth, origin=origin)
    if not any(terms):
        return result
    after = _polynomials(found, weight, xyz, result)  # by misclosures that the similarity has left
    operator = np.concatenate([similarity, after - after @ design @ similarity])
    return FitOperator(operator=operator, terms=result.terms, reach=reach, breadth=breadth, origin=origin)


def _polynomials(found: Misclosures, weight: Floats, xyz: Floats, fit: FitOperator) -> Floats:
    """Parameters of the polynomials by misclosures after the similarity.

    (C^T W P C) theta = C^T W n w with C the columns of the terms, n the ground axes, P = sum n n^T of one point: each
    axis of the intermediate frame has its own fit; a point that gives only some of its ground coordinates takes
    the others from the fit itself, so the residual that counts is its projection on the axes given.
    """
    by_term = fit.polynomial_columns(xyz)
    plan = weight[:, :2].mean(axis=1)
    by_axis = (plan, plan, weight[:, 2])
    given = np.zeros((len(xyz), 3, 3))
    np.add.at(given, found.point, found.direction[:, :, None] * found.direction[:, None, :])
    weighted = [c * w[:, None] for c, w in zip(by_term, by_axis, strict=True)]
    normal = np.block(
        [
            [weighted[a].T @ (given[:, a, b, None] * by_term[b]) for b in range(3)]
            for a in range(3)
        ]
    )  # fmt: skip
    right = np.concatenate([(weighted[a][found.point] * found.direction[:, [a]]).T for a in range(3)])
    return np.asarray(np.linalg.solve(normal, right), float)
