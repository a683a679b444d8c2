"""Minimum-deletion search: the fewest points whose removal brings a pair within its expected scatter.

What the sum of squares becomes without a set K of points follows from one solution with all points: with
M = I - J (J^T J)^-1 J^T and residuals v the reduced sum is v^T v - v_K^T (M_KK)^-1 v_K. So all sets of up to three
points are looked at for the price of one orientation, and two equal errors in one zone, which hide each other from
every test of single residuals, come out together.

Source: derived; [004a] describes the situation that needs it. See docs/sources.md.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.bundle.quality.reliability import UNCONTROLLED

if TYPE_CHECKING:
    from photostrip.arrays import Floats, Numbers


LARGEST = 3  # points of a set
TRIPLES_OF = 24  # points from which sets of three are formed; those of the best sets of two


@lru_cache(maxsize=256)
def subsets(n: int, k: int) -> Numbers:
    """All sets of k of n numbers, shape (C(n, k), k)."""
    return np.array(list(combinations(range(n), k)), np.intp).reshape(-1, k)


def gains(residuals: Floats, matrix: Floats, sets: Numbers, least: float = UNCONTROLLED) -> Floats:
    """Compute what the sum of squares loses when sets of points are taken out: v_K^T (M_KK)^-1 v_K, shape (g, s).

    -inf for a set whose errors cannot be told from a change of the elements.

    residuals: (g, n), residuals v of g adjustments of n points each, in units of their a-priori standard deviation.
    matrix: (g, n, n), the matrices M of residuals from errors.
    sets: (s, k) or (g, s, k), sets of k = 1, 2 or 3 points, the same for all adjustments or different ones.
    least: redundancy, in the mean of the set, from which on something can be told.
    """
    number = np.arange(len(residuals))[:, None]
    place = np.broadcast_to(sets, (len(residuals), *sets.shape[-2:]))
    k = place.shape[2]
    v = [residuals[number, place[:, :, i]] for i in range(k)]
    m = {(i, j): matrix[number, place[:, :, i], place[:, :, j]] for i in range(k) for j in range(i, k)}
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant, form = _form(v, m)
        value: Floats = np.where(determinant > least**k, form / determinant, -np.inf)
    return value


def _form(v: list[Floats], m: dict[tuple[int, int], Floats]) -> tuple[Floats, Floats]:
    """Return the determinant of M_KK and v^T adj(M_KK) v, by Cramer's rule."""
    if len(v) == 1:
        return m[0, 0], v[0] ** 2
    if len(v) == 2:
        form = v[0] ** 2 * m[1, 1] - 2 * v[0] * v[1] * m[0, 1] + v[1] ** 2 * m[0, 0]
        return m[0, 0] * m[1, 1] - m[0, 1] ** 2, form
    a, b, c, d, e, f = m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2]
    aa, bb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    dd, ee, ff = a * f - c * c, b * c - a * e, a * d - b * b
    x, y, z = v
    form = x * (aa * x + 2 * (bb * y + cc * z)) + y * (dd * y + 2 * ee * z) + ff * z * z
    return a * aa + b * bb + c * cc, form


def search(residuals: Floats, matrix: Floats, target: Floats) -> list[Numbers]:
    """Find for each adjustment the smallest set whose removal brings the sum of squares below its target.

    Empty when no set does it. ``target`` (k,) is the largest sum allowed after one to k points are gone, -inf where so
    many may not go; k is three at most.
    """
    total = (residuals**2).sum(axis=1)
    found = [np.zeros(0, np.intp) for _ in range(len(residuals))]
    todo = np.arange(len(residuals))
    for k in range(1, len(target) + 1):
        if not len(todo) or residuals.shape[1] < k:
            break
        v, m = residuals[todo], matrix[todo]
        sets = subsets(residuals.shape[1], k) if k < LARGEST else _triples(v, m)
        gain = gains(v, m, sets)
        best = gain.argmax(axis=1)
        rows = np.arange(len(todo))
        enough = total[todo] - gain[rows, best] <= target[k - 1]
        for row in np.flatnonzero(enough):
            found[todo[row]] = sets[best[row]] if sets.ndim == 2 else sets[row, best[row]]
        todo = todo[~enough]
    return found


def _triples(residuals: Floats, matrix: Floats) -> Numbers:
    """Form sets of three, of all points or of those that stand in the best sets of two."""
    g, n = residuals.shape
    if n <= TRIPLES_OF:
        return subsets(n, LARGEST)
    pairs = subsets(n, 2)
    gain = gains(residuals, matrix, pairs)
    best = np.full((g, n), -np.inf)
    rows = np.arange(g)[:, None]
    for side in (0, 1):
        np.maximum.at(best, (rows, pairs[:, side]), gain)
    chosen = np.sort(np.argsort(-best, axis=1, kind="stable")[:, :TRIPLES_OF], axis=1)
    triples: Numbers = chosen[:, subsets(TRIPLES_OF, LARGEST)]
    return triples
