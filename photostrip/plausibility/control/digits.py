"""Slips of the pen in one given coordinate: what is written and what was meant differ by a slip that explains it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")
LEAST_SLIP_SIGMAS = 6.0  # scatters that a slip must have at least
LEAST_DIGIT_SIGMAS = 2.0  # scatters that a unit of the digit must have: below, any error looks like a slip of it
MOST_DIGITS = 8  # digits of the largest coordinate
NEAR_SHARE = 0.3  # of the correction, within which the corrected coordinate must lie at most
MOST_DECIMALS = 4
LEAST_DIGITS = 5  # before the point, of a coordinate in which one too many is sought: fewer fit by chance


class Slip(NamedTuple):
    meant: float  # the coordinate that was meant
    text: str  # what happened, in words


def slip(given: float, predicted: float, scatter: float, tolerance: float) -> Slip | None:
    """Find the slip that turns a coordinate into one that fits.

    given, predicted: the coordinate as it is written, and what everything else lets expect, in its own unit.
    scatter: standard deviation of the prediction.
    tolerance: how far the corrected coordinate may lie from the prediction; never more than a part of the digit's
        value.
    Returns the slip that brings the coordinate nearest to the prediction; None when none brings it near.
    """
    if abs(given - predicted) < LEAST_SLIP_SIGMAS * scatter:
        return None
    fits = [
        each
        for each in _slips(given, scatter)
        if abs(each.meant - predicted) <= min(tolerance, max(NEAR_SHARE * abs(each.meant - given), scatter))
    ]
    return min(fits, key=lambda each: abs(each.meant - predicted), default=None)


def _slips(given: float, scatter: float) -> Iterator[Slip]:
    """Return every coordinate that one slip of the pen turns into the one given."""
    text = f"{abs(given):.{MOST_DECIMALS}f}"
    sign = -1.0 if given < 0 else 1.0
    yield Slip(-given, "the sign is wrong")
    yield from _lost(given, sign, text.index("."))
    point = text.index(".")
    digits = [(place, int(sign_)) for place, sign_ in enumerate(text) if sign_ != "."]
    for number, (place, digit) in enumerate(digits):
        worth = 10.0 ** (point - place - (1 if place < point else 0))
        if worth < LEAST_DIGIT_SIGMAS * scatter:
            break
        for other in range(10):
            if other != digit and abs(other - digit) * worth > LEAST_SLIP_SIGMAS * scatter:
                change = sign * (other - digit) * worth
                what = f"a typing error in the {_ordinal(number)} digit ({digit} for {other})"
                yield Slip(given + change, what)
        if number + 1 < len(digits):
            after = digits[number + 1][1]
            if after != digit:
                swapped = sign * (after - digit) * (worth - worth / 10.0)
                yield Slip(given + swapped, f"the {_ordinal(number)} and the {_ordinal(number + 1)} digit exchanged")
    yield from _added(text, sign, point)
    for times in (10.0, 100.0, 1000.0):
        if abs(given) / times > scatter:
            yield Slip(given / times, f"the decimal point is {_places(times)} too far right")
            yield Slip(given * times, f"the decimal point is {_places(times)} too far left")


def _lost(given: float, sign: float, length: int) -> Iterator[Slip]:
    """Give coordinates that had one digit more in front, or zeros after it."""
    for power in range(length, MOST_DIGITS):
        for digit in range(1, 10):
            what = (
                f"a leading {digit} is missing" if power == length else f"a leading {digit} with its zeros is missing"
            )
            yield Slip(given + sign * digit * 10.0**power, what)


def _added(text: str, sign: float, point: int) -> Iterator[Slip]:
    """Give coordinates that have one digit less."""
    for number in range(point if point > LEAST_DIGITS else 0):
        what = f"one digit too many, the {_ordinal(number)} ({text[number]})"
        yield Slip(sign * float(text[:number] + text[number + 1 :]), what)


def _ordinal(number: int) -> str:
    return ORDINALS[number] if number < len(ORDINALS) else f"{number + 1}th"


def _places(times: float) -> str:
    number = len(str(int(times))) - 1
    return f"{number} place" if number == 1 else f"{number} places"
