"""Slips of the pen in one given coordinate: what is written and what was meant differ by a slip that explains it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple

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


def _exchanged(given: float, _: float) -> Iterator[Slip]:
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
    _exchanged,
    _mistyped,
)
"""Kinds of slips, those first that few coordinates fit by chance."""
