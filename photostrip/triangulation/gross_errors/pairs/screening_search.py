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
from photostrip.triangulation.gross_errors.pairs.parallax_scatter import (
    ParallaxScatter,
    ParallaxSizes,
    revised_scatter,
    sizes_left,
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
    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.relative_orientation.pairs import Pairs


GROSS_SIGMAS = 4.0  # standard deviations; residuals from the robust start beyond it are wrong points
PAIRS_AT_ONCE = 64
HALF = 0.5
MILD = 10.0  # root of the sum of squares in units of its variance


@dataclass(frozen=True, eq=False)
class DeletedPoints:
    """What a search took out."""

    orientation: Orientation
    rows: Numbers  # rows taken out, in order, re-admitted ones included
    tests: tuple[str, ...]
    values: Floats
    limits: Floats


def robust_start(orientation: Orientation, todo: Numbers, sigma: Floats) -> tuple[Floats, Floats]:
    """Orient some pairs with falling weights, from the median parallax or, where that fails, as they are.

    Gives elements (t, 5) and the scatter of the residuals (t,), mm; see ``robust``.
    """
    part = orientation.pairs.take(todo)
    elements, scale = robust.solve(robust.start_values(part), part, sigma[todo])
    share = _share(elements, part, scale)
    again = np.flatnonzero((share <= HALF) | (scale > GROSS_SIGMAS * sigma[todo]))
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
        fits = np.abs(y_parallaxes(elements, pairs)) * np.sqrt(pairs.weight) < GROSS_SIGMAS * scale[pairs.pair]
        good = fits & in_front_of_cameras(elements, pairs) & (pairs.weight > 0)
    share: Floats = pairs.sums(good.astype(float)) / np.maximum(pairs.sums((pairs.weight > 0).astype(float)), 1.0)
    return share


def search(
    orientation: Orientation, sigma: float, *, start: bool, sets: bool, doubtful: Flags | None = None
) -> tuple[ParallaxScatter, DeletedPoints]:
    """Take gross errors out of all pairs that fail the global test.

    The search is made with the stated scatter first. Where what it leaves contradicts that scatter, the scatter is
    raised and the search repeated: for the whole strip when all pairs together prove it, for one pair as far as its
    own residuals do.

    sigma: stated standard deviation of an image coordinate, mm.
    start: orient failing pairs with falling weights first.
    sets: look for the smallest set of points that explains the misfit; without it points beyond four standard
        deviations go, worst first.
    doubtful: (p,), optional, pairs whose elements cannot be used as they are; they are searched whatever the test says.
    """
    scatter = ParallaxScatter.of(sigma, orientation.pairs.size)
    lost = np.zeros(orientation.pairs.size, bool) if doubtful is None else doubtful
    todo = np.flatnonzero(failing(orientation, scatter.by_pair) | lost)
    if not len(todo):
        return scatter, _Log([], [], [], []).closed(orientation)
    part, rows = orientation.take(todo), orientation.pairs.rows_of(todo)
    passed = ParallaxSizes.of(orientation)
    every = np.arange(len(todo))
    if sets and not lost.any():
        found = _mildly(part, scatter.by_pair[todo])
        if found is not None:
            sizes = passed.with_part(
                rows, sizes_left(part, found.orientation, found.orientation, scatter.by_pair[todo])
            )
            if not scatter.contradicted(revised_scatter(scatter, orientation.pairs, sizes)):
                return scatter, _whole(orientation, todo, rows, found)
    elements, scale = robust_start(part, every, scatter.by_pair[todo])
    begun = _assessed_at(part, elements, every)
    cleaned = _cleaned(begun, every, scale)
    while True:
        sigma_now = scatter.by_pair[todo]
        failed = np.flatnonzero(failing(part, sigma_now) | lost[todo])
        found = _search_once(part, begun if start else part, failed, sigma_now, sets=sets, start=start)
        sizes = passed.with_part(rows, sizes_left(part, found.orientation, cleaned, sigma_now))
        revised = revised_scatter(scatter, orientation.pairs, sizes)
        if not scatter.contradicted(revised):
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


def _cleaned(begun: Orientation, todo: Numbers, scale: Floats) -> Orientation:
    """Orient some pairs on what their robust start leaves of their points."""
    pairs = begun.pairs
    limit = np.full(pairs.size, np.inf)
    limit[todo] = GROSS_SIGMAS * scale
    with np.errstate(invalid="ignore"):
        inside = np.abs(begun.parallax) * np.sqrt(pairs.weight) <= limit[pairs.pair]
    enough = pairs.sums((inside & begun.used).astype(float)) > MINIMUM_POINTS
    weight = np.where(inside | ~enough[pairs.pair], pairs.weight, 0.0)
    return orient_again(begun, weight, todo)


def _search_once(
    given: Orientation, begun: Orientation, todo: Numbers, sigma: Floats, *, sets: bool, start: bool
) -> DeletedPoints:
    """Search with a given scatter; ``begun`` holds the elements and residuals at the start."""
    log = _Log([], [], [], [])
    rows = np.isin(given.pairs.pair, todo)
    # pairs that pass keep their least-squares elements
    elements = given.elements.copy()
    elements[todo] = begun.elements[todo]
    parallax = np.where(rows, begun.parallax, given.parallax)
    redundancy = np.where(rows, begun.redundancy, given.redundancy)
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


def _assessed_at(orientation: Orientation, elements: Floats, todo: Numbers) -> Orientation:
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
    limit[todo] = GROSS_SIGMAS * np.maximum(scale, sigma)[todo]
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
