"""Which rays of a point are wrong: the fewest without which all others agree.

Photos that all other points orient say how the rays of a point should meet, and how well they know it. From these
misclosures q with weights P, of 2r observed coordinates less three for the point, the sum of squares q' P q becomes
without a set K of rays q' P q - (B P q)_K' (B P B')_KK^-1 (B P q)_K, so that all sets are tried for the price of one.
An error along the base of a point on three photos can lie in any of them: whatever ray is taken out, the other
two meet. Then no ray of the point places it; its y parallaxes may be good all the same.

Source: [Baarda 1968] for the test; deletion derived, as for pairs; see docs/sources.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.network.reliability import Limit
from photostrip.rejection import SEVERAL_RAYS, TWO_RAYS, UNCONTROLLED, WRONG_RAY
from photostrip.statistics import chi2_quantile
from photostrip.strip.gross_errors.pairs.deletion import LARGEST_SET, LIKELIER, subsets

RAYS_AT_ONCE = 2048  # of points that are decided on together, for the sake of memory; it changes no result
TWO = 2  # rays
REGULARISATION = 1e-9  # keeps a point that holds its photos alone from stopping the others


@dataclass(frozen=True, eq=False)
class PointRays:
    """Points and r rays of each, linearised, in units of their standard deviations; control of them as more rows.

    A ray is what one photo says of a point in c = 2 coordinates, or one model in 3.
    """

    rays: int  # the first c r rows are theirs, the coordinates of one ray after the other
    coordinates: int  # c
    misfit: Floats  # (m, n): measured minus computed
    by_point: Floats  # (m, n, 3): derivatives by the point
    of_photos: Floats  # (m, n, n): covariances that their photos bring into the rows; 0 for control
    inside: Flags  # (m, n): rows that took part in their adjustment


CAUSES = ("", WRONG_RAY, TWO_RAYS, SEVERAL_RAYS)
AGREE, WRONG, PAIR, SEVERAL = range(len(CAUSES))


@dataclass(frozen=True, eq=False)
class Decisions:
    """What was decided about m points of r rays."""

    out: Flags  # (m, r): rays that must not be used
    cause: Numbers  # (m,): places in ``CAUSES``
    value: Floats  # (m,): largest standardised residual of a coordinate of the point
    size: Floats  # (m, r, c): estimated errors of the coordinates in standard deviations; NaN where nothing can be said


def without_place(decided: Decisions, nowhere: Flags) -> Decisions:
    """Leave out all rays of the points that meet nowhere (m,)."""
    m, r = decided.out.shape
    return Decisions(
        out=decided.out | nowhere[:, None],
        cause=np.where(nowhere, cause_of_all(np.full(m, r)), decided.cause),
        value=np.where(nowhere, np.nan, decided.value),
        size=np.where(nowhere[:, None, None], np.nan, decided.size),
    )


def alike(rays: Numbers, known: Numbers) -> Iterator[Numbers]:
    """Places of points with as many rays and given coordinates (n,), to be decided on together."""
    size = rays * (known.max(initial=0) + 1) + known
    for each in np.unique(size):
        places = np.flatnonzero(size == each)
        at_once = max(1, RAYS_AT_ONCE // int(rays[places[0]]))
        yield from np.split(places, range(at_once, len(places), at_once))


def decide(points: PointRays, limit: Limit) -> Decisions:
    """Test points, and find the wrong rays of those with a coordinate beyond the limit."""
    gap, weight, basis = _misclosures(points)
    (m, freedom), r, unit = gap.shape, points.rays, limit.unit**2
    c = points.coordinates
    carried = basis @ weight
    pulled, normal = (carried @ gap[:, :, None])[:, :, 0], carried @ basis.swapaxes(1, 2)
    share = np.einsum("mii->mi", normal)[:, : c * r]
    tests = np.abs(pulled[:, : c * r]) / np.sqrt(np.maximum(share, UNCONTROLLED))
    value = np.where(share > UNCONTROLLED, tests, 0.0).max(axis=1)
    total = np.einsum("mi,mij,mj->m", gap, weight, gap)
    out = np.repeat((value > limit.of(r) * limit.unit)[:, None], r, axis=1)
    size, told, left_over = np.full((m, r, c), np.nan), np.zeros(m, bool), np.flatnonzero(out[:, 0])
    for count in range(1, min(r, LARGEST_SET) + 1):
        if not len(left_over) or (count > 1 and freedom - c * count < 1):
            break
        sets = ray_sets(r, count)
        left, errors = _without(total[left_over], pulled[left_over], normal[left_over], sets.rays, c)
        rows = np.arange(len(left))
        likeliest = left[:, sets.of_ray].argmin(axis=2)  # of the sets with each ray: says its error
        ray = np.arange(r)
        size[left_over] = errors[rows[:, None], sets.of_ray[ray, likeliest], sets.place[ray, likeliest]]
        if freedom - c * count < 1:
            break  # nothing would check the rays that are left
        best = left.argmin(axis=1)
        least, bound = left[rows, best], chi2_quantile(1 - limit.alpha, freedom - c * count) * unit
        rivals = (left <= np.minimum(bound, least + LIKELIER * unit)[:, None]).sum(axis=1)
        only = (least <= bound) & (rivals == 1)
        sure, wrong = left_over[only], (sets.of_ray == best[only, None, None]).any(axis=2)
        told[sure], out[sure] = True, wrong
        size[sure] = np.where(wrong[:, :, None], size[sure], np.nan)
        left_over = left_over[~(least <= bound)]
    if r == 2 and freedom == 1:  # half of the y parallax each
        rows = np.flatnonzero(out[:, 0])
        size[rows] = np.stack([np.zeros((len(rows), 2)), 0.5 * pulled[rows, 1::2] / share[rows, 1::2]], axis=2)
    cause = np.where(told, WRONG, np.where(out[:, 0], cause_of_all(np.full(m, r)), AGREE))
    return Decisions(out=out, cause=cause, value=value, size=size)


def cause_of_all(rays: Numbers) -> Numbers:
    """Why all rays of points go; the only one, against the control of its point, is the wrong one."""
    return np.where(rays == 1, WRONG, np.where(rays == TWO, PAIR, SEVERAL))


class RaySets(NamedTuple):
    """All sets of as many of r rays."""

    rays: Numbers  # (s, k): rays of each set
    of_ray: Numbers  # (r, t): sets with each ray
    place: Numbers  # (r, t): which ray of the set it is


@cache
def ray_sets(rays: int, count: int) -> RaySets:
    sets = subsets(rays, count)
    by_ray = np.argsort(sets.ravel(), kind="stable").reshape(rays, -1)
    return RaySets(rays=sets, of_ray=by_ray // count, place=by_ray % count)


class _Misclosures(NamedTuple):
    gap: Floats  # (m, c): c = n - 3 conditions
    weight: Floats  # (m, c, c): inverse of their covariance
    basis: Floats  # (m, n, c): what an observed coordinate puts into them


def _misclosures(point: PointRays) -> _Misclosures:
    """Conditions of the point on photos that are adjusted without it.

    With S the covariance that the photos give to what the rows that took part say beside the point, their misclosures
    grow to (I - S)^-1 times those found, and the cofactors Z of the photos to Z + Z D' (I - S)^-1 D Z.
    """
    basis = np.linalg.qr(point.by_point, mode="complete")[0][..., 3:]
    across, misfit = basis.swapaxes(-1, -2), point.misfit[..., None]
    inside = (point.inside & (point.inside.sum(axis=-1, keepdims=True) > 3))[..., None]
    place = np.linalg.qr(point.by_point * inside)[0] * inside
    beside = np.eye(misfit.shape[-2]) * inside - place @ place.swapaxes(-1, -2)
    spread = across @ point.of_photos
    pull, own = spread @ beside, beside @ point.of_photos @ beside
    lever = pull @ np.linalg.inv(np.eye(own.shape[-1]) * (1 + REGULARISATION) - own)
    gap = across @ misfit + lever @ (beside @ misfit)
    variance = np.eye(across.shape[-2]) + spread @ basis + lever @ pull.swapaxes(-1, -2)
    return _Misclosures(gap[..., 0], np.asarray(np.linalg.inv(variance), float), basis)


class _Deleted(NamedTuple):
    left: Floats  # (m, s): sums of squares without each set
    errors: Floats  # (m, s, k, c): errors of its coordinates


def _without(total: Floats, pulled: Floats, normal: Floats, sets: Numbers, c: int) -> _Deleted:
    """Take sets (s, k) of as many rays each out.

    Their normal equations, of up to 6 errors, are eliminated element by element, together for all points and sets: 64
    points of 17 rays have 43 520 of them.
    """
    (m, n), rows = pulled.shape, (c * sets[:, :, None] + np.arange(c)).reshape(len(sets), -1).T
    of_rows, of_pairs = np.ascontiguousarray(pulled.T), np.ascontiguousarray(normal.reshape(m, -1).T)
    pull, size = of_rows[rows], len(rows)
    left = [[of_pairs[rows[i] * n + rows[j]] for j in range(i + 1)] for i in range(size)]
    reduced, factor = list(pull), [[np.zeros(0)] * i for i in range(size)]
    for j in range(size):
        left[j][j] += REGULARISATION
        for i in range(j + 1, size):
            factor[i][j] = left[i][j] / left[j][j]
            for k in range(j + 1, i + 1):
                left[i][k] = left[i][k] - factor[i][j] * left[k][j]
            reduced[i] = reduced[i] - factor[i][j] * reduced[j]
    error = np.empty_like(pull)
    for j in reversed(range(size)):
        error[j] = reduced[j] / left[j][j]
        for i in range(j + 1, size):
            error[j] -= factor[i][j] * error[i]
    sums = total[:, None] - np.einsum("ism,ism->ms", pull, error)
    return _Deleted(sums, np.ascontiguousarray(error.transpose(2, 1, 0)).reshape(m, len(sets), -1, c))
