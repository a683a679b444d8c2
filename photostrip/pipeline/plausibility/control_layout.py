"""Where the control lies in what it has to hold: a strip of photos or models by itself, or a block of strips."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import Finding
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.inputs import Inputs, MeasuredModels, ModelStrip, Settings, Strip
from photostrip.pipeline.plausibility import evidence
from photostrip.pipeline.plausibility.evidence import ImageEvidence
from photostrip.pipeline.plausibility.given_control import GivenControl
from photostrip.pipeline.strips.models import LinkedModels, link_strip
from photostrip.plausibility import given_points
from photostrip.points import ControlPoints, concatenated
from photostrip.strip.model_strip import FormedModels

UP = np.array([0.0, 0.0, 1.0])  # of a strip of models with perspective centres


@dataclass(frozen=True, eq=False)
class ModelStripEvidence:
    """A strip of models with centres, and the given points in it."""

    strip: ModelStrip
    centers: Floats  # (f, 3): perspective centres of the photos that have one, in strip coordinates
    photos: tuple[str, ...]
    depth: Floats  # (f,): height of each above the points of its models
    rows: Numbers  # rows of the given points that the strip holds
    place: Floats  # place of each of them along the strip in bases, from 0 at the first photo
    breadth: float  # half breadth of the strip over its length


def form_strips(models: MeasuredModels, settings: Settings) -> Iterator[LinkedModels]:
    """Form the strips that can be formed, for evidence alone."""
    for strip in models.strips:
        try:
            yield link_strip(strip, models.points, settings)
        except (GeometryError, np.linalg.LinAlgError):
            continue


def model_strips(
    strips: Iterable[LinkedModels], point_ids: tuple[str, ...], control: ControlPoints
) -> Iterator[ModelStripEvidence]:
    """Collect what the gate looks at in strips that have two perspective centres."""
    for linked in strips:
        if np.isfinite(linked.formed.centers[:, 0]).sum() > 1:
            yield _evidence(linked.strip, linked.formed, control, point_ids)


def _evidence(
    strip: ModelStrip, formed: FormedModels, control: ControlPoints, point_ids: tuple[str, ...]
) -> ModelStripEvidence:
    known = np.flatnonzero(np.isfinite(formed.centers[:, 0]))
    centers, depth = formed.centers[known], _depths(formed)[known]
    places = rows_of_given(control.ids, formed.point, point_ids)
    rows = np.flatnonzero(places >= 0)
    xyz = formed.xyz[places[rows]]
    along = np.interp(xyz[:, 0], centers[:, 0], known.astype(float))
    length = max(float(np.ptp(centers[:, 0])), 1e-9)
    breadth = np.quantile(np.abs(formed.xyz[:, 1] - np.median(formed.xyz[:, 1])), 0.95) / length
    return ModelStripEvidence(
        strip=strip,
        centers=centers,
        photos=tuple(strip.photos[k] for k in known.tolist()),
        depth=depth,
        rows=rows,
        place=along,
        breadth=breadth,
    )


def _depths(formed: FormedModels) -> Floats:
    """Heights of the centres above the points of their models, strip coordinates; NaN without a centre."""
    models = formed.models
    point = (models.node < models.points) & formed.used
    count = np.bincount(models.model[point], minlength=models.count)
    ground = np.bincount(models.model[point], formed.model_xyz[point, 2], models.count) / np.maximum(count, 1)
    both = np.concatenate([ground[:1], (ground[1:] + ground[:-1]) / 2, ground[-1:]])
    return np.asarray(formed.centers[:, 2] - both)


def weak_layout(
    inputs: Inputs, settings: Settings, images: ImageEvidence, control: GivenControl | None, directory: Path | None
) -> Iterator[Finding]:
    """Look where the control lies: along each strip and across, or in the block that a bundle makes of all strips."""
    if control is None:
        return
    in_bundle = settings.together
    cameras = _cameras(inputs) if in_bundle else None
    strips = [strip for strip in images.strips if len(strip.photos) > 1]
    if in_bundle and (cameras is not None or len(images.strips) > 1):
        yield from _of_block(inputs, strips, images, control, cameras, directory)
        return
    for strip in strips:
        held = _of_photos(strip, images, control)
        yield from _of_strip(strip, held, _half_breadth(strip, images, held))


def weak_layout_of_models(held: ModelStripEvidence, control: GivenControl) -> Iterator[Finding]:
    """Look where the control of a strip of models lies along it and across."""
    in_plan = _in_plan(control, held.rows, held.place)
    breadth = float(held.breadth * np.linalg.norm(np.ptp(in_plan.plan, axis=0))) if in_plan.names else 0.0
    yield from _of_strip(held.strip, in_plan, breadth)


class HeldInPlan(NamedTuple):
    """Given points that hold the plan of a strip."""

    names: list[str]
    place: Floats  # along the strip
    plan: Floats  # (n, 2), metres


def _of_strip(strip: Strip | ModelStrip, held: HeldInPlan, breadth: float) -> Iterator[Finding]:
    yield from given_points.find_line(held.plan, breadth, held.names, f"strip {strip.id}", (strip.id,))
    yield from given_points.find_weak_ends(held.place, strip.photos, strip.id, held.names)


def _of_photos(strip: Strip, images: ImageEvidence, control: GivenControl) -> HeldInPlan:
    return _in_plan(control, *evidence.places_along_strip(strip, images.observations, control.points, images.steps))


def _in_plan(control: GivenControl, rows: Numbers, place: Floats) -> HeldInPlan:
    """Those of some given points that hold the plan."""
    counts = control.points.use[rows, 0] & ~control.points.check[rows]
    points = control.points.take(rows[counts])
    given = given_points.level(points, control.frames)
    if given is None:
        return HeldInPlan([], place[:0], np.zeros((0, 2)))
    return HeldInPlan(list(points.ids), place[counts], given.xyz[:, :2])


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
        points = concatenated([points, cameras.points])
    given = given_points.level(points, frames)
    if given is None:
        return
    plan = given.xyz[:, :2]
    halves = (_half_breadth(strip, images, _of_photos(strip, images, control)) for strip in strips)
    breadth = next((half for half in halves if half > 0), 0.0)
    what = f"strip {strips[0].id}" if len(strips) == 1 else "the block"
    yield from given_points.find_line(plan, breadth, names, what, [strip.id for strip in strips])


def _half_breadth(strip: Strip, images: ImageEvidence, held: HeldInPlan) -> float:
    return evidence.half_breadth(strip, images.observations, held.names, held.plan, held.place, images.steps)
