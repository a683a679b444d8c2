"""Given coordinates by the adjustment: what it predicts of them, and how well.

The gate compares given points with a strip whose bending it takes out roughly; what a long strip bends beyond that
looks like a slip. Where a run has come to a result, its points and their covariances decide. A bundle that has found
nothing wrong with the given points of a strip has compared them better than the gate could.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.notes import Finding
from photostrip.pipeline.given_points import rejected_control, rows_of_given
from photostrip.pipeline.inputs import MeasuredModels
from photostrip.pipeline.plausibility.evidence import EvidenceStrip
from photostrip.pipeline.plausibility.given_control import GivenControl
from photostrip.pipeline.results import Result
from photostrip.plausibility.control import given_points, point_slips
from photostrip.plausibility.control.plan_fit import ODD_PROBABILITY
from photostrip.points import locate
from photostrip.statistics import SIGMA_FROM_MEDIAN, normal_quantile

CODE = "P406"
OF_DOUBTED_CONTROL = {"control-doubtful", "control-rejected"}  # notes
LIMIT = normal_quantile(1 - ODD_PROBABILITY / 2)


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

    def spread(self, row: int, axis: int) -> float:
        """Give the standard deviation of a difference, larger where the others are predicted worse than by theirs."""
        columns = [2] if axis == point_slips.HEIGHT else [0, 1]
        ratio = np.abs(np.delete(self.off, row, axis=0) / np.delete(self.sigma, row, axis=0))[:, columns]
        known = ratio[np.isfinite(ratio)]
        excess = max(SIGMA_FROM_MEDIAN * np.median(known), 1.0) if len(known) else 1.0
        return float(self.sigma[row, axis]) * excess

    def stands_out(self, row: int, axis: int) -> bool:
        """Whether a coordinate that took no part is off by more than chance."""
        off = float(np.abs(self.off[row, axis]))
        return bool(not self.sound[row, axis] and off > LIMIT * self.spread(row, axis))


def is_doubtful(formed: EvidenceStrip, result: Result, predicted: Predicted) -> bool:
    """Whether the given points of a strip may be wrong: no bundle has seen them, or some do not agree with it."""
    if result.bundle is None:
        return True
    control = result.inputs.control
    shown = rows_of_given(control.ids, formed.formed.point, result.refined.observations.point_ids) >= 0
    return bool((shown & ~predicted.agree(control.use)).any())


def strips_with_kept_exchanges(
    findings: Iterable[Finding], predicted: Predicted, ids: Sequence[str]
) -> set[tuple[str, ...]]:
    """Give the strips of which the run kept exchanged points: what it says of their other points proves nothing."""
    exchanged = [each for each in findings if each.code == point_slips.EXCHANGED]
    return {each.strips for each in exchanged if np.isnan(predicted.off[locate(each.points, ids), :2]).any()}


def confirmed(findings: Sequence[Finding], predicted: Predicted, control: GivenControl) -> Iterator[Finding]:
    """Give findings again; slips only as far as the adjustment shows them too, as it predicts the coordinates."""
    ids = control.points.ids
    untested = strips_with_kept_exchanges(findings, predicted, ids)
    for each in findings:
        if each.code == CODE and "axis" in each.evidence and each.strips not in untested:  # a slip in one coordinate
            yield from _confirmed(each, ids.index(each.points[0]), predicted, control)
        else:
            yield each


def _tested(result: Result) -> Flags:
    """Given coordinates (c, 3) that the run could test for gross errors, and of which it doubts none."""
    settings, control = result.settings, result.inputs.control
    if result.bundle is not None:
        return np.full(control.use.shape, settings.bundle.screening != "none")
    tested = np.zeros(control.use.shape, bool)
    if (settings.links if result.model_strips else settings.relative).screening == "none":
        return tested
    for strip in result.strips:
        rows = locate(strip.control.ids, control.ids)
        tested[rows] |= np.isfinite(strip.screened_control.redundancy) | (strip.shared is not None)
    doubtful = {name for note in result.notes if note.code == "control-doubtful" for name in note.points}
    tested[[name in doubtful for name in control.ids]] = False
    return tested


def of_rejected(result: Result, predicted: Predicted, control: GivenControl) -> Iterator[Finding]:
    """Give the slips of control points of which a run called one coordinate wrong, and not an image.

    Where few heights are given, their bending hides from the gate what the strip's own precision shows.
    """
    ids = control.points.ids
    for note in result.notes:
        for name in note.points if note.code == "control-rejected" and note.strip else ():
            row = ids.index(name)
            odd = [axis for axis in range(3) if predicted.stands_out(row, axis)]
            if len(odd) == 1 and (slip := _slip(row, odd[0], note.strip, predicted, control)) is not None:
                yield slip


def of_models(result: Result, models: MeasuredModels, predicted: Predicted, control: GivenControl) -> Iterator[Finding]:
    """Give the slips of given points that stand out against the adjustment of models, in one coordinate.

    The strip bends more than the gate could take out: it is not asked.
    """
    for strip in result.model_strips:
        held = rows_of_given(control.points.ids, strip.formed.point, models.points.point_ids) >= 0
        for row in np.flatnonzero(held).tolist():
            odd = [axis for axis in range(3) if predicted.stands_out(row, axis)]
            if len(odd) == 1 and (slip := _slip(row, odd[0], strip.strip.id, predicted, control)) is not None:
                yield slip


def _confirmed(finding: Finding, row: int, predicted: Predicted, control: GivenControl) -> Iterator[Finding]:
    """Test a slip by a prediction; it stands as it is where the adjustment has none."""
    axis = GROUND_AXES.index(str(finding.evidence["axis"]))
    if predicted.sound[row, axis]:
        return
    off = float(predicted.off[row, axis])
    if not np.isfinite(off * predicted.sigma[row, axis]):
        yield finding
        return
    found = _slip(row, axis, finding.strips[0], predicted, control)
    if found is not None:
        doubt = point_slips.DOUBT if point_slips.DOUBT in finding.message else ""
        yield replace(found, message=f"{found.message}{doubt}")


def _slip(row: int, axis: int, strip: str, predicted: Predicted, control: GivenControl) -> Finding | None:
    """Name the slip that explains by how much a coordinate is off; None when none does."""
    given = given_points.level(control.points.take([row]), control.frames, as_written=control.as_written)
    if given is None:
        return None
    spread, off = predicted.spread(row, axis), float(predicted.off[row, axis])
    frame = control.frames[int(control.points.frame[row])]
    if frame.kind == "projected" and axis != point_slips.HEIGHT:  # by map coordinates: a map has a scale of its own
        off *= float(given.steps.unit[0, axis]) / frame.plan_factor
    return point_slips.slip_in(given, 0, axis, off, (spread, LIMIT * spread), strip)
