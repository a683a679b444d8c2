"""The search for gross errors: test, take the worst out, adjust again; at the end put back what fits after all."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.bundle.quality import reliability
from photostrip.triangulation.bundle.quality.cofactors import cofactors_of as precision_of
from photostrip.triangulation.bundle.quality.self_calibration import image_shift
from photostrip.triangulation.bundle.selection import FIELDS, Selection, restarted, selected, supported
from photostrip.triangulation.bundle.solve import solve
from photostrip.triangulation.resection.collinearity import KnownPhotos, derivatives, project
from photostrip.triangulation.resection.ray_intersection import intersect_points
from photostrip.triangulation.robust import falling_weights

if TYPE_CHECKING:
    from collections.abc import Iterator

    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.triangulation.bundle.observations.problem import BundleProblem
    from photostrip.triangulation.bundle.settings import BundleSettings
    from photostrip.triangulation.bundle.solution import BundleSolution, Cofactors


SEARCH_ROUNDS = 200  # of testing and taking out; each takes out one error of every neighbourhood
READMISSIONS = 3
NEAR = 0.5  # test value of what may go in the same round, in units of the worst of all
REWEIGHTINGS = 6  # of the robust adjustment
NORMAL_MEDIAN = 1.1774  # median of the length of two standard normal residuals
NO_WEIGHT = 1e-3  # weight below which a ray is out


@dataclass(frozen=True)
class BundleRejection:
    """One observation that was taken out."""

    kind: str  # ``image``, ``control``, ``position`` or ``attitude``
    row: int
    axis: int  # the coordinate beyond the limit: 0, 1 or 2. A ray goes out as a whole
    test: str  # name of the test; ``start`` for what the strip method had rejected already and does not fit
    value: float
    limit: float
    size: float  # what error would explain the residual: mm, metres or radians
    readmitted: bool = False  # whether it came back


@dataclass(frozen=True, eq=False)
class ScreenedBundle:
    """A solution and how it was cleaned."""

    problem: BundleProblem  # the problem with the observations that took part
    selection: Selection  # which those are
    solution: BundleSolution
    precision: Cofactors
    rejections: tuple[BundleRejection, ...] = ()  # what was taken out, in order; re-admitted ones are marked
    rounds: int = 1

    @classmethod
    def of(cls, problem: BundleProblem, selection: Selection) -> ScreenedBundle:
        """Adjust a selection."""
        chosen = selected(problem, selection)
        solution = solve(chosen)
        return cls(problem=chosen, selection=selection, solution=solution, precision=precision_of(solution))

    def rows(self, kind: str) -> Numbers:
        """Rows of the whole problem that the observations of a kind have."""
        if kind == reliability.IMAGE:
            return np.flatnonzero(self.selection.images)
        return np.arange(len(getattr(self.selection, FIELDS[kind])))


def screen_bundle(
    problem: BundleProblem, begin: Selection, settings: BundleSettings, kept: Flags | None = None
) -> ScreenedBundle:
    """Adjust a problem and take its gross errors out.

    ``begin`` takes part at first, the rest is put in at the end where it fits; the rays ``kept`` (n,) stay in whatever
    the tests say.
    """
    keep = np.zeros(len(problem.images), bool) if kept is None else kept
    if settings.screening == "none":
        return ScreenedBundle.of(problem, supported(problem, Selection.everything(problem)))
    search = _Search(problem, settings, keep)
    chosen = supported(problem, begin)
    if settings.screening == "robust":
        chosen = search.robust(chosen)
    done = search.clean(chosen)
    for _ in range(READMISSIONS):
        more = search.fitting(done)
        if more is None:
            break
        done = search.clean(more)
    return replace(done, rejections=tuple(search.log(done, begin)), rounds=search.rounds)


class _Search:
    """What is remembered from round to round."""

    def __init__(self, problem: BundleProblem, settings: BundleSettings, kept: Flags) -> None:
        self.problem, self.settings, self.kept = problem, settings, kept
        self.out: dict[tuple[str, int, int], BundleRejection] = {}
        self.back: set[int] = set()
        self.rounds = 0

    def adjust(self, selection: Selection) -> ScreenedBundle:
        """Adjust a selection, and start from there the next time."""
        done = ScreenedBundle.of(self.problem, selection)
        self.problem = restarted(self.problem, done.solution)
        self.rounds += 1
        return done

    def robust(self, selection: Selection) -> Selection:
        """Take out at once what re-weighting leaves next to no weight."""
        chosen = selected(self.problem, selection)
        solution, weight = adjust_robustly(chosen)
        self.problem = restarted(self.problem, solution)
        self.rounds += REWEIGHTINGS
        rows = np.flatnonzero(selection.images)[weight < NO_WEIGHT]
        rows, unknown = rows[~self.kept[rows]], np.nan
        images = selection.images.copy()
        images[rows] = False
        for row in rows.tolist():
            each = BundleRejection(
                kind=reliability.IMAGE, row=row, axis=0, test="robust", value=unknown, limit=unknown, size=unknown
            )
            self.out[reliability.IMAGE, row, 0] = each
        return supported(self.problem, replace(selection, images=images))

    def clean(self, selection: Selection) -> ScreenedBundle:
        """Test and take out until nothing is beyond the limit."""
        for _ in range(SEARCH_ROUNDS):
            done = self.adjust(selection)
            worst = list(self._worst(done))
            if not worst:
                return done
            for each in worst:
                self.out[each.kind, each.row, each.axis] = each
                selection = selection.without(each.kind, each.row, each.axis)
            selection = supported(self.problem, selection)
        return self.adjust(selection)

    def _limit(self, solution: BundleSolution) -> tuple[float, float]:
        """Limit of the standardised residuals, and what they are divided by."""
        limit = reliability.limit(self.settings.test, self.settings.alpha, solution.redundancy)
        # never sharper than the stated standard deviations: else a good fit would reject its own best observations
        unit = max(solution.sigma0, 1.0) if self.settings.test == "tau" and solution.redundancy > 0 else 1.0
        return limit, unit

    def _worst(self, done: ScreenedBundle) -> Iterator[BundleRejection]:
        """Return the worst observations beyond the limit, no two of which share a point or a photo."""
        limit, unit = self._limit(done.solution)
        beyond = []
        for group in reliability.groups_of(done.problem, done.solution, done.precision):
            value = np.abs(np.nan_to_num(group.standardised)) / unit
            rows = done.rows(group.kind)
            axis = value.argmax(axis=1) if len(value) else np.zeros(0, np.intp)
            for row in np.flatnonzero(value.max(axis=1, initial=0.0) > limit).tolist():
                if group.kind == reliability.IMAGE and self.kept[rows[row]]:
                    continue
                column = int(axis[row])
                beyond.append(
                    BundleRejection(
                        kind=group.kind,
                        row=int(rows[row]),
                        axis=column,
                        test=self.settings.test,
                        value=float(value[row, column]),
                        limit=limit,
                        size=float(group.gross[row, column]),
                    )
                )
        beyond.sort(key=lambda each: (-each.value, each.kind, each.row))
        touched: set[tuple[str, int]] = set()
        for each in beyond:
            places = self._places(each)
            if each.value >= NEAR * beyond[0].value and not touched & places:
                yield each
            touched |= places

    def _places(self, each: BundleRejection) -> set[tuple[str, int]]:
        """Photo and point that an observation belongs to."""
        problem = self.problem
        if each.kind == reliability.IMAGE:
            images = problem.images
            return {("photo", int(images.photo[each.row])), ("point", int(images.point[each.row]))}
        if each.kind == reliability.CONTROL:
            return {("point", int(problem.control.point[each.row])), ("control", 0)}
        part = problem.positions if each.kind == reliability.POSITION else problem.attitudes
        return {("photo", int(part.photo[each.row])), ("control", 0)}

    def fitting(self, done: ScreenedBundle) -> Selection | None:
        """Put back the rays that fit the adjusted photos and points; None when there is no new one."""
        limit, unit = self._limit(done.solution)
        value = predicted(self.problem, done.selection, (done.solution, done.precision))[0] / unit
        fits = ~done.selection.images & (value < limit)
        fits[list(self.back)] = False  # it was back once, and went again
        control = self._given(done, limit * unit)
        if not fits.any() and not (control & ~done.selection.control).any():
            return None
        self.back |= set(np.flatnonzero(fits).tolist())
        chosen = replace(done.selection, images=done.selection.images | fits, control=done.selection.control | control)
        self._place_points(done, fits)
        chosen = supported(self.problem, chosen)
        return None if (chosen.images == done.selection.images).all() and not control.any() else chosen

    def _given(self, done: ScreenedBundle, limit: float) -> Flags:
        """Control coordinates that were left out from the start and fit."""
        control = self.problem.control
        error = np.abs(done.solution.control_residuals)
        cofactor = -np.diagonal(done.precision.control_residuals, axis1=1, axis2=2)
        with np.errstate(invalid="ignore"):
            fits = error < limit * np.sqrt(control.sigma**2 + np.maximum(cofactor, 0.0))
        tested = np.zeros(control.sigma.shape, bool)
        for kind, row, axis in self.out:
            if kind == reliability.CONTROL:
                tested[row, axis] = True
        return fits & np.isfinite(control.sigma) & ~done.selection.control & ~tested

    def _place_points(self, done: ScreenedBundle, fits: Flags) -> None:
        """Give points that come back as a whole the place where their rays meet."""
        images, solution = self.problem.images, done.solution
        active = np.zeros(self.problem.points, bool)
        active[images.point[done.selection.images]] = True
        rows = np.flatnonzero(fits & ~active[images.point])
        if len(rows):
            numbers, found = _meeting(self.problem, rows, solution)
            points = self.problem.start.points.copy()
            points[numbers] = found
            self.problem = replace(self.problem, start=replace(self.problem.start, points=points))

    def log(self, done: ScreenedBundle, begin: Selection) -> Iterator[BundleRejection]:
        """Return every observation that was out at some time."""
        limit, unit = self._limit(done.solution)
        outside = np.flatnonzero(~done.selection.images)
        value, size = predicted(self.problem, done.selection, (done.solution, done.precision))
        value = value / unit
        for (kind, row, axis), each in self.out.items():
            inside = done.selection.holds(kind, row, axis)
            test = float(value[row]) if np.isnan(each.value) and kind == reliability.IMAGE else each.value
            bound = limit if np.isnan(each.limit) else each.limit
            error = float(size[row]) if np.isnan(each.size) and kind == reliability.IMAGE else each.size
            yield replace(each, value=test, limit=bound, size=error, readmitted=inside)
        known = {row for kind, row, _ in self.out if kind == reliability.IMAGE}
        for row in outside[~begin.images[outside]].tolist():
            if row not in known:
                yield BundleRejection(
                    kind=reliability.IMAGE,
                    row=row,
                    axis=0,
                    test="start",
                    value=float(value[row]),
                    limit=limit,
                    size=float(size[row]),
                )
        for row, axis in np.argwhere(~begin.control & np.isfinite(self.problem.control.sigma)).tolist():
            if not done.selection.control[row, axis]:
                error = -float(done.solution.control_residuals[row, axis])
                yield BundleRejection(
                    kind=reliability.CONTROL, row=row, axis=axis, test="start", value=np.nan, limit=limit, size=error
                )


def adjust_robustly(problem: BundleProblem) -> tuple[BundleSolution, Floats]:
    """Adjust with weights that fall with the residual, and give the factor of the weight of each ray, 0 to 1.

    The weights are those of ``triangulation.robust``, with the scale of the residuals taken from their median.
    """
    weight = np.ones(len(problem.images))
    sigma = problem.images.sigma
    for _ in range(REWEIGHTINGS):
        spread = sigma / np.sqrt(weight)[:, None]
        solution = solve(replace(problem, images=replace(problem.images, sigma=spread)))
        problem = restarted(problem, solution)
        size = np.linalg.norm(solution.image_residuals / sigma, axis=1)
        unit = max(float(np.median(size)) / NORMAL_MEDIAN, 1e-12)
        weight = falling_weights(size / unit)
    return solution, weight


def predicted(
    problem: BundleProblem, selection: Selection, found: tuple[BundleSolution, Cofactors]
) -> tuple[Floats, Floats]:
    """Test rays that take no part against what the others give.

    Returns value: (n,), larger one of the two standardised differences of each ray outside; infinite where its point
        has no place, NaN for rays inside. Correlations between photo and point are left out, so that the values are
        rather too small than too large.
    Returns size: (n,), that difference, measured minus predicted, mm; NaN where there is none.
    """
    solution, precision = found
    value, size = np.full(len(problem.images), np.nan), np.full(len(problem.images), np.nan)
    rows = np.flatnonzero(~selection.images)
    if not len(rows):
        return value, size
    images, focal = problem.images, problem.cameras.focal[problem.cameras.of_photo]
    active = np.zeros(problem.points, bool)
    active[images.point[selection.images]] = True
    points, cofactors = solution.points.copy(), precision.points.copy()
    lost = rows[~active[images.point[rows]]]
    if len(lost):
        numbers, xyz = _meeting(problem, lost, solution)
        points[numbers], cofactors[numbers] = xyz, 0.0
    photo, point = images.photo[rows], images.point[rows]
    by_photo, by_point = derivatives(points[point], solution.centers, solution.rotations, photo, focal)
    variance = images.sigma[rows] ** 2
    variance = variance + np.einsum("nki,nij,nkj->nk", by_photo, precision.photos[photo], by_photo)
    variance = variance + np.einsum("nki,nij,nkj->nk", by_point, cofactors[point], by_point)
    measured = images.xy[rows] + image_shift(problem, solution.common, images.xy[rows], photo)
    computed = project(points[point], solution.centers, solution.rotations, photo, focal)
    with np.errstate(invalid="ignore"):
        tests = np.abs(measured - computed) / np.sqrt(variance)
    known = np.isfinite(tests).all(axis=1)
    worst = np.where(known[:, None], tests, 0.0).argmax(axis=1)
    value[rows] = np.where(known, tests.max(axis=1), np.inf)
    size[rows] = np.where(known, (measured - computed)[np.arange(len(rows)), worst], np.nan)
    return value, size


def _meeting(problem: BundleProblem, rows: Numbers, solution: BundleSolution) -> tuple[Numbers, Floats]:
    """Points that took no part, from their rays and the adjusted photos."""
    images = problem.images
    numbers, point = np.unique(images.point[rows], return_inverse=True)
    focal = problem.cameras.focal[problem.cameras.of_photo]
    xy = images.xy[rows] + image_shift(problem, solution.common, images.xy[rows], images.photo[rows])
    found = intersect_points(
        xy,
        images.sigma[rows],
        (images.photo[rows], point),
        KnownPhotos(solution.centers, solution.rotations, focal),
        len(numbers),
    )
    return numbers, found.xyz
