"""The global test of oriented pairs, and the scatter of y parallaxes that it is made with.

Source: derived; [004a] stops at tests of single residuals. See docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.special import chdtri, ndtri

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.rejection import UNCONTROLLED
from photostrip.statistics import SIGMA_FROM_MEDIAN, normal_quantile
from photostrip.strip.relative_orientation.orientation import Orientation
from photostrip.strip.relative_orientation.pairs import MINIMUM_POINTS
from photostrip.strip.robust import MEDIAN_SPREAD

ALPHA = 0.01  # probability that a strip without gross errors fails anywhere
# scale of residuals of which a fifth are large over that of the others: normal_quantile(13/16) * 1.4826
FIFTH_WRONG = 1.315


@dataclass(frozen=True, eq=False)
class GlobalTest:
    """What the y parallaxes of some pairs are tested with."""

    sigma: Floats  # (p,): standard deviation of a y parallax of weight one in each pair, mm
    level: float  # probability that a pair without gross errors fails one of its two tests

    @classmethod
    def of(cls, sigma: Floats) -> Self:
        """Share the level of a strip among its pairs and their two tests."""
        return cls(sigma, ALPHA / (2 * len(sigma)))

    def take(self, numbers: Numbers) -> GlobalTest:
        """Take some of the pairs; the level stays that of the whole strip."""
        return replace(self, sigma=self.sigma[numbers])

    def squares(self, orientation: Orientation) -> Floats:
        """Value of the test of each pair: v^T W v / sigma^2."""
        pairs = orientation.pairs
        return np.asarray(pairs.sums(pairs.weight * orientation.parallax**2) / self.sigma**2, float)

    def limits(self, count: Numbers) -> Floats:
        """Critical values: chi-square with count - 5 degrees of freedom; infinite without redundancy."""
        freedom = count - MINIMUM_POINTS
        return np.where(freedom > 0, chdtri(freedom, self.level), np.inf)

    def standardised(self, orientation: Orientation) -> Floats:
        """Parallaxes of the points used in units of their standard deviation, (m,); 0 without redundancy."""
        value = np.abs(orientation.parallax) / residual_sigma(orientation, self.sigma)
        return np.where(np.isfinite(value), value, 0.0)

    def largest_limits(self, count: Numbers) -> Floats:
        """Critical values of the largest standardised residual (Bonferroni)."""
        return np.asarray(ndtri(1 - self.level / (2 * np.maximum(count, 1))))

    def failing(self, orientation: Orientation) -> Flags:
        """Pairs whose sum of squares or largest residual exceeds its limit."""
        count = orientation.points_used
        largest = np.maximum.reduceat(self.standardised(orientation), orientation.pairs.starts)
        bad: Flags = ~(self.squares(orientation) <= self.limits(count)) | (largest > self.largest_limits(count))
        return bad & (count > MINIMUM_POINTS)


@dataclass(frozen=True, eq=False)
class ParallaxScatter:
    """Standard deviations of a y parallax of weight one that the tests are made with."""

    # from the residuals of all pairs of the strip, robust, mm; NaN when they did not contradict the stated one
    found: float
    by_pair: Floats  # (p,): those in force, mm

    @classmethod
    def of(cls, orientation: Orientation, stated: float, spoiled: float = FIFTH_WRONG) -> ParallaxScatter:
        """Decide on the scatter of a strip whose pairs are oriented on points that agree with one another.

        ``stated`` is that of a y parallax, mm. It holds unless the median residual of the whole strip proves more, even
        if wrong points among them should make that ``spoiled`` times too large.
        """
        pairs, share = orientation.pairs, np.nan_to_num(orientation.redundancy)
        tested = orientation.used & (share > UNCONTROLLED)
        found = np.nan
        if tested.any():
            sizes = np.abs(orientation.parallax[tested]) * np.sqrt(pairs.weight[tested] / share[tested])
            scale = SIGMA_FROM_MEDIAN * np.median(sizes)
            proof = 1.0 + normal_quantile(1.0 - ALPHA) * MEDIAN_SPREAD / np.sqrt(float(share[tested].sum()))
            found = scale if scale > spoiled * proof * stated else np.nan
        return cls(found, np.full(pairs.size, max(stated, np.nan_to_num(found))))


def residual_sigma(orientation: Orientation, sigma: Floats) -> Floats:
    """Return standard deviations of residuals, (m,), mm; infinite without redundancy and where a point is not used.

    sigma: (p,), of a y parallax of weight one.
    """
    pairs, share = orientation.pairs, orientation.redundancy
    with np.errstate(divide="ignore", invalid="ignore"):
        size = sigma[pairs.pair] * np.sqrt(share / pairs.weight)
    return np.where(orientation.used & (share > UNCONTROLLED), size, np.inf)
