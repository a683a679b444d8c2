"""The global test of oriented pairs: whether the scatter of their y parallaxes belongs to the measurements.

Source: derived; [004a] stops at tests of single residuals. See docs/sources.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import chi2_quantile, normal_quantile
from photostrip.triangulation.relative_orientation.pairs import MINIMUM_POINTS

if TYPE_CHECKING:
    from collections.abc import Callable

    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.triangulation.relative_orientation.orientation import Orientation


CONFIDENCE = 0.999  # of the global test, and of the test of the largest residual of a pair
NO_REDUNDANCY = 1e-6  # residuals with less are rounding


def squares(orientation: Orientation, sigma: Floats) -> Floats:
    """Value of the global test of each pair: v^T W v / sigma^2, ``sigma`` (p,) of a y parallax of weight one, mm."""
    total: Floats = orientation.pairs.sums(orientation.pairs.weight * orientation.parallax**2) / sigma**2
    return total


def global_limits(count: Numbers) -> Floats:
    """Critical values of the global test: chi-square with count - 5 degrees; infinite without redundancy."""
    return _by_number(
        count,
        lambda n: chi2_quantile(CONFIDENCE, n - MINIMUM_POINTS) if n > MINIMUM_POINTS else np.inf,
    )


def standardised(orientation: Orientation, sigma: Floats) -> Floats:
    """Parallaxes in units of their standard deviation, (m,): residuals of points used, predictions of the others.

    0 where a residual has no redundancy.
    """
    pairs, used = orientation.pairs, orientation.used
    size = np.abs(orientation.parallax) / sigma[pairs.pair] * np.sqrt(np.where(used, pairs.weight, 1.0))
    share = np.where(used, orientation.redundancy, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = size / np.sqrt(share)
    return np.where(np.isfinite(value) & (share > NO_REDUNDANCY), value, 0.0)


def failing(orientation: Orientation, sigma: Floats) -> Flags:
    """Pairs whose sum of squares or largest residual exceeds its limit."""
    count = orientation.points_used
    largest = np.maximum.reduceat(
        np.where(orientation.used, standardised(orientation, sigma), 0.0), orientation.pairs.starts
    )
    bad: Flags = ~(squares(orientation, sigma) <= global_limits(count)) | (largest > largest_limits(count))
    return bad & (count > MINIMUM_POINTS)


def largest_limits(count: Numbers) -> Floats:
    """Critical values of the largest standardised residual (Bonferroni)."""
    return _by_number(count, lambda n: normal_quantile(1 - (1 - CONFIDENCE) / (2 * max(n, 1))))


def _by_number(count: Numbers, limit: Callable[[int], float]) -> Floats:
    """Look up a limit for every number of points; each number is asked for once."""
    table = np.zeros(int(count.max(initial=0)) + 1)
    for number in np.flatnonzero(np.bincount(np.maximum(count.ravel(), 0))).tolist():
        table[number] = limit(number)
    return table[np.maximum(count, 0)]
