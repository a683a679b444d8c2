"""What a run refuses before anything is computed: settings and inputs that contradict each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.pipeline.inputs import ADJUSTMENTS, Inputs, Settings


def require_runnable(inputs: Inputs, settings: Settings) -> None:
    """Refuse an adjustment that does not exist, and photos in tables that no strip has."""
    if settings.adjustment not in ADJUSTMENTS:
        message = f"adjustment {settings.adjustment!r} is not available"
        known = " or ".join(ADJUSTMENTS)
        raise InputError(Fault(message, "not-available", key="processing.adjustment", expected=known))
    positions, orientations = inputs.positions, inputs.orientations
    tables = {
        "is measured": inputs.observations.photo_ids,
        "has a given position": () if positions is None else positions.photos,
        "has a given orientation": () if orientations is None else orientations.photos,
    }
    flown = {photo for flight in inputs.flights for photo in flight.photos}
    for what, photos in tables.items():
        if stray := [photo for photo in photos if photo not in flown]:
            message = f"photo {stray[0]} {what} but belongs to no strip ({len(stray)} such photos)"
            raise InputError(Fault(message, code="photo-without-strip", key="strips"))


def require_whole(inputs: Inputs, frames: Sequence[GroundFrame]) -> None:
    """Refuse points of which half a plan position counts, or some of X, Y and Z, which are neither plan nor height."""
    control = inputs.control
    if not frames:
        return
    geocentric = np.array([frame.kind == "geocentric" for frame in frames])[control.frame]
    part = control.use.any(axis=1) & ~control.use.all(axis=1)
    half = control.use[:, 0] != control.use[:, 1]
    faults = [
        Fault(
            f"point {control.ids[row]} is geocentric, and only some of its coordinates count",
            code="geocentric-use",
            key=f"control[{control.frame[row]}]",
            expected="`use: xyz` or `off`: X, Y and Z are neither plan nor height",
        )
        for row in np.flatnonzero(part & geocentric).tolist()
    ]
    faults += [
        Fault(
            f"of point {control.ids[row]} one plan coordinate counts without the other",
            code="half-plan-use",
            key=f"control[{control.frame[row]}]",
            expected="both, `use: xyz` or `xy`, or neither, `z` or `off`",
        )
        for row in np.flatnonzero(half & ~geocentric).tolist()
    ]
    if faults:
        raise InputError(faults)


def refuse_curvature_twice(inputs: Inputs, settings: Settings) -> None:
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
