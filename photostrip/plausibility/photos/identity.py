"""Ids of points: one id for two points, two ids for one point, the coordinates of one given for another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import coo_array

from photostrip.arrays import Floats, Numbers
from photostrip.notes import Finding
from photostrip.plausibility.finding import found
from photostrip.points import ControlPoints, PhotoPoints, located
from photostrip.strip.relative_orientation.pairs import MINIMUM_POINTS
from photostrip.strip.strip_formation.strip import FormedStrip

SAME_PLACE_SIGMAS = 8.0  # standard deviations of an image coordinate, at photo scale, in plan
SAME_HEIGHT_FACTOR = 3.0  # times that in height, times height over base
MOST_BY_CHANCE = 0.002  # points that may lie at the same place by chance in the whole strip; else nothing is said
FAR_BASES = 2.0  # bases between two places of one id: tilts move them by less
LEAST_RAYS = 2  # photos that must agree
TINY = 1e-12
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


def find_shared_ids_in_images(
    observations: PhotoPoints, rows: Numbers, along: Floats, photos: Sequence[str], strip_id: str
) -> Iterator[Finding]:
    """Find ids that two groups of photos put at places far from each other along the strip.

    Nothing is said where photos that can be oriented on each other put all that they share at places as far from each
    other: they were not flown along a line.

    rows: (m,), image points of the strip.
    along: (m,), where the photo of each puts its point along the strip, bases.
    """
    order = np.lexsort((along, observations.point[rows]))
    rows, along = rows[order], along[order]
    point = observations.point[rows]
    far = np.flatnonzero((point[1:] == point[:-1]) & (np.diff(along) > FAR_BASES)).tolist()
    if not far:
        return
    common, apart = _common_points(observations, rows, along)
    if (apart[common >= MINIMUM_POINTS] > FAR_BASES).any():
        return
    for k in far:
        same = np.flatnonzero(point == point[k])
        groups = [rows[same[same <= k]], rows[same[same > k]]]
        if min(len(each) for each in groups) < LEAST_RAYS:
            continue  # a wrong coordinate on one photo
        names = set(photos)
        one, two = (
            tuple(name for name in (observations.photo_ids[n] for n in observations.photo[each]) if name in names)
            for each in groups
        )
        gap = float(along[k + 1] - along[k])
        name = observations.point_ids[int(point[k])]
        message = (
            f"point {name} stands for two points: photos {' and '.join(one)} put it {gap:.1f} bases away from where "
            f"photos {' and '.join(two)} put it"
        )
        fix = f"give one of the two another id on photos {' and '.join(two)}"
        yield found("P301", message, fix, {"apart_in_bases": gap}, points=(name,), photos=(*one, *two),
                    strips=(strip_id,))  # fmt: skip


def find_double_ids_in_images(observations: PhotoPoints, rows: Numbers, strip_id: str) -> Iterator[Finding]:
    """Find points at one place on all photos of a strip (image points `rows`) that show both, at least two."""
    if not len(rows):
        return
    o = observations
    reach = SAME_IMAGE_SIGMAS * np.median(o.sigma[rows]) * np.sqrt(2.0)
    rows = rows[np.lexsort((o.xy[rows, 0], o.photo[rows]))]
    first = np.flatnonzero(np.diff(o.photo[rows], prepend=-1))
    extent = np.maximum.reduceat(o.xy[rows], first) - np.minimum.reduceat(o.xy[rows], first)
    pairs = np.diff(first, append=len(rows)) ** 2 / 2.0  # of points on one photo, each counted on two photos at least
    if (pairs / LEAST_RAYS * (2.0 * reach) ** 2 / np.maximum(extent.prod(axis=1), TINY)).sum() > MOST_BY_CHANCE:
        return
    near: dict[tuple[int, int], list[float]] = {}
    for lag in range(1, len(rows)):
        step = np.abs(o.xy[rows[lag:]] - o.xy[rows[:-lag]])
        beside = (o.photo[rows[lag:]] == o.photo[rows[:-lag]]) & (step[:, 0] < reach)
        if not beside.any():
            break
        for k in np.flatnonzero(beside & (step[:, 1] < reach)).tolist():
            a, b = sorted((int(o.point[rows[k]]), int(o.point[rows[k + lag]])))
            near.setdefault((a, b), []).append(float(np.hypot(*step[k])))
    for (a, b), gaps in near.items():
        both = np.intersect1d(o.photo[rows[o.point[rows] == a]], o.photo[rows[o.point[rows] == b]])
        if a == b or len(gaps) < max(LEAST_RAYS, len(both)):
            continue
        names = (o.point_ids[a], o.point_ids[b])
        gap = float(np.mean(gaps))
        message = (
            f"points {names[0]} and {names[1]} lie at the same place on all {len(both)} photos that show both, "
            f"{1000 * gap:.0f} µm from each other: two ids for one point"
        )
        evidence = {"photos": len(both), "mean_distance_mm": gap}
        yield found("P302", message, f"give {names[1]} the id {names[0]}", evidence, points=names, strips=(strip_id,))


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


def _common_points(observations: PhotoPoints, rows: Numbers, along: Floats) -> tuple[Floats, Floats]:
    """Count the points that each two photos have in common; how far apart both put them in the mean, bases."""
    at, size = (observations.photo[rows], observations.point[rows]), len(observations.photo_ids)
    one, place = (coo_array((each, at), (size, len(observations.point_ids))).tocsr() for each in (along**0, along))
    count, both = (one @ one.T).toarray(), (place @ one.T).toarray()
    return np.asarray(count, float), np.asarray(np.abs(both - both.T) / np.maximum(count, 1.0), float)


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
