"""Errors at check points with their joint covariance: they go together along a strip."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtrc

from photostrip.arrays import Floats, Numbers


@dataclass(frozen=True, eq=False)
class CheckErrors:
    """What check coordinates show of an adjustment, and what they may show."""

    ids: tuple[str, ...]  # the check points
    point: Numbers  # (w,): check point of each coordinate
    axis: Numbers  # (w,): 0, 1, 2: along its first, second, third ground axis
    difference: Floats  # (w,): adjusted minus given, metres
    covariance: Floats  # (w, w): of the differences, the errors of the given coordinates included, metres^2

    def without(self, ids: Collection[str]) -> CheckErrors | None:
        """Leave points out; None when none is left."""
        rows = np.flatnonzero([self.ids[point] not in ids for point in self.point])
        return self.take(rows) if len(rows) else None

    def take(self, rows: Numbers) -> CheckErrors:
        """Give some of the coordinates."""
        return replace(
            self,
            point=self.point[rows],
            axis=self.axis[rows],
            difference=self.difference[rows],
            covariance=self.covariance[np.ix_(rows, rows)],
        )

    @property
    def points(self) -> int:
        return len(np.unique(self.point))

    @property
    def coordinates(self) -> int:
        """Number of coordinates, which is the expectation of the sum of squares."""
        return len(self.difference)

    @cached_property
    def squares(self) -> float:
        """e^T C^-1 e with the covariance C of the differences e."""
        return float(self.difference @ np.linalg.solve(self.covariance, self.difference))

    @property
    def probability(self) -> float:
        """Probability of a larger sum of squares by chance."""
        return float(chdtrc(self.coordinates, self.squares))

    @property
    def independent(self) -> float:
        """Number of independent coordinates whose squares would scatter as much in the mean as these do.

        The mean of n squares of standard normal variables with correlations r has the variance 2 sum(r^2) / n^2.
        """
        return self.coordinates**2 / float((self.correlation**2).sum())

    @property
    def correlation(self) -> Floats:
        sigma = np.sqrt(np.diag(self.covariance))
        return self.covariance / sigma / sigma[:, None]

    @property
    def own_squares(self) -> float:
        """Sum of the squares of the differences, each over its own standard deviation."""
        return float((self.difference**2 / np.diag(self.covariance)).sum())
