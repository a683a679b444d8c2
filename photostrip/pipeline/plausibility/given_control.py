"""Given coordinates: where they lie on the Earth, and how they go with each strip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Self

from photostrip.arrays import Numbers
from photostrip.geodesy.crs import areas_of_use
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.notes import Finding
from photostrip.pipeline.inputs import Inputs, Strip
from photostrip.pipeline.plausibility import distance_trial, evidence
from photostrip.pipeline.plausibility.evidence import EvidenceStrip
from photostrip.pipeline.plausibility.image_evidence import ImageEvidence
from photostrip.plausibility.control import (
    given_points,
    wrong_heights,
    wrong_place,
    wrong_readings,
)
from photostrip.plausibility.control.straightening import GivenPoints, StripPoints
from photostrip.points import ControlPoints


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

    def compared(self, rows: Numbers, on_strip: StripPoints) -> wrong_readings.Reading:
        """Compare the given points of some rows with the same points in a strip."""
        points = self.points.take(rows)
        given = given_points.level(points, self.frames, as_written=self.as_written)
        if given is None:
            return wrong_readings.Reading([])

        def exchanged() -> GivenPoints | None:
            order = [1, 0, 2]
            other = replace(points, enu=points.enu[:, order], use=points.use[:, order])
            return given_points.level(other, self.frames)

        return wrong_readings.find_wrong_readings(
            given, on_strip, axes_are_right=self.axes_are_right, exchanged=exchanged
        )


def by_strip(
    control: GivenControl,
    images: ImageEvidence,
    strips: Sequence[Strip],
    formed: Sequence[EvidenceStrip | None],
    tried: Mapping[str, bool],
) -> list[Finding]:
    """Compare given coordinates with each strip: the formed one, or else the mosaic of its photos.

    formed: the same strips, as far as they could be formed.
    tried: ids of the strips that may be formed anew with other principal distances, and whether all their control
        shows stretched heights.
    """
    findings: list[Finding] = []
    for strip, each in zip(strips, formed, strict=True):
        readings = _of_strip(strip, each, images, control)
        of_strip = [finding for reading in readings for finding in reading.findings]
        errors = {finding.code for finding in of_strip if finding.is_error}
        if (
            errors == {wrong_readings.NO_FIT}
            and each is not None
            and distance_trial.pairs_ask(each, images.observations)
        ):
            errors = set()  # a strip that a wrong distance tears apart fits no control
        if strip.id in tried and not errors:
            whole = readings[0].heights if len(readings) == 1 and not control.as_written else None
            # where the distance is wrong, single points prove nothing
            stretch = wrong_heights.stretch_of(whole)
            of_strip = _of_distance(strip, each, stretch, images, control, stretched=tried[strip.id]) or of_strip
        findings += of_strip
    return findings


def _of_strip(
    strip: Strip, formed: EvidenceStrip | None, images: ImageEvidence, control: GivenControl
) -> list[wrong_readings.Reading]:
    if formed is None:
        held = evidence.mosaic_points(strip, images.observations, control.points, images.steps)
        return [] if held is None else [control.compared(*held)]
    rows, on_strip = evidence.strip_points(formed, images.observations, control.points, images.steps)
    return [control.compared(*part) for part in evidence.stretches(rows, on_strip)]


def _of_distance(
    strip: Strip,
    formed: EvidenceStrip | None,
    stretch: wrong_heights.HeightStretch | None,
    images: ImageEvidence,
    control: GivenControl,
    *,
    stretched: bool,
) -> list[Finding]:
    compare = partial(_compared_in_height, images=images, control=control)
    if formed is not None:
        return distance_trial.find_wrong_distance(
            formed,
            stretch,
            images.observations,
            control.points.ids,
            images.settings,
            compare,
            stretched=stretched,
        )
    if images.findings:
        return []
    return distance_trial.find_distance_without_pairs(
        strip, images.observations, control.points.ids, images.settings, compare
    )


def _compared_in_height(
    formed: EvidenceStrip, images: ImageEvidence, control: GivenControl
) -> wrong_heights.HeightStretch | None:
    rows, on_strip = evidence.strip_points(formed, images.observations, control.points, images.steps)
    given = given_points.level(control.points.take(rows), control.frames)
    return None if given is None else wrong_heights.height_stretch(given, on_strip)
