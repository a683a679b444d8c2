"""Errors of photos that are oriented on their adjusted points, as rows of derivatives like those of the points.

Source: derived; see docs/precision.md, eq. 3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers, distinct
from photostrip.frozen import NamedTuple, dataclass, replace
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, ErrorRows
from photostrip.triangulation.error_propagation.strip_errors import StripErrors
from photostrip.triangulation.resection.collinearity import distances, partials
from photostrip.triangulation.resection.resection import Resection, runs

SIGHTINGS = 2048  # gone through at a time; 3000 photos of 30 points take 160 MB less than all at once


@dataclass(frozen=True, eq=False)
class UsedRays:
    """Image points on which photos were oriented, ordered by photo."""

    photo: Numbers  # (e,): place of the photo in the strip, ascending
    image: Numbers  # (e,): row in the table of image points
    numbers: Numbers  # (k,): number of the point of each row of that table
    known: Numbers  # (q,): numbers of the strip's points, ascending
    points: Floats  # (q, 3): these, adjusted, metres
    focal: float  # principal distance, mm

    @property
    def point(self) -> Numbers:
        """Row of the point (e,) of each in the strip's points: of all at once not worth keeping."""
        return np.searchsorted(self.known, self.numbers[self.image])

    @property
    def xyz(self) -> Floats:
        """Adjusted point (e, 3) of each."""
        return self.points[self.point]

    def take(self, rows: Numbers | Flags | slice) -> UsedRays:
        return replace(self, photo=self.photo[rows], image=self.image[rows])


@dataclass(frozen=True, eq=False)
class PhotoErrors:
    """Errors of k photos that were oriented: centre, then small rotation, in the frame of the ground."""

    rows: ErrorRows  # d = 6
    influence: Floats  # (k, 6, t): what the parameters fitted to the control take away
    photos: Numbers  # (k,): places in the strip


def differentiate_photos(
    errors: StripErrors,
    sightings: UsedRays,
    resection: Resection,
    terms: Callable[[Numbers], Sequence[Floats]],
) -> Iterator[PhotoErrors]:
    """Differentiate the resections, some photos at a time: all their rows together are the largest table of a run.

    terms: gives terms of the polynomials (n, t) for X, Y and Z at some points.

    The points carry the photo with them, and its measurements move it once more: do = sum by_point dX + by_image dl.
    """
    if not resection.solved.all():
        sightings = sightings.take(resection.solved[sightings.photo])
    ends = np.searchsorted(sightings.photo, np.arange(len(resection.centers) + 1))
    parts = [slice(ends[low], ends[high]) for low, high in runs(ends, SIGHTINGS)]
    distance = np.concatenate([_distances(sightings.take(part), resection) for part in parts]).mean()
    for part in parts:
        yield _some_photos(errors, sightings.take(part), resection, terms, float(distance))


def _distances(sightings: UsedRays, resection: Resection) -> Floats:
    return distances(sightings.xyz, resection.centers, sightings.photo)


