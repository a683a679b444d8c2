"""The search for gross errors in an adjustment of rays: test, take the worst out, adjust again, take back what fits.

The adjustment is a bundle: the free network of one strip, or a block with its control and camera positions. What is
tested are standardised residuals; of a point with a ray beyond the limit ``point_decisions`` says which rays are wrong.
At the end every point with a ray outside is tested in the same way, by photos that the others orient.

Source: [Baarda 1968], [Pope 1976].
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property, partial

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers, distinct
from photostrip.errors import GeometryError
from photostrip.frozen import dataclass, replace
from photostrip.rejection import SEVERAL_RAYS, Rejection
from photostrip.triangulation.bundle import robust
from photostrip.triangulation.bundle.common_errors import CommonError, find_common_error, taken_up
from photostrip.triangulation.bundle.normal_equations.defects import refuse_endless
from photostrip.triangulation.bundle.observations.problem import BundleProblem
from photostrip.triangulation.bundle.quality import reliability
from photostrip.triangulation.bundle.quality.cofactors import JointCofactors, cofactors_of
from photostrip.triangulation.bundle.quality.reliability import CONTROL, IMAGE, Limit
from photostrip.triangulation.bundle.quality.self_calibration import image_shift
from photostrip.triangulation.bundle.selection import LEAST_RAYS, Selection, restarted, selected, supported
from photostrip.triangulation.bundle.settings import BundleSettings
from photostrip.triangulation.bundle.solution import BundleSolution, Cofactors
from photostrip.triangulation.bundle.solve import solve
from photostrip.triangulation.gross_errors.pairs.pair_search import OUT_TO_ONE_MORE
from photostrip.triangulation.gross_errors.rays.point_decisions import (
    Decision,
    PointRays,
    alike,
    cause_of_all,
    decide,
    undecided,
)
from photostrip.triangulation.resection.collinearity import KnownPhotos, derivatives, project
from photostrip.triangulation.resection.ray_intersection import two_that_meet

RAYS_TO_ONE_MORE = 50  # of a photo, for each of its points that may go at a time beside the worst: they hardly move it
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
    common: tuple[CommonError, ...] = ()  # what groups of observations share, taken up as unknowns

    @classmethod
    def of(
        cls, problem: BundleProblem, selection: Selection, settings: BundleSettings, *, rough: bool = False
    ) -> ScreenedBundle:
        chosen = selected(problem, selection)
        solution = solve(chosen, rough=rough)
        points_out = len(distinct(problem.images.point[~selection.images]))
        return cls(
            problem=chosen,
            selection=selection,
            solution=solution,
            precision=cofactors_of(solution, rough=rough),
            limit=reliability.limit_of(solution, settings, points_out, BOTH_GO if rough else 1.0),
        )

    @cached_property
    def joint(self) -> JointCofactors:
        return JointCofactors.of_solution(self.solution)


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
    the tests say.

    rough: only the rays matter: adjust as well as their tests need it; two that only go together have ``BOTH_GO``.
    """
    if settings.screening == "none":
        return ScreenedBundle.of(problem, supported(problem, Selection.everything(problem)), settings)
    search = _Search(problem, begin, settings, kept, rough=rough)
    chosen = supported(problem, begin)
    if settings.screening == "robust":
        chosen = search.robust(chosen)
    done = search.clean(chosen)
    while (more := search.fitting(done)) is not None:  # a point comes back once only
        done = search.clean(more)
    return replace(done, rejections=tuple(search.log(done)), rounds=search.rounds, common=tuple(search.common))


