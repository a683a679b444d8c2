"""Arrays by what they hold, for annotations, and what they hold together.

numpy has medians, quantiles and distinct values, but loads ``numpy.ma`` at the first call of each: a sixteenth of what
numpy, pyproj and yaml take together.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Numbers = NDArray[np.intp]  # counts, and rows of other arrays
Flags = NDArray[np.bool_]
Kind = TypeVar("Kind", bound=np.generic)
# rows; all at once take 9 MB more of 198 with 50 000 check points, a quarter and four times as many take the same
PIECE = 4096


def pieces(count: int, most: int = PIECE) -> Iterator[slice]:
    """Cut rows into pieces: what is worked out of one fits into the processor's cache, and goes before the next."""
    return (slice(start, min(start + most, count)) for start in range(0, count, most))


def runs_of(number: Numbers) -> Iterator[tuple[int, slice]]:
    """Go through equal numbers that stand one after the other: the number, and its places."""
    begins = np.flatnonzero(np.diff(number, prepend=-1)).tolist()
    for start, stop in pairwise([*begins, len(number)]):
        yield int(number[start]), slice(start, stop)


def distinct(values: NDArray[Kind]) -> NDArray[Kind]:
    """Every value of an array once, in ascending order."""
    ordered = np.sort(values, axis=None)
    first = np.ones(len(ordered), bool)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return ordered[first]


def median(values: ArrayLike) -> float:
    """Median of all values; NaN where one is, or where there is none."""
    return float(column_medians(np.ravel(np.asarray(values, float))))


def column_medians(values: Floats) -> Any:  # noqa: ANN401
    """Medians over the first axis."""
    number = len(values)
    if not number:
        return np.full(values.shape[1:], np.nan)
    low, high = (number - 1) // 2, number // 2
    parted = np.partition(values, (low, high, -1), axis=0)  # NaN come last
    return np.where(np.isnan(parted[-1]), np.nan, (parted[low] + parted[high]) / 2)


def quantile(values: Floats, share: float) -> float:
    """Value below which a share of all values lies, linear between two of them; NaN where one is."""
    place = share * (values.size - 1)
    low = int(place)
    high, part = min(low + 1, values.size - 1), place - low
    parted = np.partition(values, (low, high, -1), axis=None)
    if np.isnan(parted[-1]):
        return np.nan
    one, other = float(parted[low]), float(parted[high])
    return one + (other - one) * part if part < 0.5 else other - (other - one) * (1 - part)  # noqa: PLR2004
