"""The bundle adjustment of a whole project: start, problem, search for gross errors, variance components, result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from photostrip.errors import GeometryError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.network import defects, reliability, snooping
from photostrip.network.adjustment import BundleSolution, Cofactors, Selection, restarted, selected, solve, supported
from photostrip.network.cofactors import Correlation, correlations
from photostrip.network.cofactors import cofactors_of as precision_of
from photostrip.network.hypotheses import taken_up
from photostrip.network.snooping import ScreenedBundle
from photostrip.pipeline.block import block_result, models_result
from photostrip.pipeline.block import models as block_models
from photostrip.pipeline.block import problem as block_problem
from photostrip.pipeline.block import start as block_start
from photostrip.pipeline.block.block_result import check_errors
from photostrip.pipeline.block.datum import known_of
from photostrip.pipeline.frames import GroundFrames
from photostrip.pipeline.inputs import POLYNOMIAL, SIMILARITY, Inputs, Settings
from photostrip.pipeline.results import AdjustedStrips, BlockProblem, BlockStart, Bundle, SinglePhoto
from photostrip.pipeline.strips.models import LinkedModels
from photostrip.pipeline.strips.photos import FormedPhotos
from photostrip.points import ControlPoints, PhotoPoints, locate
from photostrip.statistics import TEST_LEVEL

REFILLED = 1e-9  # metres by which targets of plan or height points may still move
REFILLS = 3
BENDS = 0.25, 0.5, 0.75  # parts of the way from the similarity of a strip to its control
WITHIN_PHOTOS = 10  # correlations within photos that are kept


def adjust_block(
    inputs: Inputs,
    settings: Settings,
    observations: PhotoPoints,
    control: ControlPoints,
    ground: GroundFrames,
    stages: Sequence[FormedPhotos] | Sequence[LinkedModels],
    before: Bundle | None = None,
) -> AdjustedStrips:
    """Adjust all strips of a project together.

    stages: strips of two photos or more, or of independent models, which give the start.
    before: the same block with more control: this one starts from it, without what it rejected.
    Raises GeometryError when a strip, a photo or the datum cannot be determined, by name.
    """
    known = known_of(inputs, control, ground)
    if inputs.models is not None and settings.links.screening == "none":
        settings = replace(settings, bundle=replace(settings.bundle, screening="none"))

    def formed(adjustment: str) -> BlockStart:
        return block_start.start(inputs, replace(settings, adjustment=adjustment), stages, observations, known)

    def built(start: BlockStart) -> BlockProblem:
        if inputs.models is not None:
            return block_models.build(inputs.models, settings, observations, control, ground, start)
        return block_problem.build(inputs, settings, observations, control, ground, start)

    if before is not None:
        start = _start_from(before, observations, known.control)
        block = _refilled(_begin_from(before, built(start)), control, ground.control)
        estimated = _as_before(before, block, settings)
    else:
        start = formed(POLYNOMIAL)
        try:
            estimated = _searched(built(start), control, ground.control, settings)
        except GeometryError as error:
            if error.code not in {"bundle-diverged", *defects.OPEN}:
                raise
            # between bands of control 2000 models apart polynomials leave a strip 80 km off
            start = formed(SIMILARITY)
            estimated = _searched(_bent(built(start)), control, ground.control, settings)
    bundle = _bundle(inputs, settings, start, estimated)
    _refuse_inseparable(bundle.correlations, set(estimated.asked))
    if inputs.models is not None:
        adjusted = models_result.adjusted_strips(inputs.models, observations, ground.output, bundle)
    else:
        adjusted = block_result.adjusted_strips(inputs, observations, ground.output, bundle)
    if adjusted.precision is None or not settings.precision:
        return replace(adjusted, precision=None)
    checks = check_errors(bundle, adjusted, inputs.control, ground.control)
    return replace(adjusted, precision=replace(adjusted.precision, checks=(checks,)))


def _start_from(before: Bundle, observations: PhotoPoints, control: ControlPoints) -> BlockStart:
    """Start where an adjustment with more control ended; a point on one photo that has lost its control is nowhere."""
    solution, whole, origin = before.screened.solution, before.block.problem, before.block.origin
    nowhere = np.bincount(whole.images.point, minlength=whole.points) < whole.least
    nowhere[locate(control.ids, observations.point_ids)] = False
    points = np.where(nowhere[:, None] | np.isnan(before.start.points), np.nan, solution.points + origin)
    scales = None if before.start.scales is None else solution.scales
    return replace(
        before.start, centers=solution.centers + origin, rotations=solution.rotations, scales=scales, points=points
    )


def _begin_from(before: Bundle, block: BlockProblem) -> BlockProblem:
    """Begin without what an adjustment with more control rejected."""
    held, whole = before.screened.selection, before.block.problem
    inside = np.zeros(int(max(before.block.rows.max(initial=-1), block.rows.max(initial=-1))) + 1, bool)
    inside[before.block.rows[held.images]] = True
    used = np.ones((whole.points, 3), bool)
    used[whole.control.point] = held.control
    rows = inside[block.rows]
    begin = Selection(
        images=np.ones(rows.sum(), bool),
        control=block.begin.control & used[block.problem.control.point],
        positions=held.positions,
        attitudes=held.attitudes,
    )
    problem = replace(block.problem, images=block.problem.images.take(rows))
    return replace(block, problem=problem, begin=begin, kept=block.kept[rows], rows=block.rows[rows])


def _bent(block: BlockProblem) -> BlockProblem:
    """Bend strips to their control in parts: at once a long one is torn by the squares of its turns.

    Raises GeometryError as an adjustment does.
    """
    problem, control = block.problem, block.problem.control
    at = problem.start.points[control.point]
    for share in BENDS:
        part = replace(control, xyz=at + share * (control.xyz - at))
        chosen = selected(replace(problem, control=part), supported(problem, block.begin))
        problem = restarted(problem, solve(chosen, rough=True))
    return replace(block, problem=problem)


def _refilled(block: BlockProblem, control: ControlPoints, frames: Sequence[GroundFrame]) -> BlockProblem:
    """Adjust once beforehand where plan or height points need present positions.

    What is given may be wrong and bend that; the search starts where the strips were formed.
    """
    if not len(block.control) or control.use[block.control].all():
        return block
    start = block.problem.start
    for _ in range(REFILLS):
        solution = _any_solution(block)
        block = replace(block, problem=restarted(block.problem, solution))
        points = np.where(np.isfinite(block.problem.start.points), solution.points, 0.0)
        block, moved = block_problem.refilled(block, control, frames, points)
        if moved < REFILLED:
            break
    return replace(block, problem=replace(block.problem, start=start))


def _any_solution(block: BlockProblem) -> BundleSolution:
    """Adjust what begins; without the camera positions where they stand in the way, of which the search will ask."""

    def solved(begin: Selection) -> BundleSolution:
        return solve(selected(block.problem, supported(block.problem, begin)))

    try:
        return solved(block.begin)
    except GeometryError as error:
        if error.code != "bundle-diverged" or not block.begin.positions.any():
            raise
        try:
            return solved(replace(block.begin, positions=np.zeros_like(block.begin.positions)))
        except GeometryError:
            raise error from None


def _name_undetermined(block: BlockProblem, error: GeometryError) -> None:
    """Refuse by name the calibration parameters that kept an adjustment from ending, if it was they.

    With a millimetre at the edge of the photo as their a-priori standard deviation the adjustment ends; parameters
    that the measurements then hardly improve are those.
    """
    problem = block.problem
    sigma = problem.cameras.sigma
    if sigma is None or not np.isinf(sigma).any():
        return
    loose = np.where(np.isinf(sigma), reliability.millimetre(problem.images.xy), sigma)
    held = replace(problem, cameras=replace(problem.cameras, sigma=loose))
    try:
        solution = solve(selected(held, supported(held, block.begin)))
        cofactors = precision_of(solution)
    except GeometryError:
        return  # it is not they, or not they alone
    prior = loose[loose > 0.0]
    kept = np.sqrt(np.diag(cofactors.common)[: len(prior)]) / prior
    free = np.isinf(sigma)[sigma > 0.0]
    names = held.common_names()
    lost = [names[row] for row in np.flatnonzero(free & (kept > reliability.KEPT))]
    if not lost:
        return
    partner = next((each for each in correlations(solution, cofactors) if lost[0] in {each.first, each.second}), None)
    message = f"{', '.join(lost)} cannot be determined"
    if partner is not None:
        other = partner.second if partner.first == lost[0] else partner.first
        message += f": {lost[0]} cannot be told apart from {other} (correlation {partner.value:+.4f})"
    message += "; take it out of self_calibration, or give it a calibration_sigma"
    raise GeometryError(message, code="not-determinable") from error


class _Estimated(NamedTuple):
    """The adjustment with the standard deviations that it ends with."""

    block: BlockProblem
    screened: ScreenedBundle
    sigma0: reliability.Sigma0Test  # with the stated standard deviations
    asked: Sequence[str]  # names of the unknowns that the project asks for
    components: tuple[reliability.Component, ...] = ()


def _searched(
    block: BlockProblem, control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> _Estimated:
    """Adjust, and search for gross errors, for what groups of observations share, and for variance components."""
    asked = block.problem.common_names()
    try:
        block, screened = _screened(block, control, frames, settings)
    except GeometryError as error:
        _name_undetermined(block, error)
        raise
    for shared in screened.common:
        block = replace(block, problem=taken_up(block.problem, shared))
    sigma0 = reliability.sigma0_test(screened.solution, TEST_LEVEL)
    found = _Estimated(block=block, screened=screened, sigma0=sigma0, asked=asked)
    return _with_components(found, settings) if settings.bundle.variance_components else found


def _screened(
    block: BlockProblem, control: ControlPoints, frames: Sequence[GroundFrame], settings: Settings
) -> tuple[BlockProblem, ScreenedBundle]:
    """Search for gross errors; with everything from the start where what begins leaves photos or the datum open.

    Rays and control wait outside when they miss a start, and a rough one may be what is wrong.
    """
    try:
        begun = _refilled(block, control, frames)
        return begun, snooping.screen_bundle(begun.problem, begun.begin, settings.bundle, begun.kept)
    except GeometryError as error:
        everything = Selection.everything(block.problem)
        alike = block.begin.images.all() and block.begin.given == everything.given
        if alike or error.code not in defects.OPEN:
            raise
    return _screened(replace(block, begin=everything), control, frames, settings)


def _as_before(before: Bundle, block: BlockProblem, settings: Settings) -> _Estimated:
    """Adjust once, with what the search in an adjustment with more control has found."""
    asked, problem = block.problem.common_names(), block.problem
    for shared in before.screened.common:
        problem = taken_up(problem, shared)
    problem = reliability.scaled(problem, before.components, block.level)
    screened = ScreenedBundle.of(problem, supported(problem, block.begin), settings.bundle)
    screened = replace(screened, common=before.screened.common)
    sigma0 = reliability.sigma0_test(screened.solution, TEST_LEVEL)
    return _Estimated(
        block=replace(block, problem=problem),
        screened=screened,
        sigma0=sigma0,
        asked=asked,
        components=before.components,
    )


def _with_components(before: _Estimated, settings: Settings) -> _Estimated:
    """Estimate variance components, then search for gross errors once more with the standard deviations found."""
    found: tuple[reliability.Component, ...] = ()
    block, screened = before.block, before.screened
    problem, level, done = block.problem, block.level, screened
    quiet = replace(settings.bundle, screening="none")
    for _ in range(reliability.ITERATIONS):
        step = reliability.components(done.problem, done.solution, done.precision, level)
        found = reliability.combined(found, step)
        problem = reliability.scaled(restarted(problem, done.solution), step, level)
        if reliability.converged(step):
            break
        chosen = selected(problem, screened.selection)
        done = snooping.screen_bundle(chosen, screened.selection, quiet)
    block = replace(block, problem=problem)
    final = snooping.screen_bundle(problem, screened.selection, settings.bundle, block.kept)
    known = {(each.kind, each.row) for each in screened.rejections}
    again = (each for each in final.rejections if (each.kind, each.row) not in known)
    final = replace(final, rejections=(*screened.rejections, *again), common=screened.common)
    return before._replace(block=block, screened=final, components=found)


def _bundle(inputs: Inputs, settings: Settings, start: BlockStart, estimated: _Estimated) -> Bundle:
    """Collect the results of the adjustment."""
    block, screened = estimated.block, estimated.screened
    problem, solution, precision = screened.problem, screened.solution, screened.precision
    parameters = reliability.parameters_of(problem, solution, precision)
    correlations = _correlations(solution, precision)
    unit = solution.sigma0 if settings.bundle.test == "tau" and solution.redundancy > 0 else 1.0
    single = [strip for strip in inputs.strips if len(strip.photos) == 1]
    rows = start.rows_of([strip.photos[0] for strip in single]).tolist()
    return Bundle(
        start=start,
        block=block,
        screened=screened,
        groups=reliability.groups_of(problem, solution, precision),
        sigma0=estimated.sigma0,
        components=estimated.components,
        parameters=parameters,
        correlations=correlations,
        singles=tuple(
            SinglePhoto(
                strip=strip,
                center=solution.centers[row] + block.origin,
                rotation=solution.rotations[row],
                depth=_depth(solution, row),
            )
            for strip, row in zip(single, rows, strict=True)
        ),
        photo_covariances=precision.photos * unit**2,
        unit=unit,
    )


def _depth(solution: BundleSolution, photo: int) -> float:
    """Mean distance of the points that a photo shows from it, along the viewing direction, metres; NaN without any."""
    images = solution.prepared.problem.images
    points = solution.points[images.point[images.photo == photo]]
    away = (solution.centers[photo] - points) @ solution.rotations[photo][:, 2]
    return float(away.mean()) if len(away) else float("nan")


def _correlations(solution: BundleSolution, cofactors: Cofactors) -> tuple[Correlation, ...]:
    """Correlations of common parameters, with photos only the largest of each kind; and the largest within photos."""
    common = set(solution.prepared.problem.common_names())
    found: dict[tuple[str, str], Correlation] = {}
    within: list[Correlation] = []
    for each in correlations(solution, cofactors):
        if not {each.first, each.second} & common:
            within.append(each)
            continue
        kind = [name if name in common else name.partition(": ")[2] for name in (each.first, each.second)]
        found.setdefault((kind[0], kind[1]), each)
    within.sort(key=lambda each: -abs(each.value))
    return (*found.values(), *within[:WITHIN_PHOTOS])


def _refuse_inseparable(found: Sequence[Correlation], common: set[str]) -> None:
    """Refuse parameters that cannot be told apart from others."""
    for each in found:
        if {each.first, each.second} & common and abs(each.value) > reliability.INSEPARABLE:
            message = (
                f"{each.first} cannot be told apart from {each.second} (correlation {each.value:.6f}): take it out of "
                "self_calibration, or give it a calibration_sigma"
            )
            raise GeometryError(message, code="not-determinable")
