"""Given coordinates: where they lie on the Earth, and how they go with each formed strip.

Given coordinates by the adjustment: what it predicts of them, and how well.

Check points, and what the search took out, are predicted by all that took part.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.geodesy.crs import areas_of_use
from photostrip.geodesy.frame_spec import GROUND_AXES, FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import Finding
from photostrip.pipeline.given_points import rejected_control, rows_of_given
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.plausibility import control_readings, shared_errors
from photostrip.pipeline.plausibility.on_control import HeldStrip
from photostrip.pipeline.results import Result
from photostrip.pipeline.strips.models import LinkedModels
from photostrip.pipeline.strips.photos import FormedPhotos
from photostrip.plausibility import given_points, slips, wrong_place
from photostrip.plausibility.slips import HEIGHT, LIMIT
from photostrip.points import ControlPoints, locate
from photostrip.statistics import SIGMA_FROM_MEDIAN

PLAIN = FrameSpec("local", GROUND_AXES)


@dataclass(frozen=True, eq=False)
class GivenControl:
    """Control and check points with their frames, and what their place on the Earth says of how to read them."""

    points: ControlPoints
    frames: Sequence[GroundFrame]
    findings: tuple[Finding, ...]  # P401, P402, P403, by the place alone
    as_written: bool  # whether the frames cannot be right, so that the numbers count as plain metres
    axes_are_right: bool | None  # None where the place does not say

    @classmethod
    def placed(cls, inputs: Inputs, frames: Sequence[GroundFrame], directory: Path | None) -> Self:
        """Find out where given points lie on the Earth, list by list."""
        control = inputs.control
        places = [
            wrong_place.find_wrong_place(
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
        )

    @cached_property
    def read_in(self) -> Sequence[GroundFrame]:
        """Frames in which strips are laid on the points: plain ones where their own cannot be right."""
        return tie_frames([PLAIN] * len(self.frames))[0] if self.as_written else self.frames


@dataclass(frozen=True)
class OfStrip:
    """What a formed strip says of the given points that it shows."""

    whole: list[Finding] = field(default_factory=list)  # of all of them, or of a list: P103, P105, P107, P401 to P410
    slips: list[Finding] = field(default_factory=list)  # of single ones: P406, P408


def of_strip(control: GivenControl, stage: FormedPhotos | LinkedModels, settings: Settings) -> OfStrip:
    """Compare the given points with a formed strip, as they are given and as they may be read."""
    strip, points = stage.strip.id, control.points
    held = HeldStrip.of(stage, points, settings)
    if not len(held.given):
        return OfStrip()
    as_given = held.read(points, control.read_in, as_given=True)
    whole = control_readings.of_heights(held, as_given)
    if whole:
        return OfStrip(whole)
    better = control_readings.find_reading(held, points, control.read_in, as_given)
    if better is not None:
        whole.append(control_readings.named(better, as_given, held, axes_are_right=control.axes_are_right))
    else:
        whole += control_readings.of_whole_control(held, as_given, points, control.read_in)
        whole += [] if whole or as_given is None else shared_errors.of_formed(as_given, stage)
    laid, reading = (as_given, control_readings.AS_GIVEN) if better is None else (better.laid, better.reading)
    if laid is None or not laid.fits or reading.rows or (whole and better is None):
        return OfStrip(whole)
    given = given_points.level(points.take(held.given), control.frames, as_written=control.as_written)
    if given is None:
        return OfStrip(whole)
    off, sigma = laid.off
    off = reading.as_written(off, signed=True) + given.moved * given.steps.unit
    named = [given.ids.index(name) for name in whole[0].points] if whole else []
    off[named] = np.nan  # of a list that lies beside the others
    return OfStrip(whole, list(slips.find_slips(given, off, reading.as_written(sigma, signed=False), (strip,))))


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
    yield from slips.find_slips(given, predicted.off * scale, predicted.spread, asked=asked)
