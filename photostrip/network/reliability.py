"""Cofactors of everything that was adjusted: of single points, photos and residuals, and joint ones.

With Z the inverse of the photos' part of the normal matrix, W = Z times the border and K the cofactors of the common
parameters, the inverse is that without common parameters and E K E', E what a common parameter does to everything else:
-W to the photos, M W - V^-1 B'C to the points. The photos of a point lie within the band, where the elements of Z are
known; with M = V^-1 B'A of each ray, A and B its derivatives by photo and point, V the normal matrix of the point, the
cofactors of a point are V^-1 + sum M_i Z_ij M_j', those between its photos and it -sum Z_ij M_j'.

Parameters that the observations hardly tell apart: correlations by name.

How well each observation is controlled by the others: test values, detectable errors, what undetected ones can do.

The residual ``v`` of an observation of standard deviation ``sigma`` has the variance ``r sigma^2``, r its redundancy
number: the share of an error of the observation that shows in its own residual.

Variance components: how good each kind of observation really is, out of its own residuals.

The stated variances of a group are multiplied with the ratio of the weighted sum of squares of its residuals and its
share of the redundancy, until the ratios are one.

Self-calibration: what its parameters do to image coordinates, and which of them mean anything.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import EllipsisType
from typing import NamedTuple, Self

import numpy as np
from scipy.sparse import csr_array

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import GeometryError
from photostrip.network import defects
from photostrip.network.adjustment import BundleSolution, Cofactors
from photostrip.network.normal_equations import FactoredEquations
from photostrip.network.observations import PRINCIPAL_DISTANCE, LinearisedOrientations, corrected, values_of, whitening
from photostrip.network.problem import CALIBRATION, BundleProblem, BundleSettings
from photostrip.notes import in_pixels
from photostrip.rejection import UNCONTROLLED
from photostrip.statistics import chi2_quantile, normal_quantile, t_p_value, t_quantile


def cofactors_of(solution: BundleSolution) -> Cofactors:
    """Cofactors of all parameters and residuals; ``bundle-rank`` when the normal matrix is singular at the solution.

    Points and photos of a rough solution of a free network stay in its datum, which no residual feels.
    """
    prepared, found = solution.prepared, solution.factored
    problem, at, p = prepared.problem, found.equations.linearised, len(solution.common)
    m, q, u = problem.photos, problem.points, problem.unknowns
    inverse, rank = found.inverse, prepared.rank
    photos = inverse.blocks(rank, rank)
    points, cross = _of_points(solution)

    # what common parameters do to everything else
    to_photos = -found.cross.reshape(m, u, p)
    back = found.equations.common_points.toarray() - found.equations.carried.T @ found.cross
    to_points = -(found.equations.root.swapaxes(1, 2) @ back.reshape(q, 3, p))
    by_photo, by_point, image = at.rays.by_photo, at.rays.by_point, problem.images
    to_rays = by_photo @ to_photos[image.photo] + by_point @ to_points[image.point]
    to_rays[..., : prepared.calibrated] += at.rays.by_common.toarray().reshape(*at.rays.misfit.shape, -1)
    half = by_photo @ cross @ by_point.swapaxes(1, 2)
    of_rays = (
        np.eye(at.rays.misfit.shape[1])
        - by_photo @ photos[image.photo] @ by_photo.swapaxes(1, 2)
        - half
        - half.swapaxes(1, 2)
    )
    of_rays -= by_point @ points[image.point] @ by_point.swapaxes(1, 2)
    of_rays -= to_rays @ found.common @ to_rays.swapaxes(1, 2)
    points = points + to_points @ found.common @ to_points.swapaxes(1, 2)
    of_photos = np.empty((m, u + p, u + p))
    of_photos[:, :u, :u] = photos + to_photos @ found.common @ to_photos.swapaxes(1, 2)
    of_photos[:, :u, u:] = to_photos @ found.common
    of_photos[:, u:, :u] = of_photos[:, :u, u:].swapaxes(1, 2)
    of_photos[:, u:, u:] = found.common
    positions, attitudes = (_given(each, of_photos) for each in (at.positions, at.attitudes))
    if solution.free and not solution.rough:
        points, of_photos = _inner(solution, points, of_photos)
    points[~prepared.measured] = np.nan
    turn = _turns(solution.rotations, u)
    weights = prepared.prior**-2.0
    return Cofactors(
        points=points,
        photos=turn @ of_photos[:, :u, :u] @ turn.swapaxes(1, 2),
        common=found.common,
        image_residuals=_unwhitened(problem, of_rays),
        control_residuals=_control(solution, points),
        position_residuals=positions,
        attitude_residuals=attitudes,
        common_residuals=np.where(weights > 0.0, prepared.prior**2 - np.diag(found.common), 0.0),
        photo_common=turn @ of_photos[:, :u, u:],
    )


def _unwhitened(problem: BundleProblem, of_rays: Floats) -> Floats:
    """Cofactors of the residuals of rays or model coordinates in mm^2, out of those in units of sigma."""
    sigma = problem.images.sigma
    if not problem.of_models:
        return np.asarray(of_rays * sigma[:, :, None] * sigma[:, None, :])
    unwhite = np.linalg.inv(whitening(problem.images))
    return np.asarray(unwhite @ of_rays @ unwhite.swapaxes(1, 2))


def _of_points(solution: BundleSolution) -> tuple[Floats, Floats]:
    """Cofactors of points (q, 3, 3) and between the photo of each ray and its point (n, u, 3), common ones held."""
    found, prepared = solution.factored, solution.prepared
    u = prepared.problem.unknowns
    rays, inverse = found.equations.linearised.rays, found.inverse
    inner = found.equations.root.swapaxes(1, 2) @ found.equations.root
    share = rays.by_photo.swapaxes(1, 2) @ (rays.by_point @ inner[prepared.problem.images.point])  # (n, u, 3): M'
    points, cross = inner.copy(), np.empty_like(share)
    for near in prepared.near:
        photos, s = len(near.photos), len(near.points)
        row, column = near.photos[:, None], near.photos[None, :]
        held = inverse.holds(row, column)  # others share no point
        blocks = np.where(held[..., None, None], inverse.blocks(row, np.where(held, column, row)), 0.0)
        pull = np.zeros((photos, u, s, 3))
        pull[near.photo, :, near.point] = share[near.ray]
        carried = blocks.swapaxes(1, 2).reshape(u * photos, -1) @ pull.reshape(u * photos, -1)
        carried = carried.reshape(photos, u, s, 3)
        cross[near.ray] = -carried[near.photo, :, near.point]
        points[near.points] += np.einsum("upsi,upsj->sij", pull, carried)
    return points, cross


def _control(solution: BundleSolution, points: Floats) -> Floats:
    """Cofactors of the residuals of control, along its axes."""
    control = solution.prepared.problem.control
    found = -control.axes @ points[control.point] @ control.axes.swapaxes(1, 2)
    found[:, range(3), range(3)] += np.where(np.isfinite(control.sigma), control.sigma, 0.0) ** 2
    return found


def _given(linear: LinearisedOrientations, of_photos: Floats) -> Floats:
    """Cofactors of the residuals of camera positions or attitudes."""
    if not len(linear.photo):
        return np.zeros((0, 3, 3))
    partials = np.concatenate([linear.by_photo, linear.by_common], axis=2)
    found: Floats = -partials @ of_photos[linear.photo] @ partials.swapaxes(1, 2)
    with np.errstate(divide="ignore"):
        found[:, range(3), range(3)] += np.where(linear.weight > 0.0, linear.weight**-2.0, 0.0)
    return found


def _turns(rotations: Floats, unknowns: int) -> Floats:
    """Turn steps of photos or models in their own axes into the Cartesian frame: matrices (m, u, u)."""
    turn = np.tile(np.eye(unknowns), (len(rotations), 1, 1))
    turn[:, :3, :3] = turn[:, 3:6, 3:6] = rotations
    return turn


def _inner(solution: BundleSolution, points: Floats, of_photos: Floats) -> tuple[Floats, Floats]:
    """Carry cofactors of points and photos (with common parameters) over to inner constraints on the points.

    With G the generators of the similarity, E the choice of the points, H = (G'EG)^-1 and P = Q E G H: the cofactors
    are Q - G P' - P G' + G (H G'E P) G'.
    """
    state, m, p, u = solution.state, len(of_photos), len(solution.common), solution.prepared.problem.unknowns
    origin, moves = defects.point_generators(solution.prepared, state)
    flat = moves.reshape(-1, defects.DEFECT)
    inverse = np.asarray(np.linalg.inv(flat.T @ flat), float)
    swept = solution.factored.solved_for_points(flat)
    middle = inverse @ (flat.T @ swept.points) @ inverse
    found = points + _carried_over(moves, (swept.points @ inverse).reshape(moves.shape), middle)
    turned = np.zeros((m, u + p, defects.DEFECT))
    turned[:, :u] = defects.photo_generators(state, origin, u)
    shared = np.broadcast_to(swept.common, (m, p, defects.DEFECT))
    own = np.concatenate([swept.photos.reshape(m, u, -1), shared], axis=1) @ inverse
    return found, of_photos + _carried_over(turned, own, middle)


def _carried_over(moves: Floats, swept: Floats, middle: Floats) -> Floats:
    """Give G M G' - G P' - P G'."""
    product = moves @ swept.swapaxes(1, 2)
    return np.asarray(moves @ middle @ moves.swapaxes(1, 2) - product - product.swapaxes(1, 2))


def joint_cofactors(solution: BundleSolution, functions: csr_array) -> Floats:
    """Joint cofactors (k, k) of k linear functions (k, 3 q) of the points' coordinates; not of a free network.

    With F the functions and L L' the normal matrices of the points: F L^-T L^-1 F' + G Q G', where G = F L^-T T' and Q
    are the cofactors of photos and common parameters.
    """
    found = solution.factored
    white = found.equations.roots @ functions.T
    by_photos = (found.equations.carried @ white).toarray()
    by_common = (found.equations.common_points.T @ white).toarray()
    photos, common = found.shared(by_photos, by_common)
    joint = by_photos.T @ photos + by_common.T @ common + (white.T @ white).toarray()
    return np.asarray(0.5 * (joint + joint.T), float)


def coordinates_of(solution: BundleSolution, points: Numbers) -> csr_array:
    """Functions (3 k, 3 q) that are the coordinates of k points."""
    columns = (3 * points[:, None] + np.arange(3)).ravel()
    shape = (len(columns), 3 * len(solution.points))
    return csr_array((np.ones(len(columns)), (np.arange(len(columns)), columns)), shape=shape)


@dataclass(frozen=True, eq=False)
class JointCofactors:
    """Joint cofactors of several photos; of a free network in some datum, which nothing feels that can be observed."""

    factored: FactoredEquations
    rotations: Floats  # (m, 3, 3): photo to Cartesian frame

    @classmethod
    def of_solution(cls, solution: BundleSolution) -> Self:
        return cls(solution.factored, solution.rotations)

    def of(self, photos: Numbers, partials: Floats) -> Floats:
        """Joint cofactors (g, k c, k c) of c functions of each of k photos, in g sets of photos (g, k).

        partials: (g, k, c, u): by shift (m) and rotation vector (rad) of the unit in the Cartesian frame, and the
            logarithm of the scale of a model.
        """
        (g, k, c, u), found = partials.shape, self.factored
        inner = partials @ _turns(self.rotations, u)[photos]
        half = inner @ self._blocks(found.equations.prepared.rank[photos]).swapaxes(2, 3).reshape(g, k, u, -1)
        whole = half.reshape(g, k * c, k, u).swapaxes(1, 2) @ inner.swapaxes(2, 3)
        joint = whole.swapaxes(1, 2).reshape(g, k * c, -1)
        cross = (inner @ found.cross.reshape(len(self.rotations), u, -1)[photos]).reshape(g, k * c, -1)
        return np.asarray(joint + cross @ found.common @ cross.swapaxes(1, 2), float)

    def _blocks(self, sets: Numbers) -> Floats:
        """Blocks (g, k, k, u, u) of Z between the photos of sets (g, k) of places in the band."""
        inverse, factor = self.factored.inverse, self.factored.band
        row, column = np.broadcast_arrays(sets[:, :, None], sets[:, None, :])
        near = inverse.holds(row, column)
        if near.all():
            return inverse.blocks(row, column)
        u = factor.block
        found = np.empty((*row.shape, u, u))
        found[near] = inverse.blocks(row[near], column[near])
        far, m = np.unique(column[~near]), factor.size // u
        unit = np.zeros((m, u, len(far), u))
        unit[far, :, np.arange(len(far))] = np.eye(u)
        solved = factor.solve(unit.reshape(m * u, -1)).reshape(unit.shape)
        found[~near] = solved[row[~near], :, np.searchsorted(far, column[~near])]
        return found


LIMIT = 0.95
ELEMENTS = (
    "shift along x",
    "shift along y",
    "shift along z",
    "rotation about x",
    "rotation about y",
    "rotation about z",
    "scale",
)
"""Elements of a photo or model, along and about its own axes, where shift and rotation that replace each other show."""


@dataclass(frozen=True)
class Correlation:
    """Two parameters that depend on each other."""

    # first, second: names: ``camera RC30: c``, ``photo 1003: shift along x``
    first: str
    second: str
    value: float


def correlations(solution: BundleSolution, precision: Cofactors) -> tuple[Correlation, ...]:
    """List correlations above ``LIMIT``: between common parameters, between these and photos, and within photos.

    In this order; each the largest first.
    """
    problem = solution.prepared.problem
    names = problem.common_names()
    turn = _turns(np.swapaxes(solution.rotations, 1, 2), problem.unknowns)
    photos = turn @ precision.photos @ turn.swapaxes(1, 2)
    cross = turn @ precision.photo_common
    sigma = np.sqrt(np.einsum("nii->ni", photos))

    def element(photo: int, number: int) -> str:
        return f"{problem.unit} {problem.photo_name(photo)}: {ELEMENTS[number]}"

    shared = np.sqrt(np.diag(precision.common))
    found = _named(precision.common[None] / np.outer(shared, shared), lambda _, i, j: (names[i], names[j]))
    found += _named(cross / (sigma[:, :, None] * shared), lambda n, i, j: (element(n, i), names[j]), lower=False)
    found += _named(photos / (sigma[:, :, None] * sigma[:, None]), lambda n, i, j: (element(n, i), element(n, j)))
    return tuple(found)


def _named(ratio: Floats, name: Callable[[int, int, int], tuple[str, str]], *, lower: bool = True) -> list[Correlation]:
    """Name the elements (n, i, j) above the limit, the largest first; of squares only the lower half."""
    chosen = np.abs(ratio) > LIMIT
    if lower:
        chosen &= np.tri(ratio.shape[1], k=-1, dtype=bool)
    places, values = np.argwhere(chosen), ratio[chosen]
    order = np.argsort(-np.abs(values), kind="stable")
    return [Correlation(*name(*places[k].tolist()), float(values[k])) for k in order]


IMAGE, CONTROL, POSITION, ATTITUDE = KINDS = "image", "control", "position", "attitude"
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


def groups_of(
    problem: BundleProblem, solution: BundleSolution, precision: Cofactors, kinds: Sequence[str] = KINDS
) -> tuple[Group, ...]:
    """Observations of some kinds with their redundancy numbers, image coordinates first; empty kinds are left out."""
    found = [
        (IMAGE, solution.image_residuals, problem.images.sigma, precision.image_residuals),
        (CONTROL, -solution.control_residuals, problem.control.sigma, precision.control_residuals),
        (POSITION, -solution.position_residuals, problem.positions.sigma, precision.position_residuals),
        (ATTITUDE, -solution.attitude_residuals, problem.attitudes.sigma, precision.attitude_residuals),
    ]
    return tuple(_group(*each) for each in found if len(each[1]) and each[0] in kinds)


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
        return {kind: noncentrality(self.alpha if kind == IMAGE else self.alpha_of_given, power) for kind in KINDS}


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

    def of(self, camera: Camera | None) -> Self:
        """Return it in the unit in which the project gives the camera."""
        if camera is None or camera.unit != "px" or not camera.pixel_size:
            return self
        row = in_pixels({"unit": self.unit, "value": self.value, "sigma": self.sigma}, camera.pixel_size)
        return replace(self, **row)


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
