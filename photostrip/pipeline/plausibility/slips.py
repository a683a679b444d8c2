"""Slips of the pen by the adjustment: what it predicts of a given coordinate, and how well.

The gate compares given points with a strip whose bending it takes out roughly; what a long strip bends beyond that
looks like a slip. Where a run has come to a result, its points and their covariances decide.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.pipeline.given_points import rejected_control
from photostrip.points import locate
from photostrip.statistics import SIGMA_FROM_MEDIAN, normal_quantile
from photostrip.triangulation.plausibility.control import control_slips, given_points
from photostrip.triangulation.plausibility.control.control_fit import ODD_PROBABILITY
from photostrip.triangulation.plausibility.control.control_strip import AXES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from photostrip.arrays import Flags, Floats
    from photostrip.notes import Finding
    from photostrip.pipeline.plausibility.given_control import GivenControl
    from photostrip.pipeline.results import Result

CODE = "P406"
LIMIT = normal_quantile(1 - ODD_PROBABILITY / 2)
LEAST_OTHERS = 3  # given coordinates that tell how well the prediction is known


@dataclass(frozen=True, eq=False)
class Predicted:
    """Given coordinates as an adjustment in which they took no part predicts them."""

    off: Floats  # (c, 3): given minus predicted, metres along the axes of each point's frame; NaN where not known
    sigma: Floats  # (c, 3): standard deviation of that difference
    sound: Flags  # (c, 3): control coordinates that took part: the run tested them and found them right


def judged(findings: Iterable[Finding], result: Result, control: GivenControl) -> Iterator[Finding]:
    """Give findings again; slips only as far as the adjustment shows them too, as it predicts the coordinates."""
    predicted: Predicted | None = None
    for each in findings:
        if each.code == CODE and result.precision is not None:
            predicted = predicted or predict(result)
            row = control.points.ids.index(each.points[0])
            yield from _again(each, row, predicted, control)
        else:
            yield each


def predict(result: Result) -> Predicted:
    """Compare check points and rejected control with what was adjusted."""
    control, precision = result.inputs.control, result.precision
    rejected = rejected_control(result)
    for strip in result.model_strips:
        rows = locate(strip.control.ids, control.ids)
        rejected[rows] |= control.use[rows] & ~strip.control.use
    used = control.use & ~control.check[:, None] & ~rejected & (result.control_rows >= 0)[:, None]
    off = np.where(used, np.nan, -result.control_differences)
    sigma = np.full(off.shape, np.nan)
    for number, frame in enumerate(result.frames):
        rows = np.flatnonzero((control.frame == number) & (result.control_rows >= 0))
        if len(rows) and precision is not None:
            at = result.control_rows[rows]
            axes = frame.axes_at(result.points.cartesian[at])
            sigma[rows] = np.sqrt(np.einsum("nai,nij,naj->na", axes, precision.points[at], axes))
    sigma = np.hypot(sigma, np.where(control.sigma > 0, control.sigma, 0.0))
    return Predicted(off=off, sigma=sigma, sound=used & _screened(result))


def _screened(result: Result) -> bool:
    """Whether the run looked for wrong control."""
    settings = result.settings
    if result.bundle is not None:
        return settings.bundle.screening != "none"
    return (settings.links if result.model_strips else settings.relative).screening != "none"


def _again(finding: Finding, row: int, predicted: Predicted, control: GivenControl) -> Iterator[Finding]:
    """Judge a slip by a prediction; it stands as it is where the adjustment has none."""
    axis = AXES.index(str(finding.evidence["axis"]))
    off, sigma = float(predicted.off[row, axis]), float(predicted.sigma[row, axis])
    if predicted.sound[row, axis]:
        return
    if not np.isfinite(off * sigma):
        yield finding
        return
    given = given_points.level(control.points.take([row]), control.frames, as_written=control.as_written)
    if given is None:
        yield finding
        return
    spread = sigma * _excess(predicted, row, axis)
    found = control_slips.slip_in(given, 0, axis, off, (spread, LIMIT * spread), finding.strips[0])
    if found is not None:
        doubt = control_slips.DOUBT if control_slips.DOUBT in finding.message else ""
        yield replace(found, message=f"{found.message}{doubt}")


def _excess(predicted: Predicted, row: int, axis: int) -> float:
    """How many times worse than their standard deviations the other coordinates are predicted, in plan or in height."""
    columns = [2] if axis == control_slips.HEIGHT else [0, 1]
    ratio = np.abs(np.delete(predicted.off, row, axis=0) / np.delete(predicted.sigma, row, axis=0))[:, columns]
    known = ratio[np.isfinite(ratio)]
    return max(SIGMA_FROM_MEDIAN * float(np.median(known)), 1.0) if len(known) >= LEAST_OTHERS else 1.0
