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

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.rejection import UNCONTROLLED

LARGEST_SET = 3  # points of a set
LIKELIER = 9.0  # difference of two sums of squares that tells sets apart: a likelihood ratio of 90
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


def search(residuals: Floats, basis: Floats, target: Floats) -> list[Numbers]:
    """Find for each adjustment the smallest set whose removal brings the sum of squares below its target.

    Empty when no set does it. Only those points are formed into sets that may stand in one that does.

    residuals: (g, n), as of ``gains``.
    basis: (g, n, u), orthonormal columns Q of the design, M = I - Q Q^T.
    target: (k,), k <= 3: the largest sum allowed after one to k points are gone, -inf where so many may not go.
    """
    squares, (groups, n) = residuals**2, residuals.shape
    order = np.argsort(-squares, axis=1, kind="stable")
    excess = squares.sum(axis=1)[:, None] - target
    count = _possible(np.take_along_axis(squares, order, axis=1), -np.sort(-(basis**2).sum(axis=2), axis=1), excess)
    found, missing = [np.zeros(0, np.intp)] * groups, np.ones(groups, bool)
    for k in range(1, min(len(target), n) + 1):
        todo = np.flatnonzero(missing & (count[:, k - 1] >= k))
        if not len(todo):
            continue
        places = np.sort(order[todo, : count[todo, k - 1].max()], axis=1)
        v = np.take_along_axis(residuals[todo], places, axis=1)
        q = np.take_along_axis(basis[todo], places[:, :, None], axis=1)
        m = np.eye(places.shape[1]) - q @ q.transpose(0, 2, 1)
        sets = subsets(places.shape[1], k) if k < LARGEST_SET else _triples(v, m)
        gain = gains(v, m, sets)
        best = gain.argmax(axis=1)
        rows = np.arange(len(todo))
        enough = gain[rows, best] >= excess[todo, k - 1]
        for row in np.flatnonzero(enough):
            found[todo[row]] = places[row, sets[best[row]] if sets.ndim == 2 else sets[row, best[row]]]
        missing[todo] = ~enough
    return found


def _possible(squares: Floats, shares: Floats, excess: Floats) -> Numbers:
    """How many of the largest squared residuals may stand in sets of one to k that gain as much as needed, (g, k).

    With q the share of an observation in the elements, the smallest eigenvalue of M_KK is at least 1 - sum of q_K, so
    that a set gains v_K^T v_K / (1 - sum of q_K) at most.

    squares, shares: (g, n), each in descending order.
    excess: (g, k), what the sets have to gain.
    """
    most = excess.shape[1]
    before = np.cumsum(squares[:, :most], axis=1)[:, : squares.shape[1]] - squares[:, :most]
    needed = np.maximum(1.0 - np.cumsum(shares[:, :most], axis=1), 0.0) * excess[:, : squares.shape[1]]
    # the others of a set are the largest at best
    return np.asarray((squares[:, :, None] >= (needed - before)[:, None]).sum(axis=1), np.intp)


def _triples(residuals: Floats, matrix: Floats) -> Numbers:
    """Form sets of three, of all points or of those that stand in the best sets of two."""
    g, n = residuals.shape
    if n <= TRIPLES_OF:
        return subsets(n, LARGEST_SET)
    pairs = subsets(n, 2)
    gain = gains(residuals, matrix, pairs)
    best = np.full((g, n), -np.inf)
    rows = np.arange(g)[:, None]
    for side in (0, 1):
        np.maximum.at(best, (rows, pairs[:, side]), gain)
    chosen = np.sort(np.argsort(-best, axis=1, kind="stable")[:, :TRIPLES_OF], axis=1)
    triples: Numbers = chosen[:, subsets(TRIPLES_OF, LARGEST_SET)]
    return triples
