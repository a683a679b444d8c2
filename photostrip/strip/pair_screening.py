"""Gross errors of pairs by their global test: robust start, then the smallest set of points that explains the misfit.

Only pairs that fail the test are touched. They are oriented with falling weights first. Then the smallest set of up to
three points is taken out whose removal lets the pair pass. Where no such set exists, what lies beyond three standard
deviations of the robust start goes, then one point after the other, until a set of up to three explains the rest.
Nothing is taken back: in a strip of three photos or more the rays are tested all again, along the strip; in pairs of 12
to 30 points of which up to a fifth is wrong 0.1 % of the good ones are lost.

What the sum of squares becomes without a set K of points follows from one solution with all points: with
M = I - J (J^T J)^-1 J^T and residuals v the reduced sum is v^T v - v_K^T (M_KK)^-1 v_K. So all sets of up to three
points are looked at for the price of one orientation, and two equal errors in one zone, which hide each other from
every test of single residuals, come out together.

Source: derived; [004a] describes the situation that needs it, and stops at tests of single residuals; docs/sources.md.

Gross errors in relative orientation: the methods by name, the tests of single residuals, the log.

``parallax+grubbs`` tests the residual y parallax against a limit, then by Grubbs' test; ``tau`` tests studentised
residuals. Every round takes at most one point from a pair, the worst, and orients that pair again: removing several
at once also throws out good points that a bad neighbour has pulled. All pairs go through a round together. No
rejection of theirs leaves a pair or a standard zone without support.

``deletion``, ``robust`` and ``auto`` are the searches above.

Source: [004a]; the two-sided form and the order of work are chosen here, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from scipy.special import chdtri, ndtri

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import InputError
from photostrip.rejection import UNCONTROLLED, Rejection
from photostrip.statistics import SIGMA_FROM_MEDIAN, grubbs_limit, normal_quantile, tau_limit
from photostrip.strip.relative_orientation import (
    LEAST_IN_FRONT,
    MINIMUM_LEFT,
    MINIMUM_POINTS,
    SCREENINGS,
    Orientation,
    RelativeSettings,
    Support,
    assess_pairs,
    linearised_parallaxes,
    orient_again,
    rays_meet_in_front,
    unusable_pairs,
    zones,
)
from photostrip.strip.robust import MEDIAN_SPREAD, TUNING, scales

if TYPE_CHECKING:
    from photostrip.strip.robust import RobustElements


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


def smallest_sets(residuals: Floats, basis: Floats, target: Floats) -> list[Numbers]:
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


ALPHA = 0.01  # probability that a strip without gross errors fails anywhere
# scale of residuals of which a fifth are large over that of the others: normal_quantile(13/16) * 1.4826
FIFTH_WRONG = 1.315


@dataclass(frozen=True, eq=False)
class GlobalTest:
    """What the y parallaxes of some pairs are tested with."""

    sigma: Floats  # (p,): standard deviation of a y parallax of weight one in each pair, mm
    level: float  # probability that a pair without gross errors fails one of its two tests

    @classmethod
    def of(cls, sigma: Floats) -> Self:
        """Share the level of a strip among its pairs and their two tests."""
        return cls(sigma, ALPHA / (2 * len(sigma)))

    def take(self, numbers: Numbers) -> GlobalTest:
        """Take some of the pairs; the level stays that of the whole strip."""
        return replace(self, sigma=self.sigma[numbers])

    def squares(self, orientation: Orientation) -> Floats:
        """Value of the test of each pair: v^T W v / sigma^2."""
        pairs = orientation.pairs
        return np.asarray(pairs.sums(pairs.weight * orientation.parallax**2) / self.sigma**2, float)

    def limits(self, count: Numbers) -> Floats:
        """Critical values: chi-square with count - 5 degrees of freedom; infinite without redundancy."""
        freedom = count - MINIMUM_POINTS
        return np.where(freedom > 0, chdtri(freedom, self.level), np.inf)

    def standardised(self, orientation: Orientation) -> Floats:
        """Parallaxes of the points used in units of their standard deviation, (m,); 0 without redundancy."""
        value = np.abs(orientation.parallax) / residual_sigma(orientation, self.sigma)
        return np.where(np.isfinite(value), value, 0.0)

    def largest_limits(self, count: Numbers) -> Floats:
        """Critical values of the largest standardised residual (Bonferroni)."""
        return np.asarray(ndtri(1 - self.level / (2 * np.maximum(count, 1))))

    def failing(self, orientation: Orientation) -> Flags:
        """Pairs whose sum of squares or largest residual exceeds its limit."""
        count = orientation.points_used
        largest = np.maximum.reduceat(self.standardised(orientation), orientation.pairs.starts)
        bad: Flags = ~(self.squares(orientation) <= self.limits(count)) | (largest > self.largest_limits(count))
        return bad & (count > MINIMUM_POINTS)


@dataclass(frozen=True, eq=False)
class ParallaxScatter:
    """Standard deviations of a y parallax of weight one that the tests are made with."""

    # from the residuals of all pairs of the strip, robust, mm; NaN when they did not contradict the stated one
    found: float
    by_pair: Floats  # (p,): those in force, mm

    @classmethod
    def of(cls, orientation: Orientation, stated: float, spoiled: float = FIFTH_WRONG) -> ParallaxScatter:
        """Decide on the scatter of a strip whose pairs are oriented on points that agree with one another.

        ``stated`` is that of a y parallax, mm. It holds unless the median residual of the whole strip proves more, even
        if wrong points among them should make that ``spoiled`` times too large.
        """
        pairs, share = orientation.pairs, np.nan_to_num(orientation.redundancy)
        tested = orientation.used & (share > UNCONTROLLED)
        found = np.nan
        if tested.any():
            sizes = np.abs(orientation.parallax[tested]) * np.sqrt(pairs.weight[tested] / share[tested])
            scale = SIGMA_FROM_MEDIAN * np.median(sizes)
            proof = 1.0 + normal_quantile(1.0 - ALPHA) * MEDIAN_SPREAD / np.sqrt(float(share[tested].sum()))
            found = scale if scale > spoiled * proof * stated else np.nan
        return cls(found, np.full(pairs.size, max(stated, np.nan_to_num(found))))


def residual_sigma(orientation: Orientation, sigma: Floats) -> Floats:
    """Return standard deviations of residuals, (m,), mm; infinite without redundancy and where a point is not used.

    sigma: (p,), of a y parallax of weight one.
    """
    pairs, share = orientation.pairs, orientation.redundancy
    with np.errstate(divide="ignore", invalid="ignore"):
        size = sigma[pairs.pair] * np.sqrt(share / pairs.weight)
    return np.where(orientation.used & (share > UNCONTROLLED), size, np.inf)


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
    from photostrip.strip.robust import orient_robustly

    part, part_test, log = given.take(failed), test.take(failed), _Log.of(len(failed))
    found = orient_robustly(part.pairs, part_test.sigma, LARGEST_SET)
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
        part = log.without_sets(part, part_test, todo, LARGEST_SET if sets else 1, worst=True)
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
        largest: int = LARGEST_SET,
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
            found = smallest_sets(residual, basis, target)
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


SEARCHES = {"auto": (True, True), "deletion": (False, True), "robust": (True, False)}  # robust start, sets of points
NEGLIGIBLE = 1e-9  # mm; residuals of error-free data are rounding, not measurements
LIMIT_FACTOR = 4.0  # a-priori standard deviations of a y parallax
DETECTABLE = 4.13  # shift of a normal variable found in 80 % of cases by a two-sided test at 0.1 %


@dataclass(frozen=True, eq=False)
class ScreenedPairs:
    """Oriented pairs after the search for gross errors, and how far errors can be seen in them."""

    orientation: Orientation  # pairs oriented without the rejected points
    rejections: tuple[Rejection, ...]  # rows of pairs that were rejected, in order; with the error of the y parallax
    scatter: ParallaxScatter  # standard deviations of a y parallax of weight one
    # (p,): pairs that fail the global test with nothing left to reject: errors that hide each other are suspected
    masked: Flags
    converged: Flags  # (p,): whether the orientation of each pair converged

    @cached_property
    def zone(self) -> Numbers:
        """Standard zone of every point, 1 to 6, shape (m,)."""
        return zones(self.orientation.elements, self.orientation.pairs)

    @property
    def counts(self) -> Numbers:
        """Points that take part, by pair and zone, shape (p, 6)."""
        return Support.of(self.orientation, self.zone).counts

    @property
    def detectable(self) -> Floats:
        """Smallest error of each point's y parallax that a test finds in 80 % of cases, mm, shape (m,).

        Infinite where a point has no redundancy, NaN where it takes no part.
        """
        pairs = self.orientation.pairs
        with np.errstate(divide="ignore", invalid="ignore"):
            sigma = self.scatter.by_pair[pairs.pair] / np.sqrt(pairs.weight)
            size: Floats = DETECTABLE * sigma / np.sqrt(np.maximum(self.orientation.redundancy, 0.0))
        return np.where(self.orientation.used, size, np.nan)


def screen_pairs(
    orientation: Orientation, settings: RelativeSettings, sigma: float, converged: Flags | None = None
) -> ScreenedPairs:
    """Reject points with gross errors, and say what can and what cannot be seen in each pair.

    With ``auto`` and ``robust`` the pairs need not make sense yet; ``converged`` (p,) says whose orientation converged,
    all by default. ``sigma`` is that of an image coordinate, mm.
    """
    if settings.screening not in SCREENINGS:
        msg = f"screening method {settings.screening!r} is not available; choose one of {', '.join(SCREENINGS)}"
        raise InputError(msg)
    sound = np.ones(orientation.pairs.size, bool) if converged is None else converged
    doubtful = unusable_pairs(orientation, sound)
    behind = ~rays_meet_in_front(*orientation.rays)
    start, sets = SEARCHES.get(settings.screening, SEARCHES["auto"])
    with np.errstate(all="ignore"):
        found = search(orientation, max(np.sqrt(2.0) * sigma, NEGLIGIBLE), doubtful, start=start, sets=sets)
    if settings.screening in SEARCHES:
        result, log = _searched(orientation, found, behind)
        # a pair that was lost at first and now fits its points has converged after all; any other is refused
        sound = sound | (doubtful & ~found.test.failing(result))
        lost = np.flatnonzero(doubtful & unusable_pairs(result, sound))
        result = result.with_pairs(lost, orientation.take(lost))
    else:
        result, log = _sequential(orientation, settings, sigma, behind)
    return ScreenedPairs(
        orientation=result,
        rejections=_completed(log, result),
        scatter=found.scatter,
        masked=found.test.failing(result),
        converged=sound,
    )


def _searched(given: Orientation, found: PairSearch, behind: Flags) -> tuple[Orientation, list[Rejection]]:
    """Write the log of a search, and take out what lies behind a camera."""
    result = found.orientation
    if result is not given:
        behind = ~rays_meet_in_front(*result.rays)
    result, dropped = _drop_behind(result, behind)
    return result, [*found.removed, *dropped]


def _sequential(
    orientation: Orientation, settings: RelativeSettings, sigma: float, behind: Flags
) -> tuple[Orientation, list[Rejection]]:
    """Test single residuals, one stage after the other."""
    result, log = _drop_behind(orientation, behind)
    for test, bound in stages(settings, sigma):
        result, found = _stage(result, test, bound)
        log += found
    return result, log


def stages(settings: RelativeSettings, sigma: float) -> list[tuple[str, float]]:
    """Return the tests of single residuals in their order, each with its limit, mm, or its level."""
    limit, level = settings.parallax_limit, settings.grubbs_alpha
    first = LIMIT_FACTOR * sigma * np.sqrt(2.0) if limit is None else limit
    known = {"tau": [("tau", level)], "parallax+grubbs": [("parallax", first), ("grubbs", level)]}
    return known.get(settings.screening, [])


def _completed(log: list[Rejection], result: Orientation) -> tuple[Rejection, ...]:
    """Add to each rejection what only the final orientation can say."""
    parallax, used = result.parallax, result.used
    return tuple(replace(each, size=(float(parallax[each.row]),), readmitted=bool(used[each.row])) for each in log)


def _drop_behind(orientation: Orientation, behind: Flags) -> tuple[Orientation, list[Rejection]]:
    """Take out the points that come out behind a camera; no measurement of theirs can be right."""
    pairs, used = orientation.pairs, orientation.used
    rows = np.flatnonzero(behind & used)
    # with most of its points behind, the pair itself is wrong, and refuse_unusable says so
    most = pairs.sums((~behind & used).astype(float)) > LEAST_IN_FRONT * orientation.points_used
    rows = rows[most[pairs.pair[rows]]]
    if not len(rows):
        return orientation, []
    log = [rejection(row, "in front", np.nan, np.nan) for row in rows.tolist()]
    return _without(orientation, rows), log


def _without(orientation: Orientation, rows: Numbers) -> Orientation:
    weight = orientation.pairs.weight.copy()
    weight[rows] = 0.0
    return orient_again(orientation, weight, np.unique(orientation.pairs.pair[rows]))


def _stage(orientation: Orientation, test: str, bound: float) -> tuple[Orientation, list[Rejection]]:
    """Repeat one test, worst point first, until no pair has anything to reject."""
    result = orientation
    log: list[Rejection] = []
    while True:
        value, limit, _ = tested(result, test, bound)
        value[~result.used] = -np.inf
        peak = np.maximum.reduceat(value, result.pairs.starts)
        spare = Support.of(result).spare(result.pairs.pair)
        worst = (value == peak[result.pairs.pair]) & (value > limit) & spare
        rows = np.flatnonzero(worst)
        if not len(rows):
            return result, log
        _, first = np.unique(result.pairs.pair[rows], return_index=True)  # of equal values the first
        rows = rows[first]
        log += [rejection(row, test, value[row], limit[row]) for row in rows.tolist()]
        result = _without(result, rows)


class Tested(NamedTuple):
    """Every row of the pairs as a test sees it."""

    value: Floats
    limit: Floats  # infinite where nothing can be told
    unit: Floats  # millimetres of one unit of both


def tested(orientation: Orientation, test: str, bound: float) -> Tested:
    """Test single residuals.

    bound: the limit of the test ``parallax``, mm; the level of ``grubbs``, deviation from the mean of the pair, and of
        ``tau``, studentised residual.
    """
    pairs, count, size = orientation.pairs, orientation.points_used, orientation.parallax
    if test == "parallax":
        return Tested(np.abs(size), np.full(len(size), bound), np.ones(len(size)))
    if test == "grubbs":
        mean = pairs.sums(np.where(orientation.used, size, 0.0)) / count
        size = np.where(orientation.used, size - mean[pairs.pair], 0.0)
        spread = np.sqrt(pairs.sums(size**2) / (count - 1))
        unit, least, limit = spread[pairs.pair], MINIMUM_LEFT + 1, partial(grubbs_limit, alpha=bound)
    else:
        spread = np.sqrt(2.0) * orientation.sigma0
        unit, least = residual_sigma(orientation, spread), MINIMUM_POINTS + 3
        limit = partial(tau_limit, unknowns=MINIMUM_POINTS, alpha=bound)
    limits = np.where(count >= least, limit(np.maximum(count, least)), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.nan_to_num(np.abs(size) / unit, posinf=0.0)
    return Tested(value, np.where(spread > NEGLIGIBLE, limits, np.inf)[pairs.pair], unit)
