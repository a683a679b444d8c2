"""Terms of the strip polynomials, and which of them control points can carry where they stand.

How many terms control can carry is decided by its stations along the strip, not by how many points there are: a cubic
needs four different ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers

# Powers of X and Y. A term here, in the ladder and in the order of dropping is a term of X, Y and Z alike.
POWERS = {"1": (0, 0), "X": (1, 0), "Y": (0, 1), "XY": (1, 1), "X^2": (2, 0), "X^3": (3, 0)}
# Ladder: terms, degree, stations along the strip, points for an exact fit. One more point is asked for unless forced.
LADDER = (
    (("1", "X", "Y", "XY", "X^2", "X^3"), 3, 4, 6),
    (("1", "X", "Y", "XY", "X^2"), 2, 3, 5),
    (("1", "X", "Y", "X^2"), 2, 3, 4),
    (("1", "X", "Y"), 1, 2, 3),
)
DROP_ORDER = ("XY", "Y", "X^3", "X^2", "X")
# smallest over largest singular value of the scaled design; below it the control cannot tell the terms apart
LEAST_RATIO = 0.02


@dataclass(frozen=True)
class Sizes:
    """Sizes that make columns comparable and stations different."""

    reach: float  # largest distance of control from the origin along the strip, metres
    breadth: float  # half width of the strip, metres
    spacing: float  # distance along the strip that makes two stations different, metres (one base)


def columns(xyz: Floats, terms: Sequence[str]) -> Floats:
    """Design columns (n, k) of the terms, powers of X and Y of positions (n, 3), unscaled."""
    x, y = xyz[:, 0], xyz[:, 1]  # eq. 150
    result = np.empty((len(xyz), len(terms)))
    for column, (i, j) in enumerate(POWERS[term] for term in terms):
        np.multiply(x**i, y**j, out=result[:, column])
    return result


def count_stations(x: Floats, spacing: float) -> int:
    """Largest number of points along the strip of which no two are nearer than a spacing."""
    return len(np.unique(bands(x, spacing))) if len(x) else 0


def bands(x: Floats, spacing: float) -> Numbers:
    """Count the bands across the strip from its beginning; the number of the band of each point.

    A point farther than the spacing from the first of its band opens the next.
    """
    order, opening, first = np.argsort(x, kind="stable"), [], -np.inf
    for each in x[order].tolist():
        opening.append(each - first >= spacing)
        first = each if opening[-1] else first
    number = np.empty(len(x), np.intp)
    number[order] = np.cumsum(opening) - 1
    return number


def choose_terms(xyz: Floats, degree: int, sizes: Sizes, *, forced: bool = False) -> tuple[str, ...]:
    """Terms that given control points (n, 3) can carry, up to a degree; none when the control carries none.

    Six points are necessary for six terms, not sufficient: [001] after eq. 151 says six, a cubic needs four stations.
    `forced` allows a fit without redundancy.
    """
    stations = count_stations(xyz[:, 0], sizes.spacing)
    terms = ladder(stations, len(xyz) if forced else len(xyz) - 1, degree)
    for drop in DROP_ORDER:
        if not terms or condition(xyz, terms, sizes) < 1 / LEAST_RATIO:
            break
        terms = dropped(terms, drop)
    return terms


def ladder(stations: int, points: int, degree: int) -> tuple[str, ...]:
    """Most terms that so many stations and points carry, up to a degree; none where nothing is carried."""
    for candidate, power, needed, exact in LADDER:
        if power <= degree and stations >= needed and points >= exact:
            return candidate
    return ()


def dropped(terms: tuple[str, ...], drop: str) -> tuple[str, ...]:
    return tuple(term for term in terms if term != drop)


def scales(terms: Sequence[str], sizes: Sizes) -> Floats:
    """Sizes of the columns at the end of the control and the edge of the strip, shape (k,), metres to their powers."""
    return np.array([sizes.reach**i * sizes.breadth**j for i, j in (POWERS[t] for t in terms)])


def condition(xyz: Floats, terms: Sequence[str], sizes: Sizes) -> float:
    """Condition number of the scaled columns at positions (n, 3), metres; infinite when they cannot be told apart."""
    values = np.linalg.svd(columns(xyz, terms) / scales(terms, sizes), compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0 else float("inf")


def degree_of(terms: Sequence[str]) -> int:
    """Highest power of X among the terms; 0 without terms."""
    return max((POWERS[t][0] for t in terms), default=0)
