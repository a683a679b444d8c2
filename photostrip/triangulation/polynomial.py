"""Strip polynomials: the deformation that a similarity leaves, taken out axis by axis.

Every axis of the intermediate frame, X along the strip, gets its own polynomial in X and Y. How many terms the control
can carry is decided by where it stands, not by how many points there are: a cubic needs four different stations along
the strip. How many it should carry is decided by evidence: an F test of each step and the errors at control points left
out.

Source: [001] eq. 150-151, the free term of 151 corrected to X - X'.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import f_p_value

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from photostrip.triangulation.absolute import Targets

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Terms = tuple[tuple[str, ...], ...]  # of the three axes
    Fits = Callable[[Terms], list["AxisFit"]]

DEGREES = ("auto", "1", "2", "3")
POWERS = {"1": (0, 0), "X": (1, 0), "Y": (0, 1), "XY": (1, 1), "X^2": (2, 0), "X^3": (3, 0)}
# Ladder: terms, degree, stations along the strip, points for an exact fit. One more point is asked for unless forced.
LADDER = (
    (("1", "X", "Y", "XY", "X^2", "X^3"), 3, 4, 6),
    (("1", "X", "Y", "XY", "X^2"), 2, 3, 5),
    (("1", "X", "Y", "X^2"), 2, 3, 4),
    (("1", "X", "Y"), 1, 2, 3),
)
DROP_ORDER = ("XY", "Y", "X^3", "X^2", "X")
RANK_LIMIT = (
    0.02  # smallest over largest singular value of the scaled design; below it the control cannot tell the terms apart
)
SURE, LIKELY = 0.10, 0.40  # levels of the F test: enough by itself, and enough when left-out points get better too
WORSE = 1.5  # left-out errors may not grow by more, however significant the step: such control only bends the strip
PASSES = 4  # plan-only and height-only points take their missing coordinate from the fit itself
SETTLED = 1e-9  # m: nothing moves any more
PLAN, HEIGHT = "plan", "height"
GROUPS = ((PLAN, (0, 1)), (HEIGHT, (2,)))  # decided apart: control can be good in one and poor in the other
SMALLEST_REST = 1e-6  # smallest eigenvalue of I - H for a group that can be left out
SIMILARITY_PARAMETERS = {PLAN: 4, HEIGHT: 3}  # of the seven, those that each group determines


@dataclass(frozen=True)
class Settings:
    """Which polynomial takes out the strip deformation.

    Parameters
    ----------
    degree : str
        ``"auto"`` (decided by evidence), ``"1"``, ``"2"`` or ``"3"``.
    """

    degree: str = "auto"


@dataclass(frozen=True, eq=False)
class AxisFit:
    """Polynomial of one axis.

    Parameters
    ----------
    terms : tuple of str
        Names of the terms, keys of :data:`POWERS`; empty when the axis is not corrected.
    coefficients, sigmas : ndarray, shape (k,)
        Coefficients for X and Y in metres and their standard deviations (NaN without redundancy).
    effects : ndarray, shape (k,)
        Size of each term in metres at the end of the control's range and the edge of the strip.
    residuals : ndarray, shape (n,)
        Corrected minus given in metres; 0 for points that do not count in this axis.
    basis : ndarray, shape (n, k)
        Orthonormal basis of the weighted design; its rows say how control coordinates share in the fit.
    sigma0 : float
        Standard deviation in metres of a control coordinate of mean weight; NaN without redundancy.
    redundancy : int
        Control coordinates minus terms.
    condition : float
        Condition number of the scaled design; NaN without terms.
    """

    terms: tuple[str, ...]
    coefficients: Floats
    sigmas: Floats
    effects: Floats
    residuals: Floats
    basis: Floats
    sigma0: float
    redundancy: int
    condition: float

    @property
    def leverage(self) -> Floats:
        """Share of each control coordinate in its own fit, 0 to 1."""
        share: Floats = (self.basis**2).sum(axis=1)
        return share


@dataclass(frozen=True, eq=False)
class Evidence:
    """What speaks for a degree, in plan or in height.

    Parameters
    ----------
    group : str
        ``"plan"`` (X and Y) or ``"height"``.
    degree : int
        0 for the similarity alone.
    terms : int
        Number of terms in each axis of the group.
    redundancy : int
        Redundancy over the axes of the group.
    rms : float
        Root mean square of the residuals at control, metres.
    left_out : float
        Root mean square at control points that did not take part in the fit, metres.
    left_out_by : str
        ``"band"`` or ``"point"``: what was left out at a time.
    f, p : float
        F ratio of the step from the degree compared with, and the probability of a larger one by chance; NaN without.
    against : int
        The degree compared with.
    accepted : bool
        Whether the step was taken.
    """

    group: str
    degree: int
    terms: int
    redundancy: int
    rms: float
    left_out: float
    left_out_by: str
    f: float
    p: float
    against: int
    accepted: bool


@dataclass(frozen=True, eq=False)
class Polynomial:
    """The correction of a strip.

    Parameters
    ----------
    degree : int
        Highest power of X in use; 0: similarity alone.
    axes : tuple of AxisFit
        Fits of X, Y, Z.
    evidence : tuple of Evidence
        Degrees that were weighed, ascending.
    stations : tuple of int
        Different stations along the strip in plan and in height.
    reach : tuple of float
        Range of the control along X, metres.
    asked : str
        What the settings asked for.
    """

    degree: int
    axes: tuple[AxisFit, AxisFit, AxisFit]
    evidence: tuple[Evidence, ...]
    stations: tuple[int, int]
    reach: tuple[float, float]
    asked: str

    def corrections(self, xyz: Floats) -> Floats:
        """Correct positions by adding these.

        Parameters
        ----------
        xyz : ndarray, shape (n, 3)
            Strip after the similarity, intermediate frame, metres.

        Returns
        -------
        ndarray, shape (n, 3)
            Corrections in metres.

        Notes
        -----
        Source: [001] eq. 150.
        """
        return np.column_stack([_columns(xyz, axis.terms) @ axis.coefficients for axis in self.axes])

    def __call__(self, xyz: Floats) -> Floats:
        """Corrected positions; see :meth:`corrections`."""
        return xyz + self.corrections(xyz)


@dataclass(frozen=True, eq=False)
class Problem:
    """Everything a fit needs: positions, what counts, and the sizes that make columns comparable.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Control points after the similarity, intermediate frame, metres.
    targets : Targets
        What they should be.
    weight : ndarray, shape (n, 3)
        Weights along the points' axes (east, north, up), metres^-2; 0 where a coordinate does not count.
    spacing : float
        Distance along the strip that makes two stations different, metres (one base).
    breadth : float
        Half width of the strip, metres.
    """

    xyz: Floats
    targets: Targets
    weight: Floats
    spacing: float
    breadth: float

    @cached_property
    def reach(self) -> float:
        """Largest distance of control from the origin along the strip, metres."""
        return max(float(np.abs(self.xyz[:, 0]).max()), 1e-6)

    @cached_property
    def misclosures(self) -> Floats:
        """Strip minus given after the similarity, intermediate frame, metres."""
        return self.xyz - self.targets.of(self.xyz)

    @cached_property
    def by_axis(self) -> Floats:
        """Weights for the axes X, Y, Z: plan weights are those of the two plan coordinates together."""
        plan = self.weight[:, :2].mean(axis=1)
        return np.column_stack([plan, plan, self.weight[:, 2]])


def _columns(xyz: Floats, terms: Sequence[str]) -> Floats:
    """Design columns of the terms, unscaled."""
    x, y = xyz[:, 0], xyz[:, 1]
    return np.column_stack([x**i * y**j for i, j in (POWERS[t] for t in terms)] or [np.zeros((len(xyz), 0))])


def count_stations(x: Floats, spacing: float) -> int:
    """Count stations along the strip that are at least a spacing apart.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Positions along the strip.
    spacing : float
        Smallest distance of two stations.

    Returns
    -------
    int
        The largest number of points of which no two are nearer than the spacing.
    """
    return len(np.unique(bands(x, spacing))) if len(x) else 0


def bands(x: Floats, spacing: float) -> Numbers:
    """Group points into bands across the strip, from its beginning.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Positions along the strip.
    spacing : float
        A point farther than this from the first of its band opens the next.

    Returns
    -------
    ndarray of int, shape (n,)
        Number of the band of each point.
    """
    number = np.zeros(len(x), np.intp)
    current, first = -1, -np.inf
    for row in np.argsort(x, kind="stable"):
        if x[row] - first >= spacing:
            current, first = current + 1, x[row]
        number[row] = current
    return number


def choose_terms(xyz: Floats, degree: int, problem: Problem, *, forced: bool = False) -> tuple[str, ...]:
    """Terms that given control points can carry, up to a degree.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Control points that count in the axis.
    degree : int
        Highest power of X asked for.
    problem : Problem
        Sizes that make the columns comparable.
    forced : bool
        Whether a fit without redundancy is allowed.

    Returns
    -------
    tuple of str
        Names of the terms; empty when the control carries none.

    Notes
    -----
    Six points are necessary for six terms, not sufficient: [001] after eq. 151 says six, a cubic needs four stations.
    """
    stations = count_stations(xyz[:, 0], problem.spacing)
    terms = _ladder(stations, len(xyz) if forced else len(xyz) - 1, degree)
    for drop in DROP_ORDER:
        if not terms or _condition(xyz, terms, problem) < 1 / RANK_LIMIT:
            break
        terms = _dropped(terms, drop)
    return terms


def _ladder(stations: int, points: int, degree: int) -> tuple[str, ...]:
    """Most terms that so many stations and points carry, up to a degree."""
    for candidate, power, needed, exact in LADDER:
        if power <= degree and stations >= needed and points >= exact:
            return candidate
    return ()


def _dropped(terms: tuple[str, ...], drop: str) -> tuple[str, ...]:
    return tuple(term for term in terms if term != drop)


def _scales(terms: Sequence[str], problem: Problem) -> Floats:
    return np.array([problem.reach**i * problem.breadth**j for i, j in (POWERS[t] for t in terms)])


def _condition(xyz: Floats, terms: Sequence[str], problem: Problem) -> float:
    values = np.linalg.svd(_columns(xyz, terms) / _scales(terms, problem), compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0 else float("inf")


def _degree_of(terms: Sequence[str]) -> int:
    return max((POWERS[t][0] for t in terms), default=0)


@dataclass(frozen=True, eq=False)
class _Design:
    """What the fit of one axis is made of, before there are misclosures.

    Parameters
    ----------
    terms : tuple of str
        Terms; empty when the axis is not corrected.
    rows : ndarray of bool, shape (n,)
        Points that count.
    columns : ndarray, shape (n, k)
        Scaled columns of all points.
    scales : ndarray, shape (k,)
        What they were divided by.
    root : ndarray, shape (n,)
        Square roots of the weights over their mean; 0 for points that do not count.
    basis, triangle : ndarray, shape (n, k) and (k, k)
        The weighted columns, decomposed.
    condition : float
        Condition number of the scaled columns.
    """

    terms: tuple[str, ...]
    rows: NDArray[np.bool_]
    columns: Floats
    scales: Floats
    root: Floats
    basis: Floats
    triangle: Floats
    condition: float

    @classmethod
    def of(cls, problem: Problem, weight: Floats, terms: tuple[str, ...]) -> _Design:
        """Decompose the columns of one axis."""
        rows, scales = weight > 0, _scales(terms, problem)
        columns = _columns(problem.xyz, terms) / scales
        root = np.sqrt(weight / weight[rows].mean()) if rows.any() else np.zeros(len(weight))
        basis, triangle = np.zeros(columns.shape), np.zeros((0, 0))
        condition = float("nan")
        if terms:
            basis[rows], triangle = np.linalg.qr(columns[rows] * root[rows, None])
            condition = _condition(problem.xyz[rows], terms, problem)
        return cls(terms, rows, columns, scales, root, basis, triangle, condition)

    def effects(self, misclosure: Floats) -> Floats:
        """Weighted least squares; the misclosure is strip minus given."""
        if not self.terms:
            return np.zeros(0)
        # eq. 151 with the free term X - X': the polynomial equals given minus strip
        return np.asarray(np.linalg.solve(self.triangle, self.basis.T @ (-misclosure * self.root)), float)

    def correction(self, misclosure: Floats) -> Floats:
        """Correct all points, those that do not count too."""
        result: Floats = self.columns @ self.effects(misclosure)
        return result

    def fit(self, misclosure: Floats) -> AxisFit:
        """Fit, with residuals and standard deviations."""
        estimate = self.effects(misclosure)
        residuals = np.where(self.rows, misclosure + self.columns @ estimate, 0.0)
        redundancy = int(self.rows.sum()) - len(self.terms)
        if not self.terms:
            nan = float("nan")
            return AxisFit((), estimate, estimate, estimate, residuals, self.basis, nan, redundancy, nan)
        squares = float(((residuals * self.root) ** 2).sum())
        sigma0 = float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan")
        sigmas = sigma0 * np.sqrt((np.linalg.inv(self.triangle) ** 2).sum(axis=1)) / self.scales
        coefficients = estimate / self.scales
        return AxisFit(
            self.terms, coefficients, sigmas, estimate, residuals, self.basis, sigma0, redundancy, self.condition
        )


def _fit(problem: Problem, terms: Terms) -> list[AxisFit]:
    """Fit all three axes; a few passes settle points that give only some of their coordinates."""
    designs = [_Design.of(problem, problem.by_axis[:, axis], terms[axis]) for axis in range(3)]
    misclosure = problem.misclosures
    if not problem.targets.control.use.all():
        for _ in range(PASSES):
            corrections = [design.correction(misclosure[:, axis]) for axis, design in enumerate(designs)]
            before = misclosure
            misclosure = problem.xyz - problem.targets.of(problem.xyz + np.column_stack(corrections))
            if np.abs(misclosure - before).max() < SETTLED:
                break
    return [design.fit(misclosure[:, axis]) for axis, design in enumerate(designs)]


def fit(problem: Problem, settings: Settings) -> Polynomial:
    """Fit the polynomial that the settings ask for, or the one that the evidence supports.

    Parameters
    ----------
    problem : Problem
        Control points after the similarity.
    settings : Settings
        Degree, or ``"auto"``.

    Returns
    -------
    Polynomial
        The correction; of degree 0, without terms, when the control carries none or the evidence supports none.
    """
    counts = problem.by_axis > 0
    x = problem.xyz[:, 0]
    stations = tuple(count_stations(x[counts[:, axis]], problem.spacing) for axis in (0, 2))
    chosen: list[tuple[str, ...]] = []
    evidence: list[Evidence] = []
    fits_of: Fits = cache(partial(_fit, problem))  # plan and height often weigh the same candidates
    for group, axes in GROUPS:
        terms, weighed = _decide(problem, (group, axes), settings.degree, fits_of)
        chosen += [terms] * len(axes)
        evidence += weighed
    fits = fits_of(tuple(chosen))
    inside = x[counts.any(axis=1)]
    return Polynomial(
        max(_degree_of(terms) for terms in chosen),
        (fits[0], fits[1], fits[2]),
        tuple(evidence),
        (stations[0], stations[1]),
        (float(inside.min()), float(inside.max())),
        settings.degree,
    )


def _candidates(problem: Problem, axis: int, asked: str) -> list[Terms]:
    """Terms of all axes for the similarity alone and for every degree that adds something to one axis.

    The other axes get the terms of the same degree as far as their own control carries them.
    """
    forced = asked != "auto"
    points = [problem.xyz[_counted(problem, k)] for k in range(3)]
    found: list[Terms] = [((), (), ())]
    for degree in range(1, (int(asked) if forced else 3) + 1):
        terms = tuple(choose_terms(xyz, degree, problem, forced=forced) for xyz in points)
        if terms[axis] != found[-1][axis]:
            found.append(terms)
    return found


def _decide(
    problem: Problem, part: tuple[str, tuple[int, ...]], asked: str, fits_of: Fits
) -> tuple[tuple[str, ...], list[Evidence]]:
    """Go up the degrees of one group: each step must be asked for by its F test and not spoil left-out points."""
    group, axes = part
    every = _candidates(problem, axes[0], asked)
    forced = asked != "auto"
    fits = [fits_of(terms) for terms in every]
    candidates = [terms[axes[0]] for terms in every]
    left_out, by = _left_out_errors(problem, candidates, fits, axes)
    expected = _expected(problem)
    chosen, evidence = 0, []
    for number, terms in enumerate(candidates):
        against = chosen
        f, p = _f_test(fits[against], fits[number], expected) if number else (float("nan"), float("nan"))
        taken = (
            number == len(candidates) - 1
            if forced
            else number == 0 or _step_taken(p, left_out[number], left_out[against])
        )
        chosen = number if taken else chosen
        of_group = [fits[number][axis] for axis in axes]
        residuals = np.concatenate([a.residuals[_counted(problem, k)] for k, a in zip(axes, of_group, strict=True)])
        evidence.append(
            Evidence(
                group=group,
                degree=_degree_of(terms),
                terms=len(terms),
                redundancy=_redundancy(of_group, SIMILARITY_PARAMETERS[group]),
                rms=_rms(residuals),
                left_out=left_out[number],
                left_out_by=by,
                f=f,
                p=p,
                against=_degree_of(candidates[against]),
                accepted=bool(taken or number == 0),
            )
        )
    return candidates[chosen], evidence


def _step_taken(p: float, rich: float, simple: float) -> bool:
    """Whether a step to more terms is taken: by its F test alone, or by a weaker one that left-out points confirm."""
    ratio = rich / simple if simple > 0 and np.isfinite(rich) else WORSE
    return (p < SURE and ratio < WORSE) or (p < LIKELY and ratio < 1.0)


def _expected(problem: Problem) -> Floats:
    """Give the standard deviation, by axis in metres, of a misclosure from the control and the point alone."""
    weight = problem.by_axis
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.where(weight > 0, 1 / weight, 0.0).sum(axis=0) / (weight > 0).sum(axis=0)
    expected: Floats = np.sqrt(np.nan_to_num(variance))
    return expected


def _counted(problem: Problem, axis: int) -> NDArray[np.bool_]:
    result: NDArray[np.bool_] = problem.by_axis[:, axis] > 0
    return result


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _redundancy(fits: Sequence[AxisFit], similarity: int) -> int:
    """Redundancy of a fit; without terms the similarity's own parameters count."""
    total = sum(axis.redundancy for axis in fits)
    return total if any(axis.terms for axis in fits) else total - similarity


