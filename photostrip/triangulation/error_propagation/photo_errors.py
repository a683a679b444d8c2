"""Errors of photos that are oriented on their adjusted points, as rows of derivatives like those of the points.

Source: derived; see docs/precision.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.error_propagation.derivatives import UNITS, Rows
from photostrip.triangulation.resection import resection as exterior

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.error_propagation.strip_errors import StripErrors
    from photostrip.triangulation.resection.resection import Resection

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Sightings:
    """Image points on which photos were oriented, ordered by photo."""

    photo: Numbers  # (e,): place of the photo in the strip, ascending
    point: Numbers  # (e,): row of the point in the strip's points
    image: Numbers  # (e,): row in the table of image points
    xyz: Floats  # (e, 3): adjusted point, metres
    focal: float  # principal distance, mm


def photo_rows(
    errors: StripErrors, seen: Sightings, resection: Resection, influence: Floats
) -> tuple[Rows, Floats, Numbers]:
    """Rows of derivatives of the photos: centre, then small rotation, in the frame of the ground.

    Parameters
    ----------
    seen : Sightings
        What the photos were oriented on.
    influence : ndarray, shape (q, 3, t)
        What the parameters fitted to the control take away from the points.

    Returns
    -------
    rows : Rows
        One for each photo that was oriented, d = 6.
    influence : ndarray, shape (k, 6, t)
        What the parameters take away from it.
    photos : ndarray of int, shape (k,)
        Places of these photos in the strip.
    """
    chosen = resection.solved[seen.photo]
    seen = Sightings(seen.photo[chosen], seen.point[chosen], seen.image[chosen], seen.xyz[chosen], seen.focal)
    photos, starts, item = np.unique(seen.photo, return_index=True, return_inverse=True)
    by_image, by_point = _resected(seen, resection, starts, item)
    points = errors.points
    first = np.minimum.reduceat(points.first[seen.point], starts)
    moved = by_point @ points.frame[seen.point]
    rows = Rows(
        first,
        np.add.reduceat(moved, starts, axis=0),
        _core(errors, seen, (first, item), by_point, moved),
        *_own(errors, seen, item, by_image, by_point),
    )
    return rows, np.add.reduceat(by_point @ influence[seen.point], starts, axis=0), photos


def _resected(seen: Sightings, resection: Resection, starts: Numbers, item: Numbers) -> tuple[Floats, Floats]:
    """Orientation by image coordinates (e, 6, 2) and by points (e, 6, 3): do = N^-1 A^T (dl + A_S dX)."""
    rotations = resection.rotations[seen.photo]
    count = len(seen.photo)
    arm = seen.xyz - resection.centers[seen.photo]
    by_x, by_y, _ = exterior.partials(arm, rotations, np.full(count, seen.focal), np.ones(count))
    design = np.stack([by_x.T, by_y.T], axis=1)
    distance = np.linalg.norm(arm, axis=1).mean()
    unit = np.array([distance] * 3 + [1.0] * 3)  # so that shifts and rotations are of one size
    scaled = design * unit
    normal = np.add.reduceat(scaled.transpose(0, 2, 1) @ scaled, starts, axis=0)
    turn = np.zeros((count, 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = rotations
    by_image = turn @ (unit[:, None] * (np.linalg.inv(normal)[item] @ scaled.transpose(0, 2, 1)))
    return by_image, by_image @ design[:, :, :3] @ rotations.transpose(0, 2, 1)


def _core(
    errors: StripErrors, seen: Sightings, place: tuple[Numbers, Numbers], by_point: Floats, moved: Floats
) -> Floats:
    """Coefficients of units: what the points have, and the steps from the photo's first model to the points'."""
    first, item = place
    points, steps = errors.points, errors.steps
    shift = points.first[seen.point] - first[item]
    slots = points.core.shape[1]
    core = np.zeros((len(first), int(shift.max()) + slots, by_point.shape[1], UNITS))
    for ahead in range(int(shift.max()) + 1):
        chosen = np.flatnonzero(shift == ahead)
        for slot in range(slots):
            values = by_point[chosen] @ points.core[seen.point[chosen], slot]
            _add_by_item(core[:, ahead + slot], item[chosen], values)
        beyond = np.flatnonzero(shift > ahead)
        if len(beyond):
            present, starts = np.unique(item[beyond], return_index=True)
            sums = np.add.reduceat(moved[beyond], starts, axis=0)
            core[present, ahead] += sums @ steps[first[present] + ahead]
    return core


def _add_by_item(target: Floats, item: Numbers, values: Floats) -> None:
    """Add values to the rows of ascending items."""
    if len(item):
        present, starts = np.unique(item, return_index=True)
        target[present] += np.add.reduceat(values, starts, axis=0)


def _own(
    errors: StripErrors, seen: Sightings, item: Numbers, by_image: Floats, by_point: Floats
) -> tuple[Numbers, Numbers, Floats]:
    """Image points by themselves: those that made the photo's points, and those on the photo once more."""
    points, images = errors.points, errors.images
    lookup = np.full(int(images.row.max()) + 1, -1)
    lookup[images.row] = np.arange(len(images.row))
    starts = np.searchsorted(points.item, seen.point)
    counts = np.searchsorted(points.item, seen.point, side="right") - starts
    entry = np.repeat(np.arange(len(item)), counts)
    source = np.arange(len(entry)) - np.repeat(np.cumsum(counts) - counts, counts) + starts[entry]
    own = by_point[entry] @ points.own[source]
    image = points.image[source]
    here = np.flatnonzero(image == lookup[seen.image][entry])
    own[here] += by_image[entry[here]] * images.sigma[image[here]][:, None, :]
    return item[entry], image, own
