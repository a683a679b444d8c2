"""Terms of the strip polynomials, and which of them control points can carry where they stand.

How many terms control can carry is decided by its stations along the strip, not by how many points there are: a cubic
needs four different ones.

Strip polynomials: the deformation that a similarity leaves, corrected axis by axis by least squares.

Which degree they get is decided by evidence: an F test of each step and errors at control points left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.statistics import f_p_value
from photostrip.strip.absolute_orientation import Targets

# Powers of X and Y. A term here, in the ladder and in the order of dropping is a term of X, Y and Z alike.
POWERS = {"1": (0, 0), "X": (1, 0), "Y": (0, 1), "XY": (1, 1), "X^2": (2, 0), "X^3": (3, 0)}
# Ladder: terms, degree, stations along the strip, points for an exact fit. One more point is asked for unless forced.
LADDER = (
    (("1", "X", "Y", "XY", "X^2", "X^3"), 3, 4, 6),
    (("1", "X", "Y", "XY", "X^2"), 2, 3, 5),
    (("1", "X", "Y", "X^2"), 2, 3, 4),
    (("1", "X", "Y"), 1, 2, 3),
)
DROP_ORDER = ("XY", "Y", "X^3", "X^2", "X")
# smallest over largest singular value of the scaled design; below it the control cannot tell the terms apart
LEAST_RATIO = 0.02


@dataclass(frozen=True)
class Sizes:
    """Sizes that make columns comparable and stations different."""

    reach: float  # largest distance of control from the origin along the strip, metres
    breadth: float  # half width of the strip, metres
    spacing: float  # distance along the strip that makes two stations different, metres (one base)


def term_columns(xyz: Floats, terms: Sequence[str]) -> Floats:
    """Design columns (n, k) of the terms, powers of X and Y of positions (n, 3), unscaled."""
    x, y = xyz[:, 0], xyz[:, 1]  # eq. 150
    result = np.empty((len(xyz), len(terms)))
    for column, (i, j) in enumerate(POWERS[term] for term in terms):
        np.multiply(x**i, y**j, out=result[:, column])
    return result


def count_stations(x: Floats, spacing: float) -> int:
    """Largest number of points along the strip of which no two are nearer than a spacing."""
    return len(np.unique(bands(x, spacing))) if len(x) else 0


def bands(x: Floats, spacing: float) -> Numbers:
    """Count the bands across the strip from its beginning; the number of the band of each point.

    A point farther than the spacing from the first of its band opens the next.
    """
    order, opening, first = np.argsort(x, kind="stable"), [], -np.inf
    for each in x[order].tolist():
        opening.append(each - first >= spacing)
        first = each if opening[-1] else first
    number = np.empty(len(x), np.intp)
    number[order] = np.cumsum(opening) - 1
    return number


def choose_terms(xyz: Floats, degree: int, sizes: Sizes, *, forced: bool = False) -> tuple[str, ...]:
    """Terms that given control points (n, 3) can carry, up to a degree; none when the control carries none.

    Six points are necessary for six terms, not sufficient: [001] after eq. 151 says six, a cubic needs four stations.
    `forced` allows a fit without redundancy.
    """
    stations = count_stations(xyz[:, 0], sizes.spacing)
    terms = ladder(stations, len(xyz) if forced else len(xyz) - 1, degree)
    for drop in DROP_ORDER:
        if not terms or term_condition(xyz, terms, sizes) < 1 / LEAST_RATIO:
            break
        terms = dropped(terms, drop)
    return terms


def ladder(stations: int, points: int, degree: int) -> tuple[str, ...]:
    """Most terms that so many stations and points carry, up to a degree; none where nothing is carried."""
    for candidate, power, needed, exact in LADDER:
        if power <= degree and stations >= needed and points >= exact:
            return candidate
    return ()


def dropped(terms: tuple[str, ...], drop: str) -> tuple[str, ...]:
    return tuple(term for term in terms if term != drop)


def term_scales(terms: Sequence[str], sizes: Sizes) -> Floats:
    """Sizes of the columns at the end of the control and the edge of the strip, shape (k,), metres to their powers."""
    return np.array([sizes.reach**i * sizes.breadth**j for i, j in (POWERS[t] for t in terms)])


def term_condition(xyz: Floats, terms: Sequence[str], sizes: Sizes) -> float:
    """Condition number of the scaled columns at positions (n, 3), metres; infinite when they cannot be told apart."""
    values = np.linalg.svd(term_columns(xyz, terms) / term_scales(terms, sizes), compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0 else float("inf")


def degree_of(terms: Sequence[str]) -> int:
    """Highest power of X among the terms; 0 without terms."""
    return max((POWERS[t][0] for t in terms), default=0)


Terms = tuple[tuple[str, ...], ...]  # of the three axes

ITERATIONS = 4  # plan-only and height-only points take their missing coordinate from the fit itself
CONVERGED = 1e-9  # m


@dataclass(frozen=True, eq=False)
class AxisFit:
    terms: tuple[str, ...]  # names of the terms, keys of ``POWERS``; empty when the axis is not corrected
    # coefficients, sigmas: (k,): coefficients for X and Y in metres and their standard deviations (NaN without
    # redundancy)
    coefficients: Floats
    sigmas: Floats
    effects: Floats  # (k,): size of each term in metres at the end of the control's range and the edge of the strip
    residuals: Floats  # (n,): corrected minus given in metres; 0 for points that do not count in this axis
    # (n, k): orthonormal basis of the weighted design; its rows say how control coordinates share in the fit
    basis: Floats
    sigma0: float  # standard deviation in metres of a control coordinate of mean weight; NaN without redundancy
    redundancy: int
    condition: float  # condition number of the scaled design; NaN without terms

    @property
    def leverage(self) -> Floats:
        """Share of each control coordinate in its own fit, 0 to 1."""
        return np.asarray((self.basis**2).sum(axis=1), float)


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Everything a fit needs: positions, what counts, and the sizes that make columns comparable."""

    xyz: Floats  # (n, 3): control points after the similarity, intermediate frame, metres
    targets: Targets
    # (n, 3): weights along the points' axes (east, north, up), metres^-2; 0 where a coordinate does not count
    weight: Floats
    spacing: float  # distance along the strip that makes two stations different, metres (one base)
    breadth: float  # half width of the strip, metres

    @cached_property
    def sizes(self) -> Sizes:
        """What makes columns comparable."""
        reach = max(float(np.abs(self.xyz[:, 0]).max()), 1e-6)
        return Sizes(reach, self.breadth, self.spacing)

    @cached_property
    def misclosures(self) -> Floats:
        """Strip minus given after the similarity, intermediate frame, metres."""
        return self.xyz - self.targets.of(self.xyz)

    @cached_property
    def similarity(self) -> tuple[Floats, Floats]:
        """Orthonormal basis (n, 3, 7) of the weighted design of a similarity, and what it leaves, (n, 3), weighted."""
        root = np.sqrt(self.by_axis)
        moved = similarity_derivatives(self.xyz, self.xyz.mean(axis=0)) * root[:, :, None]
        basis, _ = np.linalg.qr(moved.reshape(-1, SIMILARITY_PARAMETERS))
        misclosures = (self.misclosures * root).ravel()
        left = misclosures - basis @ (basis.T @ misclosures)
        return basis.reshape(moved.shape), left.reshape(-1, 3)

    @cached_property
    def by_axis(self) -> Floats:
        """Weights for the axes X, Y, Z: plan weights are those of the two plan coordinates together."""
        plan = self.weight[:, :2].mean(axis=1)
        return np.column_stack([plan, plan, self.weight[:, 2]])


