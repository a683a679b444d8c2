"""The result of a bundle adjustment as the pipeline goes on with it: strips, points, precision, notes, check points.

The result of a network of models.

The bundle adjustment of a whole project: start, problem, search for gross errors, variance components, result.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import GeometryError
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.network import defects, hypotheses, reliability, snooping
from photostrip.network.adjustment import BundleSolution, Cofactors, Selection, restarted, selected, solve, supported
from photostrip.network.hypotheses import taken_up
from photostrip.network.problem import CALIBRATION, BundleProblem
from photostrip.network.reliability import Correlation, coordinates_of, correlations, joint_cofactors
from photostrip.network.reliability import cofactors_of as precision_of
from photostrip.network.snooping import ScreenedBundle
from photostrip.notes import Note
from photostrip.pipeline import block_problem, block_start
from photostrip.pipeline import block_problem as block_models
from photostrip.pipeline.block_start import known_of
from photostrip.pipeline.formed_models import LinkedModels
from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.frames import GroundFrames
from photostrip.pipeline.given_points import axes_of, compare_with_given
from photostrip.pipeline.inputs import POLYNOMIAL, SIMILARITY, Inputs, MeasuredModels, Settings
from photostrip.pipeline.precision import in_output
from photostrip.pipeline.results import (
    Adjusted,
    AdjustedStrips,
    BlockProblem,
    BlockStart,
    Bundle,
    PlacedModels,
    Precision,
    SinglePhoto,
    StripResult,
    Ties,
)
from photostrip.pipeline.strip_method import depth_of
from photostrip.points import ControlPoints, PhotoPoints, locate
from photostrip.rejection import Rejection
from photostrip.statistics import TEST_LEVEL
from photostrip.strip.fitted_strip import CheckErrors
from photostrip.strip.resection import of_known_photos
from photostrip.units import MILLIMETRES

OF_THE_STRIP_METHOD = {  # notes on strips that say nothing of a bundle, which tests and holds all rays itself
    "bundle-proposed",
    "contradicting-joint",
    "control-image",
    "control-rejected",
    "degree-reduced",
    "extrapolation",
    "little-control",
    "little-redundancy",
    "long-strip",
    "masked-errors",
    "no-check",
    "not-resected",
    "rays-not-tested",
    "weak-control",
    "weak-joint",
    "weak-pair",
}


def notes(bundle: Bundle, cameras: Mapping[str, Camera]) -> tuple[Note, ...]:
    """Collect the notes on the strips that still mean something, and on the adjustment.

    A strip that was found among photos in no order is a start, and no pair of it the user's.
    """
    of_strips = (note for strip in bundle.start.strips if strip.strip.listed for note in strip.notes)
    return (*(note for note in of_strips if note.code not in OF_THE_STRIP_METHOD), *_of_adjustment(bundle, cameras))


def _of_adjustment(bundle: Bundle, cameras: Mapping[str, Camera]) -> Iterator[Note]:
    """Say what the surveyor should know of the adjustment."""
    solution = bundle.screened.solution
    if solution.free:
        whose = "are those of the first strip" if bundle.start.free else "come from the start values"
        text = (
            f"neither control nor camera positions are given: a free network, its frame and scale {whose}; its "
            "accuracy is relative only"
        )
        yield Note("free-network", text)
    elif loose := defects.weak(solution.prepared, solution.state):
        yield Note("weak-datum", loose)
    test = bundle.sigma0
    if np.isfinite(test.lower) and not test.passed:
        text = (
            f"σ0 is {test.sigma0:.3f}; with the stated standard deviations it would lie between {test.lower:.3f} "
            f"and {test.upper:.3f}: they are too {'small' if test.sigma0 > 1 else 'large'}"
        )
        yield Note("unit-weight", text, severity="note")
    yield from _given_notes(bundle)
    kinds, problem = list(CALIBRATION.values()), bundle.screened.problem
    places = [hypotheses.place(problem, each) for each in bundle.screened.common if hypotheses.of_images(each)]
    taken_up = {(problem.camera_ids[camera], kinds[k].title) for camera, columns in places for k in columns}
    for each in bundle.parameters:
        parameter = each.of(cameras.get(each.camera))
        if not parameter.significant and (parameter.camera, parameter.name) not in taken_up:
            unit = "" if parameter.unit == "1" else f" {parameter.unit}"
            text = (
                f"camera {parameter.camera}: the correction of {parameter.name.replace('_', ' ')}, "
                f"{parameter.value:.3g}{unit} (standard deviation {parameter.sigma:.3g}{unit}), does not differ "
                "significantly from zero; leave it out of self_calibration"
            )
            yield Note("calibration-insignificant", text)
    common = set(bundle.screened.problem.common_names())
    for correlation in bundle.correlations:
        if not {correlation.first, correlation.second} & common:
            continue  # within a photo: shift and rotation replace each other in every aerial photo
        text = f"{correlation.first} and {correlation.second} are correlated by {correlation.value:+.3f}"
        yield Note("correlated", text, severity="note")


def _given_notes(bundle: Bundle) -> Iterator[Note]:
    """Name control and camera positions that contradict the rest, whether they were taken out or had to stay."""
    problem = bundle.block.problem
    early = "found in its strip" if bundle.start.strips else "found before the adjustment"
    for each in sorted(bundle.screened.out, key=lambda each: -abs(each.worst)):
        if each.kind != reliability.IMAGE:
            text, photos, points = _contradiction(problem, each, early)
            text += "; not used"
            yield Note("control-rejected" if points else "position-rejected", text, photos=photos, points=points)
    screened, unit = bundle.screened, bundle.screened.limit.unit
    why = "without it the adjustment fails, or half of the control would be out"
    kept = [(each, why) for each in screened.held]
    kept += [(each, f"by the sigma0 found the test value is {each.value / unit:.2f}") for each in screened.doubted]
    for each, why in kept:
        text, photos, points = _contradiction(problem, each, early)
        text += f"; it was used: {why}"
        yield Note("control-doubtful" if points else "position-doubtful", text, photos=photos, points=points)


def _contradiction(problem: BundleProblem, each: Rejection, early: str) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Say how far a given coordinate is off; of which photo or point it is. ``early``: where no test found it."""
    axis = GROUND_AXES[each.axes[0]]
    reached = early
    if np.isfinite(each.value):
        reached = f"test value {each.value:.2f}, limit {each.limit:.2f}"
    if each.kind == reliability.CONTROL:
        name = problem.point_name(int(problem.control.point[each.row]))
        size = f"{axis} by about {each.worst:+.2f} m"
        text = f"control point {name} contradicts the {problem.unit}s and the other control: {size}"
        return f"{text} ({reached})", (), (name,)
    part = problem.positions if each.kind == reliability.POSITION else problem.attitudes
    photo = problem.photo_name(int(part.photo[each.row]))
    if each.kind == reliability.POSITION:
        text = f"the given position of photo {photo} does not fit: {axis} by about {each.worst:+.2f} m"
    else:
        turn = f"{np.degrees(each.worst):+.3f} deg"
        text = f"the given angles of photo {photo} do not fit: about image axis {each.axes[0] + 1} by {turn}"
    return f"{text} ({reached})", (photo,), ()


