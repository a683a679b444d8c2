"""Ids of points: one id for two points, two ids for one point, the coordinates of one given for another.

Ids that stand for two points: rays that meet at two places, and at none of them all.

The photos are those of an adjustment or of a formed strip, in whatever way they were flown. Rays that do not meet may
as well be wrong one by one. Two that are wrong meet by chance the more seldom the farther they are off, and are at one
point the more seldom the fewer rays are wrong at all. Two points are named where of such chances none is expected.

Ids that stand for two points in two strips: ties that do not go with the other ties of the same strips.

Two strips, each on its own control, put a common point at two places that differ by the errors of both: a smooth
function of the place. What lies far off it is no error of a strip: it is two points, or, where one of the strips has
two rays of it, perhaps an image coordinate that is wrong along the base, which nothing in the strip shows.
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
from photostrip.points import ControlPoints, PhotoPoints, located
from photostrip.statistics import SIGMA_FROM_MEDIAN, normal_quantile, t_quantile
from photostrip.strip.formed_strip import FormedStrip
from photostrip.strip.resection import Intersected, KnownPhotos, intersect_points, project, where_two_meet

SAME_PLACE_SIGMAS = 8.0  # standard deviations of an image coordinate, at photo scale, in plan
SAME_HEIGHT_FACTOR = 3.0  # times that in height, times height over base
MOST_BY_CHANCE = 0.002  # points that may lie at the same place by chance in the whole strip; else nothing is said
MOST_COPIED = 100  # that are looked for, at most
COPIED_SIGMAS = 20.0  # standard deviations of an image coordinate between two points that cannot be one
SAME_IMAGE_SIGMAS = 3.5  # standard deviations of the mean difference of image coordinates on common photos


def find_double_ids(
    observations: PhotoPoints, formed: FormedStrip, focal: float, photos: Sequence[str], strip_id: str, sigma: float
) -> Iterator[Finding]:
    """Find points that lie at the same place of the formed strip and are on no photo two different points."""
    bases = np.linalg.norm(np.diff(formed.centers, axis=0), axis=1)
    depth = _depth(formed)
    reach = SAME_PLACE_SIGMAS * sigma / focal * depth
    tall = SAME_HEIGHT_FACTOR * reach * depth / max(np.median(bases), 1e-12)
    one, two = _near(formed.xyz, reach)
    apart = len(formed.xyz) ** 2 * reach**2 * np.pi / 2.0 / max(_area(formed.xyz), 1e-12)
    near = SAME_IMAGE_SIGMAS / SAME_PLACE_SIGMAS * reach  # two points farther apart are seen as two on their photos
    expected = len(formed.xyz) ** 2 * near**2 * np.pi / 2.0 / max(_area(formed.xyz), 1e-12)
    if expected > MOST_BY_CHANCE:
        return
    flown = set(photos)
    inside = np.flatnonzero(np.array([name in flown for name in observations.photo_ids], bool)[observations.photo])
    for a, b in zip(one.tolist(), two.tolist(), strict=True):
        if abs(formed.xyz[a, 2] - formed.xyz[b, 2]) > tall:
            continue
        numbers = (int(formed.point[a]), int(formed.point[b]))
        together = _together(observations, inside, numbers)
        if together is False or (together is None and apart > MOST_BY_CHANCE):
            continue
        names = tuple(observations.point_ids[number] for number in numbers)
        gap = float(np.linalg.norm(formed.xyz[a, :2] - formed.xyz[b, :2]) / depth * focal)
        message = (
            f"points {names[0]} and {names[1]} lie at the same place, {1000 * gap:.0f} µm from each other at photo "
            "scale, and no photo shows them as two: two ids for one point"
        )
        fix = f"give {names[1]} the id {names[0]}"
        evidence = {"distance_at_photo_scale_mm": gap, "expected_by_chance": float(expected)}
        yield found("P302", message, fix, evidence, points=names, strips=(strip_id,))


def find_copied_points(control: ControlPoints, observations: PhotoPoints) -> Iterator[Finding]:
    """Find given points with the very same coordinates in plan that photos show at two places (P410)."""
    rows = np.flatnonzero(control.use[:, :2].all(axis=1))
    key = np.column_stack([control.frame[rows], control.enu[rows, :2]])
    order = np.lexsort(key.T)  # np.unique sorts rows as bytes, in five times the time
    new = np.ones(len(order), bool)
    new[1:] = (key[order[1:]] != key[order[:-1]]).any(axis=1)
    one = np.empty_like(rows)
    one[order] = rows[order[new]][np.cumsum(new) - 1]
    shown = located(control.ids, observations.point_ids)
    both = (one != rows) & (shown[one] >= 0) & (shown[rows] >= 0)
    for a, b in zip(one[both][:MOST_COPIED].tolist(), rows[both][:MOST_COPIED].tolist(), strict=True):
        at = [np.flatnonzero(observations.point == shown[row]) for row in (a, b)]
        _, left, right = np.intersect1d(observations.photo[at[0]], observations.photo[at[1]], return_indices=True)
        gaps = np.linalg.norm(observations.xy[at[0][left]] - observations.xy[at[1][right]], axis=1)
        evidence: dict[str, float | int | str] = {"photos": len(gaps)}
        where = "no photo shows both"
        if len(gaps):
            evidence["apart_mm"] = np.median(gaps)
            where = f"the photos show them {evidence['apart_mm']:.1f} mm apart"
            if np.median(gaps) < COPIED_SIGMAS * np.median(observations.sigma[at[0]]):
                continue  # two ids for one point
        names = (control.ids[a], control.ids[b])
        message = f"given points {' and '.join(names)} have the same coordinates, and {where}"
        yield found("P410", message, "was the row of one of them copied?", evidence, points=names)


def _depth(formed: FormedStrip) -> float:
    """Usual distance of the points from the line of the cameras, units of the strip."""
    axis = formed.rotations[:, :, 2].mean(axis=0)
    axis /= max(float(np.linalg.norm(axis)), 1e-12)
    return float(abs(np.median(formed.centers @ axis) - np.median(formed.xyz @ axis)))


def _area(xyz: Floats) -> float:
    low, high = xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)
    return float(np.prod(high - low))


def _near(xyz: Floats, reach: float) -> tuple[Numbers, Numbers]:
    """Pairs of points nearer to each other in plan than a reach: sorted along one axis, each with those behind it."""
    axis = int(np.ptp(xyz[:, :2], axis=0).argmax())
    order = np.argsort(xyz[:, axis], kind="stable")
    along = xyz[order, axis]
    ones, twos = [], []
    for lag in range(1, len(order)):
        close = np.flatnonzero(along[lag:] - along[:-lag] < reach)
        if not len(close):
            break
        hit = close[np.abs(xyz[order[close + lag], 1 - axis] - xyz[order[close], 1 - axis]) < reach]
        ones.append(order[hit])
        twos.append(order[hit + lag])
    if not ones:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    return np.concatenate(ones), np.concatenate(twos)


def _together(observations: PhotoPoints, inside: Numbers, numbers: tuple[int, int]) -> bool | None:
    """Whether two points lie at the same place on the photos that show both; None when there is no such photo."""
    rows = [inside[observations.point[inside] == number] for number in numbers]
    _, one, two = np.intersect1d(observations.photo[rows[0]], observations.photo[rows[1]], return_indices=True)
    if not len(one):
        return None
    a, b = rows[0][one], rows[1][two]
    difference = (observations.xy[a] - observations.xy[b]).mean(axis=0)
    variance = (observations.sigma[a] ** 2 + observations.sigma[b] ** 2).sum(axis=0) / len(a) ** 2
    return bool((np.abs(difference) <= SAME_IMAGE_SIGMAS * np.sqrt(variance)).all())


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
