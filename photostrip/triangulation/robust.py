"""Relative orientation that a fifth of wrong points does not pull away: reweighted from iteration to iteration.

Source: the weights of the absolute residuals, then of Welsch; derived, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation import relative

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.relative import Pairs

    Floats = NDArray[np.float64]

NORMAL = 1.4826  # median of |x| to standard deviation, of a normal distribution
ABSOLUTE_STEPS = 30
WELSCH_STEPS = 15
WELSCH = 2.985  # standard deviations; 95 % efficient without gross errors
LONGEST = 0.3  # rad, of one step
AGREE = 4.0  # standard deviations
FEW = 3  # points that may disagree before other elements are looked for
MINIMAL = 5  # points of a set
SETS = 300  # with a third of the points wrong, 13 % of the sets are right
SURE_OF_SET = 2.0  # a set of five determines the elements worse than all points do
DEGENERATE = 1e-7  # determinant of a set, columns of unit length over the pair
SETTLED = 1e-6  # rad; what follows is least squares


def median_by_pair(values: Floats, pairs: Pairs, use: NDArray[np.bool_]) -> Floats:
    """Median of the values of every pair.

    Parameters
    ----------
    values : ndarray, shape (m,)
        Values by row.
    pairs : Pairs
        The pairs.
    use : ndarray of bool, shape (m,)
        Rows that count.

    Returns
    -------
    ndarray, shape (p,)
        Lower medians; NaN for a pair without a value.
    """
    count = pairs.sums(use.astype(float)).astype(np.intp)
    order = np.lexsort((np.where(use, values, np.inf), pairs.pair))
    middle = pairs.starts + np.maximum(count - 1, 0) // 2
    return np.where(count > 0, values[order[middle]], np.nan)


def start_values(pairs: Pairs) -> Floats:
    """Elements to start from that single wrong points do not turn: the median parallax runs along x.

    Parameters
    ----------
    pairs : Pairs
        Measurements.

    Returns
    -------
    ndarray, shape (p, 5)
        (0, kappa0, 0, 0, kappa0) in radians.
    """
    used = pairs.weight > 0
    shift = pairs.left - pairs.right
    start = np.zeros((pairs.size, 5))
    middle = [median_by_pair(shift[:, axis], pairs, used) for axis in (0, 1)]
    start[:, 1] = start[:, 4] = -np.arctan2(middle[1], middle[0])
    return start


def solve(start: Floats, pairs: Pairs, sigma: Floats) -> tuple[Floats, Floats]:
    """Orient pairs with weights that fall with the residual.

    Parameters
    ----------
    start : ndarray, shape (p, 5)
        Elements to start from, radians.
    pairs : Pairs
        Measurements; weight 0 leaves a point out.
    sigma : ndarray, shape (p,)
        A-priori standard deviation of a y parallax of weight one, mm.

    Returns
    -------
    elements : ndarray, shape (p, 5)
        Elements in radians.
    scale : ndarray, shape (p,)
        Standard deviation of a y parallax of weight one from the median residual, mm; at least the one given.
    """
    elements = start.copy()
    scale = sigma
    given = pairs.weight
    absolute = True
    for step in range(ABSOLUTE_STEPS + WELSCH_STEPS):
        with np.errstate(all="ignore"):
            q, jacobian = relative.linearised(elements, pairs)
        q = np.where(np.isfinite(q), q, 1e6)
        jacobian = np.where(np.isfinite(jacobian), jacobian, 0.0)
        size = np.abs(q) * np.sqrt(given)
        if absolute:
            weight = given / np.maximum(size / sigma[pairs.pair], 1.0)
        else:
            scale = np.maximum(sigma, NORMAL * median_by_pair(size, pairs, given > 0))
            weight = given * np.exp(-((size / (WELSCH * scale[pairs.pair])) ** 2))
        change = _step(q, jacobian, replace(pairs, weight=weight))
        elements = elements + change
        still = np.abs(change).max() < SETTLED
        if still and not absolute:
            break
        absolute = absolute and not still and step + 1 < ABSOLUTE_STEPS
    return (elements + np.pi) % (2 * np.pi) - np.pi, scale


def consensus(elements: Floats, pairs: Pairs, sigma: Floats) -> Floats:
    """Look for elements that more points agree on, in pairs where many do not agree.

    Reweighting can settle between the good points and a group of wrong ones. Minimal sets of five points, spread over
    all points of the pair, are solved to the first order; the set with which most points agree is refined.

    Parameters
    ----------
    elements : ndarray, shape (p, 5)
        Elements in radians.
    pairs : Pairs
        Measurements; weight 0 leaves a point out.
    sigma : ndarray, shape (p,)
        Standard deviation of a y parallax of weight one, mm.

    Returns
    -------
    ndarray, shape (p, 5)
        Elements in radians; those of pairs in which nothing better was found are unchanged.
    """
    result = elements.copy()
    with np.errstate(all="ignore"):
        q, jacobian = relative.linearised(elements, pairs)
    root = np.sqrt(pairs.weight) / sigma[pairs.pair]
    disagree = ~(np.abs(q) * root <= AGREE) & (pairs.weight > 0)
    for number in np.flatnonzero(pairs.sums(disagree.astype(float)) > FEW):
        rows = np.flatnonzero((pairs.pair == number) & (pairs.weight > 0) & np.isfinite(q))
        # an order of the points that does not depend on that of the table
        rows = rows[np.lexsort((pairs.left[rows, 1], pairs.left[rows, 0]))]
        step = _largest_agreement(jacobian[:, rows].T * root[rows, None], q[rows] * root[rows])
        result[number] += step
    return result


def _largest_agreement(design: Floats, residual: Floats) -> Floats:
    """Change of the elements with which most points agree; zero when none is better than no change."""
    n = len(residual)
    best, best_count = np.zeros(5), int((np.abs(residual) <= AGREE).sum())
    if n <= MINIMAL:
        return best
    draws = np.argsort(np.random.default_rng(n).random((SETS, n)), axis=1)[:, :MINIMAL]
    matrix = design[draws]
    scale = np.linalg.norm(design, axis=0)
    regular = np.abs(np.linalg.det(matrix / scale)) > DEGENERATE
    steps = -np.linalg.solve(matrix[regular], residual[draws[regular]][:, :, None])[:, :, 0]
    steps = steps[np.abs(steps).max(axis=1) < LONGEST]
    if not len(steps):
        return best
    left = np.abs(residual + steps @ design.T)
    order = (left <= SURE_OF_SET * AGREE).sum(axis=1)
    step = steps[order.argmax()]
    for _ in range(3):
        agree = np.abs(residual + design @ step) <= SURE_OF_SET * AGREE
        step = -np.linalg.lstsq(design[agree], residual[agree], rcond=None)[0]
    count = int((np.abs(residual + design @ step) <= AGREE).sum())
    return np.asarray(step, float) if count > best_count else best


def _step(q: Floats, jacobian: Floats, pairs: Pairs) -> Floats:
    """One Gauss-Newton step of all pairs, shortened when long."""
    diagonal = np.arange(5)
    normal = relative.normal_matrices(jacobian, pairs)
    scale = 1 / np.sqrt(np.maximum(normal[:, diagonal, diagonal], 1e-300))
    normal *= scale[:, :, None] * scale[:, None, :]
    normal[:, diagonal, diagonal] += 1e-9
    right = pairs.sums(jacobian * (pairs.weight * q)).T * scale
    step = -np.linalg.solve(normal, right[:, :, None])[:, :, 0] * scale
    largest = np.abs(step).max(axis=1)
    step *= np.minimum(1.0, LONGEST / np.maximum(largest, LONGEST))[:, None]
    return np.asarray(step, float)
