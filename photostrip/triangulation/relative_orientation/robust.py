"""Relative orientation that a fifth of wrong points does not pull away: reweighted from iteration to iteration.

Source: the weights of the absolute residuals, then of Welsch; derived, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import SIGMA_FROM_MEDIAN
from photostrip.triangulation.relative_orientation.solution import (
    Linearised,
    gauss_newton_steps,
    in_front_of_cameras,
    linearised_parallaxes,
    reduced_angles,
    y_parallaxes,
)

if TYPE_CHECKING:
    from photostrip.arrays import Flags, Floats
    from photostrip.triangulation.relative_orientation.pairs import Pairs


ABSOLUTE_STEPS = 30
WELSCH_STEPS = 15
WELSCH_SIGMAS = 2.985  # standard deviations; 95 % efficient without gross errors
LONGEST_STEP = 0.3  # rad
RIDGE = 1e-9  # relative, of the normal matrices
AGREEING_SIGMAS = 4.0
FEW_POINTS = 3  # points that may disagree before other elements are looked for
SET_POINTS = 5  # points of a set
SETS = 300  # with a third of the points wrong, 13 % of the sets are right
SHARE_OF_SET = 0.65  # share of the points that a set must suit
DEGENERATE_SET = 1e-7  # determinant of a set, columns of unit length over the pair
CONVERGED = 1e-6  # rad; what follows is least squares


def median_by_pair(values: Floats, pairs: Pairs, use: Flags) -> Floats:
    """Lower median of the values of every pair over the rows that count; NaN for a pair without any."""
    count = pairs.sums(use.astype(float)).astype(np.intp)
    place = np.arange(len(values)) - pairs.starts[pairs.pair]
    table = np.full((pairs.size, int(place.max(initial=0)) + 1), np.inf)
    table[pairs.pair, place] = np.where(use, values, np.inf)
    table.sort(axis=1)
    return np.where(count > 0, table[np.arange(pairs.size), np.maximum(count - 1, 0) // 2], np.nan)


def start_values(pairs: Pairs) -> Floats:
    """Elements to start from that single wrong points do not turn: the median parallax runs along x."""
    used = pairs.weight > 0
    shift = pairs.left - pairs.right
    start = np.zeros((pairs.size, 5))
    middle = [median_by_pair(shift[:, axis], pairs, used) for axis in (0, 1)]
    start[:, 1] = start[:, 4] = -np.arctan2(middle[1], middle[0])
    return start


def solve(start: Floats, pairs: Pairs, sigma: Floats, *, near: bool = False) -> tuple[Floats, Floats]:
    """Orient pairs with weights that fall with the residual.

    start: (p, 5), elements to start from, radians.
    sigma: (p,), a-priori standard deviation of a y parallax of weight one, mm.
    near: whether the start agrees with most points already: absolute residuals are not minimised first.
    Returns elements, (p, 5), and scale, (p,): standard deviation of a y parallax of weight one from the median
        residual, mm; at least the one given.
    """
    elements = start.copy()
    scale = sigma
    given = pairs.weight
    absolute = not near
    for step in range(ABSOLUTE_STEPS + WELSCH_STEPS):
        with np.errstate(all="ignore"):
            q, jacobian = linearised_parallaxes(elements, pairs)
        q = np.where(np.isfinite(q), q, 1e6)
        jacobian = np.where(np.isfinite(jacobian), jacobian, 0.0)
        size = np.abs(q) * np.sqrt(given)
        if absolute:
            weight = given / np.maximum(size / sigma[pairs.pair], 1.0)
        else:
            scale = np.maximum(sigma, SIGMA_FROM_MEDIAN * median_by_pair(size, pairs, given > 0))
            weight = given * np.exp(-((size / (WELSCH_SIGMAS * scale[pairs.pair])) ** 2))
        change, _ = gauss_newton_steps(Linearised(q, jacobian), replace(pairs, weight=weight), RIDGE, LONGEST_STEP)
        elements = elements + change
        still = np.abs(change).max() < CONVERGED
        if still and not absolute:
            break
        absolute = absolute and not still and step + 1 < ABSOLUTE_STEPS
    return reduced_angles(elements), scale


def consensus(elements: Floats, pairs: Pairs, sigma: Floats) -> Floats:
    """Look for elements that more points agree on, in pairs where many do not agree; other pairs keep theirs.

    Reweighting can end between the good points and a group of wrong ones. Minimal sets of five points, spread over all
    points of the pair, are solved to the first order; the set with which most points agree is refined. `sigma` is the
    standard deviation of a y parallax of weight one in each pair.
    """
    before = _agreeing(elements, pairs, sigma)
    todo = np.flatnonzero(pairs.sums((pairs.weight > 0).astype(float)) - before > FEW_POINTS)
    if not len(todo):
        return elements
    part = pairs.take(todo)
    start = elements[todo].copy()
    with np.errstate(all="ignore"):
        q, jacobian = linearised_parallaxes(start, part)
    root = np.sqrt(part.weight) / sigma[todo][part.pair]
    for number in range(len(todo)):
        rows = np.flatnonzero((part.pair == number) & (part.weight > 0) & np.isfinite(q))
        # an order of the points that does not depend on that of the table
        rows = rows[np.lexsort((part.left[rows, 1], part.left[rows, 0]))]
        start[number] += _best_set(jacobian[:, rows].T * root[rows, None], q[rows] * root[rows])
    other, _ = solve(start, part, sigma[todo], near=True)
    better = _agreeing(other, part, sigma[todo]) > before[todo]
    result = elements.copy()
    result[todo[better]] = other[better]
    return result


def _agreeing(elements: Floats, pairs: Pairs, sigma: Floats) -> Floats:
    """Count the points of each pair that agree with its elements."""
    with np.errstate(all="ignore"):
        size = np.abs(y_parallaxes(elements, pairs)) * np.sqrt(pairs.weight) / sigma[pairs.pair]
        good = (size <= AGREEING_SIGMAS) & (pairs.weight > 0) & in_front_of_cameras(elements, pairs)
    return pairs.sums(good.astype(float))


def _best_set(design: Floats, residual: Floats) -> Floats:
    """Change of the elements by which most residuals become small; zero when there is none."""
    n = len(residual)
    if n <= SET_POINTS:
        return np.zeros(5)
    draws = np.argsort(np.random.default_rng(n).random((SETS, n)), axis=1)[:, :SET_POINTS]
    matrix = design[draws]
    regular = np.abs(np.linalg.det(matrix / np.linalg.norm(design, axis=0))) > DEGENERATE_SET
    steps = -np.linalg.solve(matrix[regular], residual[draws[regular]][:, :, None])[:, :, 0]
    steps = steps[np.abs(steps).max(axis=1, initial=0.0) < LONGEST_STEP]
    if not len(steps):
        return np.zeros(5)
    left = np.sort(np.abs(residual + steps @ design.T), axis=1)
    return np.asarray(steps[left[:, int(SHARE_OF_SET * (n - 1))].argmin()], float)
