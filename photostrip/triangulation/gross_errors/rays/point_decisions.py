"""Which rays of a point are wrong: the fewest without which all others agree.

Photos that all other points orient say how the rays of a point should meet, and how well they know it. From these
misclosures q with weights P, of 2r observed coordinates less three for the point, the sum of squares q' P q becomes
without a set K of rays q' P q - (B P q)_K' (B P B')_KK^-1 (B P q)_K, so that all sets are tried for the price of one.
An error along the base of a point on three photos can lie in any of them: whatever ray is taken out, the other
two meet. Then no ray of the point places it; its y parallaxes may be good all the same.

Source: [Baarda 1968] for the test; deletion derived, as for pairs; see docs/sources.md.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.frozen import dataclass
from photostrip.statistics import chi2_quantile
from photostrip.triangulation.bundle.quality.reliability import UNCONTROLLED
from photostrip.triangulation.gross_errors.pairs.deletion import LARGEST

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.triangulation.bundle.quality.reliability import Limit


LIKELIER = 9.0  # difference of two sums of squares that tells sets of rays apart: a likelihood ratio of 90
ROUNDING = 1e-9  # keeps a point that holds its photos alone from stopping the others
WRONG_RAY, TWO_RAYS, SEVERAL_RAYS = "ray", "pair", "rays"
"""What was found at a point: its wrong rays; two rays that contradict each other; several of which any may be wrong."""


@dataclass(frozen=True, eq=False)
class PointRays:
    """A point and its r rays, linearised, in units of their standard deviations; control of the point as more rows."""

    rays: int  # the first 2 r rows are theirs, x and y of one ray after the other
    misfit: Floats  # (n,): measured minus computed
    by_point: Floats  # (n, 3): derivatives by the point
    by_photos: Floats  # (n, 6 r): derivatives by shift and rotation of the photos; 0 for control
    cofactors: Floats  # (6 r, 6 r): joint cofactors of the photos
    inside: Flags  # (n,): rows that took part in their adjustment


@dataclass(frozen=True, eq=False)
class Decision:
    """What was decided about a point."""

    out: Flags  # (r,): rays that must not be used
    cause: str  # ``WRONG_RAY``, ``TWO_RAYS`` or ``SEVERAL_RAYS``; empty when all rays agree
    value: float  # largest standardised residual of a coordinate of the point
    size: Floats  # (r, 2): estimated errors of the coordinates in standard deviations; NaN where nothing can be said


def undecided(rays: int) -> Decision:
    """Leave out all rays of a point, which meet nowhere."""
    unknown = np.full((rays, 2), np.nan)
    return Decision(out=np.ones(rays, bool), cause=cause_of_all(rays), value=float("nan"), size=unknown)


def decide(point: PointRays, limit: Limit) -> Decision:
    """Test a point, and find its wrong rays when one of its coordinates is beyond the limit."""
    gap, weight, basis = _misclosures(point)
    r, freedom = point.rays, len(gap)
    pulled, normal = basis @ weight @ gap, basis @ weight @ basis.T
    share = np.diag(normal)[: 2 * r]
    tests = np.abs(pulled[: 2 * r]) / np.sqrt(np.maximum(share, UNCONTROLLED))
    value = float(tests[share > UNCONTROLLED].max(initial=0.0))
    size = np.full((r, 2), np.nan)
    if value <= limit.of(r) * limit.unit:
        return Decision(out=np.zeros(r, bool), cause="", value=value, size=size)
    total, unit = float(gap @ weight @ gap), limit.unit**2
    left, sets, errors = _without(total, pulled, normal, [(ray,) for ray in range(r)])
    for count in range(1, min(r, LARGEST) + 1):
        if freedom - 2 * count < 1:
            break  # nothing would check the rays that are left
        if count > 1:
            left, sets, errors = _without(total, pulled, normal, list(combinations(range(r), count)))
        best = int(left.argmin())
        bound = chi2_quantile(1 - limit.alpha, freedom - 2 * count) * unit
        if left[best] <= bound:
            others = np.delete(left, best)
            if (others > np.minimum(bound, left[best] + LIKELIER * unit)).all():
                size[sets[best]] = errors[best]
                wrong = np.isin(np.arange(r), sets[best])
                return Decision(out=wrong, cause=WRONG_RAY, value=value, size=size)
            break
    if r == 2 and freedom == 1:
        size = np.column_stack([np.zeros(2), 0.5 * pulled[1::2] / share[1::2]])  # half of the y parallax each
    else:
        for number in np.argsort(-left, kind="stable"):  # the likeliest set with each ray says its error
            size[sets[number]] = errors[number]
    return Decision(out=np.ones(r, bool), cause=cause_of_all(r), value=value, size=size)


def cause_of_all(rays: int) -> str:
    """Why all rays of a point go; the only one, against the control of its point, is the wrong one."""
    return {1: WRONG_RAY, 2: TWO_RAYS}.get(rays, SEVERAL_RAYS)


class _Misclosures(NamedTuple):
    gap: Floats  # (c,): c = n - 3 conditions
    weight: Floats  # (c, c): inverse of their covariance
    basis: Floats  # (n, c): what an observed coordinate puts into them


def _misclosures(point: PointRays) -> _Misclosures:
    """Conditions of the point on photos that are adjusted without it.

    With S the covariance that the photos give to the conditions of the rows that took part, their misclosures grow to
    (I - S)^-1 times those found, and the cofactors Z of the photos to Z + Z D' (I - S)^-1 D Z.
    """
    basis = np.linalg.qr(point.by_point, mode="complete")[0][:, 3:]
    design, cofactors = basis.T @ point.by_photos, point.cofactors
    gap = basis.T @ point.misfit
    variance = np.eye(len(gap)) + design @ cofactors @ design.T
    rows = point.inside
    if rows.sum() > 3:
        part = np.linalg.qr(point.by_point[rows], mode="complete")[0][:, 3:]
        taken_out = part.T @ point.by_photos[rows]
        pull = design @ cofactors @ taken_out.T
        rest = np.eye(len(taken_out)) * (1 + ROUNDING) - taken_out @ cofactors @ taken_out.T
        lever = pull @ np.linalg.inv(rest)
        gap = gap + lever @ (part.T @ point.misfit[rows])
        variance = variance + lever @ pull.T
    return _Misclosures(gap, np.asarray(np.linalg.inv(variance), float), basis)


class _Deleted(NamedTuple):
    left: Floats  # (s,): sums of squares without each set
    sets: Numbers  # (s, k): rays of each set
    errors: Floats  # (s, k, 2): errors of their coordinates


def _without(total: float, pulled: Floats, normal: Floats, sets: Sequence[tuple[int, ...]]) -> _Deleted:
    """Take sets of as many rays each out."""
    rays = np.array(sets, np.intp)
    rows = (2 * rays[:, :, None] + np.arange(2)).reshape(len(rays), -1)
    pull = pulled[rows]
    inverse = np.linalg.pinv(normal[rows[:, :, None], rows[:, None, :]], rcond=1e-6, hermitian=True)
    error = np.einsum("sij,sj->si", inverse, pull)
    return _Deleted(total - np.einsum("si,si->s", pull, error), rays, error.reshape(*rays.shape, 2))
