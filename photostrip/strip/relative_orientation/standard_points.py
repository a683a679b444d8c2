"""Six standard points: the precision of their relative orientation, to the first order.

The points, in the left photo: 1 (0, 0), 2 (b, 0), 3 (0, a), 4 (b, a), 5 (0, -a), 6 (b, -a) with the photo base b.
Elements are those of ``relative``: alpha1', kappa1', alpha2', omega2', kappa2'.

Source: derived from the linear condition; the weight numbers of the dependent pair are those of [Hallert].

Standard zones of a pair: which of the six standard (Gruber) positions a point stands for.

The positions are those of the base frame, in the left photo, numbered as in the literature::

    3 (0, a)    4 (b, a)
    1 (0, 0)    2 (b, 0)
    5 (0, -a)   6 (b, -a)

with the photo base b and the spread a of the pair's own points. The numbers do not change when photos are turned.

Source: [004a], [001]; base and spread from the points are chosen here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.strip.relative_orientation.orientation import Orientation
from photostrip.strip.relative_orientation.pairs import Pairs
from photostrip.strip.relative_orientation.solution import base_rays


def cofactors(focal: float, width: float, base: float) -> Floats:
    """Cofactors (5, 5) of the elements from six standard points, rad^2/mm^2 for a y parallax of unit variance."""
    f, a, b = focal, width, base
    alpha, omega = f**2 / (2 * a**2 * b**2), 3 * f**2 / (4 * a**4)
    kappa = (8 * a**4 + 12 * a**2 * f**2 + 9 * f**4) / (12 * a**4 * b**2)
    matrix = np.diag([alpha, kappa, alpha, omega, kappa])
    matrix[[1, 4], [4, 1]] = (a**4 / 3 + a**2 * f**2 + 3 * f**4 / 4) / (a**4 * b**2)
    matrix[[1, 4, 3, 3], [3, 3, 1, 4]] = f * (2 * a**2 + 3 * f**2) / (4 * a**4 * b)
    return matrix


def dependent_from_base(base: float) -> Floats:
    """First-order relation T (5, 5) of the dependent pair (left photo fixed) to the base-frame elements.

    (by, bz, dkappa, dalpha, domega) = T (alpha1', kappa1', alpha2', omega2', kappa2'), lengths in mm. The cofactors
    follow as T Q T^T for any points. dalpha = alpha2' + bz/b is the decorrelation that [000] uses.
    """
    matrix = np.zeros((5, 5))
    matrix[0, 1] = matrix[1, 0] = -base
    matrix[2, [1, 4]] = matrix[3, [0, 2]] = -1.0, 1.0
    matrix[4, 3] = 1.0
    return matrix


ZONES = 6
MINIMUM_LEFT = 6  # a pair keeps at least one redundant point


def zones(elements: Floats, pairs: Pairs) -> Numbers:
    """Zone of every point, 1 to 6; points of weight 0 get a zone and do not shape it."""
    left, right = base_rays(elements, pairs)
    x, y = -pairs.focal * left[:2] / left[2]
    parallax = x + pairs.focal * right[0] / right[2]
    used = pairs.weight > 0
    count = np.maximum(pairs.sums(used.astype(float)), 1.0)
    base = pairs.sums(np.where(used, parallax, 0.0)) / count
    spread = np.sqrt(pairs.sums(np.where(used, y**2, 0.0)) / count * 3 / 2)  # rows at -a, 0, a
    half_base, half_spread = base[pairs.pair] / 2, spread[pairs.pair] / 2
    row = np.where(y > half_spread, 2, np.where(y < -half_spread, 4, 0))
    number: Numbers = (1 + row + (x > half_base)).astype(np.intp)
    return number


@dataclass(frozen=True, eq=False)
class Support:
    """What holds the pairs up: their points by zone."""

    zone: Numbers  # (m,): zone of every row, 1 to 6
    counts: Numbers  # (p, 6): points that take part, by pair and zone

    @classmethod
    def of(cls, orientation: Orientation, zone: Numbers | None = None) -> Support:
        """Count the points of oriented pairs, whose zones (m,) may be known already."""
        number = zones(orientation.elements, orientation.pairs) if zone is None else zone
        pairs, used = orientation.pairs, orientation.used
        place = ZONES * pairs.pair[used] + number[used] - 1
        counts = np.bincount(place, minlength=ZONES * pairs.size).reshape(-1, ZONES).astype(np.intp)
        return cls(number, counts)

    @property
    def empty(self) -> Numbers:
        """Zones without a point, by pair, shape (p,)."""
        number: Numbers = (self.counts == 0).sum(axis=1)
        return number

    def spare(self, pair: Numbers) -> Flags:
        """Rows that can go: six points stay, and no zone loses its last point while another one is empty already."""
        enough = self.counts.sum(axis=1) > MINIMUM_LEFT
        last = self.counts[pair, self.zone - 1] <= 1
        flags: Flags = enough[pair] & (~last | (self.empty[pair] == 0))
        return flags