def adjusted_strips(inputs: Inputs, observations: PhotoPoints, output: GroundFrame, bundle: Bundle) -> AdjustedStrips:
    """Put the solution of a bundle adjustment where the pipeline has its results."""
    block, screened, start = bundle.block, bundle.screened, bundle.start
    solution = screened.solution
    used = block.rows[screened.selection.images]
    rays = np.bincount(observations.point[used], minlength=len(observations.point_ids))
    number = np.flatnonzero(rays)
    cartesian = solution.points[number] + block.origin
    points = in_output(number, cartesian, rays[number], observations.point_ids, output)
    calibrated = _calibrated(observations, bundle)
    count = [len(strip.photos) for strip in inputs.strips]
    first = np.cumsum([0, *count])
    places = [(n, int(first[n])) for n, strip in enumerate(inputs.strips) if len(strip.photos) > 1]
    strips = tuple(
        _strip(strip, begin, calibrated, used, points, bundle)
        for strip, (_, begin) in zip(start.strips, places, strict=True)
    )
    photos = tuple(bundle.photo_covariances[begin : begin + count[n]] for n, begin in places)
    sigma = np.median(block.problem.images.sigma)
    return _in_one_network(bundle, calibrated, strips, points, photos, sigma, inputs.camera_named)


def _in_one_network(
    bundle: Bundle,
    observations: PhotoPoints,
    strips: tuple[StripResult, ...],
    points: Adjusted,
    photos: tuple[Floats, ...],
    sigma: float,
    cameras: Mapping[str, Camera],
) -> AdjustedStrips:
    """Put strips, points and their precision together; sigma: stated for an image or model coordinate, mm."""
    basis, count = "a-priori" if bundle.unit == 1.0 else "a-posteriori", len(strips)
    covariances = bundle.screened.precision.points[points.number] * bundle.unit**2
    return AdjustedStrips(
        strips=strips,
        points=points,
        ties=Ties.none(),  # a point has one position
        observations=observations,
        precision=Precision(covariances, photos, sigma=(sigma * bundle.unit,) * count, basis=(basis,) * count),
        notes=notes(bundle, cameras),
        bundle=bundle,
    )