class _Search:
    """What is remembered from round to round."""

    def __init__(
        self, problem: BundleProblem, begin: Selection, settings: BundleSettings, kept: Flags | None, *, rough: bool
    ) -> None:
        self.problem, self.settings, self.rough = problem, settings, rough
        images = problem.images
        self.by_point = np.lexsort((images.photo, images.point))
        self.first = np.searchsorted(images.point[self.by_point], np.arange(problem.points + 1))
        self.spared = np.zeros(problem.points, bool)  # points of rays that are kept
        self.spared[images.point[[] if kept is None else kept]] = True
        self.waiting = Selection.everything(problem).control & ~begin.control  # given coordinates not put in yet
        self.begin = begin.images
        self.control = begin.control.copy()  # those that were put in, and that nothing has rejected
        self.out: dict[tuple[str, int, int], Rejection] = {}
        nothing = partial(Rejection, test="start", value=float("nan"), limit=float("nan"))
        rays, given = np.flatnonzero(~begin.images).tolist(), np.argwhere(self.waiting).tolist()
        self.began = {(IMAGE, row, 0): nothing(kind=IMAGE, row=row, cause=SEVERAL_RAYS) for row in rays}
        self.began |= {(CONTROL, row, axis): nothing(kind=CONTROL, row=row, axes=(axis,)) for row, axis in given}
        self.latest: dict[int, Rejection] = {}  # what was last said of rays outside
        self.back: set[int] = set()  # points that came back; what must go again stays out
        self.decided = Selection.everything(problem)  # what took part when rays outside were decided on
        self.beyond = np.full(problem.points, np.inf)  # test values of points with a ray outside, when decided on
        self.rounds = self.failed = 0
        self.common: list[CommonError] = []
        self.next_trial = 0  # given coordinates that are out when a common error, tried in vain, is tried again

    def rays_of(self, point: int) -> Numbers:
        """Rows of the rays of a point, in the order of the photos."""
        return self.by_point[self.first[point] : self.first[point + 1]]

    def adjust(self, selection: Selection) -> ScreenedBundle:
        """Adjust a selection, and start from there the next time."""
        done = ScreenedBundle.of(self.problem, selection, self.settings, rough=self.rough)
        self.problem = restarted(self.problem, done.solution)
        self.rounds += 1
        return done

    def robust(self, selection: Selection) -> Selection:
        """Take out at once what re-weighting leaves next to no weight."""
        chosen = selected(self.problem, selection)
        solution, weight = robust.adjust_robustly(chosen)
        self.problem = restarted(self.problem, solution)
        self.rounds += robust.REWEIGHTINGS
        rows, unknown = np.flatnonzero(selection.images)[weight < robust.NO_WEIGHT], float("nan")
        rows = rows[~self.spared[self.problem.images.point[rows]]]
        images = selection.images.copy()
        images[rows] = False
        for row in rows.tolist():
            self.out[IMAGE, row, 0] = Rejection(kind=IMAGE, row=row, test="robust", value=unknown, limit=unknown)
        return supported(self.problem, replace(selection, images=images))

    def clean(self, selection: Selection) -> ScreenedBundle:
        """Test and take out until nothing is beyond the limit."""
        done = self.adjust(selection)
        while (worst := self._worst(done)) or reliability.sigma0_test(done.solution).too_large:
            if (not worst or worst[0].kind != IMAGE) and self._take_up_common(done, *worst[:1]):
                done = self.adjust(supported(self.problem, done.selection))
                continue
            if not worst:
                break
            done = self._without(done, worst)
        return done

    def _take_up_common(self, done: ScreenedBundle, worst: Rejection | None = None) -> bool:
        """Take up what a group of observations shares, where that explains more than the worst given coordinate."""
        if worst and self._given_out() < self.next_trial:
            return False
        found = find_common_error(self.problem, done.selection, done.solution, done.limit, worst)
        if found is None:
            self.next_trial = 2 * self._given_out() + 1
            return False
        self.common.append(found)
        self.problem = taken_up(self.problem, found)
        return True

    def _without(self, done: ScreenedBundle, worst: list[Rejection]) -> ScreenedBundle:
        """Take observations out; points without which nothing would hold some photos stay, whatever the tests say."""
        selection, axes = done.selection, [0 if each.kind == IMAGE else each.axes[0] for each in worst]
        for each, axis in zip(worst, axes, strict=True):
            selection = selection.without(each.kind, each.row, axis)
        before = self.problem
        try:
            found = self.adjust(supported(self.problem, selection))
            reliability.require_regular(found.problem, found.solution, found.precision)
        except GeometryError:
            self.problem, self.failed = before, self.failed + 1
            refuse_endless(before, [row for kind, row, _ in self.out if kind == IMAGE], self.rounds, self.failed)
            if worst[0].kind != IMAGE:
                if len(worst) > 1:
                    return self._without(done, worst[:1])
                raise
            points = self.problem.images.point[[each.row for each in worst]]
            first = points <= np.sort(points)[(len(points) - 1) // 2]
            if first.all():
                self.spared[points] = True
                return done
            halves = ([each for each, take in zip(worst, some, strict=True) if take] for some in (first, ~first))
            for half in halves:
                done = self._without(done, half)
            return done
        for each, axis in zip(worst, axes, strict=True):
            self.out[each.kind, each.row, axis] = each
            if each.kind == IMAGE:
                self.latest[each.row] = each
            elif each.kind == CONTROL:
                self.control[each.row, axis] = False
        return found

    def _worst(self, done: ScreenedBundle) -> list[Rejection]:
        """Return the worst rays of every neighbourhood, or the worst given coordinates where they are worse.

        The more of these are out, the more go at a time: the work grows with the logarithm of their number.
        """
        limit = done.limit
        rays, given = np.zeros(0), []
        for group in reliability.groups_of(done.problem, done.solution, done.precision):
            value = np.abs(np.nan_to_num(group.standardised)) / limit.unit
            if group.kind == IMAGE:
                rays = self._doubtful(done.selection, value.max(axis=1), limit)
                continue
            given += [
                Rejection(
                    kind=group.kind,
                    row=row,
                    axes=(axis,),
                    test=self.settings.test,
                    value=float(value[row, axis]),
                    limit=limit.value,
                    size=tuple(group.gross[row].tolist()),
                )
                for row, axis in np.argwhere(value > limit.value).tolist()
            ]
        given.sort(key=lambda each: -each.value)
        if given and given[0].value >= rays.max(initial=0.0):
            return given[: 1 + self._given_out() // OUT_TO_ONE_MORE]
        return self._wrong_rays(done, np.flatnonzero(self._worst_nearby(done.selection, rays)), limit)

    def _given_out(self) -> int:
        return sum(kind != IMAGE for kind, _, _ in self.out)

    def _doubtful(self, selection: Selection, value: Floats, limit: Limit) -> Floats:
        """Test values of points, by the worst of their rays; 0 where it is within the limit, or the user keeps one."""
        point, worst = self.problem.images.point[selection.images], np.zeros(self.problem.points)
        np.maximum.at(worst, point, value)
        within = worst <= limit.of(np.bincount(point, minlength=len(worst)))
        return np.where(self.spared | within, 0.0, worst)

    def _worst_nearby(self, selection: Selection, value: Floats) -> Flags:
        """Doubtful points among the worst on each of their photos: one, and more where much went or much is left."""
        photo, point = self.problem.images.photo[selection.images], self.problem.images.point[selection.images]
        out = self.problem.images.photo[self.begin & ~selection.images]
        more = np.bincount(out, minlength=self.problem.photos)
        more += np.bincount(photo, minlength=self.problem.photos) // RAYS_TO_ONE_MORE
        order = np.lexsort((-value[point], photo))
        worse = np.arange(len(order)) - np.searchsorted(photo[order], photo[order])
        wait = point[order[worse > more[photo[order]]]]
        return np.asarray((value > 0.0) & ~np.isin(np.arange(len(value)), wait), bool)

    def _wrong_rays(self, done: ScreenedBundle, points: Numbers, limit: Limit) -> list[Rejection]:
        """Return the rays of points that must go; all of a point where none of them alone does it."""
        rows, found = [each[done.selection.images[each]] for each in map(self.rays_of, points.tolist())], []
        for each, decision in zip(rows, self._decided(done, rows, limit, done.solution.points[points]), strict=True):
            all_go = replace(decision, out=np.ones(len(each), bool), cause=cause_of_all(len(each)))
            found += self._rejected(each, decision if decision.out.any() else all_go, limit)  # within rounding of it
        return found

    def _rejected(self, rows: Numbers, decision: Decision, limit: Limit) -> list[Rejection]:
        if not decision.out.any():
            return []
        size = decision.size * self.problem.images.sigma[rows]
        axis = np.fmax(np.abs(size), 0.0).argmax(axis=1)
        return [
            Rejection(
                kind=IMAGE,
                row=int(rows[place]),
                axes=(int(axis[place]),),
                test=self.settings.test,
                value=decision.value / limit.unit,
                limit=float(limit.of(len(rows))),
                size=tuple(size[place].tolist()),
                cause=decision.cause,
            )
            for place in np.flatnonzero(decision.out).tolist()
        ]

    def _decided(self, done: ScreenedBundle, rows: list[Numbers], limit: Limit, xyz: Floats) -> list[Decision]:
        """Decide on the rays of points, linearised at places near them; what is NaN becomes where they meet."""
        given, axis = np.nonzero(self.control & np.isfinite(self.problem.control.sigma))
        owner, point = self.problem.control.point[given], self.problem.images.point
        known = [np.flatnonzero(owner == point[each[0]]) for each in rows]
        found = [undecided(0)] * len(rows)
        for some in alike(list(zip(map(len, rows), map(len, known), strict=True))):
            rays, at = np.array([rows[each] for each in some]), np.array([known[each] for each in some], np.intp)
            place = xyz[some]
            for number, each in zip(some, self._alike(done, rays, (given[at], axis[at]), place, limit), strict=True):
                found[number] = each
            xyz[some] = place
        return found

    def _alike(
        self, done: ScreenedBundle, rows: Numbers, given: tuple[Numbers, Numbers], xyz: Floats, limit: Limit
    ) -> list[Decision]:
        """Decide on the r rays of each of m points with as many given coordinates."""
        images, control, cameras = self.problem.images, self.problem.control, self.problem.cameras
        photos = KnownPhotos(done.solution.centers, done.solution.rotations, cameras.focal[cameras.of_photo])
        (m, r), photo, sigma = rows.shape, images.photo[rows], images.sigma[rows][..., None]
        flat, own = images.xy[rows].reshape(-1, 2), photo.ravel()
        xy = (flat + image_shift(self.problem, done.solution.common, flat, own)).reshape(m, r, 2)
        if r >= LEAST_RAYS and (nowhere := np.isnan(xyz[:, 0])).any():
            xyz[nowhere] = two_that_meet(xy[nowhere], sigma[nowhere, :, :, 0], photo[nowhere], photos)
        place = np.repeat(xyz, r, axis=0)
        by_photo, by_point = (each.reshape(m, r, 2, -1) for each in derivatives(place, photos, own))
        off = xy - project(place, photos, own).reshape(m, r, 2)
        sound = np.asarray(np.isfinite(np.concatenate([off[..., None], by_photo], axis=3)).all(axis=(1, 2, 3)))
        for each in (off, by_photo, by_point):
            each[~sound] = 0.0
        spread, axes = control.sigma[given], control.axes[given]
        of_photos = np.zeros((m, 2 * r + spread.shape[1], 2 * r + spread.shape[1]))
        of_photos[:, : 2 * r, : 2 * r] = done.joint.of(photo, by_photo / sigma)
        to_given = np.einsum("mci,mci->mc", axes, control.xyz[given[0]] - xyz[:, None]) / spread
        rays = PointRays(
            rays=r,
            misfit=np.hstack([(off / sigma[..., 0]).reshape(m, -1), np.where(sound[:, None], to_given, 0.0)]),
            by_point=np.hstack([(by_point / sigma).reshape(m, -1, 3), axes / spread[..., None]]),
            of_photos=of_photos,
            inside=np.hstack([np.repeat(done.selection.images[rows], 2, axis=1), done.selection.control[given]]),
        )
        return [each if meets else undecided(r) for each, meets in zip(decide(rays, limit), sound, strict=True)]

    def fitting(self, done: ScreenedBundle) -> Selection | None:
        """Put back what fits the adjustment without it; None when there is nothing new."""
        point, images = self.problem.images.point, done.selection.images.copy()
        limit, xyz = done.limit, self.problem.start.points.copy()
        changed = np.full(self.problem.photos, done.selection.given != self.decided.given)
        changed[self.problem.images.photo[images != self.decided.images]] = True
        self.decided = done.selection
        within = self.beyond <= limit.of(np.diff(self.first))  # the limit rises where less is established
        numbers = distinct(point[~images & (changed[self.problem.images.photo] | within[point])])
        rows, single = list(map(self.rays_of, numbers.tolist())), np.diff(self.first)[numbers, None] < LEAST_RAYS
        placed = np.bincount(point[images], minlength=len(xyz))[numbers, None] > 1
        place = np.where(single, xyz[numbers], np.where(placed, done.solution.points[numbers], np.nan))
        decisions = self._decided(done, rows, limit, place)
        for number, rays, decision, at in zip(numbers.tolist(), rows, decisions, place, strict=True):
            self.latest |= {each.row: each for each in self._rejected(rays, decision, limit)}
            self.beyond[number] = decision.value / limit.unit
            if number not in self.back and (~decision.out & ~images[rays]).any():
                self.back.add(number)
                xyz[number] = at
                images[rays] = ~decision.out | (images[rays] & self.spared[number])
        fits = self._given(done, limit.value * limit.unit)
        self.control, self.waiting = self.control | fits, self.waiting & ~fits
        self.problem = replace(self.problem, start=replace(self.problem.start, points=xyz))
        chosen = supported(self.problem, replace(done.selection, images=images, control=self.control))
        same = (chosen.images == done.selection.images).all() and (chosen.control == done.selection.control).all()
        return None if same else chosen

    def _given(self, done: ScreenedBundle, limit: float) -> Flags:
        """Control coordinates that were left out from the start and fit."""
        control = self.problem.control
        error = np.abs(done.solution.control_residuals)
        cofactor = -np.diagonal(done.precision.control_residuals, axis1=1, axis2=2)
        with np.errstate(invalid="ignore"):
            fits = error < limit * np.sqrt(control.sigma**2 + np.maximum(cofactor, 0.0))
        return np.asarray(fits & self.waiting, bool)

    def log(self, done: ScreenedBundle) -> Iterator[Rejection]:
        """Return every observation that a test took out at some time, and those that began outside and stay there."""
        holds = done.selection.holds
        began = {key: each for key, each in self.began.items() if key not in self.out and not holds(*key)}
        for (kind, row, axis), each in (self.out | began).items():
            found = each
            if kind == IMAGE:
                found = replace(self.latest.get(row, each), test=each.test)
            elif np.isnan(each.value):
                size = tuple((-done.solution.control_residuals[row]).tolist())
                found = replace(each, limit=done.limit.value, size=size)
            yield replace(found, readmitted=holds(kind, row, axis))
