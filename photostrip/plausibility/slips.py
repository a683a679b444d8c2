"""Slips of the pen in one given coordinate: what is written and what was meant differ by a slip that explains it.

Single given points that do not go with the others: exchanged ones, slips of the pen in one coordinate.

What says so is a prediction: of an adjustment in which the coordinate took no part, or of a formed strip on its other
control. This module finds out what may have happened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations, pairwise, permutations
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.notes import Finding
from photostrip.plausibility.finding import Evidence, found
from photostrip.plausibility.given_points import GivenPoints
from photostrip.statistics import normal_quantile

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
HEIGHT = 2


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
