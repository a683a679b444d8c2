"""How well each observation is controlled by the others: test values, detectable errors, what undetected ones can do.

The residual ``v`` of an observation of standard deviation ``sigma`` has the variance ``r sigma^2``, r its redundancy
number: the share of an error of the observation that shows in its own residual.

Variance components: how good each kind of observation really is, out of its own residuals.

The stated variances of a group are multiplied with the ratio of the weighted sum of squares of its residuals and its
share of the redundancy, until the ratios are one.

Self-calibration: what its parameters do to image coordinates, and which of them mean anything.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import EllipsisType
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.network.adjustment import BundleSolution, Cofactors
from photostrip.network.observations import PRINCIPAL_DISTANCE, corrected, values_of
from photostrip.network.problem import CALIBRATION, BundleProblem, BundleSettings
from photostrip.rejection import UNCONTROLLED
from photostrip.statistics import chi2_quantile, normal_quantile, t_p_value, t_quantile

IMAGE, CONTROL, POSITION, ATTITUDE = "image", "control", "position", "attitude"
SIGMA0_LEVEL = 0.05  # at which a search takes stated standard deviations for too small


@dataclass(frozen=True, eq=False)
class Group:
    """Observations of one kind after the adjustment; one row each, k coordinates."""

    kind: str  # ``IMAGE``, ``CONTROL``, ``POSITION`` or ``ATTITUDE``
    # (n, k): observed minus adjusted: mm in the image, metres, radians for attitudes; NaN where nothing is given
    error: Floats
    sigma: Floats  # (n, k): stated standard deviations; NaN where nothing is given
    redundancy: Floats  # (n, k): redundancy numbers, 0 to 1; NaN where nothing is given

    @property
    def standardised(self) -> Floats:
        """Errors over their standard deviations, shape (n, k); NaN where the redundancy is too small to tell."""
        with np.errstate(invalid="ignore", divide="ignore"):
            value = self.error / (self.sigma * np.sqrt(self.redundancy))
        return np.where(self.redundancy >= UNCONTROLLED, value, np.nan)

    @property
    def gross(self) -> Floats:
        """What error of the observation would explain its residual, in its unit, shape (n, k)."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.redundancy >= UNCONTROLLED, self.error / self.redundancy, np.nan)

    def detectable(self, shift: float, at: tuple[int, int] | EllipsisType = ...) -> Floats:
        """Smallest errors that are found with the wanted power, (n, k), in the unit of the observation; of one `at`.

        sigma shift / sqrt(r) with ``noncentrality`` as shift; infinite where it is not controlled at all.
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(self.sigma[at] * shift / np.sqrt(np.maximum(self.redundancy[at], 0.0)), float)

    def external(self, shift: float) -> Floats:
        """How far an error that is just not found can move any coordinate, in its standard deviations.

        ``shift sqrt((1 - r) / r)``, (n, k): no coordinate, and no function of coordinates, moves by more.
        Source: [Baarda 1968].
        """
        r = np.clip(self.redundancy, 0.0, 1.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(shift * np.sqrt((1.0 - r) / r), float)


def groups_of(problem: BundleProblem, solution: BundleSolution, precision: Cofactors) -> tuple[Group, ...]:
    """All observations with their redundancy numbers, image coordinates first; empty kinds are left out."""
    found = [
        (IMAGE, solution.image_residuals, problem.images.sigma, precision.image_residuals),
        (CONTROL, -solution.control_residuals, problem.control.sigma, precision.control_residuals),
        (POSITION, -solution.position_residuals, problem.positions.sigma, precision.position_residuals),
        (ATTITUDE, -solution.attitude_residuals, problem.attitudes.sigma, precision.attitude_residuals),
    ]
    return tuple(_group(*each) for each in found if len(each[1]))


def require_regular(problem: BundleProblem, solution: BundleSolution, precision: Cofactors) -> None:
    """Refuse redundancy numbers far outside 0 to 1: rounding hides that photos hang free (``bundle-rank``)."""
    for group in groups_of(problem, solution, precision):
        if (np.abs(np.nan_to_num(group.redundancy, nan=0.5) - 0.5) > 1.0).any():
            raise GeometryError("the normal matrix is singular but for rounding", code="bundle-rank")


def _group(kind: str, error: Floats, sigma: Floats, cofactors: Floats) -> Group:
    given = np.isfinite(sigma)
    known = np.where(given, sigma, np.nan)
    redundancy = np.diagonal(cofactors, axis1=1, axis2=2) / known**2
    return Group(kind=kind, error=np.where(given, error, np.nan), sigma=known, redundancy=redundancy)


def explained_by(error: Floats, cofactor: Floats, sigma: Floats) -> Floats:
    """Say what the sum of squares falls by without each row: v' Qvv^-1 v in the directions that others control, (n,).

    error, sigma: (n, c): residuals and standard deviations. cofactor: (n, c, c): of the residuals.
    """
    share, axes = np.linalg.eigh(cofactor / (sigma[:, :, None] * sigma[:, None, :]))
    along = np.einsum("nij,ni->nj", axes, error / sigma)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(share > UNCONTROLLED, along**2 / share, 0.0).sum(axis=1), float)


def noncentrality(alpha: float, power: float) -> float:
    """Shift of a test value by the smallest error that is found with a wanted probability, in standard deviations.

    4.13 for a level of 0.001 and a power of 0.80. Source: [Baarda 1968].
    """
    return normal_quantile(1 - alpha / 2) + normal_quantile(power)


def limit(test: str, alpha: float, redundancy: int) -> float:
    """Largest standardised residual of a good observation; infinite when the redundancy does not allow the tau test.

    ``tau`` = t sqrt(r / (r - 1 + t^2)) with t of r - 1 degrees of freedom. Source: [Baarda 1968]; [Pope 1976] for tau.
    """
    if test == "baarda":
        return normal_quantile(1 - alpha / 2)
    if redundancy < 2:
        return float("inf")
    t = t_quantile(1 - alpha / 2, redundancy - 1)
    return float(t * np.sqrt(redundancy / (redundancy - 1 + t**2)))


@dataclass(frozen=True)
class Sigma0Test:
    """Whether the stated standard deviations are right on the whole."""

    sigma0: float  # standard deviation of unit weight found
    redundancy: int
    # lower, upper: limits of sigma0 between which it lies with right standard deviations, at a level; NaN without
    # redundancy
    lower: float
    upper: float

    @property
    def passed(self) -> bool:
        return self.lower <= self.sigma0 <= self.upper

    @property
    def too_large(self) -> bool:
        return self.sigma0 > self.upper


def sigma0_test(solution: BundleSolution, level: float = SIGMA0_LEVEL) -> Sigma0Test:
    """Test sigma0 against 1: chi-square, both sides."""
    f = solution.redundancy
    if f < 1:
        return Sigma0Test(sigma0=solution.sigma0, redundancy=f, lower=float("nan"), upper=float("nan"))
    ends = (chi2_quantile(p, f) for p in (level / 2, 1 - level / 2))
    lower, upper = (float(np.sqrt(end / f)) for end in ends)
    return Sigma0Test(sigma0=solution.sigma0, redundancy=f, lower=lower, upper=upper)


class Limit(NamedTuple):
    """What a point is tested against."""

    value: float  # largest standardised residual of a coordinate
    both: float  # the same of a point on two photos, which loses both rays
    given: float  # the same of a given coordinate, of which wrong rays say nothing
    alpha: float  # probability that the test of one good coordinate of a ray, or of rays that agree, rejects them
    alpha_of_given: float  # that of one good given coordinate does
    unit: float  # standard deviation of unit weight in force

    def of(self, rays: Numbers | int) -> Floats:
        """Largest standardised residual by number of rays of the point."""
        return np.where(rays == 2, self.both, self.value)

    def shifts(self, power: float) -> dict[str, float]:
        """Give ``noncentrality`` for each kind of observation."""
        return {
            kind: noncentrality(self.alpha if kind == IMAGE else self.alpha_of_given, power)
            for kind in (IMAGE, CONTROL, POSITION, ATTITUDE)
        }


def tests_of(problem: BundleProblem, solution: BundleSolution, precision: Cofactors) -> int:
    """Count the tests of single observations: every coordinate that others control is one."""
    return sum(int((each.redundancy >= UNCONTROLLED).sum()) for each in groups_of(problem, solution, precision))


def limit_of(
    solution: BundleSolution,
    settings: BundleSettings,
    tests: int,
    established: tuple[int, int],
    share_of_both: float = 1.0,
) -> Limit:
    """Limit of standardised residuals: never sharper than the stated standard deviations allow.

    Without errors all tests together have the level q of the settings. With many errors q is the part of the rejections
    that are false: with k of m hypotheses rejected the next is tested at i q / (m + 1 - i (1 - q)), i = k + 1, and
    m - k tests are left. Source: [Gavrilov 2009]. Rays and given coordinates are counted apart: that many rays are
    wrong says nothing of control.

    established: rejections of points, by their rays, and of given coordinates.
    share_of_both: what the test of a point on two photos has of the level of one test.
    """
    found = settings.test == "tau" and sigma0_test(solution).too_large
    shares = (settings.level * (rejected + 1) for rejected in established)
    alpha, of_given = (
        share / (max(tests, 1) + share) if settings.alpha is None else settings.alpha for share in shares
    )
    test, unit = ("tau", solution.sigma0) if found else ("baarda", 1.0)
    value, both, given = (limit(test, each, solution.redundancy) for each in (alpha, alpha * share_of_both, of_given))
    return Limit(value=value, both=both, given=given, alpha=alpha, alpha_of_given=of_given, unit=unit)


LEAST_REDUNDANCY = 3.0  # of a group, below which its residuals say nothing about it
ITERATIONS = 12
CONVERGED = 0.005  # relative change of a standard deviation
LEAST_FACTOR, MOST_FACTOR = 0.05, 20.0  # factors of a stated standard deviation in one step: rounding of a perfect fit


@dataclass(frozen=True)
class Component:
    """The standard deviations of one group."""

    # ``image``, ``control plan``, ``control height``, ``control``, ``positions plan``, ``positions height`` or
    # ``attitudes``
    name: str
    observations: int
    redundancy: float
    factor: float  # what its stated standard deviations are to be multiplied with; 1 when it was not estimated
    sigma: float  # relative standard deviation of the factor
    estimated: bool  # whether its redundancy was enough


def labels(kind: str, rows: int, level: Sequence[bool]) -> list[tuple[str, slice | Flags]]:
    """Split a kind of observations into groups of their own variance: name, and coordinates (rows, 3).

    ``level``: whether the axes of a row are plan and height; others, as of geocentric coordinates, stay one group.
    """
    if kind not in {CONTROL, POSITION}:
        return [(kind if kind == IMAGE else "attitudes", slice(None))]
    name = "control" if kind == CONTROL else "positions"
    flat = np.array(level, bool).reshape(rows, 1)
    height = np.arange(3) == 2
    return [(f"{name} plan", flat & ~height), (f"{name} height", flat & height), (name, ~flat & np.ones(3, bool))]


def components(
    problem: BundleProblem, solution: BundleSolution, precision: Cofactors, level: Mapping[str, Sequence[bool]]
) -> tuple[Component, ...]:
    """Compare each group's residuals with its standard deviations, once: factor^2 = v^T P v / r of the group.

    ``level`` says for ``control`` and ``position`` whether the axes of each row are plan and height. Groups without
    observations are left out. Source: [Förstner 1979], the simplified form of Helmert's estimation.
    """
    found = []
    for group in groups_of(problem, solution, precision):
        for name, where in labels(group.kind, len(group.error), level.get(group.kind, ())):
            given = np.isfinite(group.sigma)
            if not isinstance(where, slice):
                given &= where
            if given.any():
                found.append(_component(name, group, given))
    return tuple(found)


def _component(name: str, group: Group, given: Flags) -> Component:
    squares = float(((group.error[given] / group.sigma[given]) ** 2).sum())
    redundancy = float(group.redundancy[given].sum())
    estimated = redundancy >= LEAST_REDUNDANCY
    factor = float(np.clip(np.sqrt(squares / redundancy), LEAST_FACTOR, MOST_FACTOR)) if estimated else 1.0
    sigma = float(1 / np.sqrt(2 * redundancy)) if estimated else float("nan")
    return Component(
        name=name, observations=int(given.sum()), redundancy=redundancy, factor=factor, sigma=sigma, estimated=estimated
    )


def scaled(problem: BundleProblem, found: Sequence[Component], level: Mapping[str, Sequence[bool]]) -> BundleProblem:
    """Multiply the standard deviations of a problem with the factors of their groups."""
    factor = {each.name: each.factor for each in found}

    def with_factors(kind: str, sigma: Floats) -> Floats:
        result = sigma.copy()
        for name, where in labels(kind, len(sigma), level.get(kind, ())):
            if name in factor:
                result[where] = result[where] * factor[name]
        return result

    return replace(
        problem,
        images=replace(problem.images, sigma=with_factors(IMAGE, problem.images.sigma)),
        control=replace(problem.control, sigma=with_factors(CONTROL, problem.control.sigma)),
        positions=replace(problem.positions, sigma=with_factors(POSITION, problem.positions.sigma)),
        attitudes=replace(problem.attitudes, sigma=with_factors(ATTITUDE, problem.attitudes.sigma)),
    )


def combined(before: Sequence[Component], step: Sequence[Component]) -> tuple[Component, ...]:
    """Multiply the factors of a step onto those found before; redundancies are those of the last step."""
    known = {each.name: each.factor for each in before}
    return tuple(replace(each, factor=each.factor * known.get(each.name, 1.0)) for each in step)


def converged(step: Sequence[Component]) -> bool:
    """Whether a step changes nothing worth another adjustment."""
    return all(abs(each.factor - 1.0) < CONVERGED for each in step)


SIGNIFICANCE = 0.05
KEPT = 0.3  # of a loose a-priori standard deviation that a parameter keeps which is not determined
INSEPARABLE = 0.9999  # correlations of what cannot be told apart


@dataclass(frozen=True)
class Parameter:
    # camera, name, unit: which it is
    camera: str
    name: str
    unit: str
    # value, sigma: correction of the given calibration, and its standard deviation with the sigma0 found
    value: float
    sigma: float
    p: float  # probability of a value so large or larger when the true one is zero
    prior: float  # a-priori standard deviation; infinite for a free parameter
    redundancy: float  # share of the a-priori value that the measurements control; NaN for a free parameter

    @property
    def significant(self) -> bool:
        return self.p < SIGNIFICANCE


def sigmas(asked: Sequence[Sequence[str]], prior: dict[str, float]) -> Floats | None:
    """A-priori standard deviations (cameras, 10) as a problem takes them; None when nothing is asked for.

    ``prior`` holds those by name; a parameter without one is free (infinite). 0: not a parameter.
    """
    found = np.zeros((len(asked), len(CALIBRATION)))
    for row, names in enumerate(asked):
        for column, each in enumerate(CALIBRATION.values()):
            if each.asked in names:
                found[row, column] = prior.get(each.asked, np.inf)
    return found if found.any() else None


def millimetre(xy: Floats) -> Floats:
    """Values of the parameters that move a point at the edge of the measured part of a photo by 1 mm, shape (10,)."""
    edge = max(float(np.hypot(xy[:, 0], xy[:, 1]).max(initial=1.0)), 1e-3)
    return np.array([edge**-each.power for each in CALIBRATION.values()])


def image_shift(problem: BundleProblem, common: Floats, xy: Floats, photo: Numbers) -> Floats:
    """Correction (n, 2) that makes ideal image coordinates of the given principal distance, to be added to them, mm.

    A change of the principal distance is turned into a change of scale of the photo.
    """
    values = values_of(problem.cameras, common)
    if not values.any():
        return np.zeros_like(xy)
    camera = problem.cameras.of_photo[photo]
    focal = problem.cameras.focal[camera]
    shifted = corrected(problem.cameras, values, xy, camera)
    return np.asarray(shifted * (focal / (focal + values[camera, PRINCIPAL_DISTANCE]))[:, None] - xy, float)


def parameters_of(problem: BundleProblem, solution: BundleSolution, precision: Cofactors) -> tuple[Parameter, ...]:
    """Test whether each parameter is there at all: t = value / standard deviation, with the redundancy of the bundle.

    ``redundancy`` of a parameter with a prior: the part of it that the rays decide.
    """
    sigma = problem.cameras.sigma
    if sigma is None:
        return ()
    unit = solution.sigma0 if solution.redundancy > 0 else 1.0
    found, kinds = [], list(CALIBRATION.values())
    for number, (camera, column) in enumerate(np.argwhere(sigma > 0.0).tolist()):
        value, cofactor = float(solution.common[number]), float(precision.common[number, number])
        deviation = float(np.sqrt(cofactor)) * unit
        p = t_p_value(value / deviation, solution.redundancy) if deviation > 0 and solution.redundancy > 0 else 1.0
        prior = float(sigma[camera, column])
        share = float(precision.common_residuals[number]) / prior**2 if np.isfinite(prior) else float("nan")
        found.append(
            Parameter(
                camera=problem.camera_ids[camera] if problem.camera_ids else str(camera),
                name=kinds[column].title,
                unit=kinds[column].unit,
                value=value,
                sigma=deviation,
                p=p,
                prior=prior,
                redundancy=share,
            )
        )
    return tuple(found)
