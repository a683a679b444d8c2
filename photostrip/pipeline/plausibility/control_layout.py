"""Where the control lies in what it has to hold: a strip by itself, or a block whose strips hold each other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.frozen import NamedTuple
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import Finding
from photostrip.pipeline.inputs import Inputs, ModelStrip, Settings, Strip
from photostrip.pipeline.plausibility import evidence
from photostrip.pipeline.plausibility.given_control import GivenControl
from photostrip.pipeline.plausibility.image_evidence import ImageEvidence
from photostrip.points import ControlPoints
from photostrip.triangulation.plausibility.control import given_points, layout

if TYPE_CHECKING:
    from photostrip.pipeline.plausibility.model_evidence import ModelStripEvidence


def weak_layout(
    inputs: Inputs, settings: Settings, images: ImageEvidence, control: GivenControl | None, directory: Path | None
) -> Iterator[Finding]:
    """Look where the control lies: along each strip and across, or in the block that a bundle makes of all strips."""
    if control is None:
        return
    in_bundle = settings.adjustment == "bundle"
    cameras = _cameras(inputs) if in_bundle else None
    strips = [strip for strip in images.strips if len(strip.photos) > 1]
    if in_bundle and (cameras is not None or len(images.strips) > 1):
        yield from _of_block(inputs, strips, images, control, cameras, directory)
        return
    for strip in strips:
        rows, place = evidence.places_along_strip(strip, images.observations, control.points, images.steps)
        rows, place, plan = _in_plan(control, rows, place)
        names = [control.points.ids[row] for row in rows]
        breadth = evidence.half_breadth(strip, images.observations, names, plan, place, images.steps)
        yield from _of_strip(strip, names, place, plan, breadth)


def weak_layout_of_models(held: ModelStripEvidence, control: GivenControl) -> Iterator[Finding]:
    """Look where the control of a strip of models lies along it and across."""
    rows, place, plan = _in_plan(control, held.rows, held.place)
    breadth = float(held.breadth * np.linalg.norm(np.ptp(plan, axis=0))) if len(rows) else 0.0
    yield from _of_strip(held.strip, [control.points.ids[row] for row in rows], place, plan, breadth)


def _of_strip(
    strip: Strip | ModelStrip, names: list[str], place: Floats, plan: Floats, breadth: float
) -> Iterator[Finding]:
    yield from layout.find_line(plan, breadth, names, f"strip {strip.id}", (strip.id,))
    yield from layout.find_weak_ends(place, strip.photos, strip.id, names)


def _in_plan(control: GivenControl, rows: Numbers, place: Floats) -> tuple[Numbers, Floats, Floats]:
    """Those of some given points that hold the plan: rows, places along the strip, plan coordinates in metres."""
    counts = control.points.use[rows, 0] & ~control.points.check[rows]
    given = given_points.level(control.points.take(rows[counts]), control.frames)
    if given is None:
        return rows[:0], place[:0], np.zeros((0, 2))
    return rows[counts], place[counts], given.xyz[:, :2]


class HeldCameras(NamedTuple):
    """Cameras whose position takes part in a bundle."""

    points: ControlPoints  # as if they were control
    frame: FrameSpec


def _cameras(inputs: Inputs) -> HeldCameras | None:
    """Cameras whose position is given in full and takes part in a bundle; None without any."""
    positions, orientations = inputs.positions, inputs.orientations
    if positions is not None:
        photos, enu, frame = positions.photos, positions.enu, positions.frame
        whole = np.asarray(positions.use.all(axis=1), bool)
    elif orientations is not None and orientations.observed:
        photos, enu, frame = orientations.photos, orientations.enu, orientations.frame
        whole = np.asarray(np.isfinite(enu).all(axis=1), bool)
    else:
        return None
    points = ControlPoints(
        ids=photos,
        enu=enu,
        use=np.repeat(whole[:, None], 3, axis=1),
        check=np.zeros(len(enu), bool),
        sigma=np.full(enu.shape, np.nan),
        frame=np.full(len(enu), len(inputs.frames)),
    )
    return HeldCameras(points.take(whole), frame) if whole.any() else None


def _of_block(
    inputs: Inputs,
    strips: list[Strip],
    images: ImageEvidence,
    control: GivenControl,
    cameras: HeldCameras | None,
    directory: Path | None,
) -> Iterator[Finding]:
    """Look whether all that is known on the ground stands on one line; cameras hold a block as control does."""
    shown = np.isin(control.points.ids, images.observations.point_ids)
    rows = np.flatnonzero(shown & control.points.use[:, 0] & ~control.points.check)
    points, frames = control.points.take(rows), list(control.frames)
    names = points.ids
    if cameras is not None:
        try:
            frames, _ = tie_frames([*inputs.frames, cameras.frame], inputs.output, directory=directory)
        except (GeometryError, InputError):
            return
        points = _joined(points, cameras.points)
    given = given_points.level(points, frames)
    if given is None:
        return
    plan = given.xyz[:, :2]
    breadth = next((half for strip in strips if (half := _half_breadth(strip, images, control)) > 0), 0.0)
    what = f"strip {strips[0].id}" if len(strips) == 1 else "the block"
    yield from layout.find_line(plan, breadth, names, what, [strip.id for strip in strips])


def _half_breadth(strip: Strip, images: ImageEvidence, control: GivenControl) -> float:
    rows, place = evidence.places_along_strip(strip, images.observations, control.points, images.steps)
    rows, place, plan = _in_plan(control, rows, place)
    names = [control.points.ids[row] for row in rows]
    return evidence.half_breadth(strip, images.observations, names, plan, place, images.steps)


def _joined(one: ControlPoints, other: ControlPoints) -> ControlPoints:
    return ControlPoints(
        ids=(*one.ids, *other.ids),
        enu=np.concatenate([one.enu, other.enu]),
        use=np.concatenate([one.use, other.use]),
        check=np.concatenate([one.check, other.check]),
        sigma=np.concatenate([one.sigma, other.sigma]),
        frame=np.concatenate([one.frame, other.frame]),
    )
