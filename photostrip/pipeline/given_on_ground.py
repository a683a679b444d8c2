"""Given coordinates: where they lie on the Earth, how they go with each formed strip, what an adjustment says of them.

Check points, and what the search took out, are predicted by all that took part.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.crs import areas_of_use
from photostrip.geodesy.frame_spec import GROUND_AXES, FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import Finding
from photostrip.pipeline import control_readings, shared_errors
from photostrip.pipeline.control_readings import Reading
from photostrip.pipeline.evidence import HeldStrip, OnControl
from photostrip.pipeline.formed_models import LinkedModels
from photostrip.pipeline.formed_photos import FormedPhotos
from photostrip.pipeline.given_points import rejected_control, rows_of_given
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.results import Result
from photostrip.plausibility import given_points, units
from photostrip.plausibility.given_points import LIMIT
from photostrip.points import ControlPoints, locate
from photostrip.statistics import SIGMA_FROM_MEDIAN
from photostrip.strip.control_screening import HEIGHT

PLAIN = FrameSpec("local", GROUND_AXES)
NEAR_BY = 0.3  # of a base, or of how far off it is elsewhere, within which a camera position is that of its photo


@dataclass(frozen=True, eq=False)
class GivenControl:
    """Control and check points with their frames, and what their place on the Earth says of how to read them."""

    points: ControlPoints
    frames: Sequence[GroundFrame]
    findings: tuple[Finding, ...]  # P401, P402, P403, by the place alone
    as_written: bool  # whether the frames cannot be right, so that the numbers count as plain metres
    axes_are_right: bool | None  # None where the place does not say
    inputs: Inputs

    @classmethod
    def placed(cls, inputs: Inputs, frames: Sequence[GroundFrame], directory: Path | None) -> Self:
        """Find out where given points lie on the Earth, list by list."""
        control = inputs.control
        places = [
            units.find_wrong_place(
                frame,
                areas_of_use(inputs.frames[number], directory=directory),
                control.enu[(control.frame == number) & control.use[:, 0]],
                number,
            )
            for number, frame in enumerate(frames)
        ]
        sure = {place.sure for place in places}
        return cls(
            control,
            frames,
            findings=tuple(finding for place in places for finding in place.findings),
            as_written=not any(place.inside for place in places),
            axes_are_right=sure.pop() if len(sure) == 1 else None,
            inputs=inputs,
        )

    @cached_property
    def read_in(self) -> Sequence[GroundFrame]:
        """Frames in which strips are laid on the points: plain ones where their own cannot be right."""
        return tie_frames([PLAIN] * len(self.frames))[0] if self.as_written else self.frames


class OfStrip(NamedTuple):
    """What a formed strip says of the given points that it shows."""

    whole: Sequence[Finding] = ()  # of all of them, or of a list: P103, P105, P107, P401 to P410
    slips: Sequence[Finding] = ()  # of single ones: P406, P408
    mirrored: Sequence[Finding] = ()  # that it fits as its mirror image, without the cause
    confirmed: frozenset[int] = frozenset()  # control lists that it fits as they are given
    with_positions: bool | None = None  # of a mirrored one: whether camera positions go with the control, or exchanged


def of_strip(control: GivenControl, stage: FormedPhotos | LinkedModels, settings: Settings) -> OfStrip:
    """Compare the given points with a formed strip, as they are given and as they may be read."""
    points = control.points
    held = HeldStrip.of(stage, points, settings)
    if not len(held.given):
        return OfStrip()
    as_given = held.read(points, control.read_in, as_given=True)
    whole = control_readings.of_heights(held, as_given)
    if whole:
        return OfStrip(whole)
    better = control_readings.find_reading(held, points, control.read_in, as_given)
    if better is not None:
        reading, named = better.reading, [control_readings.named(better, as_given, held, control.frames)]
        if reading.mirrored:
            slips = _slips(control, held, better.laid, reading)
            return OfStrip((), slips, named, with_positions=_with_positions(control, held, better.laid))
        return OfStrip(named, [] if reading.rows else _slips(control, held, better.laid, reading, named[0].points))
    whole = control_readings.of_whole_control(held, as_given, points, control.read_in)
    whole = whole or ([] if as_given is None else shared_errors.of_formed(as_given, stage))
    if as_given is None or not as_given.fits:
        return OfStrip(whole)
    slips = [] if whole else _slips(control, held, as_given, control_readings.AS_GIVEN)
    return OfStrip(whole, slips, confirmed=frozenset(points.frame[held.given].tolist()))


def _slips(
    control: GivenControl, held: HeldStrip, laid: OnControl, reading: Reading, beside: Sequence[str] = ()
) -> list[Finding]:
    """Name slips of single given points under a reading; not of the points of a list that lies beside the others."""
    given = given_points.level(control.points.take(held.given), control.frames, as_written=control.as_written)
    if given is None:
        return []
    off, sigma = laid.off
    off = reading.as_written(off, signed=True) + given.moved * given.steps.unit
    off[[given.ids.index(name) for name in beside]] = np.nan
    sigma = reading.as_written(sigma, signed=False)
    return list(given_points.find_slips(given, off, sigma, (held.stage.strip.id,)))


def _with_positions(control: GivenControl, held: HeldStrip, mirrored: OnControl) -> bool | None:
    """Whether camera positions lie where a mirrored strip has its photos on the control as it is given.

    Returns False where they lie over the control with its plan axes exchanged, and None where nothing tells.
    """
    given, photos = control.inputs.positions, held.stage.strip.photos
    if given is None or control.as_written:
        return None
    rows = locate(photos, given.photos)
    shown = (rows >= 0) & given.use[rows].all(axis=1)
    exchanged = held.read(control_readings.PLAN_EXCHANGED(control.points), control.frames)
    try:
        tied, _ = tie_frames([given.frame, *control.inputs.frames], control.inputs.output or given.frame)
        positions = tied[0].cartesian_from_ground(given.enu[rows[shown]])
    except (GeometryError, InputError):
        return None
    off = []  # in bases
    for laid in (mirrored, exchanged):
        if laid is None or not shown.any():
            return None
        centers = laid.oriented.intermediate.cartesian_from_intermediate(laid.centers)
        base = np.median(np.linalg.norm(np.diff(centers, axis=0), axis=1))
        off.append(np.median(np.linalg.norm(centers[shown] - positions, axis=1)) / base)
    is_told = min(off) < NEAR_BY * min(max(off), 1.0)  # a flight along north-east lies where it lay
    return bool(off[0] < off[1]) if is_told else None


def of_strips(
    control: GivenControl, stages: Iterable[FormedPhotos | LinkedModels], settings: Settings
) -> tuple[list[Finding], list[Finding]]:
    """Compare the given points with all formed strips: what all of them show, and slips of single ones."""
    all_strips = [of_strip(control, each, settings) for each in stages]
    mirrored = [finding for each in all_strips for finding in each.mirrored if control.axes_are_right is not False]
    shown = locate([name for each in mirrored for name in each.points], control.points.ids)
    confirmed = frozenset[int]().union(*(each.confirmed for each in all_strips))
    whole = control_readings.of_mirrored(
        mirrored,
        control.inputs,
        control.frames,
        in_place=control.axes_are_right is True,
        others_fit=not confirmed.isdisjoint(control.points.frame[shown].tolist()),
        with_positions=next((each.with_positions for each in all_strips if each.with_positions is not None), None),
    )
    whole += [finding for each in all_strips for finding in each.whole]
    return whole, [finding for each in all_strips for finding in each.slips]


@dataclass(frozen=True, eq=False)
class Predicted:
    """Given coordinates as an adjustment in which they took no part predicts them, worked out when it is asked for.

    Check points and rejected control are predicted.
    """

    result: Result

    @cached_property
    def _used(self) -> Flags:
        """Control coordinates (c, 3) that took part."""
        result, control = self.result, self.result.inputs.control
        rejected = rejected_control(result)
        for strip in result.model_strips:
            rows = locate(strip.control.ids, control.ids)
            rejected[rows] |= control.use[rows] & ~strip.control.use
        used = control.use & ~control.check[:, None] & ~rejected & (result.control_rows >= 0)[:, None]
        return np.asarray(used, bool)

    @cached_property
    def off(self) -> Floats:
        """Given minus predicted (c, 3), metres along the axes of each point's frame; NaN where not known."""
        return np.where(self._used, np.nan, -self.result.control_differences)

    @cached_property
    def sigma(self) -> Floats:
        """Standard deviations (c, 3) of these differences; NaN without a precision."""
        result, control, precision = self.result, self.result.inputs.control, self.result.precision
        sigma = np.full(control.use.shape, np.nan)
        for number, frame in enumerate(result.frames):
            rows = np.flatnonzero((control.frame == number) & (result.control_rows >= 0))
            if len(rows) and precision is not None:
                at = result.control_rows[rows]
                axes = frame.axes_at(result.points.cartesian[at])
                with np.errstate(invalid="ignore"):  # a variance lost to rounding is not known
                    sigma[rows] = np.sqrt(np.einsum("nai,nij,naj->na", axes, precision.points[at], axes))
        return np.asarray(np.hypot(sigma, np.where(control.sigma > 0, control.sigma, 0.0)), float)

    @cached_property
    def sound(self) -> Flags:
        """Control coordinates (c, 3) that took part: the run tested them and found them right."""
        return self._used & _tested(self.result)

    def agree(self, use: Flags) -> Flags:
        """Given points (c,) whose coordinates `use` (c, 3) the adjustment predicts, or tested and kept."""
        near = np.abs(self.off) <= LIMIT * self.sigma
        return np.asarray((self.sound | near | ~use).all(axis=1))

    @cached_property
    def spread(self) -> Floats:
        """Standard deviations (c, 3), larger where the others are predicted worse than by theirs."""
        ratio, spread = np.abs(self.off / self.sigma), np.array(self.sigma)
        for columns in ([0, 1], [HEIGHT]):
            odd = ratio[:, columns] > LIMIT
            for row in np.flatnonzero(odd.any(axis=1)).tolist():
                others = np.delete(ratio, row, axis=0)[:, columns]
                others = others[np.isfinite(others)]
                spread[row, columns] *= max(SIGMA_FROM_MEDIAN * np.median(others), 1.0) if len(others) else 1.0
        return spread


