"""The whole walk, as a table of contents: image coordinates, strips, all points together."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import Fault, GeometryError, InputError
from photostrip.geodesy.frame_spec import GROUND_AXES, FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import Note
from photostrip.pipeline import overruling
from photostrip.pipeline.inputs import ADJUSTMENTS
from photostrip.pipeline.plausibility import gate
from photostrip.pipeline.precision import strip_precision
from photostrip.pipeline.results import Adjusted, Result, Ties
from photostrip.pipeline.strip import adjust_strip
from photostrip.triangulation.image_coordinates import corrections, interior

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from photostrip.camera import Camera
    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline.block.adjust import Block
    from photostrip.pipeline.inputs import Inputs, Settings
    from photostrip.pipeline.results import StripResult
    from photostrip.points import ControlPoints, PhotoPoints
    from photostrip.triangulation.image_coordinates.mark_fit import InteriorOrientation

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

CAMERAS = ("camera_positions", "orientations")  # keys of what may be given of cameras


def triangulate(inputs: Inputs, settings: Settings, *, directory: Path | None = None) -> Result:
    """Take a project through the whole strip method.

    Returns
    -------
    Result
        Every stage, adjusted points, orientations, residuals, notes.

    Raises
    ------
    InputError
        When the settings or frames contradict each other or the control is left-handed.
    GeometryError
        When a pair, a joint or the absolute orientation cannot be determined.

    Notes
    -----
    Either error carries in ``findings`` what the data say against themselves.
    """
    try:
        result = _triangulated(inputs, settings, directory)
    except (InputError, GeometryError) as error:
        error.findings = gate.of_failure(inputs, settings, directory)
        raise
    except np.linalg.LinAlgError as error:
        msg = f"the data contradict themselves so much that an equation cannot be solved ({str(error).lower()})"
        told = GeometryError(msg, code="singular")
        told.findings = gate.of_failure(inputs, settings, directory)
        raise told from error
    return replace(result, findings=gate.of_result(result, directory))


def _triangulated(inputs: Inputs, settings: Settings, directory: Path | None) -> Result:
    """Walk through the method."""
    _require(settings)
    _require_strips(inputs)
    frames, output, of_positions, of_orientations = _frames(inputs, settings, directory)
    require_whole(inputs, frames)
    observations, fiducial = _photo_coordinates(inputs, settings)
    overruling.require(settings.relative, observations)
    refined = _ideal_coordinates(observations, inputs, settings, frames)
    control = _measured_control(inputs, refined.observations)
    block: Block | None = None
    strips: tuple[StripResult, ...] = ()
    if inputs.models is not None:
        from photostrip.pipeline.models.model_strips import adjust_all  # strips of photos need none of it

        strips = adjust_all(inputs.models, control, frames, settings)
        points, ties = _join(strips, refined.observations, output)
    elif settings.adjustment == "bundle":
        from photostrip.pipeline.block.adjust import adjust_block  # a strip needs none of its libraries

        tied = (frames, output, of_positions, of_orientations)
        block = adjust_block(inputs, settings, refined.observations, control, tied)
        refined = replace(refined, observations=block.observations)
        strips, points, ties = block.strips, block.points, Ties.none()
    else:
        strips = tuple(adjust_strip(strip, refined.observations, control, frames, settings) for strip in inputs.strips)
        points, ties = _join(strips, refined.observations, output)
    rows, differences = _at_given_points(inputs, frames, points, refined.observations)
    missing = _not_determined(refined.observations, points, inputs, strips)
    covariances = block.precision if block is not None and settings.precision else None
    if block is None and settings.precision:
        each = [_precision(strip, refined.observations, frames, inputs.control) for strip in strips]
        covariances = strip_precision.joined(each, strips, points)
    found = block.notes if block is not None else tuple(note for strip in strips for note in strip.notes)
    notes = _notes(inputs, settings, found, fiducial)
    return Result(
        inputs,
        settings,
        tuple(frames),
        output,
        fiducial,
        refined,
        strips,
        points,
        rows,
        differences,
        ties,
        missing,
        notes,
        covariances,
        None if block is None else block.bundle,
    )


def _precision(
    strip: StripResult, observations: PhotoPoints, frames: Sequence[GroundFrame], given: ControlPoints
) -> strip_precision.StripPrecision:
    """Covariances of one strip of either kind."""
    if strip.photo_stages is not None:
        return strip_precision.of_strip(strip, observations, frames, given)
    from photostrip.pipeline.models import model_precision

    return model_precision.of_linked(strip, observations, frames, given)


def _require(settings: Settings) -> None:
    """Refuse what does not exist, by name."""
    if settings.adjustment not in ADJUSTMENTS:
        fault = Fault(
            f"adjustment {settings.adjustment!r} is not available",
            code="not-available",
            key="processing.adjustment",
            expected=" or ".join(ADJUSTMENTS),
        )
        raise InputError(fault)


def _require_strips(inputs: Inputs) -> None:
    """Refuse measurements on photos without a strip: nobody knows their camera."""
    cameras = _cameras(inputs)
    stray = [photo for photo in inputs.observations.photo_ids if photo not in cameras]
    if stray:
        message = f"photo {stray[0]} is measured but belongs to no strip ({len(stray)} such photos)"
        raise InputError(Fault(message, code="photo-without-strip", key="strips"))


def require_whole(inputs: Inputs, frames: Sequence[GroundFrame]) -> None:
    """Refuse geocentric points of which only some coordinates count: X, Y, Z are neither plan nor height.

    Raises
    ------
    InputError
        With a fault for each such point.
    """
    control = inputs.control
    if not frames:
        return
    geocentric = np.array([frame.kind == "geocentric" for frame in frames])
    part = control.use.any(axis=1) & ~control.use.all(axis=1)
    faults = [
        Fault(
            f"point {control.ids[row]} is geocentric, and only some of its coordinates count",
            code="geocentric-use",
            key=f"control[{control.frame[row]}]",
            expected="`use: xyz` or `off`: X, Y and Z are neither plan nor height",
        )
        for row in np.flatnonzero(part & geocentric[control.frame]).tolist()
    ]
    if faults:
        raise InputError(faults)


def _frames(
    inputs: Inputs, settings: Settings, directory: Path | None
) -> tuple[list[GroundFrame], GroundFrame, GroundFrame | None, GroundFrame | None]:
    """Ground frames of control, output, camera positions and orientations, tied together.

    With curvature by eq. 153 all share the control's centre of gravity as origin.
    """
    radius = settings.absolute.earth_radius if settings.absolute.earth_curvature == "model" else None
    _refuse_curvature_twice(inputs, settings)
    cameras = [None if given is None else given.frame for given in (inputs.positions, inputs.orientations)]
    if settings.adjustment != "bundle":
        cameras = [None, None]
    if settings.adjustment == "bundle" and _nothing_given(inputs):
        _, target = tie_frames([FrameSpec("local", GROUND_AXES)])
        return [], target, None, None
    named = {f"control[{number}]": spec for number, spec in enumerate(inputs.frames)}
    named |= {key: spec for key, spec in zip(CAMERAS, cameras, strict=True) if spec is not None}
    specs = [replace(spec, curvature_radius=radius) for spec in named.values()]
    output = None if inputs.output is None else replace(inputs.output, curvature_radius=radius)
    if not specs and output is not None:
        specs, named = [output], {"output": output}
    tied, target = tie_frames(specs, output, directory=directory, keys=list(named))
    plan = inputs.control.use[:, 0] & ~inputs.control.check
    if radius is not None and plan.any():
        origin = inputs.control.enu[plan, :2].mean(axis=0)
        tied, target = [frame.with_origin(origin) for frame in tied], target.with_origin(origin)
    found = dict(zip(named, tied, strict=True))
    control = [found[f"control[{number}]"] for number in range(len(inputs.frames))]
    return control, target, found.get(CAMERAS[0]), found.get(CAMERAS[1])


def _nothing_given(inputs: Inputs) -> bool:
    """Whether nothing ties the photos to the ground: a frame of their own is all they can have."""
    measured = set(inputs.observations.point_ids)
    control = inputs.control
    counts = control.use.any(axis=1) & ~control.check
    given = any(yes and name in measured for name, yes in zip(control.ids, counts.tolist(), strict=True))
    cameras = any(each is not None and each.photos for each in (inputs.positions, inputs.orientations))
    return not given and not cameras


def _refuse_curvature_twice(inputs: Inputs, settings: Settings) -> None:
    """Refuse curvature in image space where the ground frames carry it."""
    curved = [spec.name for spec in (*inputs.frames, *filter(None, [inputs.output])) if spec.crs != "local"]
    if settings.refinement.earth_radius is not None and curved:
        fault = Fault(
            f"Earth curvature would be counted twice: in the images and in {curved[0]}, which carries it",
            code="curvature-twice",
            key="processing.earth_curvature",
            expected="auto",
            fix="drop `earth_curvature: image`, or give plane coordinates of an unknown projection as `crs: local`",
        )
        raise InputError(fault)


def _photo_coordinates(inputs: Inputs, settings: Settings) -> tuple[PhotoPoints, InteriorOrientation | None]:
    """Interior orientation, when fiducial marks were measured."""
    if inputs.fiducials is None:
        return inputs.observations, None
    cameras = _cameras(inputs)
    orientation = interior.orient(inputs.fiducials, cameras, settings.interior)
    return interior.transform(inputs.observations, orientation), orientation


def _cameras(inputs: Inputs) -> dict[str, Camera]:
    return {photo: strip.camera for strip in inputs.strips for photo in strip.photos}


def _ideal_coordinates(
    observations: PhotoPoints, inputs: Inputs, settings: Settings, frames: Sequence[GroundFrame]
) -> corrections.Refined:
    """Image coordinates reduced to the principal point, free of distortion and refraction."""
    if inputs.models is not None:  # there are none: the observations only name the points
        return corrections.Refined(observations, {})
    wanted = settings.refinement
    if wanted.needs_heights and (wanted.flying_height is None or wanted.ground_height is None):
        # The heights come from a first run without these corrections; metres do not matter to them.
        plain = replace(wanted, refraction=False, earth_radius=None)
        first = _triangulated(inputs, replace(settings, refinement=plain), None)
        flying, ground = _heights(first, frames)
        wanted = replace(wanted, flying_height=flying, ground_height=ground)
    return corrections.refine(observations, _cameras(inputs), wanted)


def _heights(first: Result, frames: Sequence[GroundFrame]) -> tuple[float, float]:
    """Mean height of the cameras and of the ground above the ellipsoid, metres."""
    frame = frames[0] if frames else first.output
    centers = np.concatenate([s.intermediate.cartesian_from_intermediate(s.centers) for s in first.strips])
    ground = first.points.cartesian
    heights = [points[:, 2] if frame.kind == "local" else frame.geodetic(points)[:, 2] for points in (centers, ground)]
    return float(heights[0].mean()), float(heights[1].mean())


def _measured_control(inputs: Inputs, observations: PhotoPoints) -> ControlPoints:
    """Control that may influence the result: neither check points nor unmeasured ones ever get past here."""
    measured = set(observations.point_ids)
    control = inputs.control
    kept = [
        row
        for row, name in enumerate(control.ids)
        if name in measured and not control.check[row] and control.use[row].any()
    ]
    return control.take(np.array(kept, np.intp))


def _join(strips: Sequence[StripResult], observations: PhotoPoints, output: GroundFrame) -> tuple[Adjusted, Ties]:
    """Points of all strips: the mean where strips share a point, and their differences there."""
    strip = np.concatenate([np.full(len(s.formed.point), number) for number, s in enumerate(strips)])
    point = np.concatenate([s.formed.point for s in strips])
    cartesian = np.concatenate([s.cartesian for s in strips])
    number, inverse = np.unique(point, return_inverse=True)
    count = np.bincount(inverse)
    sums = np.column_stack([np.bincount(inverse, cartesian[:, axis]) for axis in range(3)])
    mean = sums / count[:, None]
    rays = np.zeros(len(number), np.intp)
    for s in strips:
        rays[np.searchsorted(number, s.formed.point)] += s.rays
    ids = [observations.point_ids[n] for n in number]
    joined = Adjusted(number, mean, output.ground_from_cartesian(mean, ids=ids), rays)
    return joined, _ties(strip, point, cartesian, output)


def _ties(strip: Numbers, point: Numbers, cartesian: Floats, output: GroundFrame) -> Ties:
    order = np.lexsort((strip, point))
    strip, point, cartesian = strip[order], point[order], cartesian[order]
    second = np.flatnonzero(point[1:] == point[:-1]) + 1
    difference = cartesian[second] - cartesian[second - 1]
    if len(second):
        difference = np.einsum("nij,nj->ni", output.axes_at(cartesian[second]), difference)
    return Ties(point[second], np.column_stack([strip[second - 1], strip[second]]), difference)


def _at_given_points(
    inputs: Inputs, frames: Sequence[GroundFrame], points: Adjusted, observations: PhotoPoints
) -> tuple[Numbers, Floats]:
    """Compare adjusted with given coordinates at control and check points, each in its own ground frame."""
    control = inputs.control
    number = {name: n for n, name in enumerate(observations.point_ids)}
    row_of = {int(n): row for row, n in enumerate(points.number)}
    rows = np.array([row_of.get(number.get(name, -1), -1) for name in control.ids], np.intp)
    differences = np.full((len(control), 3), np.nan)
    for index, frame in enumerate(frames):
        here = np.flatnonzero((control.frame == index) & (rows >= 0))
        if len(here):
            adjusted = frame.ground_from_cartesian(points.cartesian[rows[here]])
            given = np.where(np.isnan(control.enu[here]), adjusted, control.enu[here])
            differences[here] = frame.difference(adjusted, given)
    return rows, np.where(control.use, differences, np.nan)


def _not_determined(
    observations: PhotoPoints, points: Adjusted, inputs: Inputs, strips: Sequence[StripResult]
) -> dict[str, str]:
    """Points that were measured and have no coordinates, with the reason."""
    done = np.zeros(len(observations.point_ids), bool)
    done[points.number] = True
    if inputs.models is not None:
        why = "its coordinates in the models contradict each other, or were left out"
        return {observations.point_ids[number]: why for number in np.flatnonzero(~done).tolist()}
    placed = {photo: (n, k) for n, strip in enumerate(inputs.strips) for k, photo in enumerate(strip.photos)}
    contradicted = {int(number) for strip in strips for number in strip.of_photos.contradictions.point}
    seen: dict[int, list[tuple[int, int]]] = {}
    for row in np.flatnonzero(~done[observations.point]):
        photo = observations.photo_ids[observations.photo[row]]
        if photo in placed:
            seen.setdefault(int(observations.point[row]), []).append(placed[photo])
    return {
        observations.point_ids[point]: _reason(places, contradicted=point in contradicted)
        for point, places in sorted(seen.items())
    }


def _reason(places: list[tuple[int, int]], *, contradicted: bool) -> str:
    if len(places) == 1:
        return "measured on one photo"
    if contradicted:
        return "its rays contradict each other"
    neighbours = any((n, k + 1) in places for n, k in places)
    return "rejected in every pair" if neighbours else "on no two neighbouring photos of one strip"


def _notes(
    inputs: Inputs, settings: Settings, found: Sequence[Note], fiducial: InteriorOrientation | None
) -> tuple[Note, ...]:
    notes: list[Note] = [*(fiducial.notes if fiducial is not None else ()), *found]
    if settings.absolute.earth_curvature == "none" and inputs.frames and inputs.frames[0].crs != "local":
        notes.append(
            Note(
                "curvature-in-frames",
                "earth_curvature: none changes nothing here: the coordinates go through geocentric space, where the "
                "Earth is curved",
                severity="note",
            )
        )
    return tuple(notes)