def _of_all_axes(fits: Sequence[AxisFit]) -> int:
    """Redundancy over all axes; a group without terms rests on its share of the similarity."""
    return sum(_redundancy([fits[axis] for axis in axes], SIMILARITY_PARAMETERS[group]) for group, axes in GROUPS)


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
    problem: Problem, candidates: list[tuple[str, ...]], fits: list[list[AxisFit]], axes: tuple[int, ...]
) -> tuple[list[float], str]:
    """Errors at control that took no part: inner bands when every degree can do without one, else single points.

    An outer band is not left out: predicting it would be extrapolation, which no user of a polynomial should do.
    """
    counted = np.flatnonzero(_counted(problem, axes[0]))
    group = bands(problem.xyz[counted, 0], problem.spacing)
    inner = [counted[group == band] for band in range(1, int(group.max(initial=0)))]
    if inner and _carried_without(problem, counted, inner, candidates[-1]):
        return [_left_out(problem, all_axes, axes, inner) for all_axes in fits], "band"
    single = [np.array([row]) for row in counted]
    return [_left_out(problem, all_axes, axes, single) for all_axes in fits], "point"


def _carried_without(problem: Problem, counted: Numbers, inner: Sequence[Numbers], terms: tuple[str, ...]) -> bool:
    """Whether the control carries all terms without any one of its inner bands.

    The same choice as :func:`choose_terms` makes for what is left. A band that goes takes one station with it: the next
    band begins at the same point as before. The squares of singular values are those of the whole design less
    the band's share, so that nothing is fitted again.
    """
    stations = count_stations(problem.xyz[counted, 0], problem.spacing) - 1
    degree = _degree_of(terms)
    sizes = np.array([len(rows) for rows in inner])
    for size in np.unique(sizes).tolist():
        chosen = _ladder(stations, len(counted) - size, degree)
        left = np.array([rows for rows in inner if len(rows) == size])
        for drop in DROP_ORDER:
            if not chosen or not len(left):
                break
            good = _conditions_without(problem, counted, left, chosen) < 1 / RANK_LIMIT
            if good.any() and chosen != terms:
                return False
            left, chosen = left[~good], _dropped(chosen, drop)
        if len(left) and chosen != terms:
            return False
    return True


