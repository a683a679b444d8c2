"""Gross errors of pairs by their global test: robust start, then the smallest set of points that explains the misfit.

Only pairs that fail the test are touched. They are oriented with falling weights first. Then the smallest set of up to
three points is taken out whose removal lets the pair pass. Where no such set exists, what lies beyond three standard
deviations of the robust start goes, then one point after the other, until a set of up to three explains the rest.

Nothing is taken back: in a strip of three photos or more the rays are tested all again, along the strip; in pairs of 12
to 30 points of which up to a fifth is wrong 0.1 % of the good ones are lost.

Source: derived; the order of work is chosen here, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.rejection import Rejection
from photostrip.strip.gross_errors.pairs import deletion
from photostrip.strip.gross_errors.pairs.global_test import FIFTH_WRONG, GlobalTest, ParallaxScatter
from photostrip.strip.relative_orientation.orientation import Orientation, assess_pairs, orient_again
from photostrip.strip.relative_orientation.solution import linearised_parallaxes
from photostrip.strip.relative_orientation.zones import MINIMUM_LEFT
from photostrip.strip.robust import TUNING, scales

if TYPE_CHECKING:
    from photostrip.strip.relative_orientation.robust import RobustElements


# of the principal distance: y parallaxes that scatter by more are no measurements of the same points
LARGEST_SCATTER = 0.01
# of what was taken out as the worst for each one more that goes at a time: the work grows with its logarithm
OUT_TO_ONE_MORE = 8
AMPLE = 200  # points of a pair or photo that orient it: those beyond it count as if they were out already
AT_ONCE = 64  # pairs, for the sake of memory; it changes no result


@dataclass(frozen=True, eq=False)
class PairSearch:
    """What a search for gross errors took out of pairs, and what it was made with."""

    orientation: Orientation  # pairs oriented without the points taken out
    # rows of the pairs, by the test ``deletion`` (global test), ``robust`` or ``residual``
    removed: tuple[Rejection, ...]
    scatter: ParallaxScatter
    test: GlobalTest


def rejection(row: int, test: str, value: float, limit: float) -> Rejection:
    """One point of a pair; values in mm for the test ``parallax``, otherwise without unit."""
    return Rejection(kind="parallax", row=int(row), test=test, value=float(value), limit=float(limit))


def search(
    given: Orientation,
    stated: float,
    doubtful: Flags,
    *,
    start: bool = True,
    sets: bool = True,
    spoiled: float = FIFTH_WRONG,
) -> PairSearch:
    """Take gross errors out of all pairs that fail the global test.

    given: pairs oriented by least squares on all points.
    stated: standard deviation of a y parallax, mm; where what is left contradicts it, a larger one is used.
    doubtful: (p,), pairs whose elements cannot be used as they are, to be searched whatever the test says.
    start: begin with the robust elements.
    sets: look for sets of points that explain the misfit together; without it the worst goes alone.
    spoiled: as in ``ParallaxScatter.of``.
    """
    test = GlobalTest.of(np.full(given.pairs.size, stated))
    failed = np.flatnonzero(test.failing(given) | doubtful)
    if not len(failed):
        scatter = ParallaxScatter.of(given, stated, spoiled)
        return PairSearch(orientation=given, removed=(), scatter=scatter, test=GlobalTest.of(scatter.by_pair))
    from photostrip.strip.relative_orientation.robust import orient_robustly

    part, part_test, log = given.take(failed), test.take(failed), _Log.of(len(failed))
    found = orient_robustly(part.pairs, part_test.sigma, deletion.LARGEST_SET)
    robust = assess_pairs(found.elements, part.pairs, part.iterations)
    if start:
        part = robust
    todo = np.arange(len(failed))
    if sets:
        part = log.without_sets(part, part_test, todo)
        todo = todo[part_test.failing(part)]
    # pairs that a few points explain speak for the scatter; of the others, what the robust start leaves
    cleaned = given.with_pairs(failed, part.with_pairs(todo, _agreeing(robust, found).take(todo)))
    scatter = ParallaxScatter.of(cleaned, stated, spoiled)
    if scatter.found > LARGEST_SCATTER * given.pairs.focal:
        return PairSearch(orientation=given, removed=(), scatter=replace(scatter, found=np.nan), test=test)
    if not np.isnan(scatter.found):
        again = search(given, scatter.found, doubtful, start=start, sets=sets, spoiled=1.0)
        return again if not np.isnan(again.scatter.found) else replace(again, scatter=scatter)
    if start:
        part = log.without_beyond(part, part_test, todo)
    least = given.points_used[failed] // 2  # with more points wrong than right nobody can tell which are which
    while len(todo := todo[(part_test.failing(part) & (part.points_used >= least))[todo]]):
        before = len(log.removed)
        part = log.without_sets(part, part_test, todo, deletion.LARGEST_SET if sets else 1, worst=True)
        if len(log.removed) == before:
            break
    part = orient_again(part, part.pairs.weight, np.arange(len(failed)))
    rows = given.pairs.rows_of(failed)
    removed = tuple(replace(each, row=int(rows[each.row])) for each in log.removed)
    return PairSearch(orientation=given.with_pairs(failed, part), removed=removed, scatter=scatter, test=test)


@dataclass(frozen=True, eq=False)
class _Log:
    """Points taken out so far, and the ways to take out more."""

    removed: list[Rejection]
    lost: Flags  # (p,): pairs that were solved from nothing once, which is worth no second attempt within a search
    worst: Numbers  # (p,): points that went because they were the worst

    @classmethod
    def of(cls, pairs: int) -> Self:
        return cls([], np.zeros(pairs, bool), np.zeros(pairs, np.intp))

    def without_sets(
        self,
        part: Orientation,
        test: GlobalTest,
        todo: Numbers,
        largest: int = deletion.LARGEST_SET,
        *,
        worst: bool = False,
    ) -> Orientation:
        """Take the smallest set out of each pair that explains its misfit, or the ``worst`` point where none does."""
        with np.errstate(all="ignore"):
            _, jacobian = linearised_parallaxes(part.elements, part.pairs)
        count = part.points_used
        size, most = test.standardised(part), test.largest_limits(count)
        weight, pairs = part.pairs.weight.copy(), part.pairs.pair
        for some in _alike(todo, count):
            number = int(count[some[0]])
            rows = np.flatnonzero(np.isin(pairs, some) & part.used).reshape(len(some), number)
            residual, basis = _studentised(part, jacobian, rows, test.sigma[some])
            left = number - np.arange(1, largest + 1)
            target = np.where(left >= MINIMUM_LEFT, test.limits(left), -np.inf)
            found = deletion.search(residual, basis, target)
            total, limit = (residual**2).sum(axis=1), test.limits(np.array([number]))[0]
            for place, (pair, chosen) in enumerate(zip(some.tolist(), found, strict=True)):
                gone = rows[place, chosen]
                if len(gone):
                    self._remove(weight, gone, "deletion", float(total[place]), float(limit))
                elif worst:
                    more = (int(self.worst[pair]) + max(number - AMPLE, 0)) // OUT_TO_ONE_MORE
                    most_at_once = min(1 + more, max(number - MINIMUM_LEFT, 0))
                    for row in rows[place, np.argsort(-size[rows[place]], kind="stable")[:most_at_once]].tolist():
                        if size[row] > most[pair]:
                            self._remove(weight, np.array([row]), "residual", float(size[row]), float(most[pair]))
                            self.worst[pair] += 1
        changed = np.unique(pairs[weight != part.pairs.weight])
        return orient_again(part, weight, changed, self.lost)

    def without_beyond(self, part: Orientation, test: GlobalTest, todo: Numbers) -> Orientation:
        """Take all points out that lie far from the robust elements, the farthest first, as long as six are left."""
        pairs = part.pairs
        size = np.abs(part.parallax) * np.sqrt(pairs.weight)
        size = np.where(np.isfinite(size), size, np.inf)
        scale = np.maximum(test.sigma, scales(size, pairs.weight, pairs.pair, pairs.size))
        rows = np.flatnonzero(part.used & (size > TUNING * scale[pairs.pair]) & np.isin(pairs.pair, todo))
        weight, left = pairs.weight.copy(), part.points_used
        for row in rows[np.argsort(-size[rows], kind="stable")].tolist():
            pair = int(pairs.pair[row])
            if left[pair] > MINIMUM_LEFT:
                left[pair] -= 1
                value, limit = size[row] / test.sigma[pair], TUNING * scale[pair] / test.sigma[pair]
                self._remove(weight, np.array([row]), "robust", float(value), float(limit))
        return orient_again(part, weight, todo, self.lost)

    def _remove(self, weight: Floats, rows: Numbers, test: str, value: float, limit: float) -> None:
        weight[rows] = 0.0
        self.removed.extend(rejection(row, test, value, limit) for row in rows.tolist())


def _alike(todo: Numbers, count: Numbers) -> list[Numbers]:
    """Split pairs into some at a time with equal numbers of points."""
    groups = [todo[count[todo] == number] for number in np.unique(count[todo])]
    return [some for group in groups for some in np.array_split(group, 1 + len(group) // AT_ONCE)]


def _agreeing(part: Orientation, found: RobustElements) -> Orientation:
    """Give pairs the points alone that agree with their robust elements.

    Of a fifth of wrong points their scatter becomes 1.1 to 1.2 times as large, with all points 1.4 to 1.5 times.
    """
    pairs = part.pairs
    with np.errstate(invalid="ignore"):
        inside = np.abs(part.parallax) * np.sqrt(pairs.weight) <= TUNING * found.scale[pairs.pair]
    return assess_pairs(found.elements, replace(pairs, weight=np.where(inside, pairs.weight, 0.0)), part.iterations)


def _studentised(part: Orientation, jacobian: Floats, rows: Numbers, sigma: Floats) -> tuple[Floats, Floats]:
    """Residuals over sigma and orthonormal columns of the design of pairs with equal numbers of points, (g, n)."""
    root = np.sqrt(part.pairs.weight[rows]) / sigma[:, None]
    design = np.nan_to_num(np.moveaxis(jacobian[:, rows], 0, 2) * root[:, :, None], posinf=0.0, neginf=0.0)
    q, _ = np.linalg.qr(design)
    parallax = np.nan_to_num(part.parallax[rows] * root)[:, :, None]
    return (parallax - q @ (q.transpose(0, 2, 1) @ parallax))[:, :, 0], q
