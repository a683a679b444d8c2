"""Where the control lies in what it has to hold: a strip of photos or models by itself, or a block of strips.

``steps`` everywhere holds, by photo, the centre of the next photo as it lies on that photo, mm.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import Finding
from photostrip.pipeline.evidence import ImageEvidence
from photostrip.pipeline.formed_models import LinkedModels, link_strip
from photostrip.pipeline.given_cameras import GivenCenters
from photostrip.pipeline.given_on_ground import GivenControl
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.inputs import Inputs, MeasuredModels, ModelStrip, Settings, Strip
from photostrip.plausibility import given_points
from photostrip.points import ControlPoints, concatenated, locate, located
from photostrip.strip.linked_models import FormedModels

BREADTH_SHARE = 0.95  # of the points lie within the half breadth of a strip
LEAST_RAYS = 2  # photos that must show a given point


@dataclass(frozen=True, eq=False)
class ModelStripEvidence:
    """A strip of models with centres, and the given points in it; lengths in the unit of the strip."""

    strip: ModelStrip
    centers: Floats  # (f, 3): perspective centres of the photos that have one
    photos: tuple[str, ...]
    depth: Floats  # (f,): height of each above the points of its models
    rows: Numbers  # (m,): rows of the given points that the strip holds
    place: Floats  # (m,): place of each of them along the strip in bases, from 0 at the first photo
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
        strip, formed = linked.strip, linked.formed
        known = np.flatnonzero(np.isfinite(formed.centers[:, 0]))
        if len(known) < 2:
            continue
        centers, places = formed.centers[known], rows_of_given(control.ids, formed.point, point_ids)
        rows = np.flatnonzero(places >= 0)
        off_axis = np.abs(formed.xyz[:, 1] - np.median(formed.xyz[:, 1]))
        yield ModelStripEvidence(
            strip=strip,
            centers=centers,
            photos=tuple(strip.photos[k] for k in known.tolist()),
            depth=_depths(formed)[known],
            rows=rows,
            place=np.interp(formed.xyz[places[rows], 0], centers[:, 0], known.astype(float)),
            breadth=np.quantile(off_axis, BREADTH_SHARE) / max(float(np.ptp(centers[:, 0])), 1e-9),
        )


def _depths(formed: FormedModels) -> Floats:
    """Heights of the centres above the points of their models, strip coordinates; NaN without a centre."""
    models = formed.models
    point = (models.node < models.points) & formed.used
    count = np.bincount(models.model[point], minlength=models.count)
    ground = np.bincount(models.model[point], formed.model_xyz[point, 2], models.count) / np.maximum(count, 1)
    both = np.concatenate([ground[:1], (ground[1:] + ground[:-1]) / 2, ground[-1:]])
    return np.asarray(formed.centers[:, 2] - both)


class PlanControl(NamedTuple):
    """Control that holds the plan of a strip."""

    ids: tuple[str, ...]
    place: Floats  # (n,): along the strip, bases
    plan: Floats  # (n, 2), metres

    @classmethod
    def of(cls, control: GivenControl, rows: Numbers, place: Floats) -> PlanControl:
        """Take those of some given points that count in plan; their places along a strip beside them."""
        counts = _counts(control.points)[rows]
        points = control.points.take(rows[counts])
        level = given_points.level(points, control.frames)
        if level is None:
            return cls((), place[:0], np.zeros((0, 2)))
        return cls(points.ids, place[counts], level.xyz[:, :2])


def _counts(points: ControlPoints) -> Flags:
    return np.asarray(points.use[:, 0] & ~points.check, bool)


def weak_layout(
    inputs: Inputs, settings: Settings, images: ImageEvidence, control: GivenControl | None, directory: Path | None
) -> Iterator[Finding]:
    """Look where the control lies: along each strip and across, or in the block that a bundle makes of all strips."""
    if control is None:
        return
    strips = [strip for strip in images.strips if len(strip.photos) > 1]
    cameras = next(GivenCenters.of_inputs(inputs, starts=False), None) if settings.together else None
    if cameras is not None and not cameras.photos:
        cameras = None
    if settings.together and (cameras is not None or len(images.strips) > 1):
        yield from _of_block(inputs, strips, images, control, cameras, directory)
        return
    for strip in strips:
        held = _of_photos(strip, images, control)
        yield from _of_strip(strip, held, _half_breadth(strip, images, held))


def weak_layout_of_models(held: ModelStripEvidence, control: GivenControl) -> Iterator[Finding]:
    """Look where the control of a strip of models lies along it and across."""
    in_plan = PlanControl.of(control, held.rows, held.place)
    breadth = float(held.breadth * np.linalg.norm(np.ptp(in_plan.plan, axis=0))) if in_plan.ids else 0.0
    yield from _of_strip(held.strip, in_plan, breadth)


def _of_strip(strip: Strip | ModelStrip, held: PlanControl, breadth: float) -> Iterator[Finding]:
    yield from given_points.find_line(held.plan, breadth, held.ids, f"strip {strip.id}", (strip.id,))
    yield from given_points.find_weak_ends(held.place, strip.photos, strip.id, held.ids)


def _of_block(
    inputs: Inputs,
    strips: Sequence[Strip],
    images: ImageEvidence,
    control: GivenControl,
    cameras: GivenCenters | None,
    directory: Path | None,
) -> Iterator[Finding]:
    """Look whether all that is known on the ground stands on one line; cameras hold a block as control does.

    cameras: those whose position is given in full and takes part.
    """
    shown = np.isin(control.points.ids, images.observations.point_ids)
    points, frames = control.points.take(np.flatnonzero(shown & _counts(control.points))), list(control.frames)
    ids = points.ids
    if cameras is not None:
        try:
            frames, _ = tie_frames([*inputs.frames, cameras.frame], inputs.output, directory=directory)
        except (GeometryError, InputError):
            return
        points = concatenated([points, cameras.as_control(len(inputs.frames))])
    level = given_points.level(points, frames)
    if level is None:
        return
    halves = (_half_breadth(strip, images, _of_photos(strip, images, control)) for strip in strips)
    breadth = next((half for half in halves if half > 0), 0.0)
    names = [strip.id for strip in strips]
    what = f"strip {names[0]}" if len(names) == 1 else "the block"
    yield from given_points.find_line(level.xyz[:, :2], breadth, ids, what, names)


def _of_photos(strip: Strip, images: ImageEvidence, control: GivenControl) -> PlanControl:
    """Control that at least two photos of a strip show; its place along the strip is the mean of what they say."""
    observations = images.observations
    position, (step, known) = strip.positions(observations), _steps(strip, images.steps)
    rows = np.flatnonzero(position >= 0)
    usual = complex(np.median(step[known].real), np.median(step[known].imag)) if known.any() else 1.0
    step = np.where(known, step, usual)[position[rows]]
    along = (observations.xy[rows] * np.column_stack([step.real, step.imag])).sum(axis=1) / np.abs(step) ** 2
    along = position[rows] + (along if known.any() else 0.0)
    count = np.bincount(observations.point[rows], minlength=len(observations.point_ids))
    total = np.bincount(observations.point[rows], along, len(observations.point_ids))
    numbers = located(control.points.ids, observations.point_ids)
    given = np.flatnonzero((numbers >= 0) & (count[numbers] >= LEAST_RAYS))
    return PlanControl.of(control, given, total[numbers[given]] / count[numbers[given]])


def _steps(strip: Strip, steps: Mapping[str, complex]) -> tuple[NDArray[np.complex128], Flags]:
    """Return the steps to the next photos (n,), and of which photos they are known."""
    step = np.array([steps.get(photo, complex("nan")) for photo in strip.photos])
    return step, np.isfinite(step) & (step != 0)


def _half_breadth(strip: Strip, images: ImageEvidence, held: PlanControl) -> float:
    """Half the breadth of a strip, metres; 0 where two given points do not tell its scale.

    The scale is that of photos that show two given points or more, or else that of the bases between given points.
    """
    observations, (step, known) = images.observations, _steps(strip, images.steps)
    inside = strip.positions(observations) >= 0
    angle = float(np.angle((step[known] / np.abs(step[known])).sum()))  # of the flight on the photos
    half = np.quantile(np.abs(observations.xy[inside] @ [-np.sin(angle), np.cos(angle)]), BREADTH_SHARE)
    given = locate(observations.point_ids, held.ids)[observations.point]
    rows = np.flatnonzero(inside & (given >= 0))
    rows = rows[np.argsort(observations.photo[rows], kind="stable")]
    one, other = rows[:-1], rows[1:]
    same = (observations.photo[one] == observations.photo[other]) & (given[one] != given[other])
    one, other = one[same], other[same]
    image = np.linalg.norm(observations.xy[one] - observations.xy[other], axis=1)
    ground = np.linalg.norm(held.plan[given[one]] - held.plan[given[other]], axis=1)
    if not (image > 0).any():
        order = np.argsort(held.place, kind="stable")
        bases = np.abs(step[step != 0])  # NaN, and so no breadth, where one is not known
        image = np.diff(held.place[order]) * (np.median(bases) if len(bases) else 0.0)
        ground = np.linalg.norm(np.diff(held.plan[order], axis=0), axis=1)
    good = image > 0
    return half * np.median(ground[good] / image[good]) if good.any() else 0.0
