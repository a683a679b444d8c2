"""The gate around a run: what the data say against themselves, before the adjustment, after it, and when it fails.

A run is examined whether it succeeds or not. When it fails, mistakes found in the image coordinates are corrected in a
copy that serves the evidence alone, so that one mistake does not hide the next; what is adjusted is never touched.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from photostrip.errors import PhotostripError
from photostrip.geodesy.crs import area_of_use
from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline.plausibility import distance_trial, evidence, given_cameras
from photostrip.pipeline.plausibility.base_directions import closer_look
from photostrip.triangulation.image_coordinates import interior
from photostrip.triangulation.plausibility import accepted
from photostrip.triangulation.plausibility.control import (
    control_heights,
    control_place,
    control_reading,
    given_points,
    layout,
)
from photostrip.triangulation.plausibility.photos import flight, flight_order, identity, units
from photostrip.triangulation.plausibility.photos import rotations as rotations_given

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.notes import Finding
    from photostrip.pipeline.inputs import Inputs, MeasuredModels, Settings, Strip
    from photostrip.pipeline.results import Result
    from photostrip.points import ControlPoints, PhotoPoints
    from photostrip.triangulation.plausibility.control.control_strip import Given, Seen
    from photostrip.triangulation.plausibility.photos.flight_order import Arranged

OF_CAMERAS = ("P105",)  # findings on principal distances: models have none


@dataclass(frozen=True, eq=False)
class Examined:
    """What the image coordinates alone say."""

    findings: tuple[Finding, ...]
    observations: PhotoPoints  # image points with what was found put right, for further evidence only; mm, y up
    arranged: tuple[Arranged, ...]  # each strip as its photos lie
    steps: dict[str, complex]  # centre of the next photo, as the photos lie, on each photo; mm, y up
    settings: Settings
    light: bool = False  # whether no strip may be formed, as in ``photostrip check``


def before(inputs: Inputs, settings: Settings) -> Examined:
    """Examine what is given, as far as that goes without adjusting anything.

    Returns
    -------
    Examined
        What was found; what the user has accepted is not marked yet.
    """
    cameras = {photo: strip.camera for strip in inputs.strips for photo in strip.photos}
    observations, told = _photo_coordinates(inputs, settings)
    of_units, of_camera = units.examine(observations, cameras)
    told += of_units
    factor = {name: of_camera[cameras[name].name] if name in cameras else 1.0 for name in observations.photo_ids}
    in_unit = _put_right(observations, factor, frozenset())
    arranged: list[Arranged] = []
    for strip in inputs.strips:
        closer = closer_look(strip, in_unit, settings)
        findings, order = flight_order.examine(observations, strip.id, strip.photos, closer)
        told += findings
        arranged.append(order)
    for each in arranged:
        factor |= {name: factor[name] / size for name, size in each.size.items()}
    mirrored = frozenset(name for each in arranged for name in each.mirrored)
    steps = {
        name: factor.get(name, 1.0) * (step.conjugate() if name in mirrored else step)
        for each in arranged
        for name, step in zip(each.photos, each.steps, strict=True)
    }
    return Examined(tuple(told), _put_right(observations, factor, mirrored), tuple(arranged), steps, settings)


def _photo_coordinates(inputs: Inputs, settings: Settings) -> tuple[PhotoPoints, list[Finding]]:
    """Give image points in the system of the photo, and what the fiducial marks say."""
    cameras = {photo: strip.camera for strip in inputs.strips for photo in strip.photos}
    if inputs.fiducials is None:
        return inputs.observations, []
    try:
        oriented = interior.orient(inputs.fiducials, cameras, settings.interior)
        observations = interior.transform(inputs.observations, oriented)
    except PhotostripError:
        return inputs.observations, []  # what is wrong with the marks is told elsewhere
    return observations, units.of_marks(oriented.scale_x, oriented.photo_ids)


def _put_right(observations: PhotoPoints, factor: dict[str, float], mirrored: frozenset[str]) -> PhotoPoints:
    """Image points in millimetres and seen from the right side, as far as that is known."""
    by_photo = np.array([[factor[name], -factor[name] if name in mirrored else factor[name]] for name in factor])
    if not len(by_photo) or (by_photo == 1.0).all():
        return observations
    return replace(observations, xy=observations.xy * by_photo[observations.photo])


def of_inputs(inputs: Inputs, settings: Settings, directory: Path | None = None) -> tuple[Finding, ...]:
    """Tell what the data say against themselves before anything is adjusted.

    Parameters
    ----------
    settings : Settings
        What is to be done, and what is accepted.
    """
    if inputs.models is not None:
        return accepted(_of_models(inputs, inputs.models, settings, directory), settings.accept)
    examined = replace(before(inputs, settings), light=True)
    strips = _as_they_lie(inputs, examined)
    told = [*examined.findings, *_of_ids(strips, examined)]
    told += given_cameras.centers(inputs, examined.observations, strips, directory)
    told += _of_control(inputs, examined, strips, [None] * len(strips), directory)
    return accepted(told, settings.accept)


def of_result(result: Result, directory: Path | None = None) -> tuple[Finding, ...]:
    """Tell what the data say against themselves, the adjustment being done."""
    inputs, settings = result.inputs, result.settings
    if inputs.models is not None:
        return accepted(_of_models(inputs, inputs.models, settings, directory), settings.accept)
    examined = replace(before(inputs, settings), observations=result.refined.observations)
    stages = result.strips if result.bundle is None else result.bundle.start.strips  # as they were formed
    formed = [evidence.Formed(each.strip, each.orientation, each.formed) for each in (s.of_photos for s in stages)]
    strips = tuple(each.strip for each in formed)  # a photo that is a strip of its own forms nothing
    told = [*examined.findings, *_of_control(inputs, examined, strips, formed, directory)]
    for each in formed:
        told += _of_strip(each, result.refined.observations)
    told += given_cameras.centers(inputs, examined.observations, _as_they_lie(inputs, examined), directory)
    told += _of_rotations(result, formed, directory)
    return accepted(told, settings.accept)


def of_failure(inputs: Inputs, settings: Settings, directory: Path | None = None) -> tuple[Finding, ...]:
    """Tell what the data say against themselves, the adjustment having failed.

    Returns
    -------
    tuple of Finding
        By code; empty when the evidence cannot be put together either.
    """
    try:
        if inputs.models is not None:
            return accepted(_of_models(inputs, inputs.models, settings, directory), settings.accept)
        examined = before(inputs, settings)
        strips = _as_they_lie(inputs, examined)
        points = evidence.ideal(examined.observations, strips, settings)
        formed = [evidence.form(strip, points, settings) for strip in strips]
        told = [*examined.findings, *_of_control(inputs, examined, strips, formed, directory)]
        for each in formed:
            told += _of_strip(each, points) if each is not None else []
        told += given_cameras.centers(inputs, examined.observations, strips, directory)
        told += given_cameras.angles(inputs, [each for each in formed if each is not None], points, directory)
        broken = [strip for strip, each in zip(strips, formed, strict=True) if each is None]
        told += _of_ids(broken, examined)
        for strip in broken:
            told += flight_order.other_scale(examined.observations, strip.id, strip.photos)
        return accepted(told, settings.accept)
    except (PhotostripError, ArithmeticError, LookupError, ValueError):
        return ()  # the failure itself is what must be told


def _as_they_lie(inputs: Inputs, examined: Examined) -> tuple[Strip, ...]:
    """Return the strips with their photos as they lie, each place once."""
    pairs = zip(inputs.strips, examined.arranged, strict=True)
    return tuple(replace(strip, photos=arranged.photos) for strip, arranged in pairs)


# ------------------------------------------------------------------------------------------------- the control


def _of_control(
    inputs: Inputs,
    examined: Examined,
    strips: Sequence[Strip],
    formed: Sequence[evidence.Formed | None],
    directory: Path | None,
) -> list[Finding]:
    """Examine given coordinates: where they lie, how they go with each strip, how they hold it."""
    control = inputs.control
    try:
        frames, _ = tie_frames(inputs.frames, inputs.output, directory=directory)
    except PhotostripError:
        return []  # what is wrong with the frames is told elsewhere
    told, reading = _placed(inputs, frames, directory)
    for strip, each in zip(strips, formed, strict=True):
        here = _on_strip(strip, each, examined, control, frames, **reading)
        if not any(finding.is_error for finding in here) and not examined.light:
            read = partial(_by_heights, examined=examined, control=control, frames=frames)
            points, settings = examined.observations, examined.settings
            if each is not None:
                here = distance_trial.examine(each, points, settings, read) or here  # then single points prove nothing
            elif not examined.findings:
                here = distance_trial.without_pairs(strip, points, settings, read) or here
        told += here
    for strip in _as_they_lie(inputs, examined):
        told += _held(strip, examined, control, frames) if len(strip.photos) > 1 else []
    return told


def _of_ids(strips: Sequence[Strip], examined: Examined) -> list[Finding]:
    """Examine ids of points by the images alone."""
    told: list[Finding] = []
    o = examined.observations
    for strip in strips:
        rows, along = evidence.places(strip, o, examined.steps)
        told += identity.far_apart(o, rows, along, strip.photos, strip.id)
        told += identity.on_top(o, rows, strip.id)
    return told


def _on_strip(
    strip: Strip,
    formed: evidence.Formed | None,
    examined: Examined,
    control: ControlPoints,
    frames: Sequence[GroundFrame],
    *,
    as_written: bool,
    axes_are_right: bool | None,
) -> list[Finding]:
    """Compare given points with a strip: the formed one, or else the mosaic of its photos."""
    if formed is not None:
        rows, seen = evidence.sighted(formed, examined.observations, control, examined.steps)
        return [
            finding
            for part, sight in evidence.stretches(rows, seen)
            for finding in _read(
                control.take(part), sight, frames, as_written=as_written, axes_are_right=axes_are_right
            )
        ]
    mosaic = evidence.sighted_in_mosaic(strip, examined.observations, control, examined.steps)
    if mosaic is None:
        return []
    rows, seen = mosaic
    return _read(control.take(rows), seen, frames, as_written=as_written, axes_are_right=axes_are_right)


def _read(
    here: ControlPoints, seen: Seen, frames: Sequence[GroundFrame], *, as_written: bool, axes_are_right: bool | None
) -> list[Finding]:
    """Read given points against what a strip sees of them."""
    given = given_points.level(here, frames, as_written=as_written)
    if given is None:
        return []

    def exchanged() -> Given | None:
        order = [1, 0, 2]
        return given_points.level(replace(here, enu=here.enu[:, order], use=here.use[:, order]), frames)

    return control_reading.examine(given, seen, axes_are_right=axes_are_right, exchanged=exchanged)


def _by_heights(
    formed: evidence.Formed, examined: Examined, control: ControlPoints, frames: Sequence[GroundFrame]
) -> control_heights.Stretched | None:
    """Compare a formed strip with the heights of its control."""
    rows, seen = evidence.sighted(formed, examined.observations, control, examined.steps)
    given = given_points.level(control.take(rows), frames)
    return None if given is None else control_heights.stretched(given, seen)


class _Reading(TypedDict):
    """How coordinates are read, by where they lie: whether only as written, and whether their axes are right."""

    as_written: bool
    axes_are_right: bool | None


def _placed(inputs: Inputs, frames: Sequence[GroundFrame], directory: Path | None) -> tuple[list[Finding], _Reading]:
    """Examine where given points lie on the Earth."""
    control = inputs.control
    told: list[Finding] = []
    sure: list[bool | None] = []
    nowhere = False
    for number, frame in enumerate(frames):
        rows = (control.frame == number) & control.use[:, 0]
        area = area_of_use(inputs.frames[number], directory=directory)
        place = control_place.examine(frame, area, control.enu[rows], number)
        told += place.findings
        sure.append(place.sure)
        nowhere |= not place.inside
    return told, _Reading(as_written=nowhere, axes_are_right=sure[0] if len(set(sure)) == 1 else None)


def _of_models(inputs: Inputs, models: MeasuredModels, settings: Settings, directory: Path | None) -> list[Finding]:
    """Examine strips of models: given points by themselves and in each strip, perspective centres."""
    control = inputs.control
    try:
        frames, _ = tie_frames(inputs.frames, inputs.output, directory=directory)
    except PhotostripError:
        return []  # what is wrong with the frames is told elsewhere
    from photostrip.pipeline.plausibility import model_evidence  # strips of photos need none of it

    told, reading = _placed(inputs, frames, directory)
    for sight in model_evidence.sights(models, control, settings):
        here = control.take(sight.rows)
        told += _read(here, sight.seen, frames, **reading)
        told += flight.examine(sight.centers, sight.depth, model_evidence.UP, sight.photos, sight.strip.id)
        counts = here.use[:, 0] & ~here.check
        given = given_points.level(here.take(counts), frames)
        if given is not None:
            plan = given.level[:, :2]
            breadth = sight.breadth * float(np.linalg.norm(np.ptp(plan, axis=0)))
            photos, ids = sight.strip.photos, here.take(counts).ids
            told += layout.examine(sight.place[counts], plan, breadth, photos, sight.strip.id, ids)
    return [finding for finding in told if finding.code not in OF_CAMERAS]


def _held(strip: Strip, examined: Examined, control: ControlPoints, frames: Sequence[GroundFrame]) -> list[Finding]:
    """Judge where the control of a strip lies."""
    rows, place = evidence.stations(strip, examined.observations, control, examined.steps)
    counts = control.use[rows, 0] & ~control.check[rows]
    here = control.take(rows[counts])
    given = given_points.level(here, frames)
    if given is None:
        return []
    plan = given.level[:, :2]
    breadth = evidence.half_breadth(strip, examined.observations, here.ids, plan, examined.steps)
    return list(layout.examine(place[counts], plan, breadth, strip.photos, strip.id, here.ids))


# --------------------------------------------------------------------------------------------- after forming


def _of_strip(each: evidence.Formed, observations: PhotoPoints) -> list[Finding]:
    """Examine a formed strip: its perspective centres, and the ids of its points."""
    strip, formed = each.strip, each.formed
    whole = each.whole.formed  # rays that contradict each other may be those of two points
    sigma = float(np.median(observations.sigma))
    told = list(flight.examine(formed.centers, each.depth, each.up, strip.photos, strip.id))
    names = observations.point_ids
    told += identity.one_id(each.orientation, whole, names, strip.photos, sigma, strip.id)
    focal = strip.camera.principal_distance
    told += identity.two_ids(observations, formed, focal, strip.photos, strip.id, sigma)
    return told


def _of_rotations(result: Result, formed: Sequence[evidence.Formed], directory: Path | None) -> list[Finding]:
    """Compare given angles with the rotations found; not with those of a bundle that they took part in."""
    given = result.inputs.orientations
    if given is None:
        return []
    if result.bundle is not None:
        told = given_cameras.angles(result.inputs, formed, result.refined.observations, directory)
        if told or given.observed:
            return told
    target = result.inputs.output or next(iter(result.inputs.frames), given.frame)
    frame = tie_frames([given.frame], target, directory=directory)[0][0]
    rows = {photo: row for row, photo in enumerate(given.photos)}
    photos, angles, rotations = [], [], []
    for strip in result.strips:
        cartesian = strip.intermediate.cartesian_from_intermediate(strip.of_photos.resection.centers)
        turned = frame.axes_at(cartesian) @ strip.intermediate.cartesian_rotations(strip.of_photos.resection.rotations)
        for number, photo in enumerate(strip.strip.photos):
            if photo in rows:
                photos.append(photo)
                angles.append(given.angles[rows[photo]])
                rotations.append(turned[number])
    if not photos:
        return []
    return list(rotations_given.examine(np.array(angles), given.system, np.array(rotations), photos))
