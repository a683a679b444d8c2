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
from photostrip.plausibility.photos.robust_fit import LEAST_REDUNDANCY, fit_simplest

LEAST_TIES = 1 + LEAST_REDUNDANCY  # a shift fits one tie
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
    place, off = ties.plan[:, 0] + 1j * ties.plan[:, 1], ties.difference[:, 0] + 1j * ties.difference[:, 1]
    middle = complex(np.median(off.real), np.median(off.imag))
    if (np.abs(off - middle) <= MANY_RAYS_SHARE * ties.depth).all():
        return None  # none is far from the others even if the strips share no bend
    local = (place - place.mean()) / max(float(np.abs(place - place.mean()).max()), 1e-9)
    columns = [np.ones_like(local), local, np.conj(local), local**2, np.abs(local) ** 2, np.conj(local) ** 2]
    _, fit = fit_simplest(columns, 1, off, np.ones(len(off), bool), ties.sigma)
    far = np.abs(fit.residual)
    odd = fit.odd & (far > MANY_RAYS_SHARE * ties.depth)
    two = (ties.rays > TWO_RAYS) | (far > ONE_RAY_SHARE * ties.depth)
    return OddTies(rows=np.flatnonzero(odd & two), unsure=np.flatnonzero(odd & ~two), far=far, limit=fit.limit)


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
