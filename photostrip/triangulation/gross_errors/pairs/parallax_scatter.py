"""The scatter that the y parallaxes of a strip should have: the stated one, unless the residuals contradict it.

Source: derived; limits are chosen here, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from photostrip.statistics import SIGMA_FROM_MEDIAN
from photostrip.triangulation.gross_errors.pairs import deletion
from photostrip.triangulation.gross_errors.pairs.pair_global_test import failing
from photostrip.triangulation.relative_orientation import robust

if TYPE_CHECKING:
    from photostrip.arrays import Floats, Numbers
    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.relative_orientation.pairs import Pairs


SMALLEST_REDUNDANCY = 0.05  # a residual with less says little about the scatter
MEDIAN_SCATTER = 1.17  # sd of a standard deviation from the median of n residuals, times sqrt(n)
PROOF = 3.0  # of those, by which a scatter must exceed the one in force
CONTRADICTION = 1.25  # ratio of the scatter found to the one stated that is worth a change
UNCHANGED = 1.05  # ratio of scatters that makes no difference
FEW = 0.35  # share of a pair's points that may go before what is left says nothing about the scatter
ENOUGH = 5.0  # redundancy below which one error cannot be told from a larger scatter
SMALLEST_SIGMA = 1e-9  # mm


@dataclass(frozen=True, eq=False)
class ParallaxScatter:
    """Standard deviations of a y parallax of weight one that the tests are made with."""

    stated: float  # from the stated standard deviation of image coordinates, mm
    # from the residuals of all pairs of the strip, robust, mm; NaN when they did not contradict the stated one
    found: float
    by_pair: Floats  # (p,): those in force, mm

    @classmethod
    def of(cls, sigma: float, pairs: int) -> Self:
        """Take sqrt(2) times the stated standard deviation of an image coordinate, mm."""
        stated = max(float(np.sqrt(2.0)) * sigma, SMALLEST_SIGMA)
        return cls(stated, float("nan"), np.full(pairs, stated))

    def contradicted(self, revised: ParallaxScatter) -> bool:
        """Whether a revised scatter is worth another search."""
        return not bool((revised.by_pair <= UNCHANGED * self.by_pair).all())


@dataclass(frozen=True, eq=False)
class ParallaxSizes:
    """What the parallaxes of all rows say about the scatter: sizes as ``_normalised_sizes``, redundancy numbers."""

    size: Floats
    redundancy: Floats

    @classmethod
    def of(cls, orientation: Orientation) -> ParallaxSizes:
        """Sizes of all rows of oriented pairs."""
        return cls(_normalised_sizes(orientation), orientation.redundancy)

    def with_part(self, rows: Numbers, part: ParallaxSizes) -> ParallaxSizes:
        """Replace those of some rows."""
        size, redundancy = self.size.copy(), self.redundancy.copy()
        size[rows], redundancy[rows] = part.size, part.redundancy
        return ParallaxSizes(size, redundancy)


def sizes_left(given: Orientation, found: Orientation, cleaned: Orientation, sigma: Floats) -> ParallaxSizes:
    """Return what a search leaves of the pairs that failed.

    Pairs from which too many points went, or that still fail, do not speak by what the search chose to leave but by
    what a robust start leaves.
    """
    total, left = given.points_used, found.points_used
    few = total - left <= np.maximum(deletion.LARGEST, FEW * total)
    trusted = (few & ~failing(found, sigma))[given.pairs.pair]
    chosen, robustly = ParallaxSizes.of(found), ParallaxSizes.of(cleaned)
    return ParallaxSizes(
        np.where(trusted, chosen.size, robustly.size), np.where(trusted, chosen.redundancy, robustly.redundancy)
    )


def revised_scatter(scatter: ParallaxScatter, pairs: Pairs, left: ParallaxSizes) -> ParallaxScatter:
    """Raise the scatter where the residuals left by a search contradict it."""
    sizes = left.size
    tested = np.isfinite(sizes)
    freedom = pairs.sums(np.where(tested, left.redundancy, 0.0))
    if freedom.sum() < ENOUGH:
        return scatter
    pooled = SIGMA_FROM_MEDIAN * float(np.median(sizes[tested]))
    proof = 1 + PROOF * MEDIAN_SCATTER / np.sqrt(max(float(freedom.sum()), 1.0))
    first = np.isnan(scatter.found)
    level, factor = (scatter.stated, max(CONTRADICTION, proof)) if first else (scatter.found, UNCHANGED)
    found_now = pooled if pooled > factor * level else scatter.found
    level = max(level, np.nan_to_num(found_now))
    of_pair = SIGMA_FROM_MEDIAN * np.nan_to_num(robust.median_by_pair(sizes, pairs, tested))
    proven = np.where(freedom < ENOUGH, 0.0, of_pair / (1 + PROOF * MEDIAN_SCATTER / np.sqrt(np.maximum(freedom, 1.0))))
    return ParallaxScatter(scatter.stated, found_now, np.maximum(level, np.maximum(proven, scatter.by_pair)))


def _normalised_sizes(orientation: Orientation) -> Floats:
    """Sizes of the parallaxes over sqrt(redundancy / weight), mm; NaN where they say little."""
    share = np.nan_to_num(orientation.redundancy)
    speaks = orientation.used & (share > SMALLEST_REDUNDANCY)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.abs(orientation.parallax) * np.sqrt(orientation.pairs.weight / share)
    return np.where(speaks, size, np.nan)