@dataclass(frozen=True, eq=False)
class Design:
    """What the fit of one axis is made of, before there are misclosures."""

    terms: tuple[str, ...]  # terms; empty when the axis is not corrected
    rows: Flags  # (n,): points that count
    columns: Floats  # (n, k): scaled columns of all points
    scales: Floats  # (k,): what they were divided by
    root: Floats  # (n,): square roots of the weights over their mean; 0 for points that do not count
    # basis, triangle: (n, k) and (k, k): the weighted columns, decomposed
    basis: Floats
    triangle: Floats
    condition: float  # condition number of the scaled columns

    @classmethod
    def of(cls, problem: FitProblem, weight: Floats, terms: tuple[str, ...]) -> Design:
        """Decompose the columns of one axis."""
        rows, scales = weight > 0, term_scales(terms, problem.sizes)
        columns = term_columns(problem.xyz, terms) / scales
        root = np.sqrt(weight / weight[rows].mean()) if rows.any() else np.zeros(len(weight))
        basis, triangle = np.zeros(columns.shape), np.zeros((0, 0))
        condition = float("nan")
        if terms:
            basis[rows], triangle = np.linalg.qr(columns[rows] * root[rows, None])
            condition = term_condition(problem.xyz[rows], terms, problem.sizes)
        return cls(
            terms=terms,
            rows=rows,
            columns=columns,
            scales=scales,
            root=root,
            basis=basis,
            triangle=triangle,
            condition=condition,
        )

    def effects(self, misclosure: Floats) -> Floats:
        """Weighted least squares; the misclosure is strip minus given."""
        if not self.terms:
            return np.zeros(0)
        # eq. 151 with the free term X - X': the polynomial equals given minus strip
        return np.asarray(np.linalg.solve(self.triangle, self.basis.T @ (-misclosure * self.root)), float)

    def correction(self, misclosure: Floats) -> Floats:
        """Correct all points, those that do not count too."""
        return self.columns @ self.effects(misclosure)

    def fit(self, misclosure: Floats) -> AxisFit:
        """Fit, with residuals and standard deviations."""
        estimate = self.effects(misclosure)
        residuals = np.where(self.rows, misclosure + self.columns @ estimate, 0.0)
        redundancy = int(self.rows.sum()) - len(self.terms)
        squares = float(((residuals * self.root) ** 2).sum())
        sigma0 = float(np.sqrt(squares / redundancy)) if self.terms and redundancy > 0 else float("nan")
        return AxisFit(
            terms=self.terms,
            coefficients=estimate / self.scales,
            sigmas=sigma0 * np.sqrt((np.linalg.inv(self.triangle) ** 2).sum(axis=1)) / self.scales,
            effects=estimate,
            residuals=residuals,
            basis=self.basis,
            sigma0=sigma0,
            redundancy=redundancy,
            condition=self.condition,
        )


