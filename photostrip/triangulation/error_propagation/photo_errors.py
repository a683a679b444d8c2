"""Errors of photos that are oriented on their adjusted points, as rows of derivatives like those of the points.

Source: derived; see docs/precision.md, eq. 3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers, distinct
from photostrip.frozen import NamedTuple, dataclass
from photostrip.points import take_rows
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, ErrorRows, ranges
from photostrip.triangulation.error_propagation.strip_errors import StripErrors
from photostrip.triangulation.resection.collinearity import partials
from photostrip.triangulation.resection.resection import Resection, runs

SIGHTINGS = 2048  # gone through at a time; 3000 photos of 30 points take 160 MB less than all at once


@dataclass(frozen=True, eq=False)
class UsedRays:
    """Image points on which photos were oriented, ordered by photo."""

    photo: Numbers  # (e,): place of the photo in the strip, ascending
    point: Numbers  # (e,): row of the point in the strip's points
    image: Numbers  # (e,): row in the table of image points
    xyz: Floats  # (e, 3): adjusted point, metres
    focal: float  # principal distance, mm

    def take(self, rows: Numbers | Flags) -> UsedRays:
        return take_rows(self, rows, ("photo", "point", "image", "xyz"))


@dataclass(frozen=True, eq=False)
class PhotoErrors:
    """Errors of k photos that were oriented: centre, then small rotation, in the frame of the ground."""

    rows: ErrorRows  # d = 6
    influence: Floats  # (k, 6, t): what the parameters fitted to the control take away
    photos: Numbers  # (k,): places in the strip


def differentiate_photos(
    errors: StripErrors, sightings: UsedRays, resection: Resection, influence: Callable[[Numbers], Floats]
) -> Iterator[PhotoErrors]:
    """Differentiate the resections, some photos at a time: all their rows together are the largest table of a run.

    influence: (n, 3, t), what the fit takes away from n of the points.

    The points carry the photo with them, and its measurements move it once more: do = sum by_point dX + by_image dl.
    """
    sightings = sightings.take(resection.solved[sightings.photo])
    distance = float(np.linalg.norm(sightings.xyz - resection.centers[sightings.photo], axis=1).mean())
    ends = np.searchsorted(sightings.photo, np.arange(len(resection.centers) + 1))
    for low, high in runs(ends, SIGHTINGS):
        some = sightings.take(np.arange(ends[low], ends[high]))
        yield _some_photos(errors, some, resection, influence, distance)


def _some_photos(
    errors: StripErrors,
    sightings: UsedRays,
    resection: Resection,
    influence: Callable[[Numbers], Floats],
    distance: float,
) -> PhotoErrors:
    """Differentiate the resections of photos that have sightings: o = sum over their points of by.point times its row.

    The points of a photo lie side by side, (k, 6, 3 most), so that their rows are summed by products of matrices:
    similarities at once, components model by model. Beyond the first model of the photo a point's similarity is that of
    the first, and a step for each model between.
    """
    photos, starts, item = np.unique(sightings.photo, return_index=True, return_inverse=True)
    place = np.arange(len(item)) - starts[item]  # among the sightings of the photo
    by = _resected(sightings, resection, item, place, distance)
    points, images = errors.points, errors.images
    first = np.minimum.reduceat(points.first[sightings.point], starts)
    sighting, entry = ranges(*points.entries(sightings.point))
    image, by_image = points.image[entry], by.point[sighting] @ points.by_image[entry]
    once_more = np.flatnonzero(image == images.rows_of(sightings.image)[sighting])
    by_image[once_more] += by.image[sighting[once_more]] * images.sigma[image[once_more]][:, None, :]

    count, most = len(photos), int(place.max()) + 1  # points of a photo side by side, those that are none with zeros
    by_point = np.zeros((count, 6, most, 3))
    by_point[item, :, place] = by.point
    point = sightings.point[np.minimum(starts[:, None] + np.arange(most), len(item) - 1)]
    flat = by_point.reshape(count, 6, 3 * most)
    similar = points.by_similarity[point].reshape(count, 3 * most, -1)
    shift = np.zeros((count, most), np.intp)
    shift[item, place] = points.first[sightings.point] - first[item]
    along = points.by_component[point]
    slots = along.shape[2]
    farthest = int(shift.max())
    by_component = np.zeros((count, farthest + slots, 6, COMPONENTS))
    for ahead in range(farthest + 1):
        here = (by_point * (shift == ahead)[:, None, :, None]).reshape(flat.shape)
        for slot in range(slots):
            by_component[:, ahead + slot] += here @ along[:, :, slot].reshape(count, 3 * most, COMPONENTS)
        if ahead < farthest:
            beyond = (by_point * (shift > ahead)[:, None, :, None]).reshape(flat.shape)
            by_component[:, ahead] += beyond @ similar @ errors.steps[np.minimum(first + ahead, errors.models - 1)]
    rows = ErrorRows(
        first=first,
        by_similarity=flat @ similar,
        by_component=by_component,
        item=item[sighting],
        image=image,
        by_image=by_image,
    )
    return PhotoErrors(rows, flat @ influence(point.ravel()).reshape(count, 3 * most, -1), photos)


class _Resected(NamedTuple):
    """Derivatives of a photo's orientation by what it was oriented on."""

    image: Floats  # (e, 6, 2)
    point: Floats  # (e, 6, 3)


def _resected(sightings: UsedRays, resection: Resection, item: Numbers, place: Numbers, distance: float) -> _Resected:
    """Orientation by image coordinates and by points: do = N^-1 A^T (dl + A_S dX), N = A^T A of one photo."""
    rotations = resection.rotations[sightings.photo]
    arm = sightings.xyz - resection.centers[sightings.photo]
    by_x, by_y, _ = partials(arm, rotations, np.full(len(item), sightings.focal), np.ones(len(item)))
    design = np.stack([by_x.T, by_y.T], axis=1)
    unit = np.array([distance] * 3 + [1.0] * 3)  # so that shifts and rotations are of one size
    scaled = np.zeros((int(item[-1]) + 1, int(place.max()) + 1, 2, 6))
    scaled[item, place] = design * unit
    flat = scaled.reshape(len(scaled), -1, 6)
    solved = np.linalg.inv(flat.transpose(0, 2, 1) @ flat) @ flat.transpose(0, 2, 1)
    turned = (unit[:, None] * solved).reshape(len(scaled), 2, 3, -1)
    turned = resection.rotations[distinct(sightings.photo), None] @ turned
    by_image = turned.reshape(len(scaled), 6, -1, 2)[item, :, place]
    return _Resected(by_image, by_image @ (design[:, :, :3] @ rotations.transpose(0, 2, 1)))
