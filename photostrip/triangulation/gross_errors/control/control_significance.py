"""Control coordinates tested with the covariance of the strip itself.

The misclosures of a formed strip at its control are correlated: the strip bends as a whole. With the covariance of all
of them together, every coordinate is predicted by all others, near ones most, and no band mate is needed to tell a
wrong coordinate from a bend.

Source: data snooping with correlated observations; derived, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import t_quantile

if TYPE_CHECKING:
    from photostrip.arrays import Flags, Floats, Numbers


LARGEST = 400  # control coordinates whose covariance is formed as a whole
LONGEST = 300  # photos of a strip for which it is formed; for more it takes longer than all the rest
LEAST_REDUNDANCY = 3
LEAST_CHECKED_SHARE = 1e-3  # share of a coordinate's variance below which nothing checks it
POWER = 0.84  # normal quantile: an error is called detectable when it is found in 80 % of cases
BENT = 2.5  # standard deviation of unit weight beyond which the strip is bent by more than its random errors


@dataclass(frozen=True, eq=False)
class ControlCovariance:
    """Misclosures at the control as one vector."""

    # point, axis: (w,): control point and ground axis of each coordinate
    point: Numbers
    axis: Numbers
    design: Floats  # (w, 7): derivatives by a similarity
    covariance: Floats  # (w, w): covariance of the strip and of the given coordinates together, m^2


@dataclass(frozen=True, eq=False)
class ControlTests:
    """What all other coordinates say of each one; arrays by control point and axis, shape (n, 3)."""

    # value, limit: test values and critical values; value 0 where nothing can be said
    value: Floats
    limit: Floats
    size: Floats  # given minus predicted, metres
    redundancy: Floats  # redundancy numbers; 1 for coordinates that took no part
    detectable: Floats  # smallest error that is found in 80 % of cases, metres; infinite where none is
    sigma0: float  # standard deviation of unit weight of the coordinates that took part; NaN without redundancy


def predict_control(control: ControlCovariance, misclosures: Floats, used: Flags, alpha: float) -> ControlTests:
    """Test every control coordinate against what the others predict, with their covariances.

    With the projector P = W - W A (A^T W A)^-1 A^T W of those that take part and the misclosures w, the coordinate i
    has the error -(P w)_i / P_ii and the test value |(P w)_i| / sqrt(P_ii); one that takes no part is tested by those
    that do.

    misclosures: (n, 3), strip minus given along the ground axes, metres, after any similarity near the truth.
    used: (n, 3), coordinates that take part.
    alpha: level of rejecting anything in a strip without wrong control.
    """
    w = misclosures[control.point, control.axis]
    inside = np.flatnonzero(used[control.point, control.axis])
    count = len(inside)
    columns = [np.zeros(misclosures.shape) for _ in range(5)]
    value, limit, size, redundancy, detectable = columns
    limit[:] = detectable[:] = np.inf
    freedom = count - control.design.shape[1]
    if freedom < LEAST_REDUNDANCY:
        return ControlTests(value, limit, size, redundancy, detectable, float("nan"))
    tail = alpha / (2 * max(len(w), 1))
    critical = t_quantile(1 - tail, freedom - 1)
    projector = _projector(control, inside)
    pulled = projector @ w[inside]
    total = float(w[inside] @ pulled)
    for number in range(len(w)):
        place = control.point[number], control.axis[number]
        weight, pull, rest = _of_one(control, w, inside, number, (projector, pulled, total))
        share = weight * control.covariance[number, number]
        if share < LEAST_CHECKED_SHARE:
            continue
        # a covariance is never believed to be too large: what is not modelled makes misclosures larger
        spread = max(1.0, float(np.sqrt(max(rest, 0.0) / (freedom - 1))))
        limit[place] = critical
        value[place] = abs(pull) / np.sqrt(weight) / spread
        size[place] = -pull / weight
        detectable[place] = (critical + POWER) * spread / np.sqrt(weight)
        redundancy[place] = 1.0
    redundancy[control.point[inside], control.axis[inside]] = np.diag(
        projector @ control.covariance[np.ix_(inside, inside)]
    )
    return ControlTests(value, limit, size, redundancy, detectable, float(np.sqrt(max(total, 0.0) / freedom)))


def _projector(control: ControlCovariance, rows: Numbers) -> Floats:
    """Weight matrix of the coordinates after a similarity has taken what it can."""
    weight = np.linalg.inv(control.covariance[np.ix_(rows, rows)])
    design = control.design[rows] / np.maximum(np.abs(control.design[rows]).max(axis=0), 1e-300)
    pulled = weight @ design
    return np.asarray(weight - pulled @ np.linalg.pinv(design.T @ pulled, hermitian=True) @ pulled.T, float)


def _of_one(
    control: ControlCovariance, w: Floats, inside: Numbers, number: int, whole: tuple[Floats, Floats, float]
) -> tuple[float, float, float]:
    """Weight, pull and remaining sum of squares for an error of one coordinate, which may be outside."""
    projector, pulled, total = whole
    found = np.flatnonzero(inside == number)
    if len(found):
        at = int(found[0])
    else:
        rows = np.append(inside, number)
        projector = _projector(control, rows)
        pulled, at = projector @ w[rows], len(rows) - 1
        total = float(w[rows] @ pulled)
    weight, pull = float(projector[at, at]), float(pulled[at])
    return weight, pull, total - pull**2 / weight if weight > 0 else total
