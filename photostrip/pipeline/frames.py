"""Ground frames of everything that is given, tied to one Cartesian frame.

Source: [001] eq. 153 for Earth curvature in the frames; see docs/frames.md.

Measured image coordinates brought to the principal point and freed of what bends rays.

Source: [001] for interior orientation and corrections, see docs/image-coordinates.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.errors import GeometryError
from photostrip.geodesy.frame_spec import GROUND_AXES, FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.local_frame import curvature_correction
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import Note
from photostrip.pipeline.inputs import AUTO, Inputs, Settings, refuse_curvature_twice
from photostrip.pipeline.results import StripResult
from photostrip.points import PhotoPoints

if TYPE_CHECKING:
    from photostrip.strip.interior import InteriorOrientation


LEFT_BY_A_LEVEL_FIT = 2.0 / (3.0 * 5.0**0.5)  # rms of what a parabola leaves about its mean, of its height at the ends
EPOCH_UNKNOWN = 10.0  # years by which an epoch that is not given may differ from that of an operation
CAMERAS = ("camera_positions", "orientations")  # keys of what may be given of cameras


class TiedFrames(NamedTuple):
    """Frames that loading has tied, to find out whether that can be done: a run needs not do it again."""

    frames: Mapping[FrameSpec, GroundFrame]  # by what the project says about each
    output: GroundFrame

    def serve(self, specs: Sequence[FrameSpec], output: FrameSpec) -> bool:
        """Whether frames are among these, and tied to the same output."""
        return self.output.spec == output and self.frames.keys() >= set(specs)


@dataclass(frozen=True, eq=False)
class GroundFrames:
    """Ground frames of a project, tied together."""

    control: tuple[GroundFrame, ...]  # of the control lists
    output: GroundFrame  # of the result
    positions: GroundFrame | None = None  # of the camera positions; None without a bundle adjustment
    orientations: GroundFrame | None = None  # of the given orientations


def tie_ground_frames(
    inputs: Inputs, settings: Settings, directory: Path | None, known: TiedFrames | None = None
) -> GroundFrames:
    """Tie the frames of control, output, camera positions and orientations together.

    With curvature by eq. 153 all share the control's centre of gravity as origin; its radius belongs to the frames, so
    that those of loading, which know none, do not serve.
    """
    radius = settings.absolute.earth_radius if settings.absolute.earth_curvature == "model" else None
    refuse_curvature_twice(inputs, settings)
    cameras = [None if given is None else given.frame for given in (inputs.positions, inputs.orientations)]
    if inputs.orientations is not None and inputs.orientations.has_own_frame and (inputs.frames or cameras[0]):
        cameras[1] = None
    if not settings.together:
        cameras = [None, None]
    if settings.together and inputs.models is None and _nothing_given(inputs):
        if settings.adjustment == AUTO:
            raise _nothing_ties(inputs)
        _, target = tie_frames([FrameSpec("local", GROUND_AXES)])
        return GroundFrames((), target)
    named = {f"control[{number}]": spec for number, spec in enumerate(inputs.frames)}
    named |= {key: spec for key, spec in zip(CAMERAS, cameras, strict=True) if spec is not None}
    specs = [replace(spec, curvature_radius=radius) for spec in named.values()]
    output = None if inputs.output is None else replace(inputs.output, curvature_radius=radius)
    if not specs and output is not None:
        specs, named = [output], {"output": output}
    if specs and known is not None and known.serve(specs, output or specs[0]):
        tied, target = [known.frames[spec] for spec in specs], known.output
    else:
        tied, target = tie_frames(specs, output, directory=directory, keys=list(named))
    plan = inputs.control.use[:, 0] & ~inputs.control.check
    if radius is not None and plan.any():
        origin = inputs.control.enu[plan, :2].mean(axis=0)
        tied, target = [frame.with_origin(origin) for frame in tied], target.with_origin(origin)
    found = dict(zip(named, tied, strict=True))
    control = tuple(found[f"control[{number}]"] for number in range(len(inputs.frames)))
    return GroundFrames(
        control=control, output=target, positions=found.get(CAMERAS[0]), orientations=found.get(CAMERAS[1])
    )


def _nothing_ties(inputs: Inputs) -> GeometryError:
    message = (
        "nothing ties the photos to the ground: none of the control points is measured on them, and neither camera "
        "positions nor orientations are given; `processing.adjustment: bundle` makes a free network of them"
    )
    return GeometryError(message, photos=tuple(inputs.cameras), code="no-control")


def _nothing_given(inputs: Inputs) -> bool:
    """Whether nothing ties the photos to the ground: a frame of their own is all they can have."""
    measured = set(inputs.observations.point_ids)
    control = inputs.control
    counts = control.use.any(axis=1) & ~control.check
    given = any(yes and name in measured for name, yes in zip(control.ids, counts.tolist(), strict=True))
    cameras = any(each is not None and each.photos for each in (inputs.positions, inputs.orientations))
    return not given and not cameras


def datum_notes(inputs: Inputs, ground: GroundFrames) -> Iterator[Note]:
    """Say by which operation coordinates go from one datum to another, and where an epoch is missing."""
    control = inputs.control
    sigma_of = {f"control[{number}]": control.sigma[control.frame == number] for number in range(len(ground.control))}
    frames = {f"control[{number}]": frame for number, frame in enumerate(ground.control)}
    for key, frame, given in zip(
        CAMERAS, (ground.positions, ground.orientations), (inputs.positions, inputs.orientations), strict=True
    ):
        if frame is not None and given is not None:
            frames[key], sigma_of[key] = frame, given.sigma
    for key, frame in frames.items():
        shift = frame.shift
        if shift is None:
            continue
        operation, title = shift.operation, f"{frame.title} to {ground.output.title}"
        epoch, reference = operation.epoch, operation.reference_epoch
        text = f"{key}: {title} by {operation}" + (f", made for {operation.area}" if operation.area else "")
        if reference is not None:
            text += f"; coordinates of {epoch or reference:.1f}"
        yield Note("datum-change", text, severity="note", key=f"{key}.crs")
        sigma = sigma_of[key][(sigma_of[key] > 0) & np.isfinite(sigma_of[key])]
        moved = shift.moved_per_year
        if epoch is None and len(sigma) and EPOCH_UNKNOWN * moved > np.median(sigma):
            text = (
                f"{key}: {title}: coordinates move by {100 * moved:.1f} cm a year between them, and no `epoch` is "
                f"given: that of the operation, {reference:.1f}, is taken"
            )
            yield Note("epoch-missing", text, key=f"{key}.epoch")


def curvature_notes(inputs: Inputs, settings: Settings, strips: Sequence[StripResult]) -> Iterator[Note]:
    """Say where a setting of Earth curvature changes nothing, and where local coordinates may lack it."""
    if curvature_left_out(inputs, settings):
        yield from _left_out(inputs, settings, strips)
    if settings.absolute.earth_curvature == "none" and inputs.frames and inputs.frames[0].crs != "local":
        text = (
            "`earth_curvature: none` has no effect here: the coordinates go through geocentric space, where the Earth "
            "is curved"
        )
        yield Note("curvature-in-frames", text, severity="note")


def curvature_left_out(inputs: Inputs, settings: Settings) -> bool:
    """Whether local coordinates are taken as they are, and nobody says that their plane is a true one."""
    return settings.absolute.earth_curvature == "auto" and bool(inputs.frames) and inputs.frames[0].crs == "local"


LEFT_OUT = "curvature-left-out"


def _left_out(inputs: Inputs, settings: Settings, strips: Sequence[StripResult]) -> Iterator[Note]:
    """Say by how much plane map coordinates would bend what is measured, where that is more than a height's error."""
    control = inputs.control
    plan = control.enu[control.use[:, 0] & ~control.check, :2]
    said = any(note.code == LEFT_OUT for strip in strips for note in strip.notes)  # it shows in one of them
    if len(plan) < 2 or not strips or said:
        return
    reach = float(np.hypot(*(plan - (plan.max(axis=0) + plan.min(axis=0)) / 2.0).T).max())
    fall = float(curvature_correction(reach, settings.absolute.earth_radius))
    if LEFT_BY_A_LEVEL_FIT * fall > min(strip.precision.height for strip in strips):
        text = (
            f"local coordinates are taken as they are: if they are plane map coordinates with heights, the Earth's "
            f"curvature is left out, {fall:.2f} m at {reach / 1000.0:.1f} km from the middle of the control; "
            "`earth_curvature: model` takes it into account, `earth_curvature: none` says that there is none"
        )
        yield Note(LEFT_OUT, text, severity="note", key="processing.earth_curvature")


@dataclass(frozen=True, eq=False)
class PhotoCoordinates:
    """Image points in the system of the photo."""

    observations: PhotoPoints
    interior: InteriorOrientation | None  # None where no fiducial marks were measured


def orient_interior(inputs: Inputs, settings: Settings) -> PhotoCoordinates:
    """Interior orientation, when fiducial marks were measured."""
    if inputs.fiducials is None:
        return PhotoCoordinates(inputs.observations, None)
    from photostrip.strip import interior

    orientation = interior.orient(inputs.fiducials, inputs.cameras, settings.interior)
    return PhotoCoordinates(interior.transform(inputs.observations, orientation), orientation)
