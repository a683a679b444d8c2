"""Control and check points of a project: what may influence the result, and how the result differs from them.

Whether the control checks itself: how large an error of a given coordinate would be found at all.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.network import reliability
from photostrip.notes import Note
from photostrip.pipeline.results import Adjusted, AdjustedStrips, Bundle, Result, StripResult
from photostrip.points import ControlPoints, PhotoPoints, locate, located


def measured_control(control: ControlPoints, observations: PhotoPoints) -> ControlPoints:
    """Control that may influence the result: neither check points nor unmeasured ones ever get past here."""
    measured = set(observations.point_ids)
    kept = [
        row
        for row, name in enumerate(control.ids)
        if name in measured and not control.check[row] and control.use[row].any()
    ]
    return control.take(np.array(kept, np.intp))


def rows_of_given(ids: tuple[str, ...], numbers: Numbers, point_ids: tuple[str, ...]) -> Numbers:
    """Row of each given point among points that have numbers in a list of ids; -1 for those that are not there."""
    place = np.full(len(point_ids) + 1, -1)  # the last for ids that are not there
    place[numbers] = np.arange(len(numbers))
    return np.asarray(place[located(ids, point_ids)], np.intp)


def cartesian_of(control: ControlPoints, frames: Sequence[GroundFrame]) -> Floats:
    """Cartesian coordinates of points given in full, each from its own ground frame."""
    xyz = np.zeros((len(control), 3))
    for number, frame in enumerate(frames):
        rows = control.frame == number
        if rows.any():
            xyz[rows] = frame.cartesian_from_ground(control.enu[rows])
    return xyz


def axes_of(numbers: Numbers, frames: Sequence[GroundFrame], cartesian: Floats, *, level: bool = False) -> Floats:
    """Ground axes (n, 3, 3) at Cartesian points, each in the ground frame of its number; or its level axes."""
    axes = np.empty((len(numbers), 3, 3))
    for number, frame in enumerate(frames):
        rows = numbers == number
        if rows.any():
            axes[rows] = frame.level_axes_at(cartesian[rows]) if level else frame.axes_at(cartesian[rows])
    return axes


def compare_with_given(
    control: ControlPoints, frames: Sequence[GroundFrame], points: Adjusted, observations: PhotoPoints
) -> tuple[Numbers, Floats]:
    """Compare adjusted with given coordinates at control and check points, each in its own ground frame.

    Returns the row of each given point in the adjusted points (c,), -1 where it has no coordinates, and adjusted minus
        given (c, 3), metres along east, north, up; NaN where it is not given, does not count or has no result.
    """
    rows = rows_of_given(control.ids, points.number, observations.point_ids)
    differences = np.full((len(control), 3), np.nan)
    for index, frame in enumerate(frames):
        inside = np.flatnonzero((control.frame == index) & (rows >= 0))
        if len(inside):
            adjusted = frame.ground_from_cartesian(points.cartesian[rows[inside]])
            given = np.where(np.isnan(control.enu[inside]), adjusted, control.enu[inside])
            differences[inside] = frame.difference(adjusted, given)
    return rows, np.where(control.use, differences, np.nan)


def rejected_control(result: Result) -> Flags:
    """Return which control coordinates (c, 3) were given for use and that nothing used, having been found wrong."""
    control = result.inputs.control
    held, used = np.zeros((len(control), 1), bool), np.zeros(control.use.shape, bool)
    if result.bundle is not None:
        problem, selection = result.bundle.screened.problem, result.bundle.screened.selection
        rows = locate(map(problem.point_name, problem.control.point.tolist()), control.ids)
        held[rows], used[rows] = True, selection.control
    for strip in result.strips if result.bundle is None else ():
        rows = locate(strip.control.ids, control.ids)
        held[rows] = True
        used[rows] |= strip.control.use
    return np.asarray(control.use & held & ~used & ~control.check[:, None], bool)


HARDLY = 10.0  # standard deviations of a given coordinate in one model: errors of half of them must be that large
PARTS = (("plan", slice(0, 2)), ("height", slice(2, 3)))


def unchecked_control_notes(adjusted: AdjustedStrips, power: float) -> Iterator[Note]:
    """Say of which control errors would not be found; strip by strip, or of a whole block.

    An error that is found in four of five cases is 4 to 6 standard deviations where other control holds the strip
    beside it, and many times that where the strip would follow the error.

    power: probability with which the detectable errors of a bundle are found.
    """
    if adjusted.bundle is not None:
        yield from _of_bundle(adjusted.bundle, power)
        return
    for strip in adjusted.strips:
        screened = strip.screened_control
        ids = strip.control.ids
        yield from _note_of(ids, screened.detectable, strip.control.sigma, strip.precision, f"strip {strip.strip.id}")


def _of_bundle(bundle: Bundle, power: float) -> Iterator[Note]:
    problem, screened = bundle.screened.problem, bundle.screened
    shift = screened.limit.shifts(power)[reliability.CONTROL]
    for group in bundle.groups:
        if group.kind == reliability.CONTROL:
            ids = [problem.point_name(number) for number in problem.control.point.tolist()]
            precision = _largest(bundle.start.strips)
            yield from _note_of(ids, group.detectable(shift), group.sigma, precision, "the block")


def _largest(strips: Sequence[StripResult]) -> tuple[float, float]:
    plan, height = (max((each.precision[axis] for each in strips), default=0.0) for axis in (0, 1))
    return plan, height


def _note_of(
    ids: Sequence[str], detectable: Floats, sigma: Floats, precision: tuple[float, float], where: str
) -> Iterator[Note]:
    size = detectable / np.hypot(sigma, [precision[0], precision[0], precision[1]])
    parts = []
    for name, part in PARTS:
        known = np.isfinite(sigma[:, part]) & ~np.isnan(size[:, part])
        if known.any() and np.median(size[:, part][known]) > HARDLY:
            middle = np.median(detectable[:, part][known])
            parts.append(f"{middle:.2g} m in {name}" if np.isfinite(middle) else f"any size in {name}")
    if parts:
        text = (
            f"{where}: the control hardly checks itself: errors of {' and of '.join(parts)} at half of its points may "
            "stay unnoticed, and the result would follow them; add control, or check points, which would show it"
        )
        yield Note("unchecked-control", text, severity="note", points=tuple(ids))
