"""Given points whose differences do not go with those of the others."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.statistics import TEST_LEVEL, f_p_value

# Probability that the largest of sound differences stands out; plan and height of control, check and left-out points.
LEVEL = TEST_LEVEL / 6
ODD_POINT = 4.0  # times the rms of the others: points at the ends of a strip are not as good as those within
ODD_CHANCE = 0.0027  # of a larger difference, from its own standard deviation (3 sigma): few others may be too good
LARGEST_PART = 4  # at most one in so many points stands out


def stand_out(size: Floats, coordinates: int, chance: Floats) -> Flags:
    """Return which differences (n,) are too large for those that remain without them; NaN where there is none.

    The k largest stand out when the least of them does, by the F test of its square against the mean square of the
    n - k others: two wrong points must not hide each other.

    coordinates: coordinates in a difference, 2 in plan.
    chance: (n,), probability of a larger difference, from the standard deviation of each.
    """
    found = np.zeros(len(size), bool)
    known = np.flatnonzero(np.isfinite(size))
    order = known[np.argsort(-np.abs(size[known]), kind="stable")]
    count, squares = len(order), size[order] ** 2
    number = np.arange(1, min(max(1, count // LARGEST_PART), count - 1) + 1)
    rest = np.cumsum(squares[::-1])[::-1][number] / (count - number)
    far = (squares[number - 1] > ODD_POINT**2 * rest) & (chance[order[number - 1]] < ODD_CHANCE)
    for k, mean in zip(number[far].tolist(), rest[far].tolist(), strict=True):
        among = f_p_value(squares[k - 1] / mean, coordinates, coordinates * (count - k)) if mean else 0.0
        if among * (count - k + 1) < LEVEL:
            found[order[:k]] = True
    return found