def fit_axes(problem: FitProblem, terms: Terms) -> list[AxisFit]:
    """Fit the terms of X, Y, Z; points that give only some of their coordinates need a few iterations.

    Source: [001] eq. 151.
    """
    of = cache(lambda weights, terms: Design.of(problem, problem.by_axis[:, weights], terms))
    designs = [of(weights, terms[axis]) for axis, weights in enumerate((0, 0, 2))]  # X and Y weigh alike
    misclosure = problem.misclosures
    if not problem.targets.control.use.all():
        for _ in range(ITERATIONS):
            corrections = [design.correction(misclosure[:, axis]) for axis, design in enumerate(designs)]
            before = misclosure
            misclosure = problem.xyz - problem.targets.of(problem.xyz + np.column_stack(corrections))
            if np.abs(misclosure - before).max() < CONVERGED:
                break
    return [design.fit(misclosure[:, axis]) for axis, design in enumerate(designs)]


Fits = Callable[[Terms], list[AxisFit]]


__all__ = ["DEGREES", "GROUPS", "AxisFit", "Evidence", "FitProblem", "Polynomial", "PolynomialSettings", "fit"]

DEGREES = ("auto", "1", "2", "3")
LEVEL = 0.05  # of the F test
PLAN, HEIGHT = "plan", "height"
GROUPS = ((PLAN, (0, 1)), (HEIGHT, (2,)))  # decided apart: control can be good in one and poor in the other
SMALLEST_REST = 1e-6  # smallest eigenvalue of I - H for a group that can be left out
DETERMINED = {PLAN: 4, HEIGHT: 3}  # of the seven, those that each group determines


