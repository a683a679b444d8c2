"""The search for gross errors in an adjustment of rays: test, take the worst out, adjust again, take back what fits.

The adjustment is a bundle: the free network of one strip, or a block with its control and camera positions. What is
tested are standardised residuals; of a point with a ray beyond the limit ``testing`` says which rays are wrong.
At the end every point with a ray outside is tested in the same way, by photos that the others orient.

Source: [Baarda 1968], [Pope 1976].
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
from math import comb, log
from typing import NamedTuple

import numpy as np
from scipy.special import xlogy

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.network import defects, hypotheses, reliability
from photostrip.network.adjustment import BundleSolution, Cofactors, Selection, restarted, selected, solve, supported
from photostrip.network.defects import is_free
from photostrip.network.hypotheses import (
    DRIFT,
    OF_CAMERAS,
    OF_PHOTOS,
    OFFSET,
    ORDER,
    PLAINER,
    SIGMAS,
    UNSCALED,
    UP_AXIS,
    Hypothesis,
    Likely,
    Scatter,
)
from photostrip.network.problem import BundleProblem, BundleSettings, PositionObservations
from photostrip.network.reliability import ATTITUDE, CONTROL, IMAGE, POSITION, JointCofactors, Limit, cofactors_of
from photostrip.network.testing import (
    START,
    WRONG_COLUMNS,
    Adjusted,
    RayDecisions,
    RayLog,
    WrongRays,
    cause_of_all,
    decide_rays,
)
from photostrip.points import take_rows
from photostrip.rejection import Rejection
from photostrip.statistics import TEST_LEVEL
from photostrip.strip.control_screening import LARGEST_SHARE
from photostrip.strip.pair_screening import AMPLE, OUT_TO_ONE_MORE

RAYS_TO_ONE_MORE = 50  # of a photo, for each of its points that may go at a time beside the worst: they hardly move it
PHOTOS_ENOUGH = 3  # on which a point is among the worst, for it to go, whatever more it is on
RAYS_TO_DECIDE_AGAIN = 100  # of a photo, for each by which it may change before anything is decided on again
SCALED = 0.02  # of standard deviations of positions, by which they may still grow
BOTH_GO = 0.25  # share in the level of a point on two photos of a strip, which one test costs both rays


@dataclass(frozen=True, eq=False)
class ScreenedBundle:
    """A solution and how it was cleaned."""

    problem: BundleProblem  # the problem with the observations that took part
    selection: Selection  # which those are
    solution: BundleSolution
    precision: Cofactors
    limit: Limit  # what its residuals are tested against
    rejections: tuple[Rejection, ...] = ()  # what was taken out, in order; re-admitted ones are marked
    rounds: int = 1
    common: tuple[Hypothesis, ...] = ()  # what groups of observations share, taken up as unknowns
    # given coordinates beyond the limit that stay: without them the adjustment fails, or half of the control would go
    held: tuple[Rejection, ...] = ()
    doubted: tuple[Rejection, ...] = ()  # others, that are beyond it by the stated standard deviations

    @classmethod
    def of(
        cls, problem: BundleProblem, selection: Selection, settings: BundleSettings, *, rough: bool = False
    ) -> ScreenedBundle:
        chosen = selected(problem, selection)
        solution = solve(chosen, rough=rough)
        precision = cofactors_of(solution)
        tests = reliability.tests_of(chosen, solution, precision)
        points_out = len(np.unique(problem.images.point[~selection.images]))
        established = points_out, selection.given_out(problem)
        return cls(
            problem=chosen,
            selection=selection,
            solution=solution,
            precision=precision,
            limit=reliability.limit_of(solution, settings, tests, established, BOTH_GO if rough else 1.0),
        )

    @property
    def out(self) -> list[Rejection]:
        """What was taken out and stays out."""
        return [each for each in self.rejections if not each.readmitted]

    @cached_property
    def joint(self) -> JointCofactors:
        return JointCofactors.of_solution(self.solution)

    @cached_property
    def scatter(self) -> Scatter:
        return Scatter.of(self.solution, self.precision)

    def left(self, unit: float, factors: Sequence[float]) -> float:
        """Sum of squares that is left, with the price of factors of the standard deviations of positions."""
        paid = 0.0 if factors == UNSCALED else hypotheses.price(self.scatter, factors)
        return self.solution.chi_square / unit**2 + paid


def screen_bundle(
    problem: BundleProblem,
    begin: Selection,
    settings: BundleSettings,
    kept: Flags | None = None,
    *,
    rough: bool = False,
) -> ScreenedBundle:
    """Adjust a problem and take its gross errors out.

    ``begin`` takes part at first, the rest is put in at the end where it fits; the rays ``kept`` (n,) stay in whatever
    the tests say, and so does what photos, points or the datum would be open without.

    A hypothesis that was taken up while given coordinates went is doubted, and so is one about a single photo, whose
    outliers add up to it: the search is made again without it, and what explains everything by less counts.

    rough: only the rays matter: adjust as well as their tests need it; two that only go together have ``BOTH_GO``.
    """
    if settings.screening == "none":
        return ScreenedBundle.of(problem, supported(problem, Selection.everything(problem)), settings)
    search = _Search(problem, begin, settings, kept, rough=rough)
    done = _searched(search, begin)
    # standard deviations stay: their factor is that of most positions, whichever others are wrong
    taken = [each for each in (*search.common, *search.refused) if each.kind != SIGMAS]
    lost = done.held or any(each.kind != IMAGE for each in done.out)
    if not (taken and lost) and not any(each.kind in OF_PHOTOS for each in taken):
        return done
    other = _Search(problem, begin, settings, kept, rough=rough, refused=taken)
    try:
        without = _searched(other, begin)
    except GeometryError:
        return done
    unit = max(min(done.solution.sigma0, without.solution.sigma0), 1.0)
    of_photos = any(each.kind in OF_PHOTOS for each in done.common)
    cost, cost_without = (_left_and_explained(each, unit, settings.level, whole=of_photos) for each in (done, without))
    if of_photos and not any(each.kind in OF_PHOTOS for each in without.common):
        # over level ground a wrong position of a photo looks like another lens, or other marks, and nothing tells them
        # apart: what one given point or position explains is not laid on all that a photo shows
        cost -= 2.0 * log(settings.level)
    return done if cost <= cost_without else without


def _left_and_explained(done: ScreenedBundle, unit: float, level: float, *, whole: bool) -> float:
    """Sum of squares that is left, and what each cause that was found must have explained to be found.

    whole: whether a given point or position is one cause, as a photo is, and not each of its coordinates.
    """
    observations = done.problem
    photos = sum(each.kind in OF_PHOTOS for each in done.common)
    given = int(sum(np.isfinite(each.sigma).sum() for each in (observations.control, observations.positions)))
    rays_out = sum(each.kind == IMAGE for each in done.out)
    given_out = len({(each.kind, each.row, () if whole else each.axes) for each in done.out if each.kind != IMAGE})
    asked = rays_out, given_out, photos, len(done.common) - photos
    numbers = len(done.selection.images), given + given_out, len(OF_PHOTOS) * observations.photos, len(OF_CAMERAS)
    price = 2.0 * xlogy(asked, np.array(numbers) / level).sum()  # of nothing that is asked of nothing: 0
    return done.left(unit, hypotheses.factors_of(done.common)) + float(price)


def _plainer(hypothesis: Hypothesis) -> list[Hypothesis]:
    """Return what stays of a hypothesis that explains no more than a plainer one."""
    return [replace(hypothesis, kind=PLAINER[hypothesis.kind])] if hypothesis.kind in PLAINER else []


def _searched(search: _Search, begin: Selection) -> ScreenedBundle:
    """Search until there is nothing more to take out, to take up and to put back."""
    done = search.clean(search.with_doubted_control(supported(search.problem, begin)))
    while (more := search.fitting(done)) is not None:  # a point comes back once only
        done = search.clean(more)
    while (less := search.put_back(done)) is not None:
        done = search.clean(supported(search.problem, less))
    done = search.with_most_control(done)
    held = tuple(each for each in search.tested(done)[1] if search.holds(each))
    done = replace(done, rejections=tuple(search.log(done)), held=held, doubted=search.doubted(done))
    return replace(done, rounds=search.rounds, common=tuple(search.common))


class _Tried(NamedTuple):
    """A hypothesis that was adjusted with."""

    hypothesis: Hypothesis
    found: ScreenedBundle
    problem: BundleProblem  # with its unknowns, to go on with

    def explained(self, done: ScreenedBundle, unit: float) -> Likely:
        """Say what the sum of squares fell by."""
        before, after = done.solution, self.found.solution
        fall = (before.chi_square - after.chi_square) / unit**2
        return Likely.of(self.hypothesis, fall, before.redundancy - after.redundancy, 1)


def _unit(tried: Sequence[_Tried]) -> float:
    """Return the sigma0 to compare by: what is wrong makes it large, the right cause does not."""
    return max(min(each.found.solution.sigma0 for each in tried), 1.0)


class _Search:
    """What is remembered from round to round."""

    def __init__(
        self,
        problem: BundleProblem,
        begin: Selection,
        settings: BundleSettings,
        kept: Flags | None,
        *,
        rough: bool,
        refused: Sequence[Hypothesis] = (),
    ) -> None:
        self.given = self.problem = problem
        self.settings, self.rough = settings, rough
        images = problem.images
        self.by_point = np.lexsort((images.photo, images.point))
        self.free = is_free(problem)
        self.spared = np.zeros(problem.points, bool)  # points of rays that are kept
        self.held: set[tuple[str, int, int]] = set()  # given coordinates that stay
        self.spared[images.point[[] if kept is None else kept]] = True
        self.waiting = Selection.everything(problem).control & ~begin.control  # given coordinates that may come in
        self.begin = begin.images
        self.control = begin.control.copy()  # those that were put in, and that nothing has rejected
        # what tests took out, in order; what they said of rays stands in the columns of the log
        self.out: dict[tuple[str, int, int], Rejection | None] = {}
        rays, given = np.flatnonzero(~begin.images).tolist(), np.argwhere(self.waiting).tolist()
        nothing = partial(Rejection, kind=CONTROL, test=START, value=float("nan"), limit=float("nan"))
        self.began: dict[tuple[str, int, int], Rejection | None] = {(IMAGE, row, 0): None for row in rays}
        self.began |= {(CONTROL, row, axis): nothing(row=row, axes=(axis,)) for row, axis in given}
        self.rays = RayLog(begin.images, images.xy.shape[1])
        self.back = np.zeros(problem.points, bool)  # points that came back; what must go again stays out
        self.decided = Selection.everything(problem)  # what took part when rays outside were decided on
        self.beyond = np.full(problem.points, np.inf)  # test values of points with a ray outside, when decided on
        self.rounds = self.failed = 0
        self.order_asked = False
        self.common: list[Hypothesis] = []
        # what was last said of hypotheses, with what took part and how many had been taken up or refused by then
        self.asked: tuple[Selection, tuple[int, int], list[Likely]] | None = None
        # with which nothing would hold the photos, or that mean nothing in the end
        self.refused: list[Hypothesis] = list(refused)

    def rays_of(self, points: Numbers, among: Flags | None = None) -> Numbers:
        """Rows of all rays of points, or of those `among` them (n,), by point, then photo."""
        wanted = np.zeros(self.problem.points, bool)
        wanted[points] = True
        row = self.by_point[wanted[self.problem.images.point[self.by_point]]]
        return row if among is None else row[among[row]]

    def adjust(self, selection: Selection) -> ScreenedBundle:
        """Adjust a selection, and start from there the next time; what was given must not all be outside."""
        if not self.free and is_free(selected(self.problem, selection)):
            raise GeometryError("what is given contradicts the photos, all of it", code="bundle-rank")
        done = ScreenedBundle.of(self.problem, selection, self.settings, rough=self.rough)
        self.problem = restarted(self.problem, done.solution)
        self.rounds += 1
        return done

    def clean(self, selection: Selection) -> ScreenedBundle:
        """Test, and take up or take out what explains most, until nothing is beyond the limit."""
        try:
            done = self.adjust(selection)
        except GeometryError:
            reordered = self._reordered(selection)
            if reordered is None:
                raise
            done = self.adjust(supported(self.problem, reordered))
        while True:
            worst = self._worst(done)
            found = self._with_likeliest(done, worst)
            if found is None and not len(worst):
                return done
            if found is not None:
                done = found
            elif isinstance(worst, WrongRays):
                done = self._without_rays(done, worst)
            elif worst[0].kind == POSITION and (reordered := self._reordered(done.selection)) is not None:
                done = self.adjust(supported(self.problem, reordered))
            else:
                done = self._without_given(done, worst)

    def with_doubted_control(self, selection: Selection) -> Selection:
        """Put in what the strips by themselves left out of the control, where a hypothesis explains it better.

        Their search knows nothing of cameras: of a lens that is not as stated it throws out sound control.
        """
        if self.rough or not self.waiting.any():
            return selection
        everything = Selection.everything(self.problem).control
        with self._trial():
            try:
                start = supported(self.problem, replace(selection, control=everything))
                without, done = self.adjust(selection), self.adjust(start)
            except GeometryError:
                return selection
            fall = max(done.solution.chi_square - without.solution.chi_square, 0.0) / done.limit.unit**2
            out = int(self.waiting.sum())
            ways = comb(int(np.isfinite(self.problem.control.sigma).sum()), out)
            doubted = min(hypotheses.log_probability(fall, out) + log(ways), 0.0)
            likely = self._likeliest(done, doubted)
            first = hypotheses.most_likely(likely, self.settings.level).hypothesis if likely else None
            tried = None if first is None else self._with(first, done.selection)
        if tried is None:
            return selection
        self.problem = tried.problem
        self.common.append(tried.hypothesis)
        self.waiting[:], self.control = False, everything
        self.began = {key: each for key, each in self.began.items() if key[0] != CONTROL}
        return supported(self.problem, done.selection)

    def with_most_control(self, done: ScreenedBundle) -> ScreenedBundle:
        """Put all control back where half of it went, in plan or in height: which half is wrong tests cannot tell.

        They would leave what goes with some wrong coordinates. Where camera positions take part, these tell it.
        """
        gone = np.zeros_like(done.selection.control)
        for kind, row, axis in (*self.out, *self.began):
            if kind == CONTROL:
                gone[row, axis] = not done.selection.holds(kind, row, axis)
        every = done.selection.control | gone
        parts = [(gone[:, axes].sum(), every[:, axes].sum()) for axes in (slice(UP_AXIS), UP_AXIS)]
        half, back = any(out > 0 and out >= LARGEST_SHARE * whole for out, whole in parts), None
        if half and not done.selection.positions.any():
            point, images = self.problem.images.point, done.selection.images
            unseen = np.setdiff1d(self.problem.control.point[gone.any(axis=1)], point[images])
            images = images | (self.begin & np.isin(point, unseen))  # all went against what is given of their points
            back = self._tried(replace(done.selection, images=images, control=every))
        if back is None:
            return done
        self.held |= {(CONTROL, row, axis) for row, axis in np.argwhere(every).tolist()}
        return back

    @property
    def _level(self) -> float:
        """Logarithm of the level at which anything but single observations is taken up, a part of that of all tests."""
        return float(np.log(hypotheses.SHARED * self.settings.level))

    def _likeliest(self, done: ScreenedBundle, bound: float) -> list[Likely]:
        """Hypotheses that are likelier than a bound, one of each kind, and than the level.

        They are asked about anew where more has changed than few rays, and at the end, where the bound is 0.
        """
        cameras, level = self.settings.search_cameras, self.settings.level
        asked, taken = self.asked, (len(self.common), len(self.refused))
        if bound == 0.0 or asked is None or asked[1] != taken or self._moved(done.selection, asked[0]).any():
            found = hypotheses.likeliest(done.solution, done.limit.unit, level, cameras=cameras, refused=self.refused)
            self.asked = asked = done.selection, taken, found
        return [each for each in asked[2] if each.log_p <= min(bound, self._level)]

    def _take_up(self, hypothesis: Hypothesis) -> None:
        self.common.append(hypothesis)
        self.problem = hypotheses.taken_up(self.problem, hypothesis)

    def _with_likeliest(self, done: ScreenedBundle, worst: list[Rejection] | WrongRays) -> ScreenedBundle | None:
        """Take up the hypothesis that explains more, by its probability, than the worst observation; None: none does.

        Those that explain it nearly alike are adjusted with: what contradicts the rest by a hundred standard deviations
        bends the network further than it can be linearised.
        """
        likely_ones, scaled = self._likeliest(done, self._log_p(done, worst)), self._scaled(done)
        if (likely_ones or scaled) and (reordered := self._reordered(done.selection)) is not None:
            return self.adjust(supported(self.problem, reordered))
        adjusted = [(each.hypothesis, self._with(each.hypothesis, done.selection)) for each in likely_ones]
        self.refused += [hypothesis for hypothesis, each in adjusted if each is None]
        tried = [each for _, each in adjusted if each is not None]
        chosen = self._explaining_most(done, tried) if tried else None
        if scaled is not None:
            chosen = self._rather_scaled(done, scaled, tried, worst) or chosen
        if chosen is None:
            return None
        self.problem = chosen.problem
        again = chosen is scaled and hypotheses.factors_of(self.common) != UNSCALED
        self.common = [each for each in self.common if not (again and each.kind == SIGMAS)] + [chosen.hypothesis]
        if chosen is not scaled or again:
            return chosen.found
        return self.adjust(supported(self.problem, self._with_all_positions(chosen.found.selection)))

    def _explaining_most(self, done: ScreenedBundle, tried: Sequence[_Tried]) -> _Tried:
        """Return the hypothesis with which the sum of squares fell most."""
        unit = _unit(tried)
        adjusted = [each.explained(done, unit) for each in tried]
        likely = hypotheses.most_likely(adjusted, self.settings.level)
        (chosen,) = (each for each in tried if each.hypothesis.name == likely.hypothesis.name)
        return chosen._replace(hypothesis=likely.hypothesis)

    def _scaled(self, done: ScreenedBundle) -> _Tried | None:
        """Multiply the standard deviations of positions until these scatter as far; None where they do so already."""
        taken = np.array(hypotheses.factors_of(self.common))
        if not done.selection.positions.any() or any(each.kind == SIGMAS for each in self.refused):
            return None
        likely = hypotheses.of_scatter(done.scatter, done.limit.unit, taken, self._level)
        if likely is None:
            return None
        found, total, step = done, taken, np.array(likely.hypothesis.factors)
        asked = step != 1.0
        with self._trial():
            for _ in range(reliability.ITERATIONS):
                total = total * step
                scaling = replace(likely.hypothesis, factors=tuple(step.tolist()))
                self.problem = hypotheses.taken_up(self.problem, scaling)
                try:
                    found = self.adjust(supported(self.problem, done.selection))
                except GeometryError:
                    return None
                step = np.where(asked, np.maximum(found.scatter.factors / found.limit.unit, 1.0 / total), 1.0)
                if (np.abs(step - 1.0) < SCALED).all():
                    break
            return _Tried(replace(likely.hypothesis, factors=tuple(total.tolist())), found, self.problem)

    def _rather_scaled(
        self, done: ScreenedBundle, scaled: _Tried, tried: Sequence[_Tried], worst: list[Rejection] | WrongRays
    ) -> _Tried | None:
        """Return larger standard deviations of positions, or what must be taken up before; None: others explain more.

        Whatever else is wrong makes positions scatter, too: those with which they would scatter less go before.
        """
        unit, taken = _unit([*tried, scaled]), hypotheses.factors_of(self.common)
        factors = scaled.hypothesis.factors
        step = np.array(factors) / taken
        asked = step != 1.0
        # wrong ones among them, whose squares would count as explained, add nothing to what most of them explain
        by_most = (done.scatter.redundancy * step**2 - scaled.found.scatter.redundancy)[asked].sum()
        by_most -= hypotheses.price(scaled.found.scatter, step)
        explained = min(done.left(unit, taken) - scaled.found.left(unit, factors), by_most)
        log_p = Likely.of(scaled.hypothesis, explained, int(asked.sum()), len(asked)).log_p
        of_worst = self._log_p(replace(done, limit=done.limit._replace(unit=unit)), worst)
        if log_p > min([of_worst, self._level, *(each.explained(done, unit).log_p for each in tried)]):
            return None
        first, number = [], len(OF_CAMERAS) + len(OF_PHOTOS) * self.problem.photos
        for each in tried:
            with self._trial():
                self.problem = each.problem
                both = self._scaled(each.found)
            by = taken if both is None else both.hypothesis.factors
            fall = hypotheses.price(scaled.found.scatter, np.array(factors) / by)
            freedom = done.solution.redundancy - each.found.solution.redundancy
            likely = Likely.of(each.hypothesis, fall, freedom, number)
            if likely.log_p <= self._level:
                first.append(likely)
        if not first:
            return scaled
        name = hypotheses.most_likely(first, self.settings.level).hypothesis.name
        return next(each for each in tried if each.hypothesis.name == name)

    @contextmanager
    def _trial(self) -> Iterator[None]:
        """Go on with the problem as it was before, wherever a trial ends."""
        before = self.problem
        try:
            yield
        finally:
            self.problem = before

    def _with(self, hypothesis: Hypothesis, selection: Selection) -> _Tried | None:
        """Adjust a selection with a hypothesis, from the first of its starts that leads to an end; None: none does."""
        for start in hypotheses.starts(self.problem, hypothesis):
            with self._trial():
                self.problem = replace(hypotheses.taken_up(self.problem, hypothesis), start=start)
                try:
                    found = self.adjust(supported(self.problem, selection))
                except GeometryError:  # what is left would not hold the photos, or steps do not come to an end
                    continue
                if not hypotheses.impossible(found.solution):
                    return _Tried(hypothesis, found, self.problem)
        return None

    def put_back(self, done: ScreenedBundle) -> Selection | None:
        """Give up what the end supports least of all that was taken up; None where it supports everything.

        One at a time: of two that explain the same each is needless beside the other.
        """
        log_p, gone = max(
            ((self._asked_again(done, each), n) for n, each in enumerate(self.common)), default=(-np.inf, 0)
        )
        if log_p <= self._level:
            return None
        needless = self.common[gone]
        self.refused.append(needless)
        self.common[gone : gone + 1] = _plainer(needless)
        self.problem = self._with_all(self.common)
        return self._counting(done.selection)

    def _with_all(self, common: Sequence[Hypothesis]) -> BundleProblem:
        """Let what is given take up some hypotheses, and start where the last adjustment ended."""
        return replace(reduce(hypotheses.taken_up, common, self.given), start=self.problem.start)

    def _counting(self, selection: Selection) -> Selection:
        """Return a selection with all control that was put in and that nothing has rejected: a list comes back so."""
        return replace(selection, control=self.control)

    def _asked_again(self, done: ScreenedBundle, hypothesis: Hypothesis) -> float:
        """Logarithm of the probability that a hypothesis explains so much by chance beside all the others at the end.

        An adjustment without it is asked as the search was. It stays where there is none; an offset stays within a
        drift, which is asked about first.
        """
        others = [other for each in self.common for other in (_plainer(each) if each is hypothesis else [each])]
        if hypothesis.kind == OFFSET and any(each.kind == DRIFT for each in others):
            return -np.inf
        without = self._with_all(others)
        selection = supported(without, self._counting(done.selection))
        try:
            if hypothesis.kind == SIGMAS:
                unit, bare = done.limit.unit, ScreenedBundle.of(without, selection, self.settings)
                fall = bare.left(unit, UNSCALED) - done.left(unit, hypothesis.factors)
                return hypotheses.log_probability_of_any(max(fall, 0.0), 1, len(UNSCALED))
            if hypothesis.kind == ORDER:
                return -np.inf if self._order(without, selection)[1] == hypothesis else 0.0
            solution = solve(selected(without, selection))
        except GeometryError:
            return -np.inf
        return hypotheses.log_probability_again(solution, hypothesis, done.limit.unit)

    def _reordered(self, selection: Selection) -> Selection | None:
        """Give photos the positions of other rows, where an adjustment without any of them says so; asked once.

        What was taken out of them went for the order: all come back.
        """
        used = selection.positions.any()
        if self.order_asked or not used or is_free(replace(self.problem, positions=PositionObservations())):
            return None
        self.order_asked = True
        try:
            solution, found = self._order(self.problem, supported(self.problem, selection))
        except GeometryError:
            return None
        if found is None:
            return None
        self.problem = restarted(self.problem, solution)
        self._take_up(found)
        return self._with_all_positions(selection)

    def _with_all_positions(self, selection: Selection) -> Selection:
        """Put positions back that went by another order, or by smaller standard deviations."""
        self.out = {key: each for key, each in self.out.items() if key[0] != POSITION}
        return replace(selection, positions=Selection.everything(self.problem).positions)

    def _order(self, problem: BundleProblem, selection: Selection) -> tuple[BundleSolution, Hypothesis | None]:
        """Ask an adjustment in which positions take no part in which order they are those of the photos.

        It starts where the search did: positions of other photos bend the network further than it finds back.
        """
        without = replace(selection, positions=np.zeros_like(selection.positions))
        bare = selected(replace(problem, start=self.given.start), without)
        if is_free(bare):
            raise GeometryError("nothing but camera positions gives a datum", code="bundle-rank")
        solution = solve(bare)
        self.rounds += 1
        positions, level = problem.positions, self.settings.level
        return solution, hypotheses.order_of_positions(solution, cofactors_of(solution), positions, level)

    def _log_p(self, done: ScreenedBundle, worst: list[Rejection] | WrongRays) -> float:
        """Logarithm of the probability that the worst single observation, ray or coordinate, is so bad by chance."""
        if not len(worst):
            return 0.0
        if not isinstance(worst, WrongRays):
            return self._log_p_of_given(done, worst[0])
        place = np.cumsum(done.selection.images) - 1
        rows = place[worst.row[done.selection.images[worst.row]]]
        error, cofactor = done.solution.image_residuals[rows], done.precision.image_residuals[rows]
        squares = reliability.explained_by(error, cofactor, done.problem.images.sigma[rows]).max(initial=0.0)
        rays = len(done.problem.images)
        return hypotheses.log_probability_of_any(float(squares) / done.limit.unit**2, error.shape[1], rays)

    def _log_p_of_given(self, done: ScreenedBundle, worst: Rejection) -> float:
        """Rank a given coordinate, by itself or with all that is given of its point or photo."""
        problem, solution, precision = done.problem, done.solution, done.precision
        error, cofactor, sigma = {
            CONTROL: (solution.control_residuals, precision.control_residuals, problem.control.sigma),
            POSITION: (solution.position_residuals, precision.position_residuals, problem.positions.sigma),
            ATTITUDE: (solution.attitude_residuals, precision.attitude_residuals, problem.attitudes.sigma),
        }[worst.kind]
        row = worst.row
        used = np.flatnonzero(np.isfinite(sigma[row]))
        parts = error[row, used], cofactor[row][np.ix_(used, used)], sigma[row, used]
        whole = reliability.explained_by(*(each[None] for each in parts)) / done.limit.unit**2
        rows = len(problem.control) + len(problem.positions) + len(problem.attitudes)
        alone = hypotheses.log_probability_of_any(worst.value**2, 1, 3 * rows)
        return min(alone, hypotheses.log_probability_of_any(float(whole[0]), len(used), rows))

    def _without_rays(self, done: ScreenedBundle, worst: WrongRays) -> ScreenedBundle:
        """Take rays out; points without which nothing would hold some photos stay, whatever the tests say.

        Rays that hardly move any photo are worth no adjustment of their own: what fits comes back with it.
        """
        images = done.selection.images.copy()
        images[worst.row] = False
        left = replace(done.selection, images=images)
        more = self.fitting(done, left) if not self._moved(left, done.selection).any() else None
        found = None if more is None else self._tried(more)
        if found is None:
            found = self._tried(left)
        if found is not None:
            self.out |= {(IMAGE, row, 0): None for row in worst.row.tolist()}
            self.rays.test[worst.row] = self.settings.test
            self.rays.say(worst)
            return found
        points = self.problem.images.point[worst.row]
        first = points <= np.sort(points)[(len(points) - 1) // 2]
        if first.all():
            self.spared[points] = True
            return done
        for half in (first, ~first):
            done = self._without_rays(done, take_rows(worst, half, ("row", *WRONG_COLUMNS)))
        return done

    def _without_given(self, done: ScreenedBundle, worst: list[Rejection]) -> ScreenedBundle:
        """Take given coordinates out: the worst alone where the adjustment fails without all of them, else none."""
        selection = done.selection
        for each in worst:
            selection = selection.without(each.kind, each.row, each.axes[0])
        found = self._tried(selection)
        if found is None and len(worst) > 1:
            return self._without_given(done, worst[:1])
        if found is None:
            self.held.add((worst[0].kind, worst[0].row, worst[0].axes[0]))
            return done
        for each in worst:
            key = each.kind, each.row, each.axes[0]
            if each.kind == CONTROL:
                self.control[each.row, each.axes[0]] = False
                self.waiting[each.row, each.axes[0]] = key not in self.out  # it comes back once only
            self.out[key] = each
        return found

    def _tried(self, selection: Selection) -> ScreenedBundle | None:
        """Adjust a selection; None where that fails."""
        before = self.problem
        try:
            found = self.adjust(supported(self.problem, selection))
            reliability.require_regular(found.problem, found.solution, found.precision)
        except GeometryError as error:
            self.problem = before
            if error.code not in defects.OPEN:
                self.failed += 1
                rows = [row for kind, row, _ in self.out if kind == IMAGE]
                defects.refuse_endless(before, rows, self.rounds, self.failed)
            return None
        return found

    def _worst(self, done: ScreenedBundle) -> list[Rejection] | WrongRays:
        """Return the worst rays of every neighbourhood, or the worst given coordinates where they are worse.

        The more of these are out, the more go at a time: the work grows with the logarithm of their number.
        """
        rays, given = self.tested(done)
        doubtful = self._doubtful(done.selection, rays, done.limit)
        given = [each for each in given if not self.holds(each)]
        if given and given[0].value >= doubtful.max(initial=0.0):
            return given[: 1 + self._given_out() // OUT_TO_ONE_MORE]
        return self._wrong_rays(done, np.flatnonzero(self._worst_nearby(done.selection, doubtful)), done.limit)

    def tested(self, done: ScreenedBundle) -> tuple[Floats, list[Rejection]]:
        """Test values of rays that took part, and the given coordinates beyond the limit, the worst first."""
        limit, rays, given = done.limit, np.zeros(0), []
        for group in reliability.groups_of(done.problem, done.solution, done.precision):
            value = np.abs(np.nan_to_num(group.standardised)) / limit.unit
            if group.kind == IMAGE:
                rays = value.max(axis=1)
                continue
            given += [
                Rejection(
                    kind=group.kind,
                    row=row,
                    axes=(axis,),
                    test=self.settings.test,
                    value=float(value[row, axis]),
                    limit=limit.given,
                    size=tuple(group.gross[row].tolist()),
                )
                for row, axis in np.argwhere(value > limit.given).tolist()
            ]
        return rays, sorted(given, key=lambda each: -each.value)

    def doubted(self, done: ScreenedBundle) -> tuple[Rejection, ...]:
        """Given coordinates that only the sigma0 found keeps within the limit, where it is not far from what is stated.

        A wrong one enlarges sigma0, which hides it.
        """
        if self.rough or done.limit.unit == 1.0 or not reliability.sigma0_test(done.solution, TEST_LEVEL).passed:
            return ()
        by_stated = replace(done, limit=done.limit._replace(unit=1.0))
        return tuple(each for each in self.tested(by_stated)[1] if not self.holds(each))

    def holds(self, given: Rejection) -> bool:
        return (given.kind, given.row, given.axes[0]) in self.held

    def _given_out(self) -> int:
        return sum(kind != IMAGE for kind, _, _ in self.out)

    def _doubtful(self, selection: Selection, value: Floats, limit: Limit) -> Floats:
        """Test values of points, by the worst of their rays; 0 where it is within the limit, or the user keeps one."""
        point, worst = self.problem.images.point[selection.images], np.zeros(self.problem.points)
        np.maximum.at(worst, point, value)
        within = worst <= limit.of(np.bincount(point, minlength=len(worst)))
        return np.where(self.spared | within, 0.0, worst)

    def _worst_nearby(self, selection: Selection, value: Floats) -> Flags:
        """Doubtful points among the worst on enough of their photos: one, and more where much went or much is left."""
        photo, point = self.problem.images.photo[selection.images], self.problem.images.point[selection.images]
        out = self.problem.images.photo[self.begin & ~selection.images]
        more = np.bincount(out, minlength=self.problem.photos)
        rays = np.bincount(photo, minlength=self.problem.photos)
        more += rays // RAYS_TO_ONE_MORE + np.maximum(rays - AMPLE, 0) // OUT_TO_ONE_MORE
        order = np.lexsort((-value[point], photo))
        worse = np.arange(len(order)) - np.searchsorted(photo[order], photo[order])
        among = np.bincount(point[order[worse <= more[photo[order]]]], minlength=len(value))
        enough = np.minimum(np.bincount(point, minlength=len(value)), PHOTOS_ENOUGH)
        return np.asarray((value > 0.0) & (among >= enough), bool)

    def _wrong_rays(self, done: ScreenedBundle, points: Numbers, limit: Limit) -> WrongRays:
        """Return the rays of points that must go; all of a point where none of them alone does it."""
        decided = self._decided(done, self.rays_of(points, done.selection.images), done.solution.points[points])
        stays = (np.bincount(decided.place, decided.out, len(points)) == 0)[decided.place]  # within rounding of it
        cause = np.where(stays, cause_of_all(decided.rays), decided.cause)
        return self._rejected(replace(decided, out=decided.out | stays, cause=cause), limit)

    def _rejected(self, decided: RayDecisions, limit: Limit) -> WrongRays:
        """Say of the rays that must go what was decided."""
        out = decided.out
        return WrongRays(
            row=decided.row[out],
            value=decided.value[out] / limit.unit,
            limit=limit.of(decided.rays[out]),
            size=decided.size[out] * self.problem.images.sigma[decided.row[out]],
            cause=decided.cause[out],
        )

    def _decided(self, done: ScreenedBundle, rows: Numbers, xyz: Floats, control: Flags | None = None) -> RayDecisions:
        adjusted = Adjusted(
            problem=self.problem,
            selection=done.selection,
            control=self.control if control is None else control,
            solution=done.solution,
            joint=done.joint,
        )
        return decide_rays(adjusted, rows, xyz, done.limit)

    def _moved(self, selection: Selection, before: Selection) -> Flags:
        """Photos (m,) that anything else took part in than before, but for few of their rays."""
        photo, m = self.problem.images.photo, self.problem.photos
        moved = np.bincount(photo[selection.images != before.images], minlength=m)
        few = np.bincount(photo[selection.images], minlength=m) // RAYS_TO_DECIDE_AGAIN
        return np.asarray((moved > few) | (selection.given != before.given), bool)

    def fitting(self, done: ScreenedBundle, left: Selection | None = None) -> Selection | None:
        """Put back what fits the adjustment without it; None when there is nothing new.

        left: what the adjustment leaves, without rays that go.
        """
        left = done.selection if left is None else left
        point, images = self.problem.images.point, left.images.copy()
        limit, xyz = done.limit, self.problem.start.points.copy()
        photo = self.problem.images.photo
        changed = self._moved(left, self.decided)
        self.decided = replace(left, images=np.where(changed[photo], images, self.decided.images))
        rays = np.bincount(point, minlength=len(xyz))
        asked = (self.beyond <= limit.of(rays)) | np.isinf(self.beyond)  # the limit rises where less is established
        goes = np.zeros(len(xyz), bool)
        goes[point[done.selection.images & ~images]] = True
        numbers = np.unique(point[~images & (changed[photo] | asked[point]) & ~goes[point]])
        placed = np.bincount(point[images], minlength=len(xyz))[numbers, None] >= self.problem.least
        place = np.where(placed, done.solution.points[numbers], np.nan)
        place = np.where(rays[numbers, None] < self.problem.least, xyz[numbers], place)
        owner = self.problem.control.point
        unseen = self.waiting & ~np.isin(owner, point[images])[:, None]  # only rays that are out contradict it
        decided = self._decided(done, self.rays_of(numbers), place, self.control | unseen)
        self.rays.say(self._rejected(decided, limit))
        row, number = decided.row, numbers[decided.place]
        self.beyond[number] = decided.value / limit.unit
        fit = np.bincount(decided.place, ~decided.out & ~images[row], len(numbers)) > 0
        fit &= ~self.back[numbers]
        self.back[numbers[fit]] = True
        xyz[numbers[fit]] = place[fit]
        again = fit[decided.place]
        images[row[again]] = (~decided.out | (images[row] & self.spared[number]))[again]
        fits = self._given(done, limit.given * limit.unit)
        fits |= unseen & np.isin(owner, numbers[fit])[:, None]
        self.control, self.waiting = self.control | fits, self.waiting & ~fits
        self.problem = replace(self.problem, start=replace(self.problem.start, points=xyz))
        chosen = supported(self.problem, replace(left, images=images, control=self.control))
        same = (chosen.images == left.images).all() and (chosen.control == left.control).all()
        return None if same else chosen

    def _given(self, done: ScreenedBundle, limit: float) -> Flags:
        """Control coordinates that were left out, from the start or by a test, and fit."""
        control = self.problem.control
        error = np.abs(done.solution.control_residuals)
        cofactor = -np.diagonal(done.precision.control_residuals, axis1=1, axis2=2)
        with np.errstate(invalid="ignore"):
            fits = error < limit * np.sqrt(control.sigma**2 + np.maximum(cofactor, 0.0))
        return np.asarray(fits & self.waiting, bool)

    def log(self, done: ScreenedBundle) -> Iterator[Rejection]:
        """Return every observation that a test took out at some time, and those that began outside and stay there."""
        holds = done.selection.holds
        every = self.out | {key: each for key, each in self.began.items() if key not in self.out and not holds(*key)}
        rows = np.array([row for kind, row, _ in every if kind == IMAGE], np.intp)
        of_rays = self.rays.records(rows, done.selection.images)
        for (kind, row, axis), each in every.items():
            if each is None:
                yield of_rays[row]
                continue
            found = each
            if np.isnan(each.value):
                size = tuple((-done.solution.control_residuals[row]).tolist())
                found = replace(each, limit=done.limit.given, size=size)
            yield replace(found, readmitted=holds(kind, row, axis))
