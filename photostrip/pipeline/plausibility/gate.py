"""The gate around a run: what the data say against themselves, before the adjustment, after it, and when it fails.

A run is looked at whether it succeeds or not. When it fails, mistakes found in the image coordinates are corrected in a
copy that serves the evidence alone, so that one mistake does not hide the next; what is adjusted is never touched.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import Finding
from photostrip.pipeline.frames import GroundFrames
from photostrip.pipeline.image_coordinates import PhotoCoordinates
from photostrip.pipeline.inputs import Inputs, MeasuredModels, ModelStrip, Settings, Strip
from photostrip.pipeline.plausibility import (
    control_layout,
    evidence,
    given_cameras,
    given_control,
)
from photostrip.pipeline.plausibility.evidence import EvidenceStrip
from photostrip.pipeline.plausibility.given_control import GivenControl
from photostrip.pipeline.plausibility.image_evidence import ImageEvidence, of_images
from photostrip.plausibility import accepted
from photostrip.plausibility.photos import flight, flight_order, identity, rotations, shared_ids, units
from photostrip.plausibility.photos.shared_ids import OrientedRays
from photostrip.points import PhotoPoints, locate
from photostrip.strip.resection.collinearity import KnownPhotos

if TYPE_CHECKING:
    from photostrip.pipeline.results import Bundle, Result, StripResult
    from photostrip.strip.independent_models.formation import FormedModels

STRETCH_MODELS = 10  # photos of a stretch of models: what plotters measure bends more than what images give
OF_LISTS = ("P404", "P407")  # findings on control lists as wholes
OF_SLIPS = "P406"  # findings on single digits of given coordinates
# findings on photos and bases that do not go on as those before them, on points that strips put at two places
OF_STRIPS = ("P201", "P202", "P205", "P206", "P207", "P301", "P304")
OF_CAMERAS = ("P105",)  # findings on principal distances: models have none


def of_inputs(inputs: Inputs, settings: Settings, directory: Path | None = None) -> tuple[Finding, ...]:
    """Find what the data say against themselves before anything is adjusted."""
    if inputs.models is not None:
        return _of_unadjusted_models(inputs, inputs.models, settings, directory)
    images = of_images(inputs, settings)
    findings = [*images.findings, *_of_ids(images.strips, images)]
    findings += given_cameras.centers(inputs, images.observations, images.strips, directory)
    unformed = [None] * len(images.strips)
    control = _given_control(inputs, directory)
    findings += _of_control(control, images, images.strips, unformed, tried={})
    findings += control_layout.weak_layout(inputs, settings, images, control, directory)
    return _told(findings, inputs, settings)


def of_result(result: Result, directory: Path | None = None) -> tuple[Finding, ...]:
    """Find what the data say against themselves, the adjustment being done."""
    from photostrip.pipeline.plausibility import shared_control, slips  # a check has no adjusted strips
    from photostrip.plausibility.control.shared_by_control import StretchedHeights

    inputs, settings = result.inputs, result.settings
    if inputs.models is not None:
        return _of_adjusted_models(result, inputs.models, directory)
    points = result.refined.observations
    photo = PhotoCoordinates(result.measured, result.interior)
    images = replace(of_images(inputs, settings, photo), observations=points)
    control = _given_control(inputs, directory, _plain_frames(settings, result.frames))
    stages = result.strips if result.bundle is None else result.bundle.start.strips  # as they were formed
    formed = [
        evidence.EvidenceStrip(each.strip, each.orientation, each.formed) for each in (s.of_photos for s in stages)
    ]
    predicted = slips.Predicted(result)
    doubtful = [each for each in formed if slips.is_doubtful(each, result, predicted)]
    strips = tuple(each.strip for each in doubtful)  # a photo that is a strip of its own forms nothing
    doubts = [note for note in result.notes if note.code in slips.OF_DOUBTED_CONTROL]
    doubted = {note.strip for note in doubts}
    stretched = {
        each.strip.id: isinstance(each.shared, StretchedHeights) or each.strip.id in doubted for each in stages
    }
    tried = {} if result.bundle is not None else stretched  # a bundle tries another distance itself
    of_control = _of_control(control, images, strips, doubtful, tried)
    findings = [*images.findings, *(of_control if control is None else slips.confirmed(of_control, predicted, control))]
    if control is not None and not any(each.is_error for each in findings):
        named = {name for each in findings for name in each.points}
        findings += [each for each in slips.of_rejected(result, predicted, control) if named.isdisjoint(each.points)]
    findings += control_layout.weak_layout(inputs, settings, images, control, directory)
    for each, strip in zip(formed, result.photo_strips, strict=True):
        findings += _of_formed(each, points)
        findings += _of_flight(each) if result.bundle is None else _of_adjusted_flight(strip)
    findings += _of_shared_ids(result, stages, formed)
    in_metres = not any(each.is_error for each in findings)
    if in_metres and any(units.is_measured(each.orientation.sigma0) for each in formed):
        checks = inputs.control.check
        findings += units.find_wrong_sigmas_of_given(predicted.off[checks], inputs.control.sigma[checks])
    given = given_cameras.centers(inputs, points, images.strips, directory)
    findings += [each for each in given if result.bundle is None or _contradicted(each, result.bundle)]
    findings += _of_rotations(result, formed, directory)
    if result.bundle is not None:
        from photostrip.pipeline.plausibility import shared_errors  # a strip needs nothing of a bundle

        of_groups = list(shared_errors.of_bundle(result.bundle, inputs))
        if any(each.code in OF_LISTS for each in of_groups):  # all of the block says it best
            findings = [each for each in findings if each.code not in OF_LISTS]
        if not any(each.is_error for each in findings):  # of control that is misread a camera explains much
            explained = {each.key for each in of_groups if each.key}
            findings = [each for each in findings if each.key not in explained] + of_groups
    examined = [each for each in stages if each.strip in strips]
    findings += shared_control.find_shared_errors(examined, findings, joined=result.bundle is not None)
    if not any(each.is_error for each in findings) and not slips.strips_with_kept_exchanges(
        findings, predicted, inputs.control.ids
    ):
        findings += shared_control.find_shifted_checks(result)
    return _told(findings, inputs, settings)


def of_failure(
    inputs: Inputs,
    settings: Settings,
    directory: Path | None,
    photo: PhotoCoordinates | None,
    ground: GroundFrames | None,
) -> tuple[Finding, ...]:
    """Find what the data say against themselves, the adjustment having failed.

    photo, ground: what the run had found before it failed.
    Returns nothing when the evidence cannot be put together either.
    """
    try:
        if inputs.models is not None:
            return _of_unadjusted_models(inputs, inputs.models, settings, directory)
        images = of_images(inputs, settings, photo)
        points = evidence.ideal(images.observations, images.cameras, settings)
        formed = [evidence.form(strip, points, settings) for strip in images.strips]
        frames = () if ground is None else _plain_frames(settings, ground.control)
        control = _given_control(inputs, directory, frames)
        tried = dict.fromkeys([strip.id for strip in images.strips], True)
        findings = [*images.findings, *_of_control(control, images, images.strips, formed, tried)]
        findings += control_layout.weak_layout(inputs, settings, images, control, directory)
        whole = [each for each in formed if each is not None]
        for each in whole:
            findings += [*_of_formed(each, points), *_of_flight(each), *_shared_ids(each, points)]
        findings += given_cameras.centers(inputs, images.observations, images.strips, directory, starts=True)
        findings += given_cameras.angles(inputs, whole, points, directory)
        broken = [strip for strip, each in zip(images.strips, formed, strict=True) if each is None]
        findings += _of_ids(broken, images)
        for strip in broken:
            findings += flight_order.find_other_scale(images.observations, strip.id, strip.photos)
        return _told(findings, inputs, settings)
    except (GeometryError, InputError, np.linalg.LinAlgError):
        return ()  # the failure itself is what must be reported


def _told(findings: Iterable[Finding], inputs: Inputs, settings: Settings) -> tuple[Finding, ...]:
    """Leave out what strips say of themselves that were found among photos in no order: they only start a bundle."""
    found = {strip.id for strip in inputs.strips if not strip.listed}
    told = (each for each in findings if found.isdisjoint(each.strips) or each.code not in OF_STRIPS)
    return accepted(told, settings.accept)


def _given_control(inputs: Inputs, directory: Path | None, frames: Sequence[GroundFrame] = ()) -> GivenControl | None:
    """Given points in their frames; None where the frames contradict each other, which stops the run itself.

    frames: the frames, where a run has tied them already.
    """
    try:
        tied = frames or tie_frames(inputs.frames, inputs.output, directory=directory)[0]
    except InputError:
        return None
    return GivenControl.placed(inputs, tied, directory)


def _plain_frames(settings: Settings, frames: Sequence[GroundFrame]) -> Sequence[GroundFrame]:
    """Ground frames of a run; none where they carry a curvature that the given coordinates do not."""
    return () if settings.absolute.earth_curvature == "model" else frames


def _of_control(
    control: GivenControl | None,
    images: ImageEvidence,
    strips: Sequence[Strip],
    formed: Sequence[EvidenceStrip | None],
    tried: Mapping[str, bool],
) -> list[Finding]:
    """Look at given coordinates: where they lie, how they go with each strip.

    tried: ids of the strips that may be formed anew with other principal distances, and whether all their control
        shows stretched heights.
    """
    if control is None:
        return []
    copied = list(identity.find_copied_points(control.points, images.observations))
    named = {name for each in copied for name in each.names}
    of_strips = given_control.by_strip(control, images, strips, formed, tried)
    # a point with the coordinates of another looks like a slip of the pen
    of_strips = [each for each in of_strips if each.code != OF_SLIPS or named.isdisjoint(each.points)]
    return [*control.findings, *copied, *of_strips]


def _of_unadjusted_models(
    inputs: Inputs, models: MeasuredModels, settings: Settings, directory: Path | None
) -> tuple[Finding, ...]:
    """Look at strips of models of which there is no result."""
    control = _given_control(inputs, directory)
    if control is None:
        return ()
    from photostrip.pipeline.plausibility import model_evidence  # strips of photos need none of it

    return accepted(_of_models(model_evidence.form_strips(models, settings), models, control), settings.accept)


def _of_adjusted_models(result: Result, models: MeasuredModels, directory: Path | None) -> tuple[Finding, ...]:
    """Look at strips of models as they were adjusted."""
    from photostrip.pipeline.plausibility import shared_control, slips  # a check has no adjusted strips

    control = _given_control(result.inputs, directory)
    if control is None:
        return ()
    strips = [(each.of_models.strip, each.of_models.formed) for each in result.strips]
    findings = _of_models(strips, models, control)
    if result.precision is not None:
        findings = [each for each in findings if each.code != OF_SLIPS]
        findings += slips.of_models(result, models, slips.Predicted(result), control)
        if not any(each.is_error for each in findings):
            findings += shared_control.find_shifted_checks(result)
    return accepted(findings, result.settings.accept)


def _of_models(
    strips: Iterable[tuple[ModelStrip, FormedModels]], models: MeasuredModels, control: GivenControl
) -> list[Finding]:
    """Look at strips of models: given points by themselves and in each strip, perspective centres."""
    from photostrip.pipeline.plausibility import model_evidence

    findings = [*control.findings]
    for held in model_evidence.model_strips(strips, models.points.point_ids, control.points):
        for part in evidence.stretches(
            held.rows, held.on_strip, longest=STRETCH_MODELS, photos=STRETCH_MODELS, most=len(held.photos)
        ):
            findings += control.compared(*part).findings
        findings += flight.find_odd_centers(held.centers, held.depth, model_evidence.UP, held.photos, held.strip.id)
        findings += control_layout.weak_layout_of_models(held, control)
    return [finding for finding in findings if finding.code not in OF_CAMERAS]


def _of_ids(strips: Sequence[Strip], images: ImageEvidence) -> list[Finding]:
    """Look at ids of points by the images alone."""
    findings: list[Finding] = []
    observations = images.observations
    for strip in strips:
        rows, along = evidence.places_in_photos(strip, observations, images.steps)
        findings += identity.find_shared_ids_in_images(observations, rows, along, strip.photos, strip.id)
        findings += identity.find_double_ids_in_images(observations, rows, strip.id)
    return findings


def _of_formed(each: EvidenceStrip, observations: PhotoPoints) -> list[Finding]:
    """Look at a formed strip: its perspective centres, and the ids of its points."""
    strip, formed = each.strip, each.formed
    sigma = np.median(observations.sigma)
    findings = units.find_wrong_sigmas(each.orientation.sigma0, sigma, strip.id)
    focal = strip.camera.principal_distance
    findings += identity.find_double_ids(observations, formed, focal, strip.photos, strip.id, sigma)
    return findings


def _of_flight(each: EvidenceStrip) -> Iterator[Finding]:
    """Look at the perspective centres of a formed strip."""
    return flight.find_odd_centers(each.formed.centers, each.depth, each.up, each.strip.photos, each.strip.id)


def _of_adjusted_flight(strip: StripResult) -> Iterator[Finding]:
    """Look at the perspective centres of a strip as a bundle has left them."""
    centers = strip.of_photos.resection.centers
    depth = np.full(len(centers), np.median(centers[:, 2]) - np.median(strip.xyz[:, 2]))  # the Earth bends both alike
    return flight.find_odd_centers(centers, depth, np.array([0.0, 0.0, 1.0]), strip.strip.photos, strip.strip.id)


def _of_shared_ids(result: Result, stages: Iterable[StripResult], formed: Iterable[EvidenceStrip]) -> Iterator[Finding]:
    """Look for ids that stand for two points: in a bundle, or in each strip and between strips.

    stages: the strips as they were formed; formed: those of photos.
    """
    points = result.refined.observations
    if result.bundle is not None:
        rays, photos = _rays_of(result.bundle, points), result.bundle.block.problem.photo_ids
        yield from shared_ids.find_shared_ids(rays, points.point_ids, photos)
        return
    from photostrip.pipeline.common_points import compared_strips  # a check has no adjusted strips
    from photostrip.plausibility.photos import tied_strips

    for each in formed:
        yield from _shared_ids(each, points)
    for ties in compared_strips(tuple(stages), points.point_ids):
        yield from tied_strips.find_shared_ids_of_strips(ties)


def _shared_ids(each: EvidenceStrip, observations: PhotoPoints) -> Iterator[Finding]:
    """Look for ids that stand for two points of a formed strip."""
    strip, formed, o = each.strip, each.formed, observations
    photos = strip.oriented(formed.centers, formed.rotations)
    rays = OrientedRays.of_strip(photos, strip.positions(o), o.point, o.xy, o.sigma)
    return shared_ids.find_shared_ids(rays, o.point_ids, strip.photos, (strip.id,))


def _rays_of(bundle: Bundle, observations: PhotoPoints) -> OrientedRays:
    """Rays of a bundle; those that it rejected did not go with the others."""
    from photostrip.network.self_calibration import image_shift  # a strip needs nothing of a bundle

    solution = bundle.screened.solution
    problem = replace(bundle.block.problem, cameras=bundle.screened.problem.cameras)  # with what was taken up
    focal = problem.cameras.focal[problem.cameras.of_photo]
    xy, photo = observations.xy[bundle.block.rows], problem.images.photo
    return OrientedRays(
        photos=KnownPhotos(solution.centers, solution.rotations, focal),
        photo=photo,
        point=problem.images.point,
        xy=xy + image_shift(problem, solution.common, xy, photo),
        sigma=problem.images.sigma * max(bundle.unit, 1.0),
        wrong=~bundle.screened.selection.images,
    )


def _contradicted(finding: Finding, bundle: Bundle) -> bool:
    """Whether a bundle did not go with all given positions of the photos of a finding, or took up what they share."""
    from photostrip.network.hypotheses import DRIFT, OFFSET, ORDER  # a strip needs nothing of a bundle
    from photostrip.network.reliability import POSITION

    screened, problem = bundle.screened, bundle.block.problem
    rows = [
        each.row for each in (*screened.rejections, *screened.held) if each.kind == POSITION and not each.readmitted
    ]
    named = {problem.photo_ids[n] for n in problem.positions.photo[rows].tolist()}
    return not named.isdisjoint(finding.photos) or any(each.kind in (OFFSET, DRIFT, ORDER) for each in screened.common)


def _of_rotations(result: Result, formed: Sequence[EvidenceStrip], directory: Path | None) -> list[Finding]:
    """Compare given angles with the rotations found; not with those of a bundle that they took part in."""
    given = result.inputs.orientations
    if given is None:
        return []
    if result.bundle is not None:
        findings = given_cameras.angles(result.inputs, formed, result.refined.observations, directory)
        if findings or given.observed:
            return findings
    target = result.inputs.output or next(iter(result.inputs.frames), given.frame)
    frame = tie_frames([given.frame], target, directory=directory)[0][0]
    found: dict[str, Floats] = {}
    listed = set(given.photos)
    for strip in result.strips:
        resection = strip.of_photos.resection
        cartesian = strip.intermediate.cartesian_from_intermediate(resection.centers)
        turned = frame.axes_at(cartesian) @ strip.intermediate.cartesian_rotations(resection.rotations)
        found |= zip(strip.strip.photos, turned, strict=True)
    photos = [photo for photo in found if photo in listed]
    if not photos:
        return []
    angles = given.angles[locate(photos, given.photos)]
    return list(rotations.find_wrong_angles(angles, given.system, np.array([found[name] for name in photos]), photos))