@dataclass(frozen=True)
class PolynomialSettings:
    """Which polynomial takes out the strip deformation."""

    degree: str = "auto"  # ``"auto"`` (decided by evidence), ``"1"``, ``"2"`` or ``"3"``


@dataclass(frozen=True, eq=False)
class Evidence:
    """What speaks for a degree, in plan or in height."""

    group: str  # ``"plan"`` (X and Y) or ``"height"``
    degree: int
    terms: int  # number of terms in each axis of the group
    redundancy: int  # redundancy over the axes of the group
    rms: float  # root mean square of the residuals at control, metres
    left_out: float  # root mean square at control points that did not take part in the fit, metres
    left_out_by: str  # ``"band"`` or ``"point"``: what was left out at a time
    # f, p: F ratio of the step from the degree compared with, and the probability of a larger one by chance; NaN
    # without
    f: float
    p: float
    against: int  # the degree compared with
    accepted: bool  # whether the step was taken


@dataclass(frozen=True, eq=False)
class Polynomial:
    degree: int  # highest power of X in use; 0: similarity alone
    axes: tuple[AxisFit, AxisFit, AxisFit]  # fits of X, Y, Z
    evidence: tuple[Evidence, ...]  # degrees that were weighed, ascending
    stations: tuple[int, int]  # different stations along the strip in plan and in height
    reach: tuple[float, float]  # range of the control along X, metres
    asked: str

    def corrections(self, xyz: Floats) -> Floats:
        """Corrections of positions (n, 3) after the similarity, to be added. Source: [001] eq. 150."""
        columns = {terms: term_columns(xyz, terms) for terms in {axis.terms for axis in self.axes}}
        return np.column_stack([columns[axis.terms] @ axis.coefficients for axis in self.axes])

    def __call__(self, xyz: Floats) -> Floats:
        """Corrected positions; see ``corrections``."""
        return xyz + self.corrections(xyz)


def fit(problem: FitProblem, settings: PolynomialSettings) -> Polynomial:
    """Fit the polynomial that the settings ask for, or the one that the evidence supports.

    It is of degree 0, without terms, when the control carries none or the evidence supports none.
    """
    counts = problem.by_axis > 0
    x = problem.xyz[:, 0]
    stations = tuple(count_stations(x[counts[:, axis]], problem.spacing) for axis in (0, 2))
    chosen: list[tuple[str, ...]] = []
    evidence: list[Evidence] = []
    fits_of: Fits = cache(partial(fit_axes, problem))  # plan and height often weigh the same candidates
    by_degree = _by_degree(problem, settings.degree)
    for group, axes in GROUPS:
        every = _candidates(by_degree, axes[0])
        terms, weighed = decide(problem, (group, axes), every, fits_of, forced=settings.degree != "auto")
        chosen += [terms] * len(axes)
        evidence += weighed
    fits = fits_of(tuple(chosen))
    inside = x[counts.any(axis=1)]
    return Polynomial(
        degree=max(degree_of(terms) for terms in chosen),
        axes=(fits[0], fits[1], fits[2]),
        evidence=tuple(evidence),
        stations=(stations[0], stations[1]),
        reach=(float(inside.min()), float(inside.max())),
        asked=settings.degree,
    )


def _by_degree(problem: FitProblem, asked: str) -> list[Terms]:
    """Terms of all axes for every degree, as far as the control of each carries them."""
    forced = asked != "auto"
    plan, height = (problem.xyz[_counted(problem, k)] for k in (0, 2))
    found: list[Terms] = []
    for degree in range(1, (int(asked) if forced else 3) + 1):
        x, z = (choose_terms(xyz, degree, problem.sizes, forced=forced) for xyz in (plan, height))
        found.append((x, x, z))  # X and Y count together
    return found


def _candidates(by_degree: Sequence[Terms], axis: int) -> list[Terms]:
    """Terms for the similarity alone and for every degree that adds something to one axis; others get the same."""
    found: list[Terms] = [((), (), ())]
    for terms in by_degree:
        if terms[axis] != found[-1][axis]:
            found.append(terms)
    return found