def _some_photos(
    errors: StripErrors,
    sightings: UsedRays,
    resection: Resection,
    terms: Callable[[Numbers], Sequence[Floats]],
    distance: float,
) -> PhotoErrors:
    """Differentiate the resections of photos that have sightings: o = sum over their points of by.point times its row.

    The points of a photo lie side by side, (k, most), so that their rows are summed by products of matrices. Beyond the
    first model of the photo a point's similarity is that of the first, and a step for each model between.
    """
    photos, starts, item = np.unique(sightings.photo, return_index=True, return_inverse=True)
    place = np.arange(len(item)) - starts[item]  # among the sightings of the photo
    count, most = len(photos), int(place.max()) + 1
    by = _resected(sightings, resection, item, place, distance)
    points, images, of_sighting = errors.points, errors.images, sightings.point
    sighting, entry = points.entries(of_sighting)
    beside = item * most + place
    by_image = points.by_image[entry].transpose(0, 2, 1) @ by.point.reshape(-1, 3, 6)[beside[sighting]]
    image = points.image[entry]
    once_more = np.flatnonzero(image == images.rows_of(sightings.image)[sighting])
    directly = by.image.reshape(-1, 2, 6)[beside[sighting[once_more]]]
    by_image[once_more] += directly * images.stated[images.row[image[once_more]]][:, :, None]

    first = np.minimum.reduceat(points.first[of_sighting], starts)
    # where a photo has fewer points, the last again, with derivatives of zero
    point = of_sighting[np.minimum(starts[:, None] + np.arange(most), np.append(starts[1:], len(item))[:, None] - 1)]
    similar, along = points.by_similarity(point), points.by_component[point]
    shift, slots = points.first[point] - first[:, None], along.shape[2]
    farthest, all_similar = int(shift.max()), similar.reshape(count, 3 * most, -1)
    carried = np.zeros((count, farthest + slots, most, 3, COMPONENTS))
    for slot in range(slots):
        carried[np.arange(count)[:, None], shift + slot, np.arange(most)] = along[:, :, slot]
    for ahead in range(farthest):
        moved = all_similar @ errors.steps[np.minimum(first + ahead, errors.models - 1)]
        beyond = shift > ahead
        carried[:, ahead][beyond] = moved.reshape(count, most, 3, -1)[beyond]
    flat = by.point.reshape(count, 3 * most, 6).transpose(0, 2, 1)
    by_similarity = flat @ all_similar
    rows = ErrorRows(
        first=first,
        by_similarity=by_similarity,
        by_component=flat[:, None] @ carried.reshape(count, -1, 3 * most, COMPONENTS),
        item=item[sighting],
        image=image,
        by_image=by_image.transpose(0, 2, 1),
    )
    # a similarity of the whole strip moves a photo as that of its first model does
    by_terms = [
        by.point[:, :, axis].transpose(0, 2, 1) @ of_axis.reshape(count, most, -1)
        for axis, of_axis in enumerate(terms(point.ravel()))
    ]
    return PhotoErrors(rows, np.concatenate([by_similarity, *by_terms], axis=2), photos)


class _Resected(NamedTuple):
    """Derivatives of the orientations of k photos by what they were oriented on, the points of a photo side by side."""

    image: Floats  # (k, most, 2, 6)
    point: Floats  # (k, most, 3, 6)


def _resected(sightings: UsedRays, resection: Resection, item: Numbers, place: Numbers, distance: float) -> _Resected:
    """Orientation by image coordinates and by points: do = N^-1 A^T (dl + A_S dX), N = A^T A of one photo."""
    rotations = resection.rotations[sightings.photo]
    arm = sightings.xyz - resection.centers[sightings.photo]
    by_x, by_y, _ = partials(arm, rotations, np.full(len(item), sightings.focal), np.ones(len(item)))
    unit = np.array([distance] * 3 + [1.0] * 3)  # so that shifts and rotations are of one size
    count, most = int(item[-1]) + 1, int(place.max()) + 1
    scaled = np.zeros((count, most, 2, 6))
    scaled[item, place, 0], scaled[item, place, 1] = by_x.T * unit, by_y.T * unit
    flat = scaled.reshape(count, -1, 6)
    cofactors = unit[:, None] * np.linalg.inv(flat.transpose(0, 2, 1) @ flat)
    turn = resection.rotations[distinct(sightings.photo)]
    turned = (turn[:, None] @ cofactors.reshape(count, 2, 3, 6)).reshape(count, 6, 6)
    by_image = (flat @ turned.transpose(0, 2, 1)).reshape(scaled.shape)
    by_shift = (flat[:, :, :3] / distance) @ turn.transpose(0, 2, 1)
    return _Resected(by_image, by_shift.reshape(count, most, 2, 3).transpose(0, 1, 3, 2) @ by_image)
