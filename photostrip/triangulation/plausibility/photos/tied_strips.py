"""Ids that stand for two points in two strips: ties that do not go with the other ties of the same strips.

Two strips, each on its own control, put a common point at two places that differ by the errors of both: a smooth
function of the place. What lies far off it is no error of a strip.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.frozen import dataclass
from photostrip.triangulation.plausibility.control.control_strip import LEAST_REDUNDANCY, fit_simplest
from photostrip.triangulation.plausibility.finding import found

if TYPE_CHECKING:
    from collections.abc import Iterator

    from photostrip.arrays import Floats, Numbers
    from photostrip.notes import Finding

LEAST_TIES = 1 + LEAST_REDUNDANCY  # a shift fits one tie
TWO_RAYS = 2
MANY_RAYS_SHARE = 0.002  # of the flying height: of thousands of ties some are worse than the others
ONE_RAY_SHARE = 0.01  # of the flying height: an image coordinate along the base that is off by a millimetre moves less


@dataclass(frozen=True, eq=False)
class TiesOfStrips:
    """Points that two strips have in common, in a level plane."""

    names: tuple[str, ...]
    plan: Floats  # (t, 2): their places, metres
    difference: Floats  # (t, 2): where the second strip puts them minus where the first does, metres
    rays: Numbers  # (t,): photos that show each in the strip that has fewer
    sigma: float  # usual standard deviation of a difference, metres
    depth: float  # flying height, metres
    strips: tuple[str, str]


def find_shared_ids_of_strips(ties: TiesOfStrips) -> Iterator[Finding]:
    """Find ids of two points by the ties of two strips in plan.

    A wrong image coordinate along the base moves a point of two rays, and nothing in its strip shows it.
    """
    if len(ties.names) < LEAST_TIES:
        return
    place, off = ties.plan[:, 0] + 1j * ties.plan[:, 1], ties.difference[:, 0] + 1j * ties.difference[:, 1]
    least = np.where(ties.rays > TWO_RAYS, MANY_RAYS_SHARE, ONE_RAY_SHARE) * ties.depth
    middle = complex(np.median(off.real), np.median(off.imag))
    if (np.abs(off - middle) <= least).all():
        return  # none is far from the others even if the strips share no bend
    local = (place - place.mean()) / max(float(np.abs(place - place.mean()).max()), 1e-9)
    columns = [np.ones_like(local), local, np.conj(local), local**2, np.abs(local) ** 2, np.conj(local) ** 2]
    _, fit = fit_simplest(columns, 1, off, np.ones(len(off), bool), ties.sigma)
    far = np.abs(fit.residual)
    one, other = ties.strips
    for row in np.flatnonzero(fit.odd & (far > least)).tolist():
        message = (
            f"point {ties.names[row]} stands for two points: strip {other} puts it {far[row]:.4g} m away from where "
            f"strip {one} puts it; half of the other common points agree within {_others(far, row):.2g} m"
        )
        evidence = {"distance_m": float(far[row]), "limit_m": float(fit.limit[row])}
        fix = f"give it another id on the photos of strip {other}"
        yield found("P301", message, fix, evidence, points=(ties.names[row],), strips=ties.strips)


def _others(far: Floats, row: int) -> float:
    return float(np.median(np.delete(far, row)))