def decide(
    problem: FitProblem, part: tuple[str, tuple[int, ...]], every: Sequence[Terms], fits_of: Fits, *, forced: bool
) -> tuple[tuple[str, ...], list[Evidence]]:
    """Go up the degrees of plan or height: each step must be asked for by its F test and not spoil left-out points.

    part: name and axes of the part, one of ``GROUPS``.
    every: terms of all axes, ascending; the last are taken where that is forced.
    Returns the terms, and every degree that was weighed, ascending.
    """
    group, axes = part
    fits = [fits_of(terms) for terms in every]
    candidates = [terms[axes[0]] for terms in every]
    left_out, by = _left_out_errors(problem, candidates, fits, axes)
    expected = _expected(problem)
    chosen, evidence = 0, []
    for number, terms in enumerate(candidates):
        against = chosen
        f, p = _f_test(fits[against], fits[number], expected) if number else (float("nan"), float("nan"))
        if forced:
            accepted = number == len(candidates) - 1
        else:
            # asked for by the F test, and by left-out points that more terms predict better
            accepted = number == 0 or (p < LEVEL and left_out[number] < left_out[against])
        chosen = number if accepted else chosen
        of_group = [fits[number][axis] for axis in axes]
        residuals = np.concatenate([a.residuals[_counted(problem, k)] for k, a in zip(axes, of_group, strict=True)])
        evidence.append(
            Evidence(
                group=group,
                degree=degree_of(terms),
                terms=len(terms),
                redundancy=_redundancy(of_group, DETERMINED[group]),
                rms=_rms(residuals),
                left_out=left_out[number],
                left_out_by=by,
                f=f,
                p=p,
                against=degree_of(candidates[against]),
                accepted=bool(accepted or number == 0),
            )
        )
    return candidates[chosen], evidence


def _expected(problem: FitProblem) -> Floats:
    """Return the standard deviation, by axis in metres, of a misclosure from the control and the point alone."""
    weight = problem.by_axis
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.where(weight > 0, 1 / weight, 0.0).sum(axis=0) / (weight > 0).sum(axis=0)
    return np.asarray(np.sqrt(np.nan_to_num(variance)), float)


def _counted(problem: FitProblem, axis: int) -> Flags:
    return problem.by_axis[:, axis] > 0


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _redundancy(fits: Sequence[AxisFit], similarity: int) -> int:
    """Redundancy of a fit; without terms the similarity's own parameters count."""
    total = sum(axis.redundancy for axis in fits)
    return total if any(axis.terms for axis in fits) else total - similarity


def _of_all_axes(fits: Sequence[AxisFit]) -> int:
    """Redundancy over all axes; a group without terms rests on its share of the similarity."""
    return sum(_redundancy([fits[axis] for axis in axes], DETERMINED[group]) for group, axes in GROUPS)


def _f_test(simple: Sequence[AxisFit], rich: Sequence[AxisFit], expected: Floats) -> tuple[float, float]:
    """F ratio of the richer fit against the simpler over all axes, each in units of its own richer variance.

    A strip bends in plan and height together, so all axes testify to a step; whether plan or height takes it their
    own left-out points say. The variance is never taken below what the control's own standard deviations say: with
    few points a fit can look better than the control is.
    """
    left = _of_all_axes(rich)
    gained = _of_all_axes(simple) - left
    if gained < 1 or left < 1 or any(axis.redundancy < 1 for axis in rich):
        return float("nan"), float("nan")
    explained = 0.0
    for before, after, limit in zip(simple, rich, expected, strict=True):
        variance = max(float((after.residuals**2).sum()) / after.redundancy, float(limit) ** 2)
        explained += max(float((before.residuals**2).sum() - (after.residuals**2).sum()), 0.0) / variance
    f = explained / gained
    return f, f_p_value(f, gained, left)


