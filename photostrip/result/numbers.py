"""How numbers of a result are rounded, as their keys are described, and in which order its points stand."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from photostrip.arrays import Floats, Numbers, pieces
from photostrip.notes import Document
from photostrip.result.description import Block, Quantity, block_at
from photostrip.units import MICROMETRES

Plain = Any  # a number, None or nested lists of them

GROUND = 4  # decimals of metres
GEOGRAPHIC = 10  # decimals of degrees: 0.01 mm
IMAGE = 2  # decimals of micrometres
DEGREES = 6  # decimals; 0.02 mm at 1 km
RADIANS = 9
ROTATION = 12  # decimals of direction cosines
SIGNIFICANT = 4  # digits of what has no natural size
EXACT = 12  # digits of what others compute with
PER_RADIAN = {"deg": 180 / np.pi, "gon": 200 / np.pi, "rad": 1.0}  # units of angles
SIGNS = ("utf-8", "surrogatepass")  # in the order of the signs
WHOLE_NUMBERS = re.compile("([0-9]+)")
TENS = 10.0 ** np.arange(23)  # those that a float holds exactly
TIE = 1e-3  # parts of the last digit by which a number must be off the middle between two


def rounded(values: ArrayLike | float, decimals: int) -> Plain:
    """Round numbers, or nested lists of them, to decimals; None for what is no number (NaN, infinite), never -0."""
    if isinstance(values, float):  # as numpy does it, in a tenth of the time
        scaled = float(values) * 10.0**decimals
        return round(scaled) / 10.0**decimals + 0.0 if isfinite(scaled) else None
    return plain(to_decimals(values, decimals))


def to_decimals(values: ArrayLike, decimals: int) -> Floats:
    """Round numbers to decimals, never to -0."""
    return np.asarray(np.round(np.asarray(values, float), decimals) + 0.0)


def plain(values: NDArray[Any]) -> Plain:
    """Return an array as plain lists, None where a number is not finite."""
    finite = np.isfinite(values)
    if finite.all():
        return values.tolist()
    objects = np.array(values, dtype=object)
    objects[~finite] = None
    return objects.tolist()


def significant(values: ArrayLike, digits: int = SIGNIFICANT) -> Plain:
    """Round to significant digits; otherwise as ``rounded``."""
    return plain(to_digits(values, digits))


def to_digits(values: ArrayLike, digits: int) -> Floats:
    """Round numbers to significant digits: all together, but what lies in the middle between two."""
    array = np.asarray(values, float)
    flat, large = array.ravel(), np.abs(array.ravel())
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = digits - 1 - np.floor(np.log10(large))
        known = np.abs(shift) < len(TENS)  # not of 0, nor of what is not finite
        ten = TENS[np.where(known, np.abs(shift), 0).astype(int)]
        scaled = np.where(shift < 0, large / ten, large * ten)
        known &= np.abs(scaled - np.floor(scaled) - 0.5) > TIE
        whole = np.rint(scaled)
        found = np.copysign(np.where(shift < 0, whole * ten, whole / ten), flat)
    for place in np.flatnonzero(~known).tolist():
        found[place] = float(f"{flat[place]:.{digits}g}") + 0.0
    return np.asarray(found.reshape(array.shape))


def micrometres(millimetres: ArrayLike) -> Plain:
    return rounded(np.asarray(millimetres, float) * MICROMETRES, IMAGE)


def natural(name: str) -> tuple[list[str | tuple[int, str]], str]:
    """Return the key that puts ``P2`` before ``P10``; equal numbers (``7``, ``07``) by their text."""
    split = WHOLE_NUMBERS.split(name)
    parts: list[str | tuple[int, str]] = [*split]
    # numbers by length, then by digits: an id may have more digits than int() takes
    parts[1::2] = [(len(digits), digits) for digits in (part.lstrip("0") for part in split[1::2])]
    return parts, name


@lru_cache(maxsize=8)  # the points of a run are asked for twice
def natural_rank(names: tuple[str, ...]) -> Numbers:
    """Place of each name in natural order, from 0."""
    longest = max(map(len, names), default=0)
    parts = [_padded(names[part], longest) for part in pieces(len(names))]  # all at once take 10 MB of 50 000 names
    keys = np.concatenate([part for part in parts if part is not None] or [np.zeros(0, "S")])
    order = np.argsort(keys, kind="stable")
    if len(keys) < len(names) or (keys[order[1:]] == keys[order[:-1]]).any():
        order = np.array(sorted(range(len(names)), key=lambda row: natural(names[row])), np.intp)
    rank = np.empty(len(names), np.intp)
    rank[order] = np.arange(len(names))
    return rank


def order_of(number: Numbers, rank: Numbers) -> Numbers:
    """Return rows by their number, then by their rank: nearly in order already, in a tenth of the time of lexsort."""
    return np.argsort(number * (int(rank.max(initial=0)) + 1) + rank, kind="stable")


def _padded(names: Sequence[str], width: int) -> NDArray[np.bytes_] | None:
    """Return texts in the order of ``natural``, all numbers filled up to one width; None where an id has odd signs."""
    text = "\n".join(names)
    if text.count("\n") != len(names) - 1 or "\0" in text:
        return None
    signs = np.frombuffer(text.encode(*SIGNS), np.uint8)
    digit = signs - np.uint8(ord("0")) < len("0123456789")  # what stands before 0 has wrapped around
    first, end = np.flatnonzero(np.diff(digit, prepend=False, append=False)).reshape(-1, 2).T
    missing = width - (end - first)
    before = np.zeros(len(signs), np.intp)
    before[first] = missing + 1
    place = np.arange(len(signs)) + np.cumsum(before)
    filled = np.full(len(signs) + int(before.sum()), ord("0"), np.uint8)
    filled[place] = signs
    filled[place[first] - missing - 1] = 0  # a number before any other sign
    return np.array(filled.tobytes().split(b"\n"))


def rms(values: Floats) -> float:
    """Root mean square of what is not NaN; NaN when there is nothing."""
    known = values[~np.isnan(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")


def mean(values: Floats) -> float:
    """Mean of what is not NaN; NaN when there is nothing."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else float("nan")


