"""The gate around a run: what the data say against themselves, before the adjustment, after it, and when it fails.

A run is looked at whether it succeeds or not. When it fails, mistakes found in the image coordinates are corrected in a
copy that serves the evidence alone, so that one mistake does not hide the next; what is adjusted is never touched.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.network.hypotheses import DRIFT, OFFSET, ORDER
from photostrip.network.reliability import POSITION, image_shift
from photostrip.notes import Finding
from photostrip.pipeline import control_layout, evidence, given_cameras, given_on_ground, shared_errors
from photostrip.pipeline.control_readings import find_distance
from photostrip.pipeline.evidence import of_images, of_units
from photostrip.pipeline.formed_models import LinkedModels
from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.frames import CAMERAS, GroundFrames, PhotoCoordinates
from photostrip.pipeline.given_on_ground import GivenControl, Predicted
from photostrip.pipeline.inputs import Inputs, MeasuredModels, Settings
from photostrip.pipeline.precision import compared_strips
from photostrip.pipeline.results import Bundle, Result, StripResult
from photostrip.plausibility import accepted, flight, ids, units
from photostrip.plausibility.ids import OrientedRays
from photostrip.points import PhotoPoints
from photostrip.strip.resection import KnownPhotos

OF_LISTS = ("P404", "P407")  # findings on control lists as wholes
# findings on photos and bases that do not go on as those before them, on points that strips put at two places
OF_STRIPS = ("P201", "P202", "P205", "P206", "P207", "P301", "P304")
OF_DISTANCE = ("P101", "P105", "P107")  # findings on principal distances, or as much of the images
OF_IMAGES = ("P101", "P105", "P111")  # errors of images that put camera positions beside the control, too
OF_HANDS = ("P103", "P401")  # findings on axes, under which photos may come to lie below the ground
BELOW = "P204"
ALIKE = "P410"  # coordinates that are those of others
OUTSIDE = "P402"  # control lies outside its coordinate reference system: what a map stretches there no camera did
OF_HEIGHTS = (BELOW, "P205")  # findings on heights of camera positions above the control
PAIR = 2  # photos
OF_NEIGHBOURS = ("P205", "P206", "P207")  # findings on a photo, or on two, beside those next to it
OUT_OF_ORDER = "P201"  # of a strip put in order by the layout of its photos alone bases prove nothing
OF_CAMERAS = ("P105", "P107", "P110", "P111", "P112")  # findings on cameras: control that is misread looks like it


def of_inputs(inputs: Inputs, settings: Settings, directory: Path | None = None) -> tuple[Finding, ...]:
    """Find what the data say against themselves before anything is adjusted: strips are formed, and laid on control."""
    return _of_data(inputs, settings, directory, None, _given_control(inputs, directory), starts=False)


def require_sound(inputs: Inputs, settings: Settings, photo: PhotoCoordinates, directory: Path | None) -> None:
    """Refuse images that no camera makes, and camera positions that are misread: an adjustment would blame others.

    Raises InputError with the first finding of image coordinates in another unit, of a lens that nobody makes, or of
    camera positions in another unit, frame or order of axes.
    """
    if inputs.models is not None:
        return
    findings = [*of_units(inputs, settings, photo)]
    if settings.together:
        given = given_cameras.over_control(inputs, photo.observations, directory)
        findings += accepted([each.misread for each in given if each.misread is not None], settings.accept)
    for each in findings:
        if each.is_error and not each.accepted:
            message = f"{each.message}; nothing is adjusted, unless `accept: [{each.code}]` says that it is right"
            code = "positions-refused" if each.key.startswith(CAMERAS) else "images-refused"
            raise InputError(Fault(message, code=code, key=each.key, fix=each.fix))


def of_failure(
    inputs: Inputs,
    settings: Settings,
    directory: Path | None,
    photo: PhotoCoordinates | None,
    ground: GroundFrames | None,
    broken: Sequence[str] = (),
) -> tuple[Finding, ...]:
    """Find what the data say against themselves, the adjustment having failed.

    photo, ground: what the run had found before it failed.
    broken: photos that its refusal names; the strip of a pair that could not be oriented is not formed again in vain.
    Returns nothing when the evidence cannot be put together either.
    """
    try:
        frames = () if ground is None else _plain_frames(settings, ground.control)
        control = _given_control(inputs, directory, frames)
        return _of_data(inputs, settings, directory, photo, control, starts=True, broken=broken)
    except (GeometryError, InputError, np.linalg.LinAlgError):
        return ()  # the failure itself is what must be reported


def _of_data(
    inputs: Inputs,
    settings: Settings,
    directory: Path | None,
    photo: PhotoCoordinates | None,
    control: GivenControl | None,
    *,
    starts: bool,
    broken: Sequence[str] = (),
) -> tuple[Finding, ...]:
    """Look at all that is given, each strip formed by itself.

    starts: whether given orientations that are only a start count as well: they matter where a run fails.
    broken: photos that the refusal of a run names.
    """
    if inputs.models is not None:
        return _of_unadjusted_models(inputs.models, settings, control)
    images = of_images(inputs, settings, photo)
    points = evidence.ideal(images.observations, images.cameras, settings)
    pair = set(broken) if len(broken) == PAIR and not images.findings else set[str]()
    formed = [
        None if pair and pair < set(strip.photos) else evidence.form(strip, points, settings) for strip in images.strips
    ]
    whole = [each for each in formed if each is not None]
    findings = [*images.findings, *_of_control(control, points, whole, settings, slips=True)]
    findings += control_layout.weak_layout(inputs, settings, images, control, directory)
    moved = {name for each in images.findings if each.code == OUT_OF_ORDER for name in each.strips}
    for each in whole:
        findings += [*_of_formed(each, points), *_shared_ids(each, points)]
        findings += () if each.strip.id in moved else _of_flight(each)
    if not any(each.is_error and each.code in OF_IMAGES for each in accepted(images.findings, settings.accept)):
        findings += given_cameras.centers(inputs, images.observations, images.strips, directory, starts=starts)
    findings += given_cameras.angles(inputs, whole, points, directory)
    for strip in [strip for strip, each in zip(images.strips, formed, strict=True) if each is None]:
        findings += flight.find_other_scale(images.observations, strip.id, strip.photos)
        if control is not None and not any(each.code in OF_DISTANCE for each in findings):
            findings += find_distance(strip, points, control.points, control.read_in, settings)
    return _told(findings, inputs, settings)


def of_result(result: Result, directory: Path | None = None) -> tuple[Finding, ...]:
    """Find what the data say against themselves, the adjustment being done."""
    inputs, settings = result.inputs, result.settings
    control = _given_control(inputs, directory, _plain_frames(settings, result.frames))
    predicted = Predicted(result)
    if inputs.models is not None:
        return _of_adjusted_models(result, inputs.models, control, predicted)
    points = result.refined.observations
    photo = PhotoCoordinates(result.measured, result.interior)
    images = of_images(inputs, settings, photo)
    # an adjustment gives its image coordinates free of what it took up of the camera
    as_given = points if result.bundle is None else evidence.ideal(images.observations, images.cameras, settings)
    images = replace(images, observations=points)
    stages = result.strips if result.bundle is None else result.bundle.start.strips  # as they were formed
    formed = [replace(each.of_photos, observations=as_given) for each in stages]
    causes = [] if result.bundle is None else list(shared_errors.of_bundle(result.bundle, inputs, result.settings))
    misread = any(each.code in OF_CAMERAS for each in causes)  # perhaps
    odd = {each.strip.id for each in formed if given_on_ground.is_doubtful(each, result, predicted)}
    odd |= {
        each.strip.id
        for each in result.photo_strips
        if np.median(each.placed.centers[:, 2]) < np.median(each.xyz[:, 2])
    }
    doubtful = [each for each in formed if misread or each.strip.id in odd]
    findings = [*images.findings]
    findings += _of_control(control, points, doubtful, settings, slips=result.bundle is None)
    if control is not None and not any(each.is_error for each in findings):
        named = {name for each in (*findings, *causes) for name in each.points}
        findings += [
            each for each in given_on_ground.of_result(result, predicted, control) if named.isdisjoint(each.points)
        ]
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
    if any(each.code in OF_LISTS for each in causes):  # all of the block says it best
        findings = [each for each in findings if each.code not in OF_LISTS]
    if not any(each.is_error or each.code == ALIKE for each in findings):  # a camera explains much of misread control
        keys = [each.key for each in causes if each.key]
        findings = [each for each in findings if not _is_explained(each.key, keys)] + causes
    if not any(each.is_error for each in findings):
        findings += shared_errors.find_shifted_checks(result)
    return _told(findings, inputs, settings)


def _is_explained(key: str, keys: Sequence[str]) -> bool:
    """Whether causes that were found speak of a key, or of a part of it: an offset, of the heights of positions."""
    return bool(key) and any(each == key or each.startswith(f"{key}.") for each in keys)


def _told(findings: Iterable[Finding], inputs: Inputs, settings: Settings) -> tuple[Finding, ...]:
    """Leave out what strips say of themselves that were found among photos in no order: they only start a bundle.

    Of cameras nothing is said by control that lies where its map is not made for.
    """
    findings = list(findings)
    found = {strip.id for strip in inputs.strips if not strip.listed}
    silent = OF_CAMERAS if any(each.code == OUTSIDE for each in findings) else ()
    turned = {strip for each in findings if each.code in OF_HANDS for strip in each.strips}
    told = (each for each in findings if found.isdisjoint(each.strips) or each.code not in OF_STRIPS)
    told = (each for each in told if each.code not in silent)
    mixed = {strip for each in findings if each.code == OUT_OF_ORDER for strip in each.strips}  # who is next to whom
    told = (
        each
        for each in told
        if each.code not in OF_NEIGHBOURS or len(each.photos) > PAIR or mixed.isdisjoint(each.strips)
    )
    told = (each for each in told if each.code != BELOW or each.key or turned.isdisjoint(each.strips))
    if any(each.is_error and each.key.startswith("control") for each in findings):  # heights above it say nothing
        told = (each for each in told if each.code not in OF_HEIGHTS or not each.key.startswith(CAMERAS))
    if not settings.together:  # what is given of cameras takes no part
        told = (replace(each, severity="warning") if each.key.startswith(CAMERAS) else each for each in told)
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
    observations: PhotoPoints,
    formed: Sequence[FormedPhotos],
    settings: Settings,
    *,
    slips: bool,
) -> list[Finding]:
    """Look at given coordinates: where they lie, how they go with each strip, and with it by single points."""
    if control is None:
        return []
    copied = list(ids.find_copied_points(control.points, observations))
    whole, single = given_on_ground.of_strips(control, formed, settings)
    named = {name for each in copied for name in each.names}  # with the coordinates of another it looks like a slip
    told = [each for each in single if slips and named.isdisjoint(each.points)]
    return [*control.findings, *copied, *whole, *told]


def _of_unadjusted_models(
    models: MeasuredModels, settings: Settings, control: GivenControl | None
) -> tuple[Finding, ...]:
    """Look at strips of models of which there is no result."""
    if control is None:
        return ()
    formed = list(control_layout.form_strips(models, settings))
    return accepted(_of_models(formed, models, control, settings, slips=True), settings.accept)


def _of_adjusted_models(
    result: Result, models: MeasuredModels, control: GivenControl | None, predicted: Predicted
) -> tuple[Finding, ...]:
    """Look at strips of models as they were adjusted."""
    if control is None:
        return ()
    settings = result.settings
    formed = list(control_layout.form_strips(models, settings))
    findings = _of_models(formed, models, control, settings, slips=result.precision is None)
    if not any(each.is_error for each in findings):
        findings += given_on_ground.of_result(result, predicted, control)
        findings += shared_errors.find_shifted_checks(result)
    return accepted(findings, settings.accept)


def _of_models(
    formed: Sequence[LinkedModels], models: MeasuredModels, control: GivenControl, settings: Settings, *, slips: bool
) -> list[Finding]:
    """Look at strips of models: given points by themselves and in each strip, perspective centres."""
    whole, single = given_on_ground.of_strips(control, formed, settings)
    findings = [*control.findings, *whole, *(single if slips else ())]
    for held in control_layout.model_strips(formed, models.points.point_ids, control.points):
        findings += flight.find_odd_centers(held.centers, held.depth, given_cameras.UP, held.photos, held.strip.id)
        findings += control_layout.weak_layout_of_models(held, control)
    return findings


def _of_formed(each: FormedPhotos, observations: PhotoPoints) -> list[Finding]:
    """Look at a formed strip: its perspective centres, and the ids of its points."""
    strip, formed = each.strip, each.formed
    sigma = np.median(observations.sigma)
    findings = units.find_wrong_sigmas(each.orientation.sigma0, sigma, strip.id)
    focal = strip.camera.principal_distance
    findings += ids.find_double_ids(observations, formed, focal, strip.photos, strip.id, sigma)
    return findings


def _of_flight(each: FormedPhotos) -> Iterator[Finding]:
    """Look at the perspective centres of a formed strip."""
    centers, depth = each.formed.centers, evidence.depth(each)
    return flight.find_odd_centers(centers, depth, evidence.up(each), each.strip.photos, each.strip.id)


def _of_adjusted_flight(strip: StripResult) -> Iterator[Finding]:
    """Look at the perspective centres of a strip as a bundle has left them."""
    centers = strip.resection.centers
    depth = np.full(len(centers), np.median(centers[:, 2]) - np.median(strip.xyz[:, 2]))  # the Earth bends both alike
    return flight.find_odd_centers(centers, depth, given_cameras.UP, strip.strip.photos, strip.strip.id)


def _of_shared_ids(result: Result, stages: Iterable[StripResult], formed: Iterable[FormedPhotos]) -> Iterator[Finding]:
    """Look for ids that stand for two points: in a bundle, or in each strip and between strips.

    stages: the strips as they were formed; formed: those of photos.
    """
    points = result.refined.observations
    if result.bundle is not None:
        rays, photos = _rays_of(result.bundle, points), result.bundle.block.problem.photo_ids
        yield from ids.find_shared_ids(rays, points.point_ids, photos)
        return
    for each in formed:
        yield from _shared_ids(each, points)
    for ties in compared_strips(tuple(stages), points.point_ids):
        yield from ids.find_shared_ids_of_strips(ties)


def _shared_ids(each: FormedPhotos, observations: PhotoPoints) -> Iterator[Finding]:
    """Look for ids that stand for two points of a formed strip."""
    strip, formed, o = each.strip, each.formed, observations
    photos = strip.oriented(formed.centers, formed.rotations)
    rays = OrientedRays.of_strip(photos, strip.positions(o), o.point, o.xy, o.sigma)
    return ids.find_shared_ids(rays, o.point_ids, strip.photos, (strip.id,))


def _rays_of(bundle: Bundle, observations: PhotoPoints) -> OrientedRays:
    """Rays of a bundle; those that it rejected did not go with the others."""
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
    screened, problem = bundle.screened, bundle.block.problem
    rows = [each.row for each in (*screened.out, *screened.held) if each.kind == POSITION]
    named = {problem.photo_ids[n] for n in problem.positions.photo[rows].tolist()}
    return not named.isdisjoint(finding.photos) or any(each.kind in (OFFSET, DRIFT, ORDER) for each in screened.common)


def _of_rotations(result: Result, formed: Sequence[FormedPhotos], directory: Path | None) -> list[Finding]:
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
    listed, norths = set(given.photos), []
    for strip in result.strips:
        resection = strip.resection
        cartesian = strip.intermediate.cartesian_from_intermediate(resection.centers)
        turned = frame.axes_at(cartesian) @ strip.intermediate.cartesian_rotations(resection.rotations)
        found |= zip(strip.strip.photos, turned, strict=True)
        norths.append(frame.convergence(cartesian))
    photos = [photo for photo in found if photo in listed]
    if not photos:
        return []
    of_photos, north = np.array([found[name] for name in photos]), float(np.median(np.concatenate(norths)))
    return given_cameras.wrong_angles(given, photos, of_photos, north)
