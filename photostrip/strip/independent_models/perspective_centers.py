"""Perspective centres under a polynomial: they follow the ground below them as a stiff body would.

A strip polynomial says how the ground of a strip moves. A perspective centre stands high above it and moves with the
model around it: the shift of the ground below, a tilt by the slope of the height correction, and a change of the flying
height with the scale.

Source: derived; see docs/independent-models.md.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.arrays import Floats
from photostrip.strip.polynomial.terms import POWERS

NEAREST = 3  # points at least that say where the ground below a centre is


def displacement_rows(xyz: Floats, above: Floats, terms: Sequence[tuple[str, ...]]) -> list[Floats]:
    """Displacements of centres by the coefficients of the polynomials of X, Y and Z, a list of three (n, 3, k).

    dX = fx - h dfz/dX, dY = fy - h dfz/dY, dZ = fz + h (dfx/dX + dfy/dY) / 2 with h = ``above``, the heights (n,) of
    the centres above the ground below them, and ``terms`` of the three polynomials by name.
    """
    x, y = xyz[:, 0], xyz[:, 1]
    found = []
    for axis, names in enumerate(terms):
        rows = np.zeros((len(xyz), 3, len(names)))
        for column, (i, j) in enumerate(POWERS[name] for name in names):
            by_x = i * x ** max(i - 1, 0) * y**j
            by_y = j * x**i * y ** max(j - 1, 0)
            rows[:, axis, column] = x**i * y**j
            if axis == 2:  # the heights tilt the model
                rows[:, 0, column] -= above * by_x
                rows[:, 1, column] -= above * by_y
            else:
                rows[:, 2, column] += above * (by_x, by_y)[axis] / 2
        found.append(rows)
    return found


def heights_above(centers: Floats, points: Floats) -> Floats:
    """Heights of centres above the ground below them: the mean of the points that are nearest along the strip."""
    near = min(max(len(points) // max(len(centers), 1), NEAREST), len(points))
    order = np.argsort(points[:, 0], kind="stable")
    x, z = points[order, 0], np.concatenate([[0.0], np.cumsum(points[order, 2])])
    first = np.clip(np.searchsorted(x, centers[:, 0]) - near // 2, 0, len(points) - near)
    return np.asarray(centers[:, 2] - (z[first + near] - z[first]) / near)
