"""The robust estimator of the program: weights that fall with the residual, in units of a scale from the median.

Least squares follow a gross error; an adjustment repeated with falling weights comes to rest on the observations that
agree. It is a start: what the tests then find wrong is left out, and the rest adjusted by least squares.

Source: the weights of [Krarup 1980]; the scale is the median absolute deviation [Hampel 1974].

Relative orientation with these weights on y parallaxes is not pulled away by a fifth of wrong points. Where more points
disagree than a search can explain, it starts from the best of many sets of five points [Rousseeuw 1984]. Best is the
least sum of log(1 + e) over the residuals e: the median of the source knows half of them, and a single far point that
turns a pair makes half of the others fit by chance.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Floats, Numbers
from photostrip.statistics import SIGMA_FROM_MEDIAN
from photostrip.strip import relative_orientation
from photostrip.strip.relative_orientation import MINIMUM_POINTS, Pairs

TUNING = 3.0  # standard deviations up to which an observation keeps its weight [Krarup 1980]
# standard deviation of a scale from the median of n normal residuals, over the scale, times sqrt(n) [Hampel 1974]
MEDIAN_SPREAD = 1.1664
SMALLEST_WEIGHT = 1e-5  # that everything keeps, so that unknowns stay determined


def falling_weights(size: Floats) -> Floats:
    """Factors of the weights, 1 up to three standard deviations and exp(1 - e^2) at e times three.

    size: absolute residuals in units of their scale.
    """
    with np.errstate(over="ignore"):
        weight: Floats = np.exp(1.0 - np.maximum(size / TUNING, 1.0) ** 2)
    return np.maximum(weight, SMALLEST_WEIGHT)


def medians(values: Floats, weight: Floats, group: Numbers, groups: int) -> Floats:
    """Lower weighted median of each group; NaN for a group whose weights are all zero."""
    count = np.bincount(group, minlength=groups)
    order = np.lexsort((values, group))
    table, weights = np.zeros((2, groups, int(count.max(initial=0)) + 1))
    place = np.arange(len(values)) - (np.cumsum(count) - count)[group[order]]
    table[group[order], place], weights[group[order], place] = values[order], weight[order]
    total = np.cumsum(weights, axis=1)
    middle = (total < total[:, -1:] / 2).sum(axis=1)
    return np.where(total[:, -1] > 0, table[np.arange(groups), middle], np.nan)


def scales(size: Floats, weight: Floats, group: Numbers, groups: int) -> Floats:
    """Estimate the standard deviation of each group from its median absolute residual; NaN for a group without any."""
    return SIGMA_FROM_MEDIAN * medians(size, (weight > 0).astype(float), group, groups)


ROBUST_ITERATIONS = 10  # what follows is least squares
SETS = 300  # with a third of the points wrong, 13 % of the sets of five are right


class RobustElements(NamedTuple):
    """Pairs oriented with falling weights."""

    elements: Floats  # (p, 5), rad
    scale: Floats  # (p,): standard deviation of a y parallax of weight one from the median residual, mm


def start_values(pairs: Pairs) -> Floats:
    """Elements to start from that single wrong points do not turn: the median parallax runs along x.

    Where the points say so, by more than the first azimuth that is tried again, the right photo is turned beforehand.
    """
    slope = _slopes(pairs)
    slope[np.abs(np.angle(slope)) < relative_orientation.RETRY_AZIMUTHS[0]] = 1.0
    back = (pairs.right @ np.array([1.0, 1j])) / slope[pairs.pair]
    shift, counts = pairs.left - np.column_stack([back.real, back.imag]), (pairs.weight > 0).astype(float)
    middle = [medians(shift[:, axis], counts, pairs.pair, pairs.size) for axis in (0, 1)]
    start = np.zeros((pairs.size, 5))
    start[:, 1] = -np.arctan2(middle[1], middle[0])
    start[:, 4] = start[:, 1] - np.angle(slope)
    return start


def _slopes(pairs: Pairs) -> NDArray[np.complex128]:
    """Turn and scale from the left to the right photo of each pair, as complex numbers.

    They are those of a plane similarity z_right = slope z_left + shift, with weights that fall with the residual.
    """
    left, right = (xy @ np.array([1.0, 1j]) for xy in (pairs.left, pairs.right))
    weight = pairs.weight
    slope = np.ones(pairs.size, complex)
    for _ in range(ROBUST_ITERATIONS):
        total = np.maximum(pairs.sums(weight), relative_orientation.RIDGE)
        off = [z - (pairs.sums(weight * z) / total)[pairs.pair] for z in (left, right)]
        slope = pairs.sums(weight * np.conj(off[0]) * off[1])
        slope /= np.maximum(pairs.sums(weight * np.abs(off[0]) ** 2), relative_orientation.RIDGE)
        size = np.abs(off[1] - slope[pairs.pair] * off[0])
        scale = np.maximum(scales(size, pairs.weight, pairs.pair, pairs.size), relative_orientation.RIDGE)
        weight = pairs.weight * falling_weights(size / scale[pairs.pair])
    slope[slope == 0] = 1.0
    return slope


def solve(start: Floats, pairs: Pairs, sigma: Floats) -> RobustElements:
    """Orient pairs with weights that fall with the residual, the points in front of the cameras.

    start: (p, 5), elements to start from, radians.
    sigma: (p,), a-priori standard deviation of a y parallax of weight one, mm; the scale is not smaller.
    """
    elements = start.copy()
    for _ in range(ROBUST_ITERATIONS):
        with np.errstate(all="ignore"):
            q, jacobian = relative_orientation.linearised_parallaxes(elements, pairs)
        q = np.where(np.isfinite(q), q, 1e6)
        jacobian = np.where(np.isfinite(jacobian), jacobian, 0.0)
        size = np.abs(q) * np.sqrt(pairs.weight)
        scale = np.maximum(sigma, scales(size, pairs.weight, pairs.pair, pairs.size))
        weight = pairs.weight * falling_weights(size / scale[pairs.pair])
        change, _ = relative_orientation.gauss_newton_steps(
            relative_orientation.Linearised(q, jacobian),
            replace(pairs, weight=weight),
            relative_orientation.RIDGE,
            relative_orientation.LARGEST_STEP,
        )
        elements = elements + change
    return RobustElements(relative_orientation.facing(relative_orientation.reduced_angles(elements), pairs)[0], scale)


def orient_robustly(pairs: Pairs, sigma: Floats, few: int) -> RobustElements:
    """Orient pairs of which some points are wrong, from the median parallax.

    Where more than ``few`` points disagree with the outcome, weights fall again from the best set of five points, and
    the elements are kept that most points agree with.
    """
    elements, scale = solve(start_values(pairs), pairs, sigma)
    todo = np.flatnonzero(pairs.sums((pairs.weight > 0).astype(float)) - _agreeing(elements, pairs, sigma) > few)
    if len(todo):
        part = pairs.take(todo)
        other = solve(_best_sets(elements[todo], part, sigma[todo]), part, sigma[todo])
        common = np.minimum(scale[todo], other.scale)
        better = _agreeing(other.elements, part, common) > _agreeing(elements[todo], part, common)
        elements[todo[better]], scale[todo[better]] = other.elements[better], other.scale[better]
    return RobustElements(elements, scale)


def _agreeing(elements: Floats, pairs: Pairs, sigma: Floats) -> Floats:
    """Count the points of each pair that agree with its elements and lie in front of its cameras."""
    with np.errstate(all="ignore"):
        size = np.abs(relative_orientation.y_parallaxes(elements, pairs)) * np.sqrt(pairs.weight) / sigma[pairs.pair]
        good = (size <= TUNING) & (pairs.weight > 0) & relative_orientation.in_front_of_cameras(elements, pairs)
    return pairs.sums(good.astype(float))


def _best_sets(elements: Floats, pairs: Pairs, sigma: Floats) -> Floats:
    """Elements by the set of five points, solved to the first order, that leaves the smallest parallaxes."""
    with np.errstate(all="ignore"):
        q, jacobian = relative_orientation.linearised_parallaxes(elements, pairs)
    result = elements.copy()
    for number in range(pairs.size):
        rows = np.flatnonzero((pairs.pair == number) & (pairs.weight > 0) & np.isfinite(q))
        # an order of the points that does not depend on that of the table
        rows = rows[np.lexsort((pairs.left[rows, 1], pairs.left[rows, 0]))]
        if len(rows) > MINIMUM_POINTS:
            root = np.sqrt(pairs.weight[rows]) / sigma[number]
            result[number] += _best_step(jacobian[:, rows].T * root[:, None], q[rows] * root)
    return result


def _best_step(design: Floats, residual: Floats) -> Floats:
    """Change of the elements by which most residuals become small; zero when no set gives one."""
    n = len(residual)
    chance = np.random.default_rng(n).random((SETS, n))
    draws = np.argpartition(chance, MINIMUM_POINTS, axis=1)[:, :MINIMUM_POINTS]
    draws = np.take_along_axis(draws, np.take_along_axis(chance, draws, axis=1).argsort(axis=1), axis=1)
    steps = -(np.linalg.pinv(design[draws]) @ residual[draws][:, :, None])[:, :, 0]
    steps = np.where(np.abs(steps).max(axis=1, keepdims=True) < relative_orientation.LARGEST_STEP, steps, 0.0)
    left = np.log1p(np.abs(residual + steps @ design.T)).sum(axis=1)
    return np.asarray(steps[left.argmin()], float)
