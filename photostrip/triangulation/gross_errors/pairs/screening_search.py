"""Gross errors of pairs by global test: robust start, then the smallest set of points that explains the misfit.

A pair is looked at only when its sum of squared parallaxes, or a single one of them, does not belong to the scatter
that the measurements should have. What that scatter is, is decided first: the stated one, unless the residuals of the
whole strip contradict it.

Source: derived; the order of work and all limits are chosen here, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import SIGMA_FROM_MEDIAN
from photostrip.triangulation.gross_errors.pairs import deletion, pair_global_test
from photostrip.triangulation.gross_errors.pairs.pair_global_test import (
    failing,
    global_limits,
    largest_limits,
    standardised,
)
from photostrip.triangulation.gross_errors.pairs.zones import EMPTY_ZONES, MINIMUM_LEFT, ZONES, Support
from photostrip.triangulation.relative_orientation import robust
from photostrip.triangulation.relative_orientation.orientation import assess_pairs, orient_again
from photostrip.triangulation.relative_orientation.pairs import MINIMUM_POINTS
from photostrip.triangulation.relative_orientation.solution import (
    in_front_of_cameras,
    linearised_parallaxes,
    y_parallaxes,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.relative_orientation.pairs import Pairs

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

SMALLEST_REDUNDANCY = 0.05  # a residual with less says little about the scatter
MEDIAN_SCATTER = 1.17  # sd of a standard deviation from the median of n residuals, times sqrt(n)
PROOF = 3.0  # of those, by which a scatter must exceed the one in force
CONTRADICTION = 1.25  # ratio of the scatter found to the one stated that is worth a change
UNCHANGED = 1.05  # ratio of scatters that makes no difference
FEW = 0.35  # share of a pair's points that may go before what is left says nothing about the scatter
ENOUGH = 5.0  # redundancy below which one error cannot be told from a larger scatter
SMALLEST_SIGMA = 1e-9  # mm
GROSS = 4.0  # standard deviations; residuals from the robust start beyond it are wrong points
PAIRS_AT_ONCE = 64
HALF = 0.5
MILD = 10.0  # root of the sum of squares in units of its variance


@dataclass(frozen=True, eq=False)
class ParallaxScatter:
    """Standard deviations of a y parallax of weight one that the tests are made with."""

    stated: float  # from the stated standard deviation of image coordinates, mm
    # from the residuals of all pairs of the strip, robust, mm; NaN when they did not contradict the stated one
    found: float
    by_pair: Floats  # (p,): those in force, mm


@dataclass(frozen=True, eq=False)
class DeletedPoints:
    """What a search took out."""

    orientation: Orientation
    rows: Numbers  # rows taken out, in order, re-admitted ones included
    tests: tuple[str, ...]
    values: Floats
    limits: Floats


# ---------------------------------------------------------------------------------------------- robust start


def robust_start(orientation: Orientation, todo: Numbers, sigma: Floats) -> tuple[Floats, Floats]:
    """Orient some pairs with falling weights.

    They start from the median parallax and, where that fails, from their present elements.

    Parameters
    ----------
    todo : ndarray of int
        Pairs to orient, ascending.
    sigma : ndarray, shape (p,)
        Standard deviation of a y parallax of weight one, mm.

    Returns
    -------
    elements : ndarray, shape (t, 5)
        Elements in radians.
    scale : ndarray, shape (t,)
        Scatter of the residuals, mm; see ``robust.solve``.
    """
    part = orientation.pairs.take(todo)
    elements, scale = robust.solve(robust.start_values(part), part, sigma[todo])
    share = _share(elements, part, scale)
    again = np.flatnonzero((share <= HALF) | (scale > GROSS * sigma[todo]))
    if len(again):
        rest = part.take(again)
        present = np.nan_to_num(orientation.elements[todo[again]])
        other, spread = robust.solve(present, rest, sigma[todo[again]])
        better = (spread < scale[again]) & (_share(other, rest, spread) > HALF)
        elements[again[better]], scale[again[better]] = other[better], spread[better]
    elements = robust.consensus(elements, part, sigma[todo])
    return elements, scale


def _share(elements: Floats, pairs: Pairs, scale: Floats) -> Floats:
    """Share of the points that lie in front and belong to the scatter."""
    with np.errstate(all="ignore"):
        fits = np.abs(y_parallaxes(elements, pairs)) * np.sqrt(pairs.weight) < GROSS * scale[pairs.pair]
        good = fits & in_front_of_cameras(elements, pairs) & (pairs.weight > 0)
    share: Floats = pairs.sums(good.astype(float)) / np.maximum(pairs.sums((pairs.weight > 0).astype(float)), 1.0)
    return share


# ------------------------------------------------------------------------------------------------------ search


def search(
    orientation: Orientation, sigma: float, *, start: bool, sets: bool, doubtful: Flags | None = None
) -> tuple[ParallaxScatter, DeletedPoints]:
    """Take gross errors out of all pairs that fail the global test.

    The search is made with the stated scatter first. Where what it leaves contradicts that scatter, the scatter is
    raised and the search repeated: for the whole strip when all pairs together prove it, for one pair as far as its
    own residuals do.

    Parameters
    ----------
    sigma : float
        Stated standard deviation of an image coordinate, mm.
    start : bool
        Orient failing pairs with falling weights first.
    sets : bool
        Look for the smallest set of points that explains the misfit; without it points beyond four standard deviations
        go, worst first.
    doubtful : ndarray of bool, shape (p,), optional
        Pairs whose elements cannot be used as they are; they are searched whatever the test says.

    Returns
    -------
    ParallaxScatter
        Scatter of the parallaxes that the search was made with.
    DeletedPoints
        Pairs oriented without the wrong points, and what was taken out.
    """
    stated = max(float(np.sqrt(2.0)) * sigma, SMALLEST_SIGMA)
    scatter = ParallaxScatter(stated, float("nan"), np.full(orientation.pairs.size, stated))
    lost = np.zeros(orientation.pairs.size, bool) if doubtful is None else doubtful
    todo = np.flatnonzero(failing(orientation, scatter.by_pair) | lost)
    if not len(todo):
        return scatter, _Log([], [], [], []).closed(orientation)
    part, rows = orientation.take(todo), orientation.pairs.rows_of(todo)
    passed = _Sizes.of(orientation)
    every = np.arange(len(todo))
    if sets and not lost.any():
        found = _mildly(part, scatter.by_pair[todo])
        if found is not None:
            sizes = passed.with_part(rows, _left(part, found, found.orientation, scatter.by_pair[todo]))
            if (_revised(scatter, orientation.pairs, sizes).by_pair <= UNCHANGED * scatter.by_pair).all():
                return scatter, _whole(orientation, todo, rows, found)
    elements, scale = robust_start(part, every, scatter.by_pair[todo])
    seen = _seen_from(part, elements, every)
    cleaned = _cleaned(seen, every, scale)
    while True:
        sigma_now = scatter.by_pair[todo]
        failed = np.flatnonzero(failing(part, sigma_now) | lost[todo])
        found = _search_once(part, seen if start else part, failed, sigma_now, sets=sets, start=start)
        sizes = passed.with_part(rows, _left(part, found, cleaned, sigma_now))
        revised = _revised(scatter, orientation.pairs, sizes)
        if (revised.by_pair <= UNCHANGED * scatter.by_pair).all():
            return scatter, _whole(orientation, todo, rows, found)
        scatter = revised


def _mildly(part: Orientation, sigma: Floats) -> DeletedPoints | None:
    """Search pairs that fail by so little that least squares have turned them by nothing worth speaking of.

    They need no robust start. None when there are others among them, or when no set of three points explains one.
    """
    if (pair_global_test.squares(part, sigma) > MILD**2).any():
        return None
    log = _Log([], [], [], [])
    result = _delete_sets(part, sigma, np.arange(part.pairs.size), log)
    return None if failing(result, sigma).any() else log.closed(result)


def _whole(orientation: Orientation, todo: Numbers, rows: Numbers, found: DeletedPoints) -> DeletedPoints:
    """Put searched pairs back among all."""
    return replace(found, orientation=orientation.with_pairs(todo, found.orientation), rows=rows[found.rows])


@dataclass(frozen=True, eq=False)
class _Sizes:
    """What the parallaxes of all rows say about the scatter: sizes as ``_normalised``, redundancy numbers."""

    size: Floats
    redundancy: Floats

    @classmethod
    def of(cls, orientation: Orientation) -> _Sizes:
        return cls(_normalised(orientation), orientation.redundancy)

    def with_part(self, rows: Numbers, part: _Sizes) -> _Sizes:
        size, redundancy = self.size.copy(), self.redundancy.copy()
        size[rows], redundancy[rows] = part.size, part.redundancy
        return _Sizes(size, redundancy)


def _cleaned(seen: Orientation, todo: Numbers, scale: Floats) -> Orientation:
    """Orient some pairs on what their robust start leaves of their points."""
    pairs = seen.pairs
    limit = np.full(pairs.size, np.inf)
    limit[todo] = GROSS * scale
    with np.errstate(invalid="ignore"):
        inside = np.abs(seen.parallax) * np.sqrt(pairs.weight) <= limit[pairs.pair]
    enough = pairs.sums((inside & seen.used).astype(float)) > MINIMUM_POINTS
    weight = np.where(inside | ~enough[pairs.pair], pairs.weight, 0.0)
    return orient_again(seen, weight, todo)


def _left(given: Orientation, found: DeletedPoints, cleaned: Orientation, sigma: Floats) -> _Sizes:
    """Return what a search leaves of the pairs that failed.

    Pairs from which too many points went, or that still fail, do not speak by what the search chose to leave but by
    what a robust start leaves.
    """
    total, left = given.points_used, found.orientation.points_used
    few = total - left <= np.maximum(deletion.LARGEST, FEW * total)
    trusted = (few & ~failing(found.orientation, sigma))[given.pairs.pair]
    chosen, robustly = _Sizes.of(found.orientation), _Sizes.of(cleaned)
    return _Sizes(
        np.where(trusted, chosen.size, robustly.size), np.where(trusted, chosen.redundancy, robustly.redundancy)
    )


def _revised(scatter: ParallaxScatter, pairs: Pairs, left: _Sizes) -> ParallaxScatter:
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
    own = SIGMA_FROM_MEDIAN * np.nan_to_num(robust.median_by_pair(sizes, pairs, tested))
    proven = np.where(freedom < ENOUGH, 0.0, own / (1 + PROOF * MEDIAN_SCATTER / np.sqrt(np.maximum(freedom, 1.0))))
    return ParallaxScatter(scatter.stated, found_now, np.maximum(level, np.maximum(proven, scatter.by_pair)))


def _normalised(orientation: Orientation) -> Floats:
    """Sizes of the parallaxes over sqrt(redundancy / weight), mm; NaN where they say little."""
    share = np.nan_to_num(orientation.redundancy)
    speaks = orientation.used & (share > SMALLEST_REDUNDANCY)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.abs(orientation.parallax) * np.sqrt(orientation.pairs.weight / share)
    return np.where(speaks, size, np.nan)


def _search_once(
    given: Orientation, seen: Orientation, todo: Numbers, sigma: Floats, *, sets: bool, start: bool
) -> DeletedPoints:
    """Search with a given scatter; ``seen`` holds the elements and residuals to begin with."""
    log = _Log([], [], [], [])
    rows = np.isin(given.pairs.pair, todo)
    # pairs that pass keep their least-squares elements
    elements = given.elements.copy()
    elements[todo] = seen.elements[todo]
    parallax = np.where(rows, seen.parallax, given.parallax)
    redundancy = np.where(rows, seen.redundancy, given.redundancy)
    result = replace(given, elements=elements, parallax=parallax, redundancy=redundancy)
    if sets and len(todo):
        result = _delete_sets(result, sigma, todo, log)
        todo = todo[failing(result, sigma)[todo]]
    if len(todo):
        result = _delete_worst(result, sigma, todo, log, start=start)
        todo = todo[failing(result, sigma)[todo]]
        if sets and len(todo):
            result = _delete_sets(result, sigma, todo, log)
    return log.closed(result)


@dataclass(frozen=True, eq=False)
class _Log:
    """What was taken out so far."""

    rows: list[int]
    tests: list[str]
    values: list[float]
    limits: list[float]

    def add(self, row: int, test: str, value: float, limit: float) -> None:
        self.rows.append(row)
        self.tests.append(test)
        self.values.append(value)
        self.limits.append(limit)

    def closed(self, orientation: Orientation) -> DeletedPoints:
        rows = np.array(self.rows, np.intp)
        return DeletedPoints(orientation, rows, tuple(self.tests), np.array(self.values), np.array(self.limits))


def _seen_from(orientation: Orientation, elements: Floats, todo: Numbers) -> Orientation:
    """Residuals and redundancy of some pairs at given elements, which need not be those of least squares."""
    part, rows = orientation.pairs.take(todo), orientation.pairs.rows_of(todo)
    steps = np.zeros(len(todo), np.intp)
    fresh = assess_pairs(elements[todo], part, steps)
    parallax, redundancy = orientation.parallax.copy(), orientation.redundancy.copy()
    parallax[rows], redundancy[rows] = fresh.parallax, fresh.redundancy
    return replace(orientation, elements=elements, parallax=parallax, redundancy=redundancy)


def _delete_sets(orientation: Orientation, sigma: Floats, todo: Numbers, log: _Log) -> Orientation:
    """Minimum-deletion search in some pairs; those that no set of three explains stay as they are."""
    with np.errstate(all="ignore"):
        _, jacobian = linearised_parallaxes(orientation.elements, orientation.pairs)
    support = Support.of(orientation)
    spare = support.spare(orientation.pairs.pair)
    count = orientation.points_used
    weight = orientation.pairs.weight.copy()
    changed: list[int] = []
    for number in np.unique(count[todo]):
        group = todo[count[todo] == number]
        for first in range(0, len(group), PAIRS_AT_ONCE):
            some = group[first : first + PAIRS_AT_ONCE]
            for pair, rows, total, limit in _sets_of(orientation, jacobian, sigma, some, spare, support):
                weight[rows] = 0.0
                changed.append(pair)
                for row in rows.tolist():
                    log.add(row, "deletion", total, limit)
    return orient_again(orientation, weight, np.array(sorted(changed), np.intp)) if changed else orientation


def _sets_of(
    orientation: Orientation, jacobian: Floats, sigma: Floats, some: Numbers, spare: Flags, support: Support
) -> list[tuple[int, Numbers, float, float]]:
    """Look for sets in pairs with equal numbers of points: pair, rows, sum of squares before, its limit."""
    pairs = orientation.pairs
    chosen = np.zeros(pairs.size, bool)
    chosen[some] = True
    rows = np.flatnonzero(chosen[pairs.pair] & orientation.used).reshape(len(some), -1)
    n = rows.shape[1]
    root = np.sqrt(pairs.weight[rows]) / sigma[some, None]
    design = np.moveaxis(jacobian[:, rows], 0, 2) * root[:, :, None]
    design = np.where(np.isfinite(design), design, 0.0)
    q, _ = np.linalg.qr(design)
    matrix = np.eye(n) - q @ q.transpose(0, 2, 1)
    residual = (matrix @ (orientation.parallax[rows] * root)[:, :, None])[:, :, 0]
    left = n - np.arange(1, deletion.LARGEST + 1)
    target = np.where(left >= MINIMUM_LEFT, global_limits(left), -np.inf)
    target = np.broadcast_to(target, (len(some), deletion.LARGEST))
    result = []
    limit = float(global_limits(np.array([n]))[0])
    total = (residual**2).sum(axis=1)
    for place, found in enumerate(deletion.search(residual, matrix, target, ~spare[rows])):
        if len(found) and _holds(support, int(some[place]), rows[place, found]):
            result.append((int(some[place]), rows[place, found], float(total[place]), limit))
    return result


def _holds(support: Support, pair: int, rows: Numbers) -> bool:
    """Whether a pair keeps its support without some points."""
    counts = support.counts[pair] - np.bincount(support.zone[rows] - 1, minlength=ZONES)
    empty = int((counts == 0).sum())
    return bool(counts.sum() >= MINIMUM_LEFT and empty <= max(EMPTY_ZONES, int(support.empty[pair])))


def _delete_worst(orientation: Orientation, sigma: Floats, todo: Numbers, log: _Log, *, start: bool) -> Orientation:
    """Take out what the present elements cannot explain, worst first, while zones and pairs keep their support.

    From a robust start all points beyond four standard deviations go at once: its elements do not follow them. After
    that, and without such a start, the worst one goes and the pair is oriented again.
    """
    result = orientation
    if start:
        result = _delete_beyond(result, sigma, todo, log)
    while True:
        value = np.where(result.used, standardised(result, sigma), -np.inf)
        value[~np.isin(result.pairs.pair, todo)] = -np.inf
        limit = largest_limits(result.points_used)[result.pairs.pair]
        value[~Support.of(result).spare(result.pairs.pair)] = -np.inf
        peak = np.maximum.reduceat(value, result.pairs.starts)
        rows = np.flatnonzero((value == peak[result.pairs.pair]) & (value > limit))
        if not len(rows):
            return result
        changed, first = np.unique(result.pairs.pair[rows], return_index=True)
        rows = rows[first]
        for row in rows.tolist():
            log.add(row, "residual", float(value[row]), float(limit[row]))
        weight = result.pairs.weight.copy()
        weight[rows] = 0.0
        result = orient_again(result, weight, changed)


def _delete_beyond(orientation: Orientation, sigma: Floats, todo: Numbers, log: _Log) -> Orientation:
    """Take out all points far from a robust start, the farthest first, as long as support lasts."""
    pairs = orientation.pairs
    size = np.abs(orientation.parallax) * np.sqrt(pairs.weight)
    size = np.where(np.isfinite(size), size, np.inf)
    scale = SIGMA_FROM_MEDIAN * robust.median_by_pair(size, pairs, orientation.used)
    limit = np.full(pairs.size, np.inf)
    limit[todo] = GROSS * np.maximum(scale, sigma)[todo]
    rows = np.flatnonzero(orientation.used & (size > limit[pairs.pair]))
    support = Support.of(orientation)
    counts = support.counts.copy()
    weight = pairs.weight.copy()
    for row in rows[np.argsort(-size[rows], kind="stable")].tolist():
        pair, zone = int(pairs.pair[row]), int(support.zone[row]) - 1
        after = counts[pair].copy()
        after[zone] -= 1
        if after.sum() < MINIMUM_LEFT or (after[zone] == 0 and (after == 0).sum() > EMPTY_ZONES):
            continue
        counts[pair] = after
        weight[row] = 0.0
        log.add(row, "robust", float(size[row] / sigma[pair]), float(limit[pair] / sigma[pair]))
    return orient_again(orientation, weight, todo)
