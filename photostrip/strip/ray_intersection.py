"""Points without a model: those whose good rays come from photos that are no neighbours.

A point on three photos whose middle measurement is wrong stands in no pair, and is yet well determined: its two good
rays meet under twice the angle.

Source: derived; see docs/sources.md.

Points where all rays that saw them meet, from photos of known orientation, with their precision.

A point starts at the place where its rays come nearest to each other; least squares on the image coordinates follow.
Source: derived.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.points import PhotoPoints
from photostrip.strip.formed_strip import FormedStrip
from photostrip.strip.resection import KnownPhotos, derivatives_by_point, project

SMALLEST_ANGLE = 1e-4  # sine of the angle between the rays


def bridge(
    formed: FormedStrip, observations: PhotoPoints, photos: Sequence[str], focal: float, rows: Numbers
) -> FormedStrip:
    """Return a strip that also holds the points which some rays place without a model.

    Such a point lies in the middle between its first and its last ray.

    rows: rows of the observations: good rays of points that the strip does not hold.
    """
    place = {photo: number for number, photo in enumerate(photos)}
    position = np.array([place[observations.photo_ids[number]] for number in observations.photo[rows]], np.intp)
    order = np.lexsort((position, observations.point[rows]))
    rows, position = rows[order], position[order]
    point, begin, count = np.unique(observations.point[rows], return_index=True, return_counts=True)
    ends = np.column_stack([begin, begin + count - 1])[count > 1]
    if not len(ends):
        return formed
    at = position[ends]
    image = np.concatenate([observations.xy[rows[ends]], np.full((*ends.shape, 1), -focal)], axis=2)
    direction = np.einsum("nkij,nkj->nki", formed.rotations[at], image)
    xyz, sound = meeting(formed.centers[at], direction)
    found, numbers = np.flatnonzero(sound), np.asarray(point[count > 1], np.intp)
    every = np.concatenate([formed.point, numbers[found]])
    order = np.argsort(every, kind="stable")
    home = np.concatenate([np.full(len(formed.point), -1), at[found, 0]])
    return replace(
        formed,
        point=every[order],
        xyz=np.concatenate([formed.xyz, xyz[found]])[order],
        model_count=np.concatenate([formed.model_count, np.zeros(len(found), np.intp)])[order],
        home=home[order],
        bridging=np.sort(rows[np.isin(observations.point[rows], numbers[found])]),
    )


def meeting(centers: Floats, directions: Floats) -> tuple[Floats, Flags]:
    """Middle of two rays where they are nearest, and whether they meet, in front of both cameras and not too flat.

    Centres and directions are (n, 2, 3); the middle is NaN where the rays do not meet.
    """
    unit = directions / np.linalg.norm(directions, axis=2, keepdims=True)
    base = centers[:, 1] - centers[:, 0]
    cosine = np.einsum("ni,ni->n", unit[:, 0], unit[:, 1])
    first, second = (np.einsum("ni,ni->n", base, unit[:, side]) for side in (0, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = 1 - cosine**2
        length = np.column_stack([first - cosine * second, cosine * first - second]) / sine[:, None]
        sound = (sine > SMALLEST_ANGLE**2) & (length > 0).all(axis=1)
        xyz = (centers + length[:, :, None] * unit).mean(axis=1)
    return np.where(sound[:, None], xyz, np.nan), sound


ITERATIONS = 12
CONVERGED = 1e-12  # of the distance of a point from its photos
PARALLEL_CONDITION = 1e-9  # reciprocal condition of rays that meet nowhere


@dataclass(frozen=True, eq=False)
class Intersected:
    """Points from known photos."""

    xyz: Floats  # (q, 3): points, metres; NaN where rays do not meet in front of the cameras
    covariance: Floats  # (q, 3, 3): their covariances for the stated standard deviations, metres^2
    residuals: Floats  # (n, 2): measured minus computed image coordinates, mm
    rays: Numbers  # (q,): number of rays of each point


def intersect_points(
    xy: Floats, sigma: Floats, rows: tuple[Numbers, Numbers], photos: KnownPhotos, count: int
) -> Intersected:
    """Intersect points from photos of known orientation, all points in one batch.

    xy, sigma: (n, 2), ideal image coordinates and their standard deviations, mm.
    rows: photo and point of each row.
    Returns points with their precision, the orientations taken as known. A point with one ray, with parallel rays, or
        with rays that meet behind a camera has no coordinates.
    """
    (photo, point), (centers, rotations, focal) = rows, photos
    rays = np.bincount(point, minlength=count)
    direction = np.einsum("nij,nj->ni", rotations[photo], np.column_stack([xy, -focal[photo]]))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    nearest = np.einsum("nij,nj->ni", across, centers[photo])
    xyz, sound = _solved(_summed(across, point, count), _summed(nearest, point, count))
    far = np.ones(count)
    np.maximum.at(far, point, np.linalg.norm(np.nan_to_num(xyz[point]) - centers[photo], axis=1))
    covariance = np.full((count, 3, 3), np.nan)
    for _ in range(ITERATIONS):
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = derivatives_by_point(xyz[point], photos, photo) / sigma[:, :, None]
            misfit = (xy - project(xyz[point], photos, photo)) / sigma
        bad = ~np.isfinite(slope).all(axis=(1, 2)) | ~np.isfinite(misfit).all(axis=1)
        slope[bad], misfit[bad] = 0.0, 0.0
        normal = _summed(np.einsum("nki,nkj->nij", slope, slope), point, count)
        step, good = _solved(normal, _summed(np.einsum("nki,nk->ni", slope, misfit), point, count))
        sound &= good
        xyz = xyz + np.where(sound[:, None], step, 0.0)
        if not sound.any() or np.abs(step[sound] / far[sound, None]).max() < CONVERGED:
            break
    covariance[sound] = np.linalg.inv(normal[sound])
    ahead = np.einsum("ni,ni->n", xyz[point] - centers[photo], rotations[photo][:, :, 2]) < 0
    sound &= rays >= 2
    sound[point[~ahead]] = False
    xyz[~sound], covariance[~sound] = np.nan, np.nan
    with np.errstate(invalid="ignore"):
        residuals = xy - project(xyz[point], photos, photo)
    return Intersected(xyz=xyz, covariance=covariance, residuals=residuals, rays=rays)


def _summed(values: Floats, point: Numbers, count: int) -> Floats:
    flat = values.reshape(len(values), int(np.prod(values.shape[1:])))
    sums = np.column_stack([np.bincount(point, column, count) for column in flat.T])
    return np.asarray(sums.reshape(count, *values.shape[1:]), np.float64)


def two_that_meet(xy: Floats, sigma: Floats, photo: Numbers, photos: KnownPhotos) -> Floats:
    """Places where two of the r rays of each of m points meet, those with which most others agree; NaN: nowhere.

    xy, sigma: (m, r, 2), ideal image coordinates and their standard deviations, mm; photo: (m, r), r at least two.
    """
    xyz = where_two_meet(xy, photo, photos)
    (m, r), pairs = photo.shape, xyz.shape[1]
    seen = project(np.repeat(xyz.reshape(-1, 3), r, axis=0), photos, np.repeat(photo, pairs, axis=0).ravel())
    off = np.abs(xy[:, None] - seen.reshape(m, pairs, r, 2)) / sigma[:, None]
    best = np.log1p(np.nan_to_num(off.max(axis=3), nan=np.inf)).sum(axis=2).argmin(axis=1)
    return np.asarray(xyz[np.arange(m), best], float)


def where_two_meet(xy: Floats, photo: Numbers, photos: KnownPhotos) -> Floats:
    """Places (m, r (r - 1) / 2, 3) where each two of the r rays of m points meet; NaN: nowhere."""
    two = np.column_stack(np.triu_indices(photo.shape[1], 1))
    direction = np.concatenate([xy, -photos.focal[photo][..., None]], axis=2)
    direction = np.einsum("mrij,mrj->mri", photos.rotations[photo], direction)
    xyz, _ = meeting(photos.centers[photo][:, two].reshape(-1, 2, 3), direction[:, two].reshape(-1, 2, 3))
    return np.asarray(xyz.reshape(len(photo), len(two), 3), float)


def _solved(normal: Floats, right: Floats) -> tuple[Floats, Flags]:
    """Solve small systems; NaN where one is singular."""
    size = np.sqrt(np.maximum(np.einsum("nii->ni", normal), 0.0))
    size[size == 0.0] = 1.0
    scaled = normal / size[:, :, None] / size[:, None, :]
    values = np.linalg.eigvalsh(scaled)
    sound = values[:, 0] > PARALLEL_CONDITION
    scaled[~sound] = np.eye(3)
    solution = np.linalg.solve(scaled, (right / size)[:, :, None])[:, :, 0] / size
    solution[~sound] = np.nan
    return solution, sound