MATRIX = tuple(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3))  # of a rotation, by rows
# Decimals of a value whose unit stands beside it; without a unit it is a ratio.
DECIMALS_BY_UNIT = {"": 2, "um": IMAGE, "ppm": 1, "m": GROUND, "deg": DEGREES, "gon": DEGREES, "rad": RADIANS}


def coordinate_decimals(frame: Document) -> list[int]:
    """Return the decimals of x, y, z in a frame, the block of a result: angles have more than lengths."""
    lengths = frame.get("decimals") or GROUND
    return [GEOGRAPHIC if frame["kind"] == "geographic" and axis != "up" else lengths for axis in frame["axes"]]


def angle_decimals(unit: str) -> int:
    """Return the decimals of angles of photos in ``deg``, ``gon`` or ``rad``."""
    return RADIANS if unit == "rad" else DEGREES


def rounded_column(entry: Quantity, column: NDArray[Any], units: Sequence[str] | None) -> NDArray[Any]:
    """Round the numbers of a column; units: those of its rows where they stand in a column beside it."""
    if entry.many and entry.kind == "number":
        return np.fromiter((None if each is None else rounded_as(entry, each) for each in column), object, len(column))
    if units is not None:
        column = np.array(column, float)
        for unit in set(units):
            rows = np.array([each == unit for each in units], bool)
            column[rows] = to_decimals(column[rows], DECIMALS_BY_UNIT[unit])
        return column
    if entry.decimals is not None:
        return to_decimals(column, entry.decimals)
    return column if entry.digits is None else to_digits(column, entry.digits)


def rounded_as(entry: Quantity, value: Any, unit: str = "") -> Plain:  # noqa: ANN401 (any value)
    """Return a value, or a list of numbers, as its key is written; None for a number that is not finite."""
    decimals = DECIMALS_BY_UNIT[unit] if entry.unit_key else entry.decimals
    if decimals is not None:
        return rounded(value, decimals)
    if entry.digits is not None:
        return significant(value, entry.digits)
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def attributes(value: object, names: str) -> Document:
    """Return attributes of a value by their names; several values of one as a list."""
    values = {name: getattr(value, name) for name in names.split()}
    return {name: list(each) if isinstance(each, tuple) else each for name, each in values.items()}


def record(path: str, values: Mapping[str, Any]) -> Document:
    """Round the values of a block, each as its key is described; its tables are rounded already."""
    return _record(block_at(path), values)


def _record(block: Block, values: Mapping[str, Any]) -> Document:
    return {key: _written(block[key], value, values) for key, value in values.items()}


def _written(entry: Quantity | Block, value: Any, beside: Mapping[str, Any]) -> Plain:  # noqa: ANN401 (any value)
    if value is None or isinstance(value, str):
        return value
    if isinstance(entry, Quantity):
        return rounded_as(entry, value, beside.get(entry.unit_key, ""))
    return _record(entry, value) if isinstance(value, Mapping) else value
