"""Errors of photos that are oriented on their adjusted points, as rows of derivatives like those of the points.

Source: derived; see docs/precision.md, eq. 3.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.frozen import dataclass
from photostrip.points import take_rows
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, ErrorRows, add_by_item, ranges
from photostrip.triangulation.resection.collinearity import partials
from photostrip.triangulation.resection.resection import runs

if TYPE_CHECKING:
    from collections.abc import Iterator

    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors
    from photostrip.triangulation.resection.resection import Resection

SIGHTINGS = 2048  # gone through at a time; 3000 photos of 30 points take 160 MB less than all at once


@dataclass(frozen=True, eq=False)
class Sightings:
    """Image points on which photos were oriented, ordered by photo."""

    photo: Numbers  # (e,): place of the photo in the strip, ascending
    point: Numbers  # (e,): row of the point in the strip's points
    image: Numbers  # (e,): row in the table of image points
    xyz: Floats  # (e, 3): adjusted point, metres
    focal: float  # principal distance, mm

    def take(self, rows: Numbers | Flags) -> Sightings:
        return take_rows(self, rows, ("photo", "point", "image", "xyz"))


@dataclass(frozen=True, eq=False)
class PhotoErrors:
    """Errors of k photos that were oriented: centre, then small rotation, in the frame of the ground."""

    rows: ErrorRows  # d = 6
    influence: Floats  # (k, 6, t): what the parameters fitted to the control take away
    photos: Numbers  # (k,): places in the strip


def differentiate_photos(
    errors: StripErrors, sightings: Sightings, resection: Resection, point_influence: Floats
) -> Iterator[PhotoErrors]:
    """Differentiate the resections, some photos at a time: all their rows together are the largest table of a run.

    point_influence: (q, 3, t), what the fit takes away from the points.

    The points carry the photo with them, and its measurements move it once more: do = sum by_point dX + by_image dl.
    """
    sightings = sightings.take(resection.solved[sightings.photo])
    distance = float(np.linalg.norm(sightings.xyz - resection.centers[sightings.photo], axis=1).mean())
    ends = np.searchsorted(sightings.photo, np.arange(len(resection.centers) + 1))
    for low, high in runs(ends, SIGHTINGS):
        some = sightings.take(np.arange(ends[low], ends[high]))
        yield _some_photos(errors, some, resection, point_influence, distance)


def _some_photos(
    errors: StripErrors, sightings: Sightings, resection: Resection, point_influence: Floats, distance: float
) -> PhotoErrors:
    """Differentiate the resections of the photos that have sightings."""
    photos, starts, item = np.unique(sightings.photo, return_index=True, return_inverse=True)
    by = _resected(sightings, resection, starts, item, distance)
    points, images = errors.points, errors.images
    moved = by.point @ points.by_similarity[sightings.point]
    first = np.minimum.reduceat(points.first[sightings.point], starts)
    sighting, entry = ranges(*points.entries(sightings.point))
    image, by_image = points.image[entry], by.point[sighting] @ points.by_image[entry]
    once_more = np.flatnonzero(image == images.rows_of(sightings.image)[sighting])
    by_image[once_more] += by.image[sighting[once_more]] * images.sigma[image[once_more]][:, None, :]
    rows = ErrorRows(
        first=first,
        by_similarity=np.add.reduceat(moved, starts, axis=0),
        by_component=_by_component(errors, sightings, first, item, by.point, moved),
        item=item[sighting],
        image=image,
        by_image=by_image,
    )
    return PhotoErrors(rows, np.add.reduceat(by.point @ point_influence[sightings.point], starts, axis=0), photos)


class _Resected(NamedTuple):
    """Derivatives of a photo's orientation by what it was oriented on."""

    image: Floats  # (e, 6, 2)
    point: Floats  # (e, 6, 3)


def _resected(sightings: Sightings, resection: Resection, starts: Numbers, item: Numbers, distance: float) -> _Resected:
    """Orientation by image coordinates and by points: do = N^-1 A^T (dl + A_S dX), N = A^T A of one photo."""
    rotations = resection.rotations[sightings.photo]
    count = len(sightings.photo)
    arm = sightings.xyz - resection.centers[sightings.photo]
    by_x, by_y, _ = partials(arm, rotations, np.full(count, sightings.focal), np.ones(count))
    design = np.stack([by_x.T, by_y.T], axis=1)
    unit = np.array([distance] * 3 + [1.0] * 3)  # so that shifts and rotations are of one size
    scaled = design * unit
    normal = np.add.reduceat(scaled.transpose(0, 2, 1) @ scaled, starts, axis=0)
    turn = np.zeros((count, 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = rotations
    by_image = turn @ (unit[:, None] * (np.linalg.inv(normal)[item] @ scaled.transpose(0, 2, 1)))
    return _Resected(by_image, by_image @ design[:, :, :3] @ rotations.transpose(0, 2, 1))


def _by_component(
    errors: StripErrors, sightings: Sightings, first: Numbers, item: Numbers, by_point: Floats, moved: Floats
) -> Floats:
    """Coefficients of components: what the points have, and the steps from the photo's first model to the points'."""
    points, steps = errors.points, errors.steps
    shift = points.first[sightings.point] - first[item]
    slots = points.by_component.shape[1]
    result = np.zeros((len(first), int(shift.max()) + slots, by_point.shape[1], COMPONENTS))
    for ahead in range(int(shift.max()) + 1):
        chosen = np.flatnonzero(shift == ahead)
        for slot in range(slots):
            values = by_point[chosen] @ points.by_component[sightings.point[chosen], slot]
            add_by_item(result[:, ahead + slot], item[chosen], values)
        beyond = np.flatnonzero(shift > ahead)
        if len(beyond):
            present, starts = np.unique(item[beyond], return_index=True)
            sums = np.add.reduceat(moved[beyond], starts, axis=0)
            result[present, ahead] += sums @ steps[first[present] + ahead]
    return result