def _conditions_without(problem: Problem, counted: Numbers, groups: Numbers, terms: tuple[str, ...]) -> Floats:
    """Condition numbers of the scaled design without each of several groups of points of equal size."""
    scaled = _columns(problem.xyz, terms) / _scales(terms, problem)
    parts = scaled[groups]
    squares = np.linalg.eigvalsh(scaled[counted].T @ scaled[counted] - parts.transpose(0, 2, 1) @ parts)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(squares[:, 0] > 0, np.sqrt(squares[:, -1] / squares[:, 0]), np.inf)


def _left_out(problem: Problem, fits: Sequence[AxisFit], axes: tuple[int, ...], groups: Sequence[Numbers]) -> float:
    """Root mean square error at groups of control predicted from all others, without fitting again.

    The error of a left-out group is (I - H)^-1 times its residuals, H the part of the hat matrix within the group.
    The similarity is taken to share its parameters evenly among the points.
    """
    share = SIMILARITY_PARAMETERS[PLAN] / 2 if len(axes) > 1 else float(SIMILARITY_PARAMETERS[HEIGHT])
    errors: list[Floats] = []
    for axis in axes:
        fit_, total = fits[axis], int(_counted(problem, axis).sum())
        root = np.sqrt(np.where(_counted(problem, axis), problem.by_axis[:, axis], 1.0))
        for size in np.unique([len(rows) for rows in groups]).tolist():
            rows = np.array([each for each in groups if len(each) == size])
            parts = fit_.basis[rows]
            hat = parts @ parts.transpose(0, 2, 1) if fit_.terms else np.eye(size) * min(share / total, 0.9)
            rest = np.broadcast_to(np.eye(size) - hat, (len(rows), size, size))
            free = np.linalg.eigvalsh(rest)[:, 0] >= SMALLEST_REST
            # a group that alone determines part of the fit cannot be predicted by the others
            errors.append(np.full(int((~free).sum()) * size, np.inf))
            if free.any():
                residuals = (fit_.residuals[rows] * root[rows])[free]
                errors.append((np.linalg.solve(rest[free], residuals[:, :, None])[:, :, 0] / root[rows][free]).ravel())
    return _rms(np.concatenate(errors))
