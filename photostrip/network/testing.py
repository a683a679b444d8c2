"""Which rays of a point are wrong: the fewest without which all others agree.

Photos that all other points orient say how the rays of a point should meet, and how well they know it. From these
misclosures q with weights P, of 2r observed coordinates less three for the point, the sum of squares q' P q becomes
without a set K of rays q' P q - (B P q)_K' (B P B')_KK^-1 (B P q)_K, so that all sets are tried for the price of one.
An error along the base of a point on three photos can lie in any of them: whatever ray is taken out, the other
two meet. Then no ray of the point places it; its y parallaxes may be good all the same.

Source: [Baarda 1968] for the test; deletion derived, as for pairs; see docs/sources.md.

Decisions on many rays at once, in columns: points with as many rays and given coordinates are linearised together.

What a search said of rays, in columns: thousands of them are decided on, some several times; records are made once.

Source: derived; bookkeeping.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.network.adjustment import BundleSolution, Selection
from photostrip.network.observations import in_models
from photostrip.network.problem import BundleProblem
from photostrip.network.reliability import IMAGE, JointCofactors, Limit, image_shift
from photostrip.rejection import SEVERAL_RAYS, TWO_RAYS, UNCONTROLLED, WRONG_RAY, Rejection
from photostrip.statistics import chi2_quantile
from photostrip.strip.pair_screening import LARGEST_SET, LIKELIER, subsets
from photostrip.strip.resection import KnownPhotos, derivatives, project, two_that_meet

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


@dataclass(frozen=True, eq=False)
class Adjusted:
    """An adjustment by which rays are decided on."""

    problem: BundleProblem  # with all observations
    selection: Selection  # which of them took part
    control: Flags  # (c, 3): given coordinates that count
    solution: BundleSolution
    joint: JointCofactors


@dataclass(frozen=True, eq=False)
class RayDecisions:
    """What was decided about rays."""

    row: Numbers  # (n,): rows of the observations, the rays of a point side by side
    # place, rays: (n,): which of the points it is, and how many rays of it were decided on
    place: Numbers
    rays: Numbers
    out: Flags  # (n,): that must not be used
    cause: Numbers  # (n,): of the point, place in ``CAUSES``
    value: Floats  # (n,): largest standardised residual of a coordinate of the point
    size: Floats  # (n, c): estimated errors of the coordinates in standard deviations; NaN where nothing can be said


def decide_rays(adjusted: Adjusted, row: Numbers, xyz: Floats, limit: Limit) -> RayDecisions:
    """Decide on rays, given by point and photo, of points linearised at places near them (m, 3).

    What of these places is NaN becomes where the rays meet.
    """
    problem = adjusted.problem
    point = problem.images.point[row]
    numbers = np.unique(point)
    first = np.searchsorted(point, numbers)
    rays = np.diff(first, append=len(row))
    given, axis = np.nonzero(adjusted.control & np.isfinite(problem.control.sigma))
    owner = problem.control.point[given]
    by_owner = np.argsort(owner, kind="stable")
    known, first_known = (
        np.bincount(owner, minlength=problem.points)[numbers],
        np.searchsorted(owner[by_owner], numbers),
    )
    n = len(row)
    out, cause, value, size = (
        np.zeros(n, bool),
        np.full(n, AGREE),
        np.zeros(n),
        np.full(problem.images.xy[row].shape, np.nan),
    )
    for some in alike(rays, known):
        at = first[some, None] + np.arange(rays[some[0]])
        of_control = by_owner[first_known[some, None] + np.arange(known[some[0]])]
        place = xyz[some]
        decided = _decided(adjusted, row[at], (given[of_control], axis[of_control]), place, limit)
        xyz[some], out[at], size[at] = place, decided.out, decided.size
        cause[at], value[at] = decided.cause[:, None], decided.value[:, None]
    of_point = np.repeat(np.arange(len(numbers)), rays)
    return RayDecisions(row=row, place=of_point, rays=rays[of_point], out=out, cause=cause, value=value, size=size)


def _decided(adjusted: Adjusted, rows: Numbers, given: tuple[Numbers, Numbers], xyz: Floats, limit: Limit) -> Decisions:
    """Decide on the r rays (m, r) of each of m points with as many given coordinates."""
    problem, control = adjusted.problem, adjusted.problem.control
    m, r = rows.shape
    seen = _seen(adjusted, rows, xyz)
    off, by_photo, by_point = (each.reshape(m, r, *each.shape[1:]) for each in seen)
    c = problem.images.xy.shape[1]
    sound = np.asarray(np.isfinite(np.concatenate([off[..., None], by_photo], axis=3)).all(axis=(1, 2, 3)))
    for each in (off, by_photo, by_point):
        each[~sound] = 0.0
    spread, axes = control.sigma[given], control.axes[given]
    of_photos = np.zeros((m, c * r + spread.shape[1], c * r + spread.shape[1]))
    of_photos[:, : c * r, : c * r] = adjusted.joint.of(problem.images.photo[rows], by_photo)
    to_given = np.einsum("mci,mci->mc", axes, control.xyz[given[0]] - xyz[:, None]) / spread
    rays = PointRays(
        rays=r,
        coordinates=c,
        misfit=np.hstack([off.reshape(m, -1), np.where(sound[:, None], to_given, 0.0)]),
        by_point=np.hstack([by_point.reshape(m, -1, 3), axes / spread[..., None]]),
        of_photos=of_photos,
        inside=np.hstack([np.repeat(adjusted.selection.images[rows], c, axis=1), adjusted.selection.control[given]]),
    )
    return without_place(decide(rays, limit), ~sound)


class _Seen(NamedTuple):
    """Rays linearised in units of their standard deviations, photos in the Cartesian frame."""

    off: Floats  # (n, c): measured minus computed
    by_photo: Floats  # (n, c, u)
    by_point: Floats  # (n, c, 3)


def _seen(adjusted: Adjusted, rows: Numbers, xyz: Floats) -> _Seen:
    """Linearise the rays (m, r) of points at places (m, 3); what of these is NaN becomes where the rays meet."""
    problem, solution, images = adjusted.problem, adjusted.solution, adjusted.problem.images
    (m, r), photo, own = rows.shape, images.photo[rows], images.photo[rows.ravel()]
    nowhere = np.isnan(xyz[:, 0])
    if images.of_models:
        turned = np.einsum("nij,nj->ni", solution.rotations[own], images.xy[rows.ravel()])
        placed = solution.scales[own, None] * turned + solution.centers[own]
        xyz[nowhere] = placed.reshape(m, r, 3)[nowhere].mean(axis=1)
        return _Seen(*in_models(images, rows.ravel(), solution.state, np.repeat(xyz, r, axis=0)))
    photos = KnownPhotos(solution.centers, solution.rotations, problem.cameras.focal[problem.cameras.of_photo])
    flat, sigma = images.xy[rows.ravel()], images.sigma[rows.ravel()]
    xy = flat + image_shift(problem, solution.common, flat, own)
    if r >= problem.least and nowhere.any():
        pairs = xy.reshape(m, r, 2), sigma.reshape(m, r, 2)
        xyz[nowhere] = two_that_meet(pairs[0][nowhere], pairs[1][nowhere], photo[nowhere], photos)
    place = np.repeat(xyz, r, axis=0)
    by_photo, by_point = derivatives(place, photos, own)
    off = xy - project(place, photos, own)
    return _Seen(off / sigma, by_photo / sigma[..., None], by_point / sigma[..., None])


START = "start"  # in the place of a test


@dataclass(frozen=True, eq=False)
class WrongRays:
    """Rays that must go, each with what was said of its point."""

    row: Numbers  # (n,): rows of the observations
    # value, limit: (n,): test value of the point and what it is tested against
    value: Floats
    limit: Floats
    size: Floats  # (n, c): estimated errors of the coordinates, mm
    cause: Numbers  # (n,): places in ``CAUSES``

    def __len__(self) -> int:
        return len(self.row)


WRONG_COLUMNS = "value", "limit", "size", "cause"


class RayLog:
    """What was last said of each ray of a problem, and by which test it went."""

    def __init__(self, begin: Flags, coordinates: int) -> None:
        """Begin with some of the rays (n,), of so many coordinates each; points with others meet somehow."""
        rays = len(begin)
        self.test, self.said = np.full(rays, START, "U8"), np.zeros(rays, bool)
        self.value, self.limit = np.full(rays, np.nan), np.full(rays, np.nan)
        self.size, self.cause = np.full((rays, coordinates), np.nan), np.where(begin, AGREE, SEVERAL)

    def say(self, wrong: WrongRays) -> None:
        for column in WRONG_COLUMNS:
            getattr(self, column)[wrong.row] = getattr(wrong, column)
        self.said[wrong.row] = True

    def records(self, row: Numbers, holds: Flags) -> dict[int, Rejection]:
        """Make the records of rays (n,), by row; ``holds`` (m,): rays that take part in the end."""
        axis = np.fmax(np.abs(self.size[row]), 0.0).argmax(axis=1)
        columns = (self.test, self.said, self.value, self.limit, self.size, self.cause, holds)
        every = zip(row.tolist(), axis.tolist(), *(each[row].tolist() for each in columns), strict=True)
        return {
            number: Rejection(
                kind=IMAGE,
                row=number,
                test=test,
                value=value,
                limit=limit,
                axes=(worst,) if said else (),
                size=tuple(size) if said else (),
                cause=CAUSES[cause],
                readmitted=back,
            )
            for number, worst, test, said, value, limit, size, cause, back in every
        }
