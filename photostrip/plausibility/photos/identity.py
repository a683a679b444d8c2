"""Ids of points: one id for two points, two ids for one point, the coordinates of one given for another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.notes import Finding
from photostrip.plausibility.finding import found
from photostrip.points import ControlPoints, PhotoPoints, located
from photostrip.strip.strip_formation.strip import FormedStrip

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
