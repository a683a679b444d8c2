"""Given points in one level frame in the middle of them: what their coordinates mean there, and where they lie.

Slips of the pen in one given coordinate: what is written and what was meant differ by a slip that explains it.

Single given points that do not go with the others: exchanged ones, slips of the pen in one coordinate.

What says so is a prediction: of an adjustment in which the coordinate took no part, or of a formed strip on its other
control. This module finds out what may have happened.

Errors that all control shares, or that of one list, tested before points are tested one by one.

A principal distance that is wrong by a share e stretches a strip of nearly vertical photos in height by e against its
plan; a control list in another frame, or with heights of another kind, lies beside the others by one shift. At the
control these are few columns more in the misclosures: the heights above their mean, or ones at the coordinates of a
list. They are tested by what the sum of squares loses with them (``control_screening``), against what it loses without
any one point.

Source: derived.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise, permutations
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError, InputError, PhotostripError
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.local_frame import EARTH_RADIUS
from photostrip.notes import Finding
from photostrip.plausibility.finding import Evidence, found
from photostrip.points import ControlPoints
from photostrip.statistics import f_p_value, normal_quantile
from photostrip.strip.control_screening import HEIGHT, JointAdjustment, StripAtControl, adjust


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


ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")
LEAST_SLIP_SIGMAS = 6.0  # scatters that a slip must have at least
MOST_BY_CHANCE = 0.1  # of errors about as large that come as near to a slip
MOST_DIGITS = 8  # digits of the largest coordinate
MOST_DECIMALS = 4
LEAST_DIGITS = 5  # before the point, of a coordinate in which one too many is sought: fewer fit by chance


class Slip(NamedTuple):
    meant: float  # the coordinate that was meant
    text: str  # what happened, in words


def slip(given: float, predicted: float, scatter: float, tolerance: float) -> Slip | None:
    """Find the slip that turns a coordinate into one that fits.

    given, predicted: the coordinate as it is written, and what everything else lets expect, in its own unit.
    scatter: standard deviation of the prediction.
    tolerance: how far the corrected coordinate may lie from the prediction.
    Returns the slip, of the first kind that brings the coordinate near, that brings it nearest; None when none does, or
    when many errors of such a size would look as much like one.
    """
    error, asked = abs(given - predicted), 0
    if error < LEAST_SLIP_SIGMAS * scatter:
        return None
    for kind in KINDS:
        near = [each for each in kind(given, scatter) if error / 2.0 <= abs(each.meant - given) <= 2.0 * error]
        asked += len(near)
        best = min(near, key=lambda each: abs(each.meant - predicted), default=None)
        if best is None or (off := abs(best.meant - predicted)) > tolerance:
            continue
        # of errors from half to twice this one, either way, so many come as near to any slip
        return best if asked * 2.0 * max(off, scatter) <= MOST_BY_CHANCE * 3.0 * error else None
    return None


def _written(given: float) -> tuple[str, float]:
    """Return the digits of a coordinate, and its sign."""
    return f"{abs(given):.{MOST_DECIMALS}f}", -1.0 if given < 0 else 1.0


def _places_of(text: str) -> Iterator[tuple[int, int, float]]:
    """Give number, digit and worth of each place."""
    point = text.index(".")
    for number, (place, sign) in enumerate((place, sign) for place, sign in enumerate(text) if sign != "."):
        yield number, int(sign), 10.0 ** (point - place - (1 if place < point else 0))


def _turned_over(given: float, _: float) -> Iterator[Slip]:
    yield Slip(-given, "the sign is wrong")


def _point_moved(given: float, scatter: float) -> Iterator[Slip]:
    for times in (10.0, 100.0, 1000.0):
        if abs(given) / times > scatter:
            yield Slip(given / times, f"the decimal point is {_places(times)} too far right")
            yield Slip(given * times, f"the decimal point is {_places(times)} too far left")


def _digits_exchanged(given: float, _: float) -> Iterator[Slip]:
    text, sign = _written(given)
    digits = list(_places_of(text))
    for (number, digit, worth), (_, after, _) in pairwise(digits):
        if after != digit:
            what = f"the {_ordinal(number)} and the {_ordinal(number + 1)} digit exchanged"
            yield Slip(given + sign * (after - digit) * (worth - worth / 10.0), what)


def _mistyped(given: float, scatter: float) -> Iterator[Slip]:
    text, sign = _written(given)
    for number, digit, worth in _places_of(text):
        for other in range(10):
            if other != digit and abs(other - digit) * worth > LEAST_SLIP_SIGMAS * scatter:
                what = f"a typing error in the {_ordinal(number)} digit ({digit} for {other})"
                yield Slip(given + sign * (other - digit) * worth, what)


def _lost(given: float, _: float) -> Iterator[Slip]:
    """Give coordinates that had one digit more in front, or zeros after it."""
    text, sign = _written(given)
    length = text.index(".")
    for power in range(length, MOST_DIGITS):
        for digit in range(1, 10):
            what = (
                f"a leading {digit} is missing" if power == length else f"a leading {digit} with its zeros is missing"
            )
            yield Slip(given + sign * digit * 10.0**power, what)


def _added(given: float, _: float) -> Iterator[Slip]:
    """Give coordinates that have one digit less."""
    text, sign = _written(given)
    point = text.index(".")
    for number in range(point if point > LEAST_DIGITS else 0):
        what = f"one digit too many, the {_ordinal(number)} ({text[number]})"
        yield Slip(sign * float(text[:number] + text[number + 1 :]), what)


def _ordinal(number: int) -> str:
    return ORDINALS[number] if number < len(ORDINALS) else f"{number + 1}th"


def _places(times: float) -> str:
    number = len(str(int(times))) - 1
    return f"{number} place" if number == 1 else f"{number} places"


KINDS: tuple[Callable[[float, float], Iterator[Slip]], ...] = (
    _turned_over,
    _point_moved,
    _added,
    _lost,
    _digits_exchanged,
    _mistyped,
)
"""Kinds of slips, those first that few coordinates fit by chance."""


ODD_PROBABILITY = 1e-6  # that a good coordinate is called odd
LIMIT = normal_quantile(1 - ODD_PROBABILITY / 2)
SCALE_CHANGE = 3e-4  # of a large error: the scale of a map is not the same where the point came to lie
NOWHERE = 1e7  # metres, a quarter of the Earth's circumference: no map reaches so far


def find_slips(
    given: GivenPoints, off: Floats, sigma: Floats, strips: Sequence[str] = (), *, asked: Flags | None = None
) -> Iterator[Finding]:
    """Name exchanged points (P408), and points of which one coordinate alone is off, with its slip (P406).

    off, sigma: (n, 3), given minus predicted along the axes as they are written, metres, and standard deviations; NaN
        where nothing is predicted.
    asked: (n, 3), coordinates that are asked about; all that are predicted, if not said.
    """
    odd = np.abs(off) > LIMIT * sigma
    odd &= True if asked is None else asked
    far = (given.moved[:, :2] != 0.0).any(axis=1)
    done: set[int] = set()
    for row in np.flatnonzero(far).tolist():
        if (order := _order_of_columns(given, row)) is not None:
            done.add(row)
            yield _in_other_columns(given, row, order, strips)
    in_plan = np.flatnonzero(odd[:, :HEIGHT].any(axis=1) & ~far & given.use[:, 0]).tolist()
    for one, other in combinations(in_plan, 2):
        left = max(_left_if_exchanged(given, off, sigma, *pair) for pair in ((one, other), (other, one)))
        if given.group[one] == given.group[other] and left < 1.0 and not done & {one, other}:
            done |= {one, other}
            yield _exchanged(given, off, (one, other), strips)
    for row in [each for each in np.flatnonzero(odd.any(axis=1)).tolist() if each not in done]:
        axes = np.flatnonzero(odd[row]).tolist()
        if len(axes) == 1 and (wrong := slip_in(given, row, axes[0], off[row], sigma[row], strips)) is not None:
            yield wrong


def _left_if_exchanged(given: GivenPoints, off: Floats, sigma: Floats, one: int, other: int) -> float:
    """Misclosure of a point with the plan of another, over its largest value by chance."""
    step = given.steps.axes[one] @ np.nan_to_num(given.xyz[other] - given.xyz[one])
    near = LIMIT * sigma[one, :HEIGHT] + SCALE_CHANGE * np.linalg.norm(step)
    return float(np.max(np.abs(off[one, :HEIGHT] + step[:HEIGHT]) / near, initial=0.0))


def _exchanged(given: GivenPoints, off: Floats, rows: tuple[int, int], strips: Sequence[str]) -> Finding:
    names = (given.ids[rows[0]], given.ids[rows[1]])
    message = f"given points {names[0]} and {names[1]} fit when their coordinates are exchanged"
    evidence: Evidence = {"misclosure_as_given_m": float(np.linalg.norm(off[list(rows), :HEIGHT], axis=1).max())}
    fix = "were their ids exchanged, in the table or on the photos?"
    return found("P408", message, fix, evidence, points=names, strips=strips)


def _order_of_columns(given: GivenPoints, row: int) -> tuple[int, ...] | None:
    """Order in which the coordinates of a far point would lie among the others of its list."""
    others = (given.group == given.group[row]) & (given.moved == 0).all(axis=1) & np.isfinite(given.written).all(axis=1)
    if not others.any():
        return None
    low, high = given.written[others].min(axis=0), given.written[others].max(axis=0)
    reach = np.append(np.full(2, float((high - low)[:2].max())), float(np.ptp(given.xyz[others, :2], axis=0).max()))
    for order in list(permutations(range(3)))[1:]:
        read = given.written[row, list(order)]
        if ((read > low - reach) & (read < high + reach)).all():
            return order
    return None


def _in_other_columns(given: GivenPoints, row: int, order: tuple[int, ...], strips: Sequence[str]) -> Finding:
    message = (
        f"{_role(given, row)} point {given.ids[row]} lies far from all others; with what is called east, north, up "
        f"read as {', '.join(GROUND_AXES[each] for each in order)} it lies among them"
    )
    fix = f"put the coordinates of {given.ids[row]} into their columns"
    evidence: Evidence = {
        "given_east": float(given.written[row, 0]),
        "east_that_would_fit": float(given.written[row, order[0]]),
    }
    return found("P406", message, fix, evidence, points=(given.ids[row],), strips=strips)


def _role(given: GivenPoints, row: int) -> str:
    return "check" if given.check[row] else "control"


def slip_in(
    given: GivenPoints, row: int, axis: int, off: Floats, sigma: Floats, strips: Sequence[str]
) -> Finding | None:
    """Name the slip of the pen that explains why one coordinate of a point is off; None when none does.

    off, sigma: (3,), given minus predicted along the axes as they are written, and standard deviations, metres.
    """
    written, unit = float(given.written[row, axis]), float(given.steps.unit[row, axis])
    spread, size = float(sigma[axis]), float(off[axis])
    if not np.isfinite(written):
        return None
    near, predicted = LIMIT * spread, written - size / unit
    nowhere = abs(size) > NOWHERE
    if not nowhere and not given.moved[row, axis] and axis != HEIGHT:
        near += SCALE_CHANGE * abs(size)
    exact = np.spacing(abs(written)) * unit < spread  # whether the computer holds digits that could be compared
    fits = slip(written, predicted, spread / unit, near / unit) if exact else None
    evidence: Evidence = {"axis": GROUND_AXES[axis], "given": written, "off_m": size, "standard_deviation_m": spread}
    head = f"{_role(given, row)} point {given.ids[row]}"
    if fits is not None:
        message = (
            f"{head} is off by {size:+.2f} m in {GROUND_AXES[axis]}: looks like {fits.text}; {fits.meant:.10g} would "
            f"fit within {abs(fits.meant - predicted) * unit:.2g} m"
        )
        evidence["would_fit"] = fits.meant
    elif nowhere:
        message = (
            f"{head} has {written:.10g} for {GROUND_AXES[axis]}, {abs(size) / 1000:.6g} km from where the photos show "
            "it: no place on the Earth is so far away"
        )
    else:
        return None
    fix = f"look {given.ids[row]} up in the records"
    return found("P406", message, fix, evidence, points=(given.ids[row],), strips=strips)


MORE_THAN_ALONE = 1.0 + 1e-6  # of what one point explains: a list may have one point only
CURVED_SIGMAS = 2.0  # standard deviations within which a bend is that of the Earth's curvature
FALSE_ALARM = 1e-5  # probability of an error of all where there is none


class StretchedHeights(NamedTuple):
    """How the heights of a strip are stretched against its plan."""

    share: float  # 0.01: heights one percent too large
    sigma: float
    gain: float  # of the sum of squares, over the variance factor of what is left


class ShiftedList(NamedTuple):
    """How the control of one list lies beside that of the others."""

    number: int  # of the list
    # shift, sigma: (3,): given minus what the others predict, along the ground axes, metres; NaN where nothing is given
    shift: Floats
    sigma: Floats
    gain: float


def find_shared(strip: StripAtControl) -> StretchedHeights | ShiftedList | None:
    """Find what all control of a strip, or of a list, shares; None where nothing says so, or single points say more."""
    # the section with most relief says most
    strip, whole = _adjusted(max(strip.sections, key=lambda each: float(np.std(each[1].placed[:, HEIGHT])))[1])
    if whole is None:
        return None
    alone = max((each.gain for each in whole.deletions(whole.points) if np.isfinite(each.gain)), default=0.0)
    found = [_stretch(strip, whole, alone), *_shifts(strip, whole, alone)]
    return max((each for each in found if each is not None), key=lambda each: each.gain, default=None)


def _adjusted(strip: StripAtControl) -> tuple[StripAtControl, JointAdjustment | None]:
    """Return a section with the adjustment of its misclosures; None where nothing checks what is common to them."""
    if len(strip.coordinates.point) <= strip.design.shape[1] + 1:
        return strip, None
    try:
        laid = strip.laid
        return strip, adjust(laid, laid.misclosures(), strip.joint_covariance, bends=False)
    except PhotostripError:
        return strip, None


def _stretch(strip: StripAtControl, whole: JointAdjustment, alone: float) -> StretchedHeights | None:
    place = strip.coordinates
    of_strip = strip.placed[:, HEIGHT] - strip.placed[:, HEIGHT].mean()
    # a strip that bends has heights where the ground has none, and wrong heights are none of the strip
    tested, also = (
        _tested(whole, (place.direction[:, HEIGHT] * height[place.point])[:, None], alone)
        for height in (_relief(strip, whole.w), of_strip)
    )
    if tested is None or also is None or tested.value[0] <= -1.0:  # level ground: heights turned over are its errors
        return None
    return StretchedHeights(float(tested.value[0]), float(tested.sigma[0]), tested.gain)


def find_curvature(strip: StripAtControl) -> Shared | None:
    """Find the Earth's curvature between a strip and plane coordinates; its value is 1 where it is all left out.

    A strip lies D^2 / 2R lower than heights of a map, at the distance D from its middle. Its own bends stand in the
    covariance of the misclosures: those of a sound strip are not taken for it. Source: [001] eq. 153.
    """
    strip, whole = _adjusted(max(strip.sections, key=lambda each: float(np.ptp(each[1].placed[:, 0])))[1])
    if whole is None:
        return None
    place, d = strip.coordinates, strip.placed[:, :HEIGHT] - strip.placed[:, :HEIGHT].mean(axis=0)
    fall = (d**2).sum(axis=1)[place.point] / (2.0 * EARTH_RADIUS)
    found = _tested(whole, (-place.direction[:, HEIGHT] * fall)[:, None], 0.0)
    return found if found is not None and abs(found.value[0] - 1.0) < CURVED_SIGMAS * found.sigma[0] else None


def _relief(strip: StripAtControl, w: Floats) -> Floats:
    """Heights of the ground at the control (n,), against their mean, metres.

    They are those given, without what the curvature of the Earth takes from a plane: the photos follow it.
    """
    height, place = strip.placed[:, HEIGHT].copy(), strip.coordinates
    rows = np.flatnonzero(place.axis == HEIGHT)
    height[place.point[rows]] -= w[rows]
    if strip.targets.frames[0].kind != "local":
        d = strip.placed[:, :HEIGHT] - strip.placed[:, :HEIGHT].mean(axis=0)
        height += (d**2).sum(axis=1) / (2.0 * EARTH_RADIUS)
    return np.asarray(height - height.mean(), float)


def _shifts(strip: StripAtControl, whole: JointAdjustment, alone: float) -> list[ShiftedList]:
    """Shifts of all lists but the largest."""
    place, lists = strip.coordinates, strip.control.frame[strip.coordinates.point]
    numbers, sizes = np.unique(lists, return_counts=True)
    found = []
    for number in numbers[np.argsort(sizes, kind="stable")][:-1].tolist():
        inside = lists == number
        axes = np.unique(place.axis[inside])
        tested = _tested(whole, (inside[:, None] & (place.axis[:, None] == axes)).astype(float), alone)
        if tested is not None:
            shift, sigma = np.full((2, 3), np.nan)
            shift[axes], sigma[axes] = -tested.value, tested.sigma
            found.append(ShiftedList(number=number, shift=shift, sigma=sigma, gain=tested.gain))
    return found


class Shared(NamedTuple):
    """Columns that are significant: their values, standard deviations, and what the sum of squares loses with them."""

    value: Floats
    sigma: Floats
    gain: float


def _tested(whole: JointAdjustment, columns: Floats, alone: float) -> Shared | None:
    """Test columns (w, k) of the misclosures; None where chance, or a single point, explains as much."""
    count, unknowns = columns.shape
    scaled = columns * whole.size[:count, None]
    normal, pull = scaled.T @ whole.matrix[:count, :count] @ scaled, scaled.T @ whole.pull[:count]
    return significant(normal, pull, whole.squares, whole.freedom - unknowns, alone)


def significant(normal: Floats, pull: Floats, squares: float, rest: int, alone: float) -> Shared | None:
    """Test what normal equations (k, k) find of differences; None where chance, or a single point, explains as much.

    squares, rest: their sum of squares, and the redundancy that is left with the columns.
    """
    unknowns = len(pull)
    if rest < 1 or np.linalg.matrix_rank(normal, hermitian=True) < unknowns:
        return None
    inverse = np.linalg.inv(normal)
    gain = float(pull @ inverse @ pull)
    spread = max(1.0, (squares - gain) / rest)
    if gain <= MORE_THAN_ALONE * alone or f_p_value(gain / unknowns / spread, unknowns, rest) > FALSE_ALARM:
        return None
    return Shared(inverse @ pull, np.sqrt(np.diag(inverse) * spread), gain / spread)