def is_doubtful(stage: FormedPhotos, result: Result, predicted: Predicted) -> bool:
    """Whether the given points of a strip may be wrong: no bundle has seen them, or some do not agree with it."""
    if result.bundle is None:
        return True
    control = result.inputs.control
    shown = rows_of_given(control.ids, stage.formed.point, result.refined.observations.point_ids) >= 0
    return bool((shown & ~predicted.agree(control.use)).any())


def _tested(result: Result) -> Flags:
    """Given coordinates (c, 3) that the run could test for gross errors, and of which it doubts none."""
    settings, control = result.settings, result.inputs.control
    tested = np.full(control.use.shape, result.bundle is not None and settings.bundle.screening != "none")
    if result.bundle is None and (settings.links if result.model_strips else settings.relative).screening != "none":
        for strip in result.strips:
            rows = locate(strip.control.ids, control.ids)
            tested[rows] |= np.isfinite(strip.screened_control.redundancy)
    doubtful = {name for note in result.notes if note.code == "control-doubtful" for name in note.points}
    tested[[name in doubtful for name in control.ids]] = False
    return tested


def of_result(result: Result, predicted: Predicted, control: GivenControl) -> Iterator[Finding]:
    """Name slips of given coordinates that the adjustment predicts, and that took no part or were not tested."""
    given = given_points.level(control.points, control.frames, as_written=control.as_written)
    if given is None or result.precision is None:
        return
    asked = np.isfinite(predicted.off) & ~predicted.sound
    if not (asked & (np.abs(predicted.off) > LIMIT * predicted.sigma)).any() and not given.moved.any():
        return  # what the axes are where they are written takes long to say
    unit = np.array([[frame.plan_factor, frame.plan_factor, frame.height_factor] for frame in control.frames])
    projected = np.array([frame.kind == "projected" for frame in control.frames])[control.points.frame]
    # differences count by map coordinates: a map has a scale of its own
    scale = np.where(projected[:, None], given.steps.unit / unit[control.points.frame], 1.0)
    scale[:, HEIGHT] = 1.0
    yield from given_points.find_slips(given, predicted.off * scale, predicted.spread, asked=asked)
