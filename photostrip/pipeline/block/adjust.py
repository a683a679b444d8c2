"""The bundle adjustment of a whole project: start, problem, search for gross errors, variance components, result."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.notes import Note
from photostrip.pipeline.block import problem as block_problem
from photostrip.pipeline.block import start as block_start
from photostrip.pipeline.results import Adjusted, Bundle, Precision, SinglePhoto
from photostrip.triangulation.bundle import snooping
from photostrip.triangulation.bundle.quality import reliability, self_calibration, variance_components
from photostrip.triangulation.bundle.quality.cofactors import cofactors_of as precision_of
from photostrip.triangulation.bundle.quality.correlations import correlations
from photostrip.triangulation.bundle.selection import restarted, selected, supported
from photostrip.triangulation.bundle.solve import solve
from photostrip.triangulation.resection.collinearity import project
from photostrip.triangulation.resection.resection import Resection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline.inputs import Inputs, Settings
    from photostrip.pipeline.results import BlockProblem, BlockStart, StripResult
    from photostrip.points import ControlPoints, PhotoPoints
    from photostrip.triangulation.bundle.quality.correlations import Correlation
    from photostrip.triangulation.bundle.snooping import ScreenedBundle
    from photostrip.triangulation.bundle.solution import BundleSolution, Cofactors

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

REFILLED = 1e-9  # metres by which targets of plan or height points may still move
REFILLS = 3
WITHIN_PHOTOS = 10  # correlations within photos that are kept
OF_THE_STRIP_METHOD = {
    "control-doubtful",
    "control-rejected",
    "covariance-proposed",
    "degree-reduced",
    "extrapolation",
    "little-control",
    "little-redundancy",
    "long-strip",
    "not-resected",
    "strip-contradicted",
    "weak-control",
}
"""Notes on strips that say nothing of a bundle adjustment."""


@dataclass(frozen=True, eq=False)
class Block:
    """A bundle adjustment as the pipeline goes on with it."""

    strips: tuple[StripResult, ...]  # strips with the orientations and points of the bundle
    points: Adjusted
    precision: Precision  # covariances of points and photos
    observations: PhotoPoints  # ideal image coordinates, the calibration found taken into account
    bundle: Bundle
    notes: tuple[Note, ...]


def adjust_block(
    inputs: Inputs,
    settings: Settings,
    observations: PhotoPoints,
    control: ControlPoints,
    frames: tuple[Sequence[GroundFrame], GroundFrame, GroundFrame | None, GroundFrame | None],
) -> Block:
    """Adjust all strips of a project together.

    Parameters
    ----------
    frames : tuple
        Frames of the control lists, of the output, of the camera positions and of the orientations.

    Returns
    -------
    Block
        Strips, points and precision, and the adjustment itself.

    Raises
    ------
    GeometryError
        When a pair, a strip, a photo or the datum cannot be determined, by name.
    """
    of_control, output, of_positions, of_orientations = frames
    known = block_start.known_of(inputs, control, of_control, output, (of_positions, of_orientations))
    start = block_start.start(inputs, settings, observations, known)
    places = (of_control, of_positions, of_orientations)
    block = block_problem.build(inputs, settings, observations, control, places, start)
    try:
        block = _settled(block, control, of_control)
        screened = snooping.screen_bundle(block.problem, block.begin, settings.bundle, block.kept)
    except GeometryError as error:
        _name_undetermined(block, error)
        raise
    sigma0 = reliability.sigma0_test(screened.solution)
    components: tuple[variance_components.Component, ...] = ()
    if settings.bundle.variance_components:
        block, screened, components = _components(block, screened, settings)
    bundle = _bundle(inputs, settings, start, block, screened, sigma0, components)
    return _block(inputs, observations, output, bundle)


def _settled(block: BlockProblem, control: ControlPoints, frames: Sequence[GroundFrame]) -> BlockProblem:
    """Adjust once beforehand where plan or height points need present positions."""
    if not len(block.control) or control.use[block.control].all():
        return block
    for _ in range(REFILLS):
        chosen = supported(block.problem, block.begin)
        solution = solve(selected(block.problem, chosen))
        block = replace(block, problem=restarted(block.problem, solution))
        points = np.where(np.isfinite(block.problem.start.points), solution.points, 0.0)
        block, moved = block_problem.refilled(block, control, frames, points)
        if moved < REFILLED:
            break
    return block


def _name_undetermined(block: BlockProblem, error: GeometryError) -> None:
    """Refuse by name the calibration parameters that kept an adjustment from ending, if it was they.

    With a millimetre at the edge of the photo as their a-priori standard deviation the adjustment ends; parameters
    that the measurements then hardly improve are those.
    """
    problem = block.problem
    sigma = problem.cameras.sigma
    if sigma is None or not np.isinf(sigma).any():
        return
    loose = np.where(np.isinf(sigma), self_calibration.millimetre(problem.images.xy), sigma)
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
    lost = [names[row] for row in np.flatnonzero(free & (kept > self_calibration.KEPT))]
    if not lost:
        return
    partner = next((each for each in correlations(solution, cofactors) if lost[0] in {each.first, each.second}), None)
    message = f"{', '.join(lost)} cannot be determined"
    if partner is not None:
        other = partner.second if partner.first == lost[0] else partner.first
        message += f": {lost[0]} cannot be told apart from {other} (correlation {partner.value:+.4f})"
    message += "; take it out of self_calibration, or give it a calibration_sigma"
    raise GeometryError(message, code="not-determinable") from error


def _components(
    block: BlockProblem, screened: ScreenedBundle, settings: Settings
) -> tuple[BlockProblem, ScreenedBundle, tuple[variance_components.Component, ...]]:
    """Estimate variance components, then search for gross errors once more with the standard deviations found."""
    found: tuple[variance_components.Component, ...] = ()
    problem, level = block.problem, block.level
    done = screened
    quiet = replace(settings.bundle, screening="none")
    for _ in range(variance_components.ITERATIONS):
        step = variance_components.components(done.problem, done.solution, done.precision, level)
        found = variance_components.combined(found, step)
        problem = variance_components.scaled(restarted(problem, done.solution), step, level)
        if variance_components.converged(step):
            break
        chosen = selected(problem, screened.selection)
        done = snooping.screen_bundle(chosen, screened.selection, quiet)
    block = replace(block, problem=problem)
    final = snooping.screen_bundle(problem, screened.selection, settings.bundle, block.kept)
    before = {(each.kind, each.row): each for each in screened.rejections}
    log = tuple(each for each in screened.rejections if each not in final.rejections)
    again = tuple(each for each in final.rejections if (each.kind, each.row) not in before)
    return block, replace(final, rejections=(*log, *again)), found


def _bundle(
    inputs: Inputs,
    settings: Settings,
    start: BlockStart,
    block: BlockProblem,
    screened: ScreenedBundle,
    sigma0: reliability.Sigma0Test,
    components: tuple[variance_components.Component, ...],
) -> Bundle:
    """Collect what is told of the adjustment."""
    problem, solution, precision = screened.problem, screened.solution, screened.precision
    parameters = self_calibration.parameters_of(problem, solution, precision)
    correlations = _correlations(solution, precision)
    _refuse_inseparable(correlations, set(problem.common_names()))
    unit = solution.sigma0 if settings.bundle.test == "tau" and solution.redundancy > 0 else 1.0
    number = {photo: row for row, photo in enumerate(start.photos)}
    singles = tuple(
        SinglePhoto(strip, solution.centers[row] + block.origin, solution.rotations[row])
        for strip in inputs.strips
        if len(strip.photos) == 1
        for row in (number[strip.photos[0]],)
    )
    groups = reliability.groups_of(problem, solution, precision)
    return Bundle(
        start, block, screened, groups, sigma0, components, parameters, correlations, singles,
        precision.photos * unit**2, unit,
    )  # fmt: skip


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
        if {each.first, each.second} & common and abs(each.value) > self_calibration.INSEPARABLE:
            message = (
                f"{each.first} cannot be told apart from {each.second} (correlation {each.value:.6f}): take it out of "
                "self_calibration, or give it a calibration_sigma"
            )
            raise GeometryError(message, code="not-determinable")


# ------------------------------------------------------------------------------------------------- the result


def _block(inputs: Inputs, observations: PhotoPoints, output: GroundFrame, bundle: Bundle) -> Block:
    """Put the solution where the pipeline has its results."""
    block, screened, start = bundle.block, bundle.screened, bundle.start
    solution = screened.solution
    used = block.rows[screened.selection.images]
    rays = np.bincount(observations.point[used], minlength=len(observations.point_ids))
    number = np.flatnonzero(rays)
    cartesian = solution.points[number] + block.origin
    ids = [observations.point_ids[n] for n in number]
    points = Adjusted(number, cartesian, output.ground_from_cartesian(cartesian, ids=ids), rays[number])
    calibrated = _calibrated(observations, bundle)
    count = [len(strip.photos) for strip in inputs.strips]
    first = np.cumsum([0, *count])
    places = [(n, int(first[n])) for n, strip in enumerate(inputs.strips) if len(strip.photos) > 1]
    strips = tuple(
        _strip(strip, begin, calibrated, used, points, bundle)
        for strip, (_, begin) in zip(start.strips, places, strict=True)
    )
    sigma = float(np.median(block.problem.images.sigma)) * bundle.unit
    covariances = bundle.screened.precision.points[number] * bundle.unit**2
    photos = tuple(bundle.photo_covariances[begin : begin + count[n]] for n, begin in places)
    basis = "a-priori" if bundle.unit == 1.0 else "a-posteriori"
    precision = Precision(covariances, photos, (sigma,) * len(strips), (basis,) * len(strips))
    notes = (*_strip_notes(start), *_notes(bundle))
    return Block(strips, points, precision, calibrated, bundle, notes)


def _calibrated(observations: PhotoPoints, bundle: Bundle) -> PhotoPoints:
    """Image coordinates with the calibration that was found."""
    problem = bundle.block.problem
    if not len(bundle.screened.solution.common):
        return observations
    place = {photo: number for number, photo in enumerate(bundle.start.photos)}
    photo = np.array([place[name] for name in observations.photo_ids], np.intp)[observations.photo]
    shift = self_calibration.image_shift(problem, bundle.screened.solution.common, observations.xy, photo)
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
    place = {photo: number for number, photo in enumerate(photos)}
    position = np.array([place.get(photo, -1) for photo in observations.photo_ids], np.intp)[observations.photo]
    rows = used[position[used] >= 0]
    rows = rows[np.argsort(position[rows], kind="stable")]
    seen = np.zeros(len(observations.point_ids), bool)
    seen[observations.point[position >= 0]] = True
    inside = seen[points.number]
    number, cartesian = points.number[inside], points.cartesian[inside]
    xyz = frame.intermediate_from_cartesian(cartesian)
    formed = strip.of_photos.formed
    at = np.minimum(np.searchsorted(formed.point, number), len(formed.point) - 1)
    known = formed.point[at] == number
    models = np.where(known, formed.model_count[at], 0)
    shape = np.where(known[:, None], formed.xyz[at], np.nan)
    control_at = np.searchsorted(number, formed.point[strip.control_rows])
    focal = np.full(len(photos), strip.of_photos.strip.camera.principal_distance)
    at_rows = np.searchsorted(number, observations.point[rows])
    residuals = observations.xy[rows] - project(xyz[at_rows], centers, rotations, position[rows], focal)
    counts = np.maximum(2 * np.bincount(position[rows], minlength=len(photos)), 1)
    rms = np.sqrt(np.bincount(position[rows], (residuals**2).sum(axis=1), len(photos)) / counts)
    stages = replace(
        strip.of_photos,
        formed=replace(formed, point=number, xyz=shape, model_count=models),
        resection=Resection(centers, rotations, residuals, rms, np.ones(len(photos), bool)),
        rows=rows,
    )
    return replace(
        strip,
        control_rows=np.minimum(control_at, len(number) - 1),
        xyz=xyz,
        cartesian=cartesian,
        rays=points.rays[inside],
        polynomial=None,
        photo_stages=stages,
    )


def _strip_notes(start: BlockStart) -> tuple[Note, ...]:
    """Return the notes of the strips that still mean something."""
    return tuple(note for strip in start.strips for note in strip.notes if note.code not in OF_THE_STRIP_METHOD)


def _notes(bundle: Bundle) -> list[Note]:
    """Say what the surveyor should know of the adjustment."""
    notes = []
    solution = bundle.screened.solution
    if solution.free:
        what = (
            "frame and scale are those of the first strip" if bundle.start.free else "frame and scale are the start's"
        )
        text = f"neither control nor camera positions: a free network, {what}; its accuracy is relative only"
        notes.append(Note("free-network", text))
    test = bundle.sigma0
    if np.isfinite(test.lower) and not test.passed:
        text = (
            f"sigma0 is {test.sigma0:.3f}; with the stated standard deviations it would lie between {test.lower:.3f} "
            f"and {test.upper:.3f}: they are too {'small' if test.sigma0 > 1 else 'large'}"
        )
        notes.append(Note("unit-weight", text, severity="note"))
    notes += _given_notes(bundle)
    for parameter in bundle.parameters:
        if not parameter.significant:
            text = (
                f"camera {parameter.camera}: {parameter.name} is {parameter.value:.3g} {parameter.unit} with a "
                f"standard deviation of {parameter.sigma:.3g}: it does not differ from "
                "zero; leave it out of self_calibration"
            )
            notes.append(Note("calibration-insignificant", text))
    common = set(bundle.screened.problem.common_names())
    for correlation in bundle.correlations:
        if not {correlation.first, correlation.second} & common:
            continue  # within a photo: shift and rotation replace each other in every aerial photo
        text = f"{correlation.first} and {correlation.second} are correlated by {correlation.value:+.3f}"
        notes.append(Note("correlated", text, severity="note"))
    return notes


def _given_notes(bundle: Bundle) -> list[Note]:
    """Name control and camera positions that were taken out."""
    notes = []
    problem = bundle.block.problem
    for each in bundle.screened.rejections:
        if each.readmitted or each.kind == reliability.IMAGE:
            continue
        axis = ("east (X)", "north (Y)", "up (Z)")[each.axis]
        reached = (
            f"test value {each.value:.1f}, limit {each.limit:.1f}" if np.isfinite(each.value) else "found in its strip"
        )
        if each.kind == reliability.CONTROL:
            name = problem.point_name(int(problem.control.point[each.row]))
            text = (
                f"control point {name} contradicts the photos and the other control: {axis} by about {each.size:+.2f} m"
            )
            notes.append(Note("control-rejected", f"{text} ({reached}); not used", points=(name,)))
            continue
        part = problem.positions if each.kind == reliability.POSITION else problem.attitudes
        photo = problem.photo_name(int(part.photo[each.row]))
        if each.kind == reliability.POSITION:
            text = f"the given position of photo {photo} does not fit: {axis} by about {each.size:+.2f} m"
        else:
            turn = f"{np.degrees(each.size):+.3f} deg"
            text = f"the given angles of photo {photo} do not fit: about image axis {each.axis + 1} by {turn}"
        notes.append(Note("position-rejected", f"{text} ({reached}); not used", photos=(photo,)))
    return notes
