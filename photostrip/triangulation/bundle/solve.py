"""From a problem to its least-squares solution: Gauss-Newton with step control.

Source: [Granshaw 1980] for the reduced normal equations; step control after [Marquardt 1963]; the step that may lead
up: derived.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.frozen import NamedTuple
from photostrip.geometry.rotation import from_vector
from photostrip.triangulation.bundle.normal_equations import datum, defects
from photostrip.triangulation.bundle.normal_equations.point_elimination import Eliminated
from photostrip.triangulation.bundle.normal_equations.reduced import (
    Reduced,
    control_residuals,
    control_squares,
    factored,
    given_at,
    points_of,
    reduce,
)
from photostrip.triangulation.bundle.observations.collinearity import PHOTO, SIGNS
from photostrip.triangulation.bundle.observations.problem import BundleProblem
from photostrip.triangulation.bundle.observations.ray_batches import RayBatch
from photostrip.triangulation.bundle.parameters import (
    Parameters,
    ParameterStep,
    PreparedProblem,
    parameters_from,
    prepare,
)
from photostrip.triangulation.bundle.solution import BundleSolution, IterationStep

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
    free = datum.is_free(problem)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # starts far off: such steps are refused
        ended = _iterate(prepared, free=free, rough=rough)
    return _solution(prepared, ended, free=free)


class _Ended(NamedTuple):
    state: Parameters
    reduced: Reduced | None  # the normal equations there, or of a rough solution before a last step that moves nothing
    steps: list[IterationStep]


def _iterate(prepared: PreparedProblem, *, free: bool, rough: bool) -> _Ended:
    """Step until the next step would be short enough.

    Where the sum of squares grows, the step is taken back and the diagonal of the normal equations raised, more each
    time; where it falls again, less. Source: [Marquardt 1963].
    """
    start = prepared.problem.start
    state = parameters_from(prepared, start.centers, start.rotations, start.points, np.zeros(len(prepared.prior)))
    damping, steps = 0.0, []
    if not free:
        defects.refuse_loose(prepared, state)
    best = reduce(prepared, state)
    defects.refuse_weak_points(prepared, best)
    for _ in range(MOST_STEPS):
        move = _move(prepared, state, best, damping, free=free)
        steps.append(_recorded(best, move, damping))
        moved = _moved(prepared, state, move)
        if damping == 0.0 and _still_to_come(steps) < CONVERGED:
            return _Ended(moved, best if rough else None, steps)
        found = reduce(prepared, moved)
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
        best = reduce(prepared, state, damping)
    raise defects.diverged(prepared, state, len(steps))


def _stepped(
    prepared: PreparedProblem, state: Parameters, reduced: Reduced, steps: list[IterationStep], *, free: bool
) -> tuple[Parameters, Reduced] | None:
    """Go one step on from where the sum of squares has grown; None where that cannot be.

    A principal distance and the heights of its photos move together along a curve: a step leaves it, the next one finds
    it again, and steps that never leave it do not come to an end.
    """
    try:
        move = _move(prepared, state, reduced, 0.0, free=free)
    except (GeometryError, np.linalg.LinAlgError):
        return None
    steps.append(_recorded(reduced, move, 0.0))
    moved = _moved(prepared, state, move)
    return moved, reduce(prepared, moved)


def _still_to_come(steps: list[IterationStep]) -> float:
    """Foretell the length of the next step from the last two."""
    last = steps[-1].length
    before = steps[-2].length if len(steps) > 1 else 1.0
    return last * min(last / before, 1.0) if before > 0.0 else last


def _move(
    prepared: PreparedProblem, state: Parameters, reduced: Reduced, damping: float, *, free: bool
) -> ParameterStep:
    """Find the step of all parameters: photos and common parameters from the reduced equations, then the points.

    N11 dx1 + N12 dx2 = b1 for photos and common parameters is solved by the factor of N11 and the Schur complement
    N22 - N12' N11^-1 N12; the length of the step is the root of dx' N dx.
    """
    blocks = reduced.blocks[prepared.structure.diagonal]
    anchor = datum.anchor(prepared, state, blocks) if free else None
    add = anchor
    if damping:
        add = np.eye(PHOTO) * (damping * blocks) + (0.0 if anchor is None else anchor)
    band = factored(prepared, reduced, add)
    if band is None:
        defects.refuse_weak_points(prepared, reduced)
        defects.refuse_singular(prepared, reduced, anchor)
    p = len(state.common)
    border = reduced.border.reshape(-1, p + 1)
    solved = band.solve(border)
    rest = reduced.corner[:p] - border[:, :p].T @ solved
    defects.refuse_common(prepared, reduced.corner[:p, :p], rest[:, :p])
    common = np.asarray(np.linalg.solve(rest[:, :p] + damping * np.diag(np.diag(rest)), rest[:, p]), float)
    flat = solved[:, p] - solved[:, :p] @ common
    photos = flat.reshape(-1, PHOTO)
    eliminated_length = sum(float(np.einsum("cs,cs->", each.rows[-1], each.rows[-1])) for each in reduced.points)
    square = eliminated_length + float(border[:, p] @ flat) + float(reduced.corner[:p, p] @ common)
    points = tuple(
        _shift(batch, eliminated, photos, common[: len(prepared.calibrated)])
        for batch, eliminated in zip(prepared.structure.batches, reduced.points, strict=True)
    )
    move = ParameterStep(photos=photos, common=common, points=points, length=float(np.sqrt(max(square, 0.0))))
    return datum.centred(prepared, state, move) if free else move


def _shift(batch: RayBatch, eliminated: Eliminated, photos: Floats, common: Floats) -> Floats:
    """Find the steps (3, S) of the points of a batch from those of the photos: L^-T (L^-1 A'l - T' dx)."""
    k, n = len(batch.photo), PHOTO * len(batch.photo)
    rows = eliminated.rows
    shift = np.empty(rows.shape[1:])
    of_sets, done = photos[batch.sets].reshape(-1, 1, n), 0
    for first, last, count, size in batch.runs:
        run = rows[:n, :, first:last].reshape(n, 3, count, size).transpose(1, 2, 0, 3)
        shift[:, first:last] = (of_sets[done : done + count] @ run).reshape(3, -1)
        done += count
    if len(common):
        shift += np.einsum("pcs,p->cs", rows[PHOTO * k : -1], common)
    np.subtract(rows[-1], shift, out=shift)
    eliminated.root.backward(shift)
    return shift


def _moved(prepared: PreparedProblem, state: Parameters, move: ParameterStep) -> Parameters:
    moves = (move.photos * SIGNS)[prepared.structure.rank]
    return Parameters(
        centers=state.centers + np.einsum("nij,nj->ni", state.rotations, moves[:, :3]),
        rotations=state.rotations @ from_vector(moves[:, 3:]),
        xyz=tuple(xyz + shift for xyz, shift in zip(state.xyz, move.points, strict=True)),
        common=state.common + move.common,
    )


def _recorded(reduced: Reduced, move: ParameterStep, damping: float) -> IterationStep:
    shift = max(float(np.abs(part).max(initial=0.0)) for part in (move.photos[:, :3], *move.points))
    turn = float(np.abs(move.photos[:, 3:]).max(initial=0.0))
    return IterationStep(chi_square=reduced.chi_square, length=move.length, damping=damping, shift=shift, turn=turn)


def _solution(prepared: PreparedProblem, ended: _Ended, *, free: bool) -> BundleSolution:
    """Find the residuals of all observations at the end, in their units, and the weighted sum of their squares."""
    problem, structure, state = prepared.problem, prepared.structure, ended.state
    residuals = np.zeros((len(problem.images), 2))
    table, chi_square = prepared.table(state), 0.0
    for batch, xyz in zip(structure.batches, state.xyz, strict=True):
        misfit = prepared.rays(batch, xyz, table, state.common)[0].misfit
        chi_square += float(np.einsum("akr,akr->", misfit, misfit))
        real = batch.real
        residuals[batch.row[:, real].ravel()] = np.moveaxis(misfit[:, :, real], 0, 2).reshape(-1, 2)
    residuals *= problem.images.sigma
    positions, attitudes = given_at(prepared, state)
    for linear in (positions, attitudes):
        chi_square += float(((linear.residual * linear.weight) ** 2).sum())
    chi_square += control_squares(prepared, state) + float(((state.common / prepared.prior) ** 2).sum())
    return BundleSolution(
        centers=state.centers,
        rotations=state.rotations,
        points=points_of(prepared, state),
        common=state.common,
        image_residuals=residuals,
        control_residuals=control_residuals(prepared, state),
        position_residuals=positions.residual,
        attitude_residuals=attitudes.residual,
        chi_square=chi_square,
        redundancy=_redundancy(prepared, free=free),
        free=free,
        steps=tuple(ended.steps),
        prepared=prepared,
        reduced=ended.reduced,
    )


def _redundancy(prepared: PreparedProblem, *, free: bool) -> int:
    """Observations, priors among them, minus unknowns: six of a photo, three of a point with rays, and those in common.

    A free network has seven unknowns less, those of its datum.
    """
    problem = prepared.problem
    observed = np.zeros(problem.points, bool)
    observed[problem.images.point] = True
    observations = sum(
        int(np.isfinite(sigma).sum())
        for sigma in (
            problem.images.sigma,
            problem.control.sigma[observed[problem.control.point]],
            problem.positions.sigma,
            problem.attitudes.sigma,
            prepared.prior,
        )
    )
    unknowns = PHOTO * problem.photos + 3 * int(observed.sum()) + len(prepared.prior)
    return observations - unknowns + (datum.DEFECT if free else 0)