def _calibrated(observations: PhotoPoints, bundle: Bundle) -> PhotoPoints:
    """Image coordinates with the calibration that was found."""
    problem = bundle.screened.problem  # with the cameras that the last search has freed
    if not len(bundle.screened.solution.common):
        return observations
    photo = bundle.start.rows_of(observations.photo_ids)[observations.photo]
    shift = reliability.image_shift(problem, bundle.screened.solution.common, observations.xy, photo)
    return replace(observations, xy=observations.xy + shift)


def _strip(
    strip: StripResult, begin: int, observations: PhotoPoints, used: Numbers, points: Adjusted, bundle: Bundle
) -> StripResult:
    """Return a strip the points and orientations of the bundle, in its own intermediate frame."""
    solution, frame = bundle.screened.solution, strip.intermediate
    photos = strip.strip.photos
    numbers = slice(begin, begin + len(photos))
    centers = frame.intermediate_from_cartesian(solution.centers[numbers] + bundle.block.origin)
    rotations = frame.intermediate_rotations(solution.rotations[numbers])
    position = strip.of_photos.strip.positions(observations)
    rows = used[position[used] >= 0]
    rows = rows[np.argsort(position[rows], kind="stable")]
    measured = np.zeros(len(observations.point_ids), bool)
    measured[observations.point[position >= 0]] = True
    inside = measured[points.number]
    number, cartesian = points.number[inside], points.cartesian[inside]
    xyz = frame.intermediate_from_cartesian(cartesian)
    formed = strip.of_photos.formed
    at = np.minimum(np.searchsorted(formed.point, number), len(formed.point) - 1)
    known = formed.point[at] == number
    models = np.where(known, formed.model_count[at], 0)
    shape = np.where(known[:, None], formed.xyz[at], np.nan)
    control_at = np.searchsorted(number, formed.point[strip.control_rows])
    oriented = strip.of_photos.strip.oriented(centers, rotations)
    residuals = np.empty_like(observations.xy)
    residuals[used] = solution.image_residuals
    resection = of_known_photos(residuals[rows], position[rows], oriented)
    return replace(
        strip,
        control_rows=np.minimum(control_at, len(number) - 1),
        xyz=xyz,
        cartesian=cartesian,
        rays=points.rays[inside],
        polynomial=None,
        stage=replace(strip.of_photos, formed=replace(formed, point=number, xyz=shape, model_count=models)),
        placed=resection,
        rows=rows,
    )


MOST_TESTED = 40  # check points that are tested together; in a block of 400 photos 60 of them take 11 % of a run


def check_errors(
    bundle: Bundle, adjusted: AdjustedStrips, given: ControlPoints, frames: Sequence[GroundFrame]
) -> CheckErrors | None:
    """Compare a bundle adjustment with its check points; None without any."""
    points = adjusted.points
    places, differences = compare_with_given(given, frames, points, adjusted.observations)
    rows = np.flatnonzero(given.check & np.isfinite(differences).any(axis=1))
    if not len(rows):
        return None
    if len(rows) > MOST_TESTED:
        rows = rows[np.linspace(0, len(rows) - 1, MOST_TESTED).round().astype(int)]
    rows = rows[np.argsort(places[rows], kind="stable")]
    at = places[rows]
    axes = axes_of(given.frame[rows], frames, points.cartesian[at])
    solution = bundle.screened.solution
    joint = (
        joint_cofactors(solution, coordinates_of(solution, points.number[at])).reshape(len(at), 3, len(at), 3)
        * bundle.unit**2
    )
    turned = np.einsum("iap,ipjq,jbq->iajb", axes, joint, axes).reshape(3 * len(at), 3 * len(at))
    difference = differences[rows].ravel()
    known = np.flatnonzero(np.isfinite(difference))
    covariance = turned[np.ix_(known, known)] + np.diag(given.sigma[rows].ravel()[known] ** 2)
    return CheckErrors(
        ids=given.take(rows).ids,
        point=known // 3,
        axis=known % 3,
        difference=difference[known],
        covariance=covariance,
    )


def adjusted_models(
    models: MeasuredModels, observations: PhotoPoints, output: GroundFrame, bundle: Bundle
) -> AdjustedStrips:
    """Put the solution of a network of models where the pipeline has its results."""
    block, screened, measured = bundle.block, bundle.screened, models.points
    solution, count = screened.solution, len(measured.point_ids)
    used = block.rows[screened.selection.images]
    held = np.zeros(len(solution.points), bool)
    held[measured.node[used]] = True
    number = np.flatnonzero(held[:count])
    cartesian = solution.points + block.origin
    covariances = screened.precision.points * bundle.unit**2
    shown = _photos_of_points(models, used, count)
    points = in_output(number, cartesian[number], shown[number], observations.point_ids, output)
    strips = tuple(_strip_of_models(strip, models, bundle, used, cartesian, held) for strip in bundle.start.strips)
    photos = tuple(_of_centers(strip, held, covariances) for strip in strips)
    return _in_one_network(bundle, observations, strips, points, photos, float(np.median(measured.sigma)), {})


