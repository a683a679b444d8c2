"""Given coordinates: where they lie on the Earth, and how they go with each formed strip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from photostrip.geodesy.crs import areas_of_use
from photostrip.geodesy.frame_spec import GROUND_AXES, FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import Finding
from photostrip.pipeline.inputs import Inputs, Settings
from photostrip.pipeline.plausibility import control_readings, shared_control
from photostrip.pipeline.plausibility.on_control import HeldStrip
from photostrip.pipeline.strips.models import LinkedModels
from photostrip.pipeline.strips.photos import FormedPhotos
from photostrip.plausibility.control import given_points, slips, wrong_place
from photostrip.points import ControlPoints

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
        whole += [] if whole or as_given is None else shared_control.of_formed(as_given, stage)
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
