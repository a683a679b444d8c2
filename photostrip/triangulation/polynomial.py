"""Strip polynomials: the deformation that a similarity leaves, taken out axis by axis.

Every axis of the intermediate frame, X along the strip, gets its own polynomial in X and Y. How many terms the control can
carry is decided by where it stands, not by how many points there are: a cubic needs four different stations along
the strip. How many it should carry is decided by evidence: an F test of each step and errors at control points left out.

Source: [001] eq. 150-151, the free term of 151 corrected to X - X'.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import f_p_value

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.triangulation.absolute import Targets

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

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
RANK_LIMIT = 0.02  # smallest over largest singular value of the scaled design; below it the control cannot tell the terms apart
F_LEVEL = 0.10  # significance asked of a step to more terms
PASSES = 4  # plan-only and height-only points take their missing coordinate from the fit itself
FLOOR = 1e-3  # of a point's a-priori standard deviation: smaller residuals are rounding
SIMILARITY_PARAMETERS = 7


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
    leverage : ndarray, shape (n,)
        Share of each control coordinate in its own fit, 0 to 1.
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
    leverage: Floats
    sigma0: float
    redundancy: int
    condition: float


@dataclass(frozen=True, eq=False)
class Evidence:
    """What speaks for a degree.

    Parameters
    ----------
    degree : int
        0 for the similarity alone.
    terms : tuple of int
        Number of terms in X, Y and Z.
    redundancy : int
        Redundancy over all three axes.
    rms : ndarray, shape (3,)
        Root mean square of the residuals at control, metres.
    left_out : ndarray, shape (3,)
        Root mean square at control points that did not take part in the fit, metres.
    left_out_by : str
        ``"band"`` or ``"point"``: what was left out at a time; empty when nothing could be.
    f, p : float
        F ratio of the step from the degree compared with, and the probability of a larger one by chance; NaN without.
    against : int
        The degree compared with.
    accepted : bool
        Whether the step was taken.
    """

    degree: int
    terms: tuple[int, int, int]
    redundancy: int
    rms: Floats
    left_out: Floats
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
        Weights along the points' ground axes, metres^-2; 0 where a coordinate does not count.
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

    @property
    def reach(self) -> float:
        """Largest distance of control from the origin along the strip, metres."""
        return max(float(np.abs(self.xyz[:, 0]).max()), 1e-6)

    @property
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
    points = len(xyz) if forced else len(xyz) - 1
    terms: list[str] = []
    for candidate, power, needed, exact in LADDER:
        if power <= degree and stations >= needed and points >= exact:
            terms = list(candidate)
            break
    for drop in DROP_ORDER:
        if not terms or _condition(xyz, terms, problem) < 1 / RANK_LIMIT:
            break
        terms = [t for t in terms if t != drop]
    return tuple(terms)


def _scales(terms: Sequence[str], problem: Problem) -> Floats:
    return np.array([problem.reach**i * problem.breadth**j for i, j in (POWERS[t] for t in terms)])


def _condition(xyz: Floats, terms: Sequence[str], problem: Problem) -> float:
    values = np.linalg.svd(_columns(xyz, terms) / _scales(terms, problem), compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0 else float("inf")


def _degree_of(terms: Sequence[str]) -> int:
    return max((POWERS[t][0] for t in terms), default=0)


def _fit_axis(problem: Problem, misclosure: Floats, weight: Floats, terms: tuple[str, ...]) -> AxisFit:
    """Weighted least squares of one axis; the misclosure is strip minus given."""
    rows = weight > 0
    n = len(weight)
    residuals, leverage = np.zeros(n), np.zeros(n)
    residuals[rows] = misclosure[rows]
    empty = np.zeros(0)
    if not terms:
        return AxisFit((), empty, empty, empty, residuals, leverage, float("nan"), int(rows.sum()), float("nan"))
    scales = _scales(terms, problem)
    columns = _columns(problem.xyz, terms)[rows] / scales
    root = np.sqrt(weight[rows] / weight[rows].mean())
    q, r = np.linalg.qr(columns * root[:, None])
    # eq. 151 with the free term X - X': the polynomial equals given minus strip
    estimate = np.linalg.solve(r, q.T @ (-misclosure[rows] * root))
    residuals[rows] = misclosure[rows] + columns @ estimate
    leverage[rows] = (q**2).sum(axis=1)
    redundancy = int(rows.sum()) - len(terms)
    squares = float(((residuals[rows] * root) ** 2).sum())
    sigma0 = float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan")
    inverse = np.linalg.inv(r)
    sigmas = sigma0 * np.sqrt((inverse**2).sum(axis=1))
    return AxisFit(
        terms, estimate / scales, sigmas / scales, estimate, residuals, leverage, sigma0, redundancy,
        _condition(problem.xyz[rows], terms, problem),
    )  # fmt: skip


def _fit(problem: Problem, terms: Sequence[tuple[str, ...]], without: Numbers | None = None) -> list[AxisFit]:
    """Fit all three axes; a few passes settle points that give only some of their coordinates."""
    weight = problem.by_axis
    if without is not None:
        weight = weight.copy()
        weight[without] = 0.0
    partial = not problem.targets.control.use.all()
    corrected = problem.xyz
    for _ in range(PASSES if partial else 1):
        misclosure = problem.xyz - (problem.targets.of(corrected) if partial else _full_targets(problem))
        fits = [_fit_axis(problem, misclosure[:, axis], weight[:, axis], terms[axis]) for axis in range(3)]
        corrected = problem.xyz + np.column_stack([_columns(problem.xyz, f.terms) @ f.coefficients for f in fits])
    return fits


def _full_targets(problem: Problem) -> Floats:
    return problem.targets.of(problem.xyz)


def fit(problem: Problem, settings: Settings, precision: tuple[float, float]) -> Polynomial:
    """Fit the polynomial that the settings ask for, or the one that the evidence supports.

    Parameters
    ----------
    problem : Problem
        Control points after the similarity.
    settings : Settings
        Degree, or ``"auto"``.
    precision : tuple of float
        A-priori standard deviation of a strip point in plan and height, metres; residuals far below it are rounding.

    Returns
    -------
    Polynomial
        The correction; of degree 0, without terms, when the control carries none or the evidence supports none.
    """
    forced = settings.degree != "auto"
    highest = int(settings.degree) if forced else 3
    counts = problem.by_axis > 0
    stations = (
        count_stations(problem.xyz[counts[:, 0], 0], problem.spacing),
        count_stations(problem.xyz[counts[:, 2], 0], problem.spacing),
    )
    candidates = _candidates(problem, highest, forced=forced)
    floor = FLOOR * np.array([precision[0], precision[0], precision[1]])
    chosen, evidence = _weigh(problem, candidates, floor, forced=forced)
    terms = candidates[chosen]
    fits = _fit(problem, terms)
    x = problem.xyz[counts.any(axis=1), 0]
    degree = max(_degree_of(t) for t in terms)
    return Polynomial(
        degree,
        (fits[0], fits[1], fits[2]),
        evidence,
        stations,
        (float(x.min()), float(x.max())),
        settings.degree,
    )


def _candidates(problem: Problem, highest: int, *, forced: bool) -> list[list[tuple[str, ...]]]:
    """Terms of each axis for the similarity alone and every degree that adds something."""
    counts = problem.by_axis > 0
    found: list[list[tuple[str, ...]]] = [[(), (), ()]]
    for degree in range(1, highest + 1):
        terms = [choose_terms(problem.xyz[counts[:, axis]], degree, problem, forced=forced) for axis in range(3)]
        if terms != found[-1]:
            found.append(terms)
    return found


def _weigh(
    problem: Problem, candidates: list[list[tuple[str, ...]]], floor: Floats, *, forced: bool
) -> tuple[int, tuple[Evidence, ...]]:
    """Go up the degrees: a step is taken when the F test asks for it and left-out points do not get worse."""
    fits = [_fit(problem, terms) for terms in candidates]
    left_out, by = _left_out_errors(problem, candidates, fits)
    chosen, evidence = 0, []
    for number, terms in enumerate(candidates):
        f, p = (float("nan"), float("nan")) if not number else _f_test(fits[chosen], fits[number], floor)
        better = number > 0 and p < F_LEVEL and _relative_error(left_out[number], left_out[chosen], floor) <= 1.0
        against = max(_degree_of(t) for t in candidates[chosen])
        if better or (forced and number == len(candidates) - 1):
            chosen = number
        evidence.append(
            Evidence(
                max(_degree_of(t) for t in terms),
                (len(terms[0]), len(terms[1]), len(terms[2])),
                _total_redundancy(fits[number]),
                np.array([_rms(axis.residuals[_counted(problem, k)]) for k, axis in enumerate(fits[number])]),
                left_out[number],
                by,
                f,
                p,
                against,
                bool(better or number == 0 or (forced and number == len(candidates) - 1)),
            )
        )
    return chosen, tuple(evidence)


def _counted(problem: Problem, axis: int) -> NDArray[np.bool_]:
    result: NDArray[np.bool_] = problem.by_axis[:, axis] > 0
    return result


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _total_redundancy(fits: Sequence[AxisFit]) -> int:
    if any(axis.terms for axis in fits):
        return sum(axis.redundancy for axis in fits)
    return sum(axis.redundancy for axis in fits) - SIMILARITY_PARAMETERS


def _f_test(simple: Sequence[AxisFit], rich: Sequence[AxisFit], floor: Floats) -> tuple[float, float]:
    """F ratio of the richer fit against the simpler over all axes, each in units of its own richer variance."""
    gained = _total_redundancy(simple) - _total_redundancy(rich)
    left = _total_redundancy(rich)
    if gained < 1 or left < 1 or any(axis.redundancy < 1 for axis in rich):
        return float("nan"), float("nan")
    explained = 0.0
    for before, after, limit in zip(simple, rich, floor, strict=True):
        variance = max(float((after.residuals**2).sum()) / after.redundancy, limit**2)
        explained += max(float((before.residuals**2).sum() - (after.residuals**2).sum()), 0.0) / variance
    f = explained / gained
    return f, f_p_value(f, gained, left)


def _relative_error(rich: Floats, simple: Floats, floor: Floats) -> float:
    """Left-out error of the richer fit over that of the simpler, mean over the axes; 1 when unknown."""
    ratio = np.maximum(rich, floor) / np.maximum(simple, floor)
    known = np.isfinite(ratio)
    return float(np.sqrt(np.mean(ratio[known] ** 2))) if known.any() else 1.0


def _left_out_errors(
    problem: Problem, candidates: list[list[tuple[str, ...]]], fits: list[list[AxisFit]]
) -> tuple[list[Floats], str]:
    """Errors at control that took no part: inner bands when every degree can do without one, else single points.

    An outer band is not left out: predicting it would be extrapolation, which no user of a polynomial should do.
    """
    group = bands(problem.xyz[:, 0], problem.spacing)
    inner = range(1, int(group.max()))
    rest = [np.flatnonzero(group != band) for band in inner]
    richest = candidates[-1]
    if inner and all(_carried(problem, rows, richest) for rows in rest):
        return [_by_bands(problem, terms, group, inner) for terms in candidates], "band"
    return [_by_points(problem, axis_fits) for axis_fits in fits], "point"


def _carried(problem: Problem, rows: Numbers, terms: Sequence[tuple[str, ...]]) -> bool:
    """Whether some of the control still carries all terms."""
    weight = problem.by_axis
    for axis in range(3):
        kept = rows[weight[rows, axis] > 0]
        if choose_terms(problem.xyz[kept], _degree_of(terms[axis]), problem, forced=True) != terms[axis]:
            return False
    return True


def _by_bands(problem: Problem, terms: Sequence[tuple[str, ...]], group: Numbers, inner: range) -> Floats:
    errors: list[list[float]] = [[], [], []]
    for band in inner:
        rows = np.flatnonzero(group == band)
        fits = _fit(problem, terms, rows)
        misclosure = problem.xyz - _full_targets(problem)
        for axis, result in enumerate(fits):
            counted = rows[problem.by_axis[rows, axis] > 0]
            predicted = misclosure[counted, axis] + _columns(problem.xyz[counted], result.terms) @ result.coefficients
            errors[axis] += predicted.tolist()
    return np.array([_rms(np.array(values)) for values in errors])


def _by_points(problem: Problem, fits: Sequence[AxisFit]) -> Floats:
    """Leave-one-out errors in closed form: residual over one minus leverage."""
    errors = []
    for axis, result in enumerate(fits):
        rows = _counted(problem, axis)
        free = 1 - result.leverage[rows] if result.terms else np.full(rows.sum(), 1 - SIMILARITY_PARAMETERS / max(3 * rows.sum(), 8))
        with np.errstate(divide="ignore", invalid="ignore"):
            errors.append(_rms(np.where(free > 1e-6, result.residuals[rows] / free, np.inf)))  # noqa: PLR2004
    return np.array(errors)