def _left_out_errors(
    problem: FitProblem, candidates: list[tuple[str, ...]], fits: list[list[AxisFit]], axes: tuple[int, ...]
) -> tuple[list[float], str]:
    """Errors at control that took no part: inner bands when every degree can do without one, else single points.

    An outer band is not left out: predicting it would be extrapolation, which no user of a polynomial should do.
    """
    counted = np.flatnonzero(_counted(problem, axes[0]))
    group = bands(problem.xyz[counted, 0], problem.spacing)
    order = np.argsort(group, kind="stable")
    inner = np.split(counted[order], np.flatnonzero(np.diff(group[order])) + 1)[1:-1]
    if inner and _carried_without(problem, counted, inner, candidates[-1]):
        return [_left_out(problem, all_axes, axes, inner) for all_axes in fits], "band"
    single = [np.array([row]) for row in counted]
    return [_left_out(problem, all_axes, axes, single) for all_axes in fits], "point"


def _carried_without(problem: FitProblem, counted: Numbers, inner: Sequence[Numbers], terms: tuple[str, ...]) -> bool:
    """Whether the control carries all terms without any one of its inner bands.

    The same choice as ``terms.choose_terms`` makes for what is left. A band that goes takes one station
    with it: the next band begins at the same point as before. The squares of singular values are those of the whole
    design less the band's share, so that nothing is fitted again.
    """
    stations = count_stations(problem.xyz[counted, 0], problem.spacing) - 1
    degree = degree_of(terms)
    sizes = np.array([len(rows) for rows in inner])
    for size in np.unique(sizes).tolist():
        chosen = ladder(stations, len(counted) - size, degree)
        left = np.array([rows for rows in inner if len(rows) == size])
        for drop in DROP_ORDER:
            if not chosen or not len(left):
                break
            good = _conditions_without(problem, counted, left, chosen) < 1 / LEAST_RATIO
            if good.any() and chosen != terms:
                return False
            left, chosen = left[~good], dropped(chosen, drop)
        if len(left) and chosen != terms:
            return False
    return True


def _conditions_without(problem: FitProblem, counted: Numbers, groups: Numbers, terms: tuple[str, ...]) -> Floats:
    """Condition numbers of the scaled design without each of several groups of points of equal size."""
    scaled = term_columns(problem.xyz, terms) / term_scales(terms, problem.sizes)
    parts = scaled[groups]
    squares = np.linalg.eigvalsh(scaled[counted].T @ scaled[counted] - parts.transpose(0, 2, 1) @ parts)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(squares[:, 0] > 0, np.sqrt(squares[:, -1] / squares[:, 0]), np.inf)


def _left_out(problem: FitProblem, fits: Sequence[AxisFit], axes: tuple[int, ...], groups: Sequence[Numbers]) -> float:
    """Root mean square error at groups of control predicted from all others, without fitting again."""
    errors: list[Floats] = []
    for size in sorted({len(rows) for rows in groups}):
        rows = np.array([each for each in groups if len(each) == size])
        root = np.sqrt(problem.by_axis)[rows][:, :, list(axes)]
        if any(fits[axis].terms for axis in axes):  # axes that are decided together weigh alike and have one basis
            residuals = np.stack([fits[axis].residuals for axis in axes], axis=-1)[rows] * root
            found = _from_the_others(fits[axes[0]].basis[rows], residuals)
        else:
            basis, residuals = (each[rows].reshape(len(rows), 3 * size, -1) for each in problem.similarity)
            found = _from_the_others(basis, residuals).reshape(len(rows), size, 3)[:, :, list(axes)]
        errors.append((found / root).ravel())
    return _rms(np.concatenate(errors))


def _from_the_others(basis: Floats, residuals: Floats) -> Floats:
    """Predict groups (g, k) from all that is not in them: (I - H)^-1 times their residuals, H the hat matrix within.

    basis: (g, k, t), rows of the orthonormal basis of the design. A group that alone determines part of the fit cannot
        be predicted: its errors are infinite.
    residuals: (g, k, a), of one or more fits.
    """
    rest = np.eye(residuals.shape[1]) - basis @ basis.transpose(0, 2, 1)
    free = np.linalg.eigvalsh(rest)[:, 0] >= SMALLEST_REST
    errors = np.full(residuals.shape, np.inf)
    if free.any():
        errors[free] = np.linalg.solve(rest[free], residuals[free])
    return errors
