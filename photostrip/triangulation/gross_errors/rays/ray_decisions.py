"""Which ray of a point is wrong, when photos that all other points orient say how its rays should meet.

The wrong ray is the only one without which the others agree. An error along the base of a point on three photos can lie
in any of them: removing one leaves two, which always meet. Then no ray of the point places it; its y parallaxes
are good all the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import chi2_quantile
from photostrip.triangulation.gross_errors.rays.windows import FEWEST

if TYPE_CHECKING:
    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.triangulation.gross_errors.rays.window_points import Group


ALPHA = 0.01  # of rejecting any point of a window without gross errors
BETTER = 9.0  # difference of two test values that tells rays apart: a likelihood ratio of 90
TINY = 1e-12  # keeps a ray that cannot be tested from stopping the others
GOOD, RAY, PAIR, RAYS, NONE = range(5)
"""Kinds: all rays agree; the wrong ones are known; two rays disagree; any of several may be wrong; none agree."""


@dataclass(frozen=True, eq=False)
class RayDecisions:
    """What was decided about points."""

    group: Group
    weight: Floats  # (k, r): 1 for a ray that may be used, 0 for one that may not
    # value, limit: (k,): root of the sum of squares of each point's misclosures in units of their standard deviations,
    # and its critical value
    value: Floats
    limit: Floats
    # (k, r, 2): estimated errors of the image coordinates in units of their standard deviations; NaN where nothing can
    # be said
    size: Floats
    kind: Numbers  # (k,): ``GOOD``, ``RAY``, ``PAIR``, ``RAYS`` or ``NONE``

    def take(self, rows: Flags) -> RayDecisions:
        """Give some of the points."""
        return RayDecisions(
            self.group.take(rows),
            self.weight[rows],
            self.value[rows],
            self.limit[rows],
            self.size[rows],
            self.kind[rows],
        )


@dataclass(frozen=True, eq=False)
class _Doubted:
    """Points whose rays disagree: conditions, weights of their misclosures, weighted misclosures, sum of squares."""

    number: Numbers
    basis: Floats
    held: Floats
    pulled: Floats
    total: Floats
    level: Floats

    def take(self, rows: Flags) -> _Doubted:
        return _Doubted(
            self.number[rows], self.basis[rows], self.held[rows], self.pulled[rows], self.total[rows], self.level[rows]
        )

    def without(self, rays: tuple[int, ...]) -> tuple[Floats, Floats]:
        """Give sums of squares without some rays, and the errors of those rays, shapes (k,) and (k, rays, 2)."""
        columns = [2 * ray + axis for ray in rays for axis in (0, 1)]
        part = self.basis[:, :, columns].transpose(0, 2, 1)
        normal = part @ self.held @ part.transpose(0, 2, 1)
        right = np.einsum("kij,kj->ki", part, self.pulled)
        shift = np.linalg.solve(normal + TINY * np.eye(len(columns)), right[:, :, None])[:, :, 0]
        return self.total - np.einsum("ki,ki->k", right, shift), shift.reshape(-1, len(rays), 2)


def decide(group: Group, expected: tuple[Floats, Floats], number: Numbers) -> RayDecisions:
    """Say of each point which of its rays are wrong, by photos that were oriented without it.

    ``expected`` is what those photos leave of the conditions of each point (k, 2r - 3), and its variances; ``number``
    (w,) the points of each window, among which one in a hundred windows may lose a good one.
    """
    k, r = group.ray.shape
    gap, variance = expected
    held = np.asarray(np.linalg.inv(variance), float)
    pulled = (held @ gap[:, :, None])[:, :, 0]
    total = np.maximum(np.einsum("ki,ki->k", gap, pulled), 0.0)
    level = 1 - ALPHA / np.maximum(number, 1)[group.window]
    limit = _quantiles(level, 2 * r - 3)
    start = RayDecisions(
        group, np.ones((k, r)), np.sqrt(total), np.sqrt(limit), np.full((k, r, 2), np.nan), np.zeros(k, np.intp)
    )
    bad = np.flatnonzero(~(total <= limit))
    doubted = _Doubted(bad, group.basis[bad], held[bad], pulled[bad], total[bad], level[bad])
    return _of_two(start, bad, gap) if r == FEWEST else _of_several(start, doubted)


def _quantiles(level: Floats, freedom: int) -> Floats:
    levels, inverse = np.unique(level, return_inverse=True)
    found: Floats = np.array([chi2_quantile(float(each), freedom) for each in levels])[inverse]
    return found


def _of_two(start: RayDecisions, bad: Numbers, gap: Floats) -> RayDecisions:
    """Leave both rays of points on two photos out; the y parallax is all that is known of the error."""
    weight, kind, size = start.weight.copy(), start.kind.copy(), start.size.copy()
    weight[bad], kind[bad] = 0.0, PAIR
    size[bad, :, 0] = 0.0
    size[bad, :, 1] = np.sqrt(0.5) * gap[bad, :1] * [[1.0, -1.0]]
    return replace(start, weight=weight, kind=kind, size=size)


def _of_several(start: RayDecisions, doubted: _Doubted) -> RayDecisions:
    """Look for the smallest sets of rays without which the others agree."""
    r = start.group.ray.shape[1]
    weight, kind, size = start.weight.copy(), start.kind.copy(), start.size.copy()
    for out in range(1, r - 1):
        if not len(doubted.number):
            break
        sets = list(combinations(range(r), out))
        tried = [doubted.without(rays) for rays in sets]
        left = np.column_stack([squares for squares, _ in tried])
        possible = left <= _quantiles(doubted.level, 2 * (r - out) - 3)[:, None]
        order = np.sort(left, axis=1)
        clear = (possible.sum(axis=1) == 1) | (order[:, 1] - order[:, 0] > BETTER)
        found = np.asarray(possible.any(axis=1), bool)
        for place in np.flatnonzero(found).tolist():
            point = doubted.number[place]
            if clear[place]:
                best = int(left[place].argmin())
                size[point, list(sets[best])] = tried[best][1][place]
                weight[point, list(sets[best])] = 0.0
            else:
                size[point] = _apparent(sets, np.where(possible[place], left[place], np.inf), tried, place)
                weight[point] = 0.0
            kind[point] = RAY if clear[place] else RAYS
        if out == r - 2:
            for place in np.flatnonzero(~found).tolist():
                size[doubted.number[place]] = _apparent(sets, left[place], tried, place)
        doubted = doubted.take(~found)
    weight[doubted.number], kind[doubted.number] = 0.0, NONE
    return replace(start, weight=weight, kind=kind, size=size)


def _apparent(sets: list[tuple[int, ...]], left: Floats, tried: list[tuple[Floats, Floats]], place: int) -> Floats:
    """Error that each ray of a point would have in the likeliest set with it; 0 for a ray in none that is possible."""
    size = np.zeros((max(max(rays) for rays in sets) + 1, 2))
    for number in np.argsort(-left, kind="stable").tolist():
        if np.isfinite(left[number]):
            size[list(sets[number])] = tried[number][1][place]
    return size
