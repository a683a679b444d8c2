"""Ids that stand for two points in two strips: ties that do not go with the other ties of the same strips.

Two strips, each on its own control, put a common point at two places that differ by the errors of both: a smooth
function of the place. What lies far off it is no error of a strip: it is two points, or, where one of the strips has
two rays of it, perhaps an image coordinate that is wrong along the base, which nothing in the strip shows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.notes import Finding
from photostrip.plausibility.finding import found
from photostrip.statistics import SIGMA_FROM_MEDIAN, t_quantile

LEAST_TIES = 3  # a shift fits one tie, and of two that differ nobody knows which is right
COLUMNS = (1, 3, 6)  # of polynomials of degree 0, 1 and 2 in plan
SIMPLE_SIGMAS = 2.5  # times what makes sense that a fit may leave before another degree is taken
REWEIGHTINGS = 30  # of the fit of least distances
KEPT_SIGMAS = 5.0  # robust standard deviations within which a tie goes with the others
ODD_PROBABILITY = 1e-6  # that a good tie is called odd
TWO_RAYS = 2
MANY_RAYS_SHARE = 0.002  # of the flying height: of thousands of ties some are worse than the others
FEW_TIES_SHARE = 0.05  # of the flying height: so far apart no two strips on the ground put a point
ONE_RAY_SHARE = 0.01  # of the flying height: an image coordinate along the base that is off by a millimetre moves less


@dataclass(frozen=True, eq=False)
class TiesOfStrips:
    """Points that two strips have in common, in a level plane."""

    points: Numbers  # (t,): as numbered in the observations
    names: tuple[str, ...]
    plan: Floats  # (t, 2): their places, metres
    difference: Floats  # (t, 2): where the second strip puts them minus where the first does, metres
    rays: Numbers  # (t,): photos that show each in the strip that has fewer
    sigma: float  # usual standard deviation of a difference, metres
    depth: float  # flying height, metres
    strips: tuple[str, str]


class OddTies(NamedTuple):
    """Ties that do not go with the others."""

    rows: Numbers  # those that stand for two points
    unsure: Numbers  # those that may have a wrong image coordinate along the base instead
    far: Floats  # (t,): how far each tie is off, metres
    limit: Floats  # (t,): how far chance may bring it, metres


def odd_ties(ties: TiesOfStrips) -> OddTies | None:
    """Find the ties of two points by their places in plan; None where nothing is odd at first sight."""
    if len(ties.names) < LEAST_TIES:
        return _of_few(ties)
    off = ties.difference - np.median(ties.difference, axis=0)
    if (np.hypot(*off.T) <= MANY_RAYS_SHARE * ties.depth).all():
        return None  # none is far from the others even if the strips share no bend
    far, limit = _off_the_bend(ties.plan, off, ties.sigma)
    odd = (far > limit) & (far > MANY_RAYS_SHARE * ties.depth)
    two = (ties.rays > TWO_RAYS) | (far > ONE_RAY_SHARE * ties.depth)
    return OddTies(rows=np.flatnonzero(odd & two), unsure=np.flatnonzero(odd & ~two), far=far, limit=limit)


def _off_the_bend(plan: Floats, off: Floats, sigma: float) -> tuple[Floats, Floats]:
    """How far each tie is off the bend that the others show, and how far chance may bring it, metres.

    The bend is a polynomial in plan, of the lowest degree that leaves no more than makes sense, or least.
    """
    local = plan - plan.mean(axis=0)
    x, y = (local / max(float(np.hypot(*local.T).max()), 1e-9)).T
    columns = np.column_stack([np.ones_like(x), x, y, x**2, x * y, y**2])
    fits: list[tuple[float, Floats, Floats]] = []
    for number in COLUMNS:
        if fits and (len(off) <= number + 1 or fits[-1][0] <= SIMPLE_SIGMAS * sigma):
            break
        fits.append(_fitted(columns[:, :number], off, sigma))
    _, far, limit = min(fits, key=lambda each: each[0])
    return far, limit


def _fitted(columns: Floats, off: Floats, sigma: float) -> tuple[float, Floats, Floats]:
    """Fit a bend that wrong ties do not disturb: that of the least sum of distances says which go with the others.

    Returns the standard deviation of a difference, at least ``sigma``; how far each is off; and how far chance goes.
    """
    unknowns = columns.shape[1]
    far, weight = np.hypot(*off.T), np.ones(len(off))
    for _ in range(REWEIGHTINGS):
        root = np.sqrt(weight)[:, None]
        far = np.hypot(*(off - columns @ np.linalg.lstsq(columns * root, off * root, rcond=1e-9)[0]).T)
        weight = 1.0 / np.maximum(far, 0.01 * sigma)
    usual = SIGMA_FROM_MEDIAN * float(np.median(far))
    kept = far < KEPT_SIGMAS * max(usual, sigma)
    inverse = np.linalg.pinv(columns[kept].T @ columns[kept], rcond=1e-12)
    left = off - columns @ (inverse @ columns[kept].T @ off[kept])
    freedom = 2 * (int(kept.sum()) - unknowns)
    if freedom < 1:
        return np.inf, np.hypot(*left.T), np.full(len(off), np.inf)
    sigma0 = max(float(np.sqrt((left[kept] ** 2).sum() / freedom)), sigma)
    spread = np.sqrt(1.0 + np.einsum("ni,ij,nj->n", columns, inverse, columns))
    return sigma0, np.hypot(*left.T), sigma0 * spread * t_quantile(1 - ODD_PROBABILITY, freedom)


def _of_few(ties: TiesOfStrips) -> OddTies:
    far = np.hypot(*ties.difference.T)
    limit = np.full(len(far), FEW_TIES_SHARE * ties.depth)
    return OddTies(rows=np.flatnonzero(far > limit), unsure=np.zeros(0, np.intp), far=far, limit=limit)


def find_shared_ids_of_strips(ties: TiesOfStrips) -> Iterator[Finding]:
    """Find ids of two points by the ties of two strips, and ties of which that or a wrong image coordinate is true."""
    odd = odd_ties(ties)
    if odd is None:
        return
    one, other = ties.strips
    for row in [*odd.rows.tolist(), *odd.unsure.tolist()]:
        far, name, sure = float(odd.far[row]), ties.names[row], row in odd.rows
        apart = (
            f"strip {other} puts it {far:.4g} m away from where strip {one} puts it{_others(np.delete(odd.far, row))}"
        )
        evidence = {"distance_m": far, "limit_m": float(odd.limit[row])}
        if sure:
            message, fix = f"stands for two points: {apart}", f"give it another id on the photos of strip {other}"
        else:
            message = f"stands for two points, or is measured wrong along the base: {apart}"
            fix = "look at it on the photos of both strips: two rays do not show which of them is wrong"
        yield found(
            "P301" if sure else "P304", f"point {name} {message}", fix, evidence, points=(name,), strips=ties.strips
        )


def _others(far: Floats) -> str:
    return f"; half of the other common points agree within {np.median(far):.2g} m" if len(far) else ""
