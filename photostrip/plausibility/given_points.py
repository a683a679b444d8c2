"""Given points in one level frame in the middle of them: what their coordinates mean there, and where they lie."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.notes import Finding
from photostrip.plausibility.finding import Evidence, found
from photostrip.points import ControlPoints


class WrittenAxes(NamedTuple):
    """What a step of a written coordinate is in the level frame."""

    unit: Floats  # (n, 3): metres in a unit of the written coordinates
    axes: Floats  # (n, 3, 3): directions of the written axes, as rows


@dataclass(frozen=True, eq=False)
class GivenPoints:
    """Given points in a level frame."""

    ids: tuple[str, ...]
    # (n, 3): east, north, up in metres in a level frame in the middle of the control; NaN where not given
    xyz: Floats
    use: Flags  # (n, 3): which coordinates count
    check: Flags  # (n,): check points
    group: Numbers  # (n,): control list of each
    # (n, 3): the coordinates as they are written, east, north, up; NaN where slips of the pen cannot be sought in them
    written: Floats
    moved: Floats  # (n, 3): what was taken from them, so that a point far from all others comes among them
    written_axes: Callable[[], WrittenAxes]  # what a step of them is; worked out for points that stand out only

    @cached_property
    def steps(self) -> WrittenAxes:
        """What a step of the written coordinates is."""
        return self.written_axes()


_LevelPoints = tuple[Floats, Callable[[], WrittenAxes]]  # (n, 3) in the level frame; what the written axes are

# times as far from the middle of a list as a good half of it: strip and map say nothing of such a place
FAR_AWAY = 20.0
HIGHEST = 2e4  # metres, twice the height of a mountain: no height lies so far from the others; geocentric Z may
LEAST_OF_LIST = 4  # points that tell where a list lies


def level(control: ControlPoints, frames: Sequence[GroundFrame], *, as_written: bool = False) -> GivenPoints | None:
    """Bring given points into one level frame; None when none of them has a plan position.

    as_written: take the numbers as plain coordinates in metres, when their frames cannot be right.
    """
    plan = np.asarray(control.use[:, :2].all(axis=1), bool)
    height = control.use[:, 2]
    if not plan.any():
        return None
    written = np.where(control.use, control.enu, np.nan)
    moved = far_away(written, control.frame)
    filled = _filled(written - moved, control.frame)
    decoded = None if as_written else _decoded(filled, control, frames, plan)
    xyz, written_axes = decoded or _plain(filled, control, frames, plan)
    known = np.column_stack([plan, plan, height])
    return GivenPoints(
        ids=control.ids,
        xyz=np.where(known, xyz, np.nan),
        use=known,
        check=control.check,
        group=control.frame,
        written=written,
        moved=moved,
        written_axes=written_axes,
    )


def _plain(filled: Floats, control: ControlPoints, frames: Sequence[GroundFrame], plan: Flags) -> _LevelPoints:
    """Take the numbers as they are written, in the units of their frames as far as these have one."""
    written = _plain_axes(control, frames)
    return (filled - np.mean(filled[plan], axis=0)) * written.unit, lambda: written


def _plain_axes(control: ControlPoints, frames: Sequence[GroundFrame]) -> WrittenAxes:
    unit = np.array([[frame.plan_factor, frame.plan_factor, frame.height_factor] for frame in frames])
    unit = np.where(unit > 0, unit, 1.0)[control.frame]
    return WrittenAxes(unit, np.tile(np.eye(3), (len(control), 1, 1)))


def far_away(written: Floats, lists: Numbers) -> Floats:
    """By how much coordinates (n, 3) that lie far from all others of their list are moved to its middle."""
    moved = np.zeros_like(written)
    for number in np.unique(lists).tolist():
        rows = np.flatnonzero((lists == number) & np.isfinite(written[:, :2]).all(axis=1))
        if len(rows) < LEAST_OF_LIST:
            continue
        off = written[rows, :2] - np.median(written[rows, :2], axis=0)
        reach = FAR_AWAY * np.median(np.abs(off), axis=0).max()
        moved[rows, :2] = np.where(np.abs(off) > reach, off, 0.0)
        rows = np.flatnonzero((lists == number) & np.isfinite(written[:, 2]))
        off = written[rows, 2] - np.median(written[rows, 2]) if len(rows) >= LEAST_OF_LIST else np.zeros(len(rows))
        moved[rows, 2] = np.where(np.abs(off) > max(reach, HIGHEST), off, 0.0)
    return moved


def _filled(written: Floats, lists: Numbers) -> Floats:
    """Coordinates with the mean of their list, or of all, where they are not given."""
    filled = written.copy()
    for number in np.unique(lists).tolist():
        rows = lists == number
        for axis in range(3):
            values = written[rows, axis]
            if not np.isfinite(values).any():
                values = written[:, axis]
            mean = np.median(values[np.isfinite(values)]) if np.isfinite(values).any() else 0.0
            part = filled[rows, axis]
            filled[rows, axis] = np.where(np.isfinite(part), part, mean)
    return filled


def _decoded(filled: Floats, control: ControlPoints, frames: Sequence[GroundFrame], plan: Flags) -> _LevelPoints | None:
    """Bring the points through their frames; None where the frames refuse."""
    cartesian = np.empty_like(filled)
    try:
        for number in np.unique(control.frame).tolist():
            rows = control.frame == number
            cartesian[rows] = frames[number].cartesian_from_ground(filled[rows])
        middle = np.median(cartesian[plan], axis=0)
        first = frames[int(control.frame[int(np.argmax(plan))])]
        turn = first.level_axes_at(middle[None, :])[0]
    except (GeometryError, InputError):
        return None
    if not np.isfinite(cartesian).all():
        return None
    return (cartesian - middle) @ turn.T, lambda: _axes_through_frames(filled, cartesian, turn, control, frames)


def _axes_through_frames(
    filled: Floats, cartesian: Floats, turn: Floats, control: ControlPoints, frames: Sequence[GroundFrame]
) -> WrittenAxes:
    axes, unit = np.empty((len(filled), 3, 3)), np.ones_like(filled)
    try:
        for number in np.unique(control.frame).tolist():
            rows, frame = control.frame == number, frames[number]
            axes[rows] = frame.axes_at(cartesian[rows])
            if frame.kind != "geocentric":  # whose coordinates are no plan and no height
                unit[rows] = _metres(frame, filled[rows])
    except (GeometryError, InputError):  # at the edge of a projection
        return _plain_axes(control, frames)
    return WrittenAxes(unit, axes @ turn.T)


def _metres(frame: GroundFrame, enu: Floats) -> Floats:
    """Metres on the ground in a unit of each coordinate: a map has a scale of its own."""
    unit = np.broadcast_to([frame.plan_factor, frame.plan_factor, frame.height_factor], enu.shape).astype(float)
    if frame.kind != "local":
        step = 1e-5 if frame.kind == "geographic" else 1.0
        start = frame.cartesian_from_ground(enu)
        for axis in range(2):
            stepped = frame.cartesian_from_ground(enu + step * np.eye(3)[axis])
            unit[:, axis] = np.linalg.norm(stepped - start, axis=1) / step
    return unit


ONE_END_SHARE = 0.4  # of the strip's length: control that spans less, all in one half, is at one end
HALF_SHARE = 0.55
BEYOND_SHARE = 0.5  # of the control's length: what lies farther out is extrapolated by more than half of it
LEAST_BREADTH = 0.08  # rms distance of the control from a line, in half breadths of the strip: errors grow 12-fold
LEAST_PHOTOS = 4  # photos of a strip that has ends
LEAST_POINTS = 2


def find_weak_ends(place: Floats, photos: Sequence[str], strip: str, ids: Sequence[str]) -> Iterator[Finding]:
    """Find control of a strip that lies at one end, or far from an end.

    place: (n,), where control points lie along the strip, bases.
    Yields P501, P503.
    """
    last = len(photos) - 1
    if len(ids) < LEAST_POINTS or len(photos) < LEAST_PHOTOS:
        return
    low, high = float(np.clip(place, 0, last).min()), float(np.clip(place, 0, last).max())
    evidence: Evidence = {
        "first_control_at_photo": low + 1,
        "last_control_at_photo": high + 1,
        "photos": len(photos),
    }
    at_begin, at_end = high <= HALF_SHARE * last, low >= (1 - HALF_SHARE) * last
    if high - low < ONE_END_SHARE * last and (at_begin or at_end):
        end = "beginning" if at_begin else "end"
        message = (
            f"strip {strip}: all control lies at its {end}, within {high - low:.1f} of {last} bases; beyond it the "
            "strip is unsupported, and its errors grow with the 1.5th power of the length"
        )
        fix = "add control at the other end"
        yield found("P501", message, fix, evidence, points=ids, strips=(strip,))
        return
    for gap, end in ((low, photos[0]), (last - high, photos[-1])):
        if gap > max(BEYOND_SHARE * (high - low), 1.0):
            message = (
                f"strip {strip}: its end at photo {end} lies {gap:.1f} bases beyond the control, which spans "
                f"{high - low:.1f}; what is there is extrapolated"
            )
            fix = f"add control near photo {end}, or leave the photos beyond it out"
            yield found("P503", message, fix, evidence, photos=(end,), strips=(strip,))


def find_line(
    plan: Floats, half_breadth: float, ids: Sequence[str], what: str, strips: Sequence[str]
) -> Iterator[Finding]:
    """Tell control that stands on one line: nothing holds the rotation about it.

    plan: (n, 2), control points, and with them cameras that hold as well, metres.
    ids: control points.
    what: what they hold, a strip or a block.
    Yields P502.
    """
    if len(ids) <= LEAST_POINTS or half_breadth <= 0:  # points measured along one line only have no breadth
        return
    values = np.linalg.svd(plan - plan.mean(axis=0), compute_uv=False)
    breadth = float(values[-1] / np.sqrt(len(plan) - LEAST_POINTS) / half_breadth)
    if breadth > LEAST_BREADTH:
        return
    message = (
        f"{what}: its control lies on one line, within {100 * breadth:.1f} % (rms) of half the breadth of "
        f"{'a' if len(strips) > 1 else 'the'} strip: an error in one height turns the "
        f"{'block' if len(strips) > 1 else 'strip'} about it"
    )
    fix = "add a control point at some distance from that line"
    yield found("P502", message, fix, {"rms_distance_over_half_breadth": breadth}, points=ids, strips=strips)
