"""Ids that stand for two points: rays that meet at two places, and at none of them all.

The photos are those of an adjustment or of a formed strip, in whatever way they were flown. Rays that do not meet may
as well be wrong one by one. Two that are wrong meet by chance the more seldom the farther they are off, and are at one
point the more seldom the fewer rays are wrong at all. Two points are named where of such chances none is expected.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import comb

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.notes import Finding, listed
from photostrip.plausibility.finding import found
from photostrip.statistics import SIGMA_FROM_MEDIAN, normal_quantile
from photostrip.strip.resection.collinearity import KnownPhotos, project
from photostrip.strip.resection.ray_intersection import Intersected, intersect_points, where_two_meet

LEVEL = 0.01  # of one ray of a project that is called wrong falsely
NAMED = 1e-3  # of one false name in a project
AT_A_TIME = 200_000  # rays


@dataclass(frozen=True, eq=False)
class OrientedRays:
    """Rays of photos of known orientation."""

    photos: KnownPhotos
    photo: Numbers  # (n,)
    point: Numbers  # (n,)
    xy: Floats  # (n, 2): ideal image coordinates, mm
    sigma: Floats  # (n, 2): their standard deviations, mm
    wrong: Flags  # (n,): those that do not go with the others

    @classmethod
    def of_strip(
        cls, photos: KnownPhotos, position: Numbers, point: Numbers, xy: Floats, sigma: Floats
    ) -> OrientedRays:
        """Take the rays of a formed strip, which tell themselves how well they meet.

        position: (n,), photo of each image point in the strip; -1 for others.
        """
        rows = np.flatnonzero(position >= 0)
        rays = cls(
            photos=photos,
            photo=position[rows],
            point=point[rows],
            xy=xy[rows],
            sigma=sigma[rows],
            wrong=np.zeros(len(rows), bool),
        )
        met = rays.meeting(~rays.wrong, int(point.max(initial=0)) + 1)
        off, several = rays.off(met.xyz), met.rays[rays.point] > 1
        fitting = off[np.isfinite(off)]
        unit = max(SIGMA_FROM_MEDIAN * float(np.median(fitting)), 1.0) if len(fitting) else 1.0
        return replace(rays, sigma=rays.sigma * unit, wrong=(off > unit * rays.limit) & several)

    @property
    def limit(self) -> float:
        """Misfit of a coordinate that chance gives none of so many, in standard deviations."""
        return normal_quantile(1.0 - LEVEL / (4.0 * max(len(self.point), 1)))

    def off(self, place: Floats) -> Floats:
        """Give the misfit (n,) of each ray at the place of its point, (q, 3), in standard deviations."""
        with np.errstate(all="ignore"):
            off = np.abs(self.xy - project(place[self.point], self.photos, self.photo)) / self.sigma
        return np.asarray(np.nan_to_num(off.max(axis=1), nan=np.inf), float)

    def meeting(self, use: Flags, count: int) -> Intersected:
        """Intersect some of the rays of so many points."""
        return intersect_points(self.xy[use], self.sigma[use], (self.photo[use], self.point[use]), self.photos, count)


class TwoPlaces(NamedTuple):
    """Where the rays of a point meet."""

    here: Flags  # (r,): rays that meet at the first place; the others meet at the second
    one: Floats  # (3,)
    other: Floats  # (3,)
    chance: float  # with which a wrong ray passes by others as near as those of the second place


def find_shared_ids(
    rays: OrientedRays, point_ids: Sequence[str], photo_ids: Sequence[str], strips: tuple[str, ...] = ()
) -> Iterator[Finding]:
    """Find ids that stand for two points (P301).

    photo_ids: names of the photos that ``rays`` counts.
    """
    of_point, wrong = (np.bincount(rays.point[use], minlength=len(point_ids)) for use in (slice(None), rays.wrong))
    share = (wrong > 0).sum() / max(len(rays.point), 1)  # of the rays are wrong
    order = np.argsort(rays.point, kind="stable")
    doubtful = (wrong > 1) & (of_point > 3)
    for size in np.unique(of_point[doubtful]).tolist():
        asked = order[(doubtful & (of_point == size))[rays.point[order]]].reshape(-1, size)
        for rows, two in _two_places(rays, asked):
            fewer = int(min(two.here.sum(), (~two.here).sum()))
            expected = float(comb(of_point, fewer).sum() * share**fewer * two.chance ** (2 * fewer - 3))
            if expected > NAMED:
                continue
            name = point_ids[int(rays.point[rows[0]])]
            photos = rays.photo[rows]
            first, second = ([photo_ids[n] for n in photos[use].tolist()] for use in (two.here, ~two.here))
            far = np.linalg.norm(two.one - rays.photos.centers[photos], axis=1).mean()
            apart = float(np.linalg.norm(two.other - two.one) / far)
            message = (
                f"point {name} stands for two points: photos {listed(first)} put it {100 * apart:.2g} % of its "
                f"distance from the cameras away from where photos {listed(second)} put it"
            )
            evidence = {"apart_over_distance": apart, "expected_by_chance": expected}
            fix = f"give one of the two another id on photos {listed(second)}"
            yield found("P301", message, fix, evidence, points=(name,), photos=(*first, *second), strips=strips)


def _two_places(rays: OrientedRays, asked: Numbers) -> Iterator[tuple[Numbers, TwoPlaces]]:
    """Part the rays (m, r) of points into as many as meet at one place, and others that meet elsewhere."""
    size = asked.shape[1]
    pairs = size * (size - 1) // 2
    step = max(AT_A_TIME // (pairs * size), 1)
    for rows in (asked[start : start + step] for start in range(0, len(asked), step)):
        count = len(rows) * pairs
        flat = np.repeat(rows, pairs, axis=0).ravel()
        tried = OrientedRays(
            photos=rays.photos,
            photo=rays.photo[flat],
            point=np.repeat(np.arange(count), size),
            xy=rays.xy[flat],
            sigma=rays.sigma[flat],
            wrong=rays.wrong[flat],
        )
        one = where_two_meet(rays.xy[rows], rays.photo[rows], rays.photos).reshape(-1, 3)
        one = _meeting(tried, tried.off(one) <= rays.limit, pairs)
        first = tried.off(one)
        here = first <= rays.limit
        other = _meeting(tried, ~here, pairs)
        second = np.where(here, 0.0, tried.off(other)).reshape(-1, size).max(axis=1)
        away = np.where(here, np.inf, first).reshape(-1, size).min(axis=1)
        here = here.reshape(-1, size)
        most = here.sum(axis=1).reshape(-1, pairs)  # what needs fewer wrong rays explains more
        sound = (most == most.max(axis=1, keepdims=True)).ravel() & (most.ravel() > 1)
        sound &= (second <= np.maximum(rays.limit, LEVEL * away)) & np.isfinite(away)
        nearest = np.full(count, np.inf)
        nearest[sound] = np.minimum(np.maximum(second[sound], rays.limit) / away[sound], 1.0)
        chance = nearest.reshape(-1, pairs)
        for row, best in enumerate(chance.argmin(axis=1).tolist()):
            at = row * pairs + best
            if sound[at]:
                places = TwoPlaces(here=here[at], one=one[at], other=other[at], chance=float(chance[row, best]))
                yield rows[row], places


def _meeting(tried: OrientedRays, use: Flags, pairs: int) -> Floats:
    """Intersect some of the rays tried for as many pairs of each point, (m pairs, 3): most pairs choose the same."""
    rows = use.reshape(tried.point[-1] + 1, -1)
    chosen = np.column_stack([np.arange(len(rows)) // pairs, np.packbits(rows, axis=1)])
    _, once, again = np.unique(chosen, axis=0, return_index=True, return_inverse=True)
    first = np.zeros(len(rows), bool)
    first[once] = True
    place = np.cumsum(first) - 1
    kept = first[tried.point] & use
    of_once = replace(tried, point=place[tried.point]).meeting(kept, len(once)).xyz
    return of_once[place[once[again.ravel()]]]