def _photos_of_points(models: MeasuredModels, used: Numbers, count: int) -> Numbers:
    """Count the photos that show each point in a model that has it."""
    measured, photos = models.points, models.points.photo_ids
    shows = np.zeros((len(measured.model_ids), 2), np.intp)
    for strip in models.strips:
        flown = locate(strip.photos, photos)
        shows[locate(strip.models, measured.model_ids)] = np.column_stack([flown[:-1], flown[1:]])
    rows = used[measured.node[used] < count]
    pairs = np.column_stack([np.repeat(measured.node[rows], 2), shows[measured.model[rows]].ravel()])
    return np.bincount(np.unique(pairs, axis=0)[:, 0], minlength=count)


def _strip_of_models(
    strip: StripResult, models: MeasuredModels, bundle: Bundle, used: Numbers, cartesian: Floats, held: Flags
) -> StripResult:
    """Return a strip the points, centres and models of the network, in its own intermediate frame."""
    stage, frame, measured = strip.of_models, strip.intermediate, models.points
    formed, solution = stage.formed, bundle.screened.solution
    inside = np.zeros(len(measured), bool)
    inside[used] = True
    in_strip = np.unique(formed.models.node[inside[formed.models.row]])
    place = np.minimum(np.searchsorted(formed.node, in_strip), len(formed.node) - 1)
    known = formed.node[place] == in_strip
    formed = replace(
        formed,
        used=inside[formed.models.row],
        node=in_strip,
        node_xyz=np.where(known[:, None], formed.node_xyz[place], np.nan),
        node_models=np.bincount(formed.models.node[inside[formed.models.row]], minlength=len(cartesian))[in_strip],
    )
    centers = np.full((len(stage.strip.photos), 3), np.nan)
    of_centers = formed.photos
    there = (of_centers >= 0) & held[of_centers]
    centers[there] = frame.intermediate_from_cartesian(cartesian[of_centers[there]])
    xyz = frame.intermediate_from_cartesian(cartesian[formed.point])
    own = locate(stage.strip.models, bundle.start.photos)
    at = np.searchsorted(formed.point, strip.formed.point[strip.control_rows])
    return replace(
        strip,
        control_rows=np.minimum(at, len(formed.point) - 1),
        polynomial=None,
        xyz=xyz,
        cartesian=cartesian[formed.point],
        rays=formed.photo_count,
        depth=depth_of(centers, xyz),
        stage=replace(stage, formed=formed),
        placed=PlacedModels(
            centers=centers,
            rotations=frame.intermediate_rotations(solution.rotations[own]),
            scales=solution.scales[own] * MILLIMETRES,
        ),
    )


def _of_centers(strip: StripResult, held: Flags, covariances: Floats) -> Floats:
    """Covariances (f, 6, 6) of the photos of a strip: of their centres alone."""
    found = np.full((len(strip.strip.photos), 6, 6), np.nan)
    nodes = strip.of_models.formed.photos
    known = np.flatnonzero((nodes >= 0) & held[nodes])
    found[known, :3, :3] = covariances[nodes[known]]
    return found


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
            return block_models.build_models(inputs.models, settings, observations, control, ground, start)
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
        adjusted = adjusted_models(inputs.models, observations, ground.output, bundle)
    else:
        adjusted = adjusted_strips(inputs, observations, ground.output, bundle)
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
        if not (before.components and shared.kind == hypotheses.SIGMAS):  # they hold its factors
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
    """Estimate variance components, then search for gross errors once more with the standard deviations found.

    That search may take up more of what observations share: the result is that of all that was taken up.
    """
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
    for shared in final.common:
        block = replace(block, problem=taken_up(block.problem, shared))
    known = {(each.kind, each.row) for each in screened.rejections}
    again = (each for each in final.rejections if (each.kind, each.row) not in known)
    common = *screened.common, *final.common
    final = replace(final, rejections=(*screened.rejections, *again), common=common)
    plan, up = hypotheses.factors_of(screened.common)
    taken = {"positions plan": plan, "positions height": up, "positions": float(np.cbrt(plan**2 * up))}
    found = tuple(replace(each, factor=each.factor * taken.get(each.name, 1.0)) for each in found)
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
