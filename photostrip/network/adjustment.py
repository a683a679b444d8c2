"""What a bundle adjustment finds: the estimate, its residuals and how it got there; and, on request, its precision.

From a problem to its least-squares solution: Gauss-Newton with step control.

Source: step control after [Marquardt 1963]; the step that may lead up: derived.

Which observations of a problem take part: taking them out, putting them back, starting again from a solution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_vector
from photostrip.network import defects
from photostrip.network.normal_equations import FactoredEquations, NormalEquations, equations_at, factored, linearise
from photostrip.network.observations import whitening
from photostrip.network.problem import BundleProblem, Parameters, PreparedProblem, StartValues, prepare


@dataclass(frozen=True)
class IterationStep:
    chi_square: float  # weighted sum of squares of all residuals before the step
    length: float  # length of the step in standard deviations: the root of ``dx' N dx`` over all parameters
    damping: float  # damping of the step; 0 for a full Gauss-Newton step
    # shift, turn: largest shift of a perspective centre or point in metres, largest rotation of a photo in radians
    shift: float
    turn: float


@dataclass(frozen=True, eq=False)
class BundleSolution:
    """The least-squares estimate."""

    centers: Floats  # (m, 3): perspective centres, or origins of models, metres, in the frame of the problem
    rotations: Floats  # (m, 3, 3): rotations, photo or model to Cartesian frame
    scales: Floats  # (m,): scales of models, metres per millimetre; 1 for photos
    points: Floats  # (q, 3): points, metres. A point without rays keeps its start
    common: Floats  # (p,): calibration, offset and drift parameters, in the order of ``Problem.common_names()``
    # (n, c): measured minus adjusted image or model coordinates, mm, in the order of ``problem.images``
    image_residuals: Floats
    # (c, 3): adjusted minus given coordinates along the axes of each row, metres, also where the sigma is infinite
    control_residuals: Floats
    # (g, 3): adjusted minus given camera positions along the axes, metres, offset and drift taken off
    position_residuals: Floats
    attitude_residuals: Floats  # (a, 3): rotation from the given to the adjusted attitude about the photo axes, radians
    chi_square: float  # weighted sum of squares of all residuals, those of weighted parameters included
    # observations (weighted parameters included) minus parameters, plus the datum defect of a free network
    redundancy: int
    free: bool  # true when the datum came from inner constraints on the points: no control, no positions
    rough: bool  # good enough for tests of residuals; the datum of a free network is then any
    steps: tuple[IterationStep, ...]  # the way from the start, one entry for each step that was taken or refused
    prepared: PreparedProblem  # the problem as it was laid out; spares the precision that work
    equations: NormalEquations | None  # at the solution, where the last steps of a rough one left them

    @property
    def state(self) -> Parameters:
        return Parameters(
            centers=self.centers, rotations=self.rotations, scales=self.scales, points=self.points, common=self.common
        )

    @cached_property
    def factored(self) -> FactoredEquations:
        """The normal equations at the solution in factors; ``bundle-rank`` where they are singular."""
        equations = self.equations or equations_at(self.prepared, self.state)
        held = defects.anchors if self.rough else defects.anchor
        anchor = held(equations.unreduced, self.prepared.rank, self.state) if self.free else None
        found = factored(equations, anchor)
        if found is None:
            raise GeometryError("the normal matrix is singular at the solution", code="bundle-rank")
        return found

    @property
    def sigma0(self) -> float:
        """Standard deviation of unit weight, 1 when the stated sigmas are right; NaN without redundancy."""
        return float((self.chi_square / self.redundancy) ** 0.5) if self.redundancy > 0 else float("nan")


@dataclass(frozen=True, eq=False)
class Cofactors:
    """Cofactors: covariances for a sigma0 of 1. Multiply by sigma0 squared where that is wanted."""

    points: Floats  # (q, 3, 3): cofactors of the points, m^2, Cartesian; NaN for a point without rays
    # (m, u, u): cofactors of photos or models: shift of the perspective centre (m), then rotation vector (rad), both in
    # the Cartesian frame; the rotation is ``from_vector(v) @ R``; of models the logarithm of the scale
    photos: Floats
    common: Floats  # (p, p): cofactors of the common parameters
    # (n, c, c): cofactors of the residuals of each ray, mm^2: with sigma of a coordinate, its redundancy number is
    # ``diagonal / sigma**2``
    image_residuals: Floats
    # (c, 3, 3): the same for control, along its axes, m^2; of rows and columns that are not given: minus the cofactor
    # of the adjusted coordinate
    control_residuals: Floats
    position_residuals: Floats  # (g, 3, 3): the same for camera positions
    attitude_residuals: Floats  # (a, 3, 3): the same for attitudes, rad^2
    # (p,): the same for the a-priori values of weighted common parameters; 0 where a parameter is free
    common_residuals: Floats
    photo_common: Floats  # (m, u, p): cofactors between photos and common parameters


FIRST_DAMPING = 1e-4
MORE, LESS = 10.0, 0.1  # factors of the damping after a refused and after a taken step
LARGEST_DAMPING = 1e8
MOST_STEPS = 30
# what the steps after the last one may still move, in standard deviations over all parameters together, estimated by
# how much shorter the last step was than the one before it
CONVERGED = 1e-6
SQUARES_ROUNDING = 1e-9  # part of the sum of squares by which it may seem to grow at the minimum
# part of the sum of squares by which it falls in a step that is the last of a rough solution: what is left then are
# bends of a whole long strip, which no ray feels
ROUGH = 1e-3


def solve(problem: BundleProblem, *, rough: bool = False) -> BundleSolution:
    """Adjust a bundle of rays by Gauss-Newton steps, damped where the sum of squares grows.

    Without control and positions the datum comes from inner constraints on the points: the adjusted points have no
    shift, rotation and change of scale against their start.

    rough: stop when the sum of squares hardly falls, which is enough for tests of residuals.
    Raises GeometryError when points, photos or the datum cannot be determined, by name (``bundle-rays``,
        ``bundle-rank``), or when the steps do not come to an end (``bundle-diverged``).
    """
    defects.refuse_repeated(problem)
    prepared = prepare(problem)
    free = defects.is_free(problem)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # starts far off: such steps are refused
        ended = _iterate(prepared, free=free, rough=rough)
    return _solution(prepared, ended, free=free, rough=rough)


class _Ended(NamedTuple):
    state: Parameters
    equations: NormalEquations | None  # there, or of a rough solution before a last step that moves nothing
    steps: list[IterationStep]


def _iterate(prepared: PreparedProblem, *, free: bool, rough: bool) -> _Ended:
    """Step until the next step would be short enough.

    Where the sum of squares grows, the step is taken back and the diagonal of the normal equations raised, more each
    time; where it falls again, less. Source: [Marquardt 1963].
    """
    state, damping, steps = prepared.begun, 0.0, []
    if not free:
        defects.refuse_loose(prepared, state)
    best = equations_at(prepared, state)
    defects.refuse_weak_points(best)
    for _ in range(MOST_STEPS):
        move = _move(state, best, damping, free=free)
        steps.append(_recorded(best, move, damping))
        moved = _moved(state, move)
        if damping == 0.0 and _still_to_come(steps) < CONVERGED:
            return _Ended(moved, best if rough else None, steps)
        found = equations_at(prepared, moved)
        if found.chi_square <= best.chi_square * (1.0 + SQUARES_ROUNDING):
            if rough and found.chi_square > best.chi_square * (1.0 - ROUGH):
                return _Ended(moved, found, steps)
            state, best = moved, found
            damping = 0.0 if damping <= FIRST_DAMPING else damping * LESS
            continue
        further = None if damping else _stepped(prepared, moved, found, steps, free=free)
        if further is not None and further[1].chi_square < best.chi_square:
            state, best = further
            continue
        damping = max(damping * MORE, FIRST_DAMPING)
        if damping > LARGEST_DAMPING:
            break
        best = equations_at(prepared, state, damping)
    raise defects.diverged(prepared, state, len(steps))


def _stepped(
    prepared: PreparedProblem, state: Parameters, equations: NormalEquations, steps: list[IterationStep], *, free: bool
) -> tuple[Parameters, NormalEquations] | None:
    """Go one step on from where the sum of squares has grown; None where that cannot be.

    A principal distance and the heights of its photos move together along a curve: a step leaves it, the next one finds
    it again, and steps that never leave it do not come to an end.
    """
    try:
        move = _move(state, equations, 0.0, free=free)
    except (GeometryError, np.linalg.LinAlgError):
        return None
    steps.append(_recorded(equations, move, 0.0))
    moved = _moved(state, move)
    return moved, equations_at(prepared, moved)


def _still_to_come(steps: list[IterationStep]) -> float:
    """Foretell the length of the next step from the last two."""
    last = steps[-1].length
    before = steps[-2].length if len(steps) > 1 else 1.0
    return last * min(last / before, 1.0) if before > 0.0 else last


class _Move(NamedTuple):
    """A step of all parameters."""

    photos: Floats  # (m, u): of photos or models, in their own axes
    points: Floats  # (q, 3): metres
    common: Floats  # (p,)
    length: float  # in standard deviations: the root of dx' N dx


def _move(state: Parameters, equations: NormalEquations, damping: float, *, free: bool) -> _Move:
    """Find the step of all parameters from the normal equations."""
    prepared = equations.prepared
    anchor = defects.anchor(equations.unreduced, prepared.rank, state) if free else None
    added = anchor
    if damping:
        added = np.eye(prepared.problem.unknowns) * (damping * equations.own) + (0.0 if anchor is None else anchor)
    found = factored(equations, added, damping)
    if found is None:
        defects.refuse_weak_points(equations)
        defects.refuse_singular(equations, anchor)
    defects.refuse_common(prepared, equations.corner, found.left)
    right = equations.right_photos, equations.right_points, equations.right_common
    by_photos, by_points, common = (each[:, 0] for each in found.solved(*(side[:, None] for side in right)))
    square = float(right[1] @ right[1] + right[0] @ by_photos + right[2] @ common)
    photos, points = by_photos.reshape(-1, prepared.problem.unknowns), by_points.reshape(-1, 3)
    if free:
        origin, moves = defects.point_generators(prepared, state)
        flat = moves.reshape(-1, defects.DEFECT)
        similarity = np.linalg.solve(flat.T @ flat, flat.T @ by_points)
        photos = photos - defects.photo_generators(state, origin, prepared.problem.unknowns) @ similarity
        points = points - moves @ similarity
    return _Move(photos=photos, points=points, common=common, length=float(np.sqrt(max(square, 0.0))))


def _moved(state: Parameters, move: _Move) -> Parameters:
    return Parameters(
        centers=state.centers + np.einsum("nij,nj->ni", state.rotations, move.photos[:, :3]),
        rotations=state.rotations @ from_vector(move.photos[:, 3:6]),
        scales=state.scales * np.exp(move.photos[:, 6:].sum(axis=1)),
        points=state.points + move.points,
        common=state.common + move.common,
    )


def _recorded(equations: NormalEquations, move: _Move, damping: float) -> IterationStep:
    shift = max(float(np.abs(part).max(initial=0.0)) for part in (move.photos[:, :3], move.points))
    turn = float(np.abs(move.photos[:, 3:6]).max(initial=0.0))
    return IterationStep(chi_square=equations.chi_square, length=move.length, damping=damping, shift=shift, turn=turn)


def _solution(prepared: PreparedProblem, ended: _Ended, *, free: bool, rough: bool) -> BundleSolution:
    """Find the residuals of all observations at the end, in their units, and the weighted sum of their squares."""
    problem, state = prepared.problem, ended.state
    at = linearise(prepared, state)
    control = problem.control
    return BundleSolution(
        centers=state.centers,
        rotations=state.rotations,
        scales=state.scales,
        points=state.points,
        common=state.common,
        image_residuals=_residuals(problem, at.rays.misfit),
        control_residuals=np.einsum("nij,nj->ni", control.axes, state.points[control.point] - control.xyz),
        position_residuals=at.positions.residual,
        attitude_residuals=at.attitudes.residual,
        chi_square=at.chi_square,
        redundancy=_redundancy(prepared, free=free),
        free=free,
        rough=rough,
        steps=tuple(ended.steps),
        prepared=prepared,
        equations=ended.equations,
    )


def _residuals(problem: BundleProblem, misfit: Floats) -> Floats:
    """Residuals of rays or model coordinates in mm, out of those in units of sigma."""
    if not problem.of_models:
        return np.asarray(misfit * problem.images.sigma)
    return np.asarray(np.linalg.solve(whitening(problem.images), misfit[:, :, None])[:, :, 0], float)


def _redundancy(prepared: PreparedProblem, *, free: bool) -> int:
    """Observations, priors among them, minus unknowns: of the units, three of a point with rays, and those in common.

    A free network has seven unknowns less, those of its datum.
    """
    problem = prepared.problem
    observations = sum(
        int(np.isfinite(sigma).sum())
        for sigma in (
            problem.images.sigma,
            problem.control.sigma[prepared.measured[problem.control.point]],
            problem.positions.sigma,
            problem.attitudes.sigma,
            prepared.prior,
        )
    )
    unknowns = problem.unknowns * problem.photos + 3 * int(prepared.measured.sum()) + len(prepared.prior)
    return observations - unknowns + (defects.DEFECT if free else 0)


FIELDS = {"image": "images", "control": "control", "position": "positions", "attitude": "attitudes"}


@dataclass(frozen=True, eq=False)
class Selection:
    """Which observations take part."""

    images: Flags  # (n,): rays
    # control, positions, attitudes: (c, 3), (g, 3), (a, 3): coordinates
    control: Flags
    positions: Flags
    attitudes: Flags

    @classmethod
    def everything(cls, problem: BundleProblem) -> Selection:
        return cls(
            images=np.ones(len(problem.images), bool),
            control=np.isfinite(problem.control.sigma),
            positions=np.isfinite(problem.positions.sigma),
            attitudes=np.isfinite(problem.attitudes.sigma),
        )

    @property
    def given(self) -> bytes:
        """Which given coordinates take part."""
        return b"".join(each.tobytes() for each in (self.control, self.positions, self.attitudes))

    def given_out(self, problem: BundleProblem) -> int:
        """Count the given coordinates that take no part, of control where it is seen."""
        shown = np.isin(problem.control.point, problem.images.point[self.images])[:, None]
        every = Selection.everything(problem)
        parts = (
            (every.control & shown, self.control),
            (every.positions, self.positions),
            (every.attitudes, self.attitudes),
        )
        return sum(int((given & ~used).sum()) for given, used in parts)

    def without(self, kind: str, row: int, axis: int) -> Selection:
        flags = getattr(self, FIELDS[kind]).copy()
        flags[row if kind == "image" else (row, axis)] = False
        return replace(self, **{FIELDS[kind]: flags})

    def holds(self, kind: str, row: int, axis: int) -> bool:
        flags = getattr(self, FIELDS[kind])
        return bool(flags[row] if kind == "image" else flags[row, axis])


def placeable(problem: BundleProblem, selection: Selection) -> Flags:
    """Rays (n,) of points with enough rays, or with three given coordinates: others place no point, nor check one."""
    point = problem.images.point
    rays = np.bincount(point[selection.images], minlength=problem.points)
    control = selection.control & np.isfinite(problem.control.sigma)
    given = np.zeros(problem.points, bool)
    given[problem.control.point[control.all(axis=1)]] = True
    return np.asarray(selection.images & ((rays >= problem.least) | given)[point], bool)


def supported(problem: BundleProblem, selection: Selection) -> Selection:
    """Take out the rays of points that too few rays are left of, and control that no ray is left of."""
    point = problem.images.point
    images = placeable(problem, selection) & np.isfinite(problem.start.points[point]).all(axis=1)
    shown = np.zeros(problem.points, bool)
    shown[point[images]] = True
    control = selection.control & np.isfinite(problem.control.sigma) & shown[problem.control.point][:, None]
    return replace(selection, images=images, control=control)


def selected(problem: BundleProblem, selection: Selection) -> BundleProblem:
    """Leave the observations that take part: other rays go, other coordinates get infinite standard deviations."""
    control, positions, attitudes = problem.control, problem.positions, problem.attitudes
    return replace(
        problem,
        images=problem.images.take(selection.images),
        start=replace(problem.start, points=np.nan_to_num(problem.start.points)),
        control=replace(control, sigma=np.where(selection.control, control.sigma, np.inf)),
        positions=replace(positions, sigma=np.where(selection.positions, positions.sigma, np.inf)),
        attitudes=replace(attitudes, sigma=np.where(selection.attitudes, attitudes.sigma, np.inf)),
    )


def restarted(problem: BundleProblem, solution: BundleSolution) -> BundleProblem:
    """Start where a solution of the problem, or of a selection, ended; a point that took no part keeps its start."""
    known = np.asarray(np.isfinite(problem.start.points).all(axis=1), bool)
    points = np.where(known[:, None], solution.points, problem.start.points)
    scales = None if problem.start.scales is None else solution.scales
    return replace(
        problem, start=StartValues(centers=solution.centers, rotations=solution.rotations, points=points, scales=scales)
    )
