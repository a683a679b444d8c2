"""Errors of points that stand in no model: where two rays of photos that are no neighbours come nearest.

Source: derived; see docs/precision.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import similarity_derivatives
from photostrip.triangulation.error_propagation.derivatives import UNITS, Images, Rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.relative_orientation.relative import Orientation
    from photostrip.triangulation.strip_formation.formation import FormedStrip

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]


def with_bridges(
    points: Rows,
    strip: tuple[Orientation, FormedStrip],
    seen: tuple[Images, Numbers],
    photos: tuple[Floats, Floats],
    steps: Floats,
) -> Rows:
    """Complete the rows of the points of a strip by those without a model.

    Parameters
    ----------
    points : Rows
        Points of the strip; those without a model are empty but for ``frame``.
    seen : tuple of Images and ndarray of int
        Image points, and the place of each pair's two points among them.
    photos : tuple of ndarray
        Perspective centres (p + 1, 3) from the common origin in metres, and rotations (p + 1, 3, 3).
    steps : ndarray, shape (p, 7, 6)
        Steps between the models.
    """
    orientation, formed = strip
    images, place = seen
    image, item, xy = _ends(orientation, formed, images, place)
    at = images.photo[image]
    rays = np.concatenate([xy, np.full((*at.shape, 1), -orientation.pairs.focal)], axis=2)
    turned = np.einsum("nkij,nkj->nki", photos[1][at], rays)
    by_center, by_turn, own = _meeting(photos[0][at], turned, photos[1][at])
    count = int((at[:, 1] - at[:, 0]).max())
    core = np.zeros((len(points.first), max(points.core.shape[1], count), 3, UNITS))
    core[:, : points.core.shape[1]] = points.core
    first = points.first.copy()
    first[item] = np.minimum(at[:, 0], len(steps) - 1)
    moved = by_center @ similarity_derivatives(photos[0][at[:, 1]], np.zeros(3))
    moved[:, :, 3:6] += by_turn
    for slot in range(count):
        inside = np.flatnonzero(at[:, 0] + slot < at[:, 1])
        core[item[inside], slot] = moved[inside] @ steps[at[inside, 0] + slot]
    things = np.concatenate([points.item, np.repeat(item, 2)])
    order = np.argsort(things, kind="stable")
    entries = np.concatenate([points.image, image.ravel()])
    values = own.reshape(-1, 3, 2) * images.sigma[image.ravel()][:, None, :]
    coefficients = np.concatenate([points.own, values])
    return Rows(first, points.frame, core, things[order], entries[order], coefficients[order])


def _ends(
    orientation: Orientation, formed: FormedStrip, images: Images, place: Numbers
) -> tuple[Numbers, Numbers, Floats]:
    """First and last image point of each point without a model, its row in the strip, and the coordinates in mm."""
    xy, point = np.zeros((len(images.row), 2)), np.zeros(len(images.row), np.intp)
    for side, measured in ((0, orientation.pairs.left), (1, orientation.pairs.right)):
        xy[place[:, side]] = measured
        point[place[:, side]] = orientation.point
    rows = np.flatnonzero(np.isin(images.row, formed.bridging))
    rows = rows[np.lexsort((images.photo[rows], point[rows]))]
    number, begin, count = np.unique(point[rows], return_index=True, return_counts=True)
    ends = rows[np.column_stack([begin, begin + count - 1])]
    return ends, np.searchsorted(formed.point, number), xy[ends]


def _meeting(centers: Floats, rays: Floats, rotations: Floats) -> tuple[Floats, Floats, Floats]:
    """Middle between two rays by the second centre, by a small turn of the second photo, and by image coordinates.

    With factors (l1, l2) = G b, G the left inverse of [r1, -r2], the middle is (l1 r1 + b + l2 r2) / 2.
    """
    first, second = rays[:, 0], rays[:, 1]
    inverse = np.linalg.pinv(np.stack([first, -second], axis=2))
    factors = np.einsum("nij,nj->ni", inverse, centers[:, 1] - centers[:, 0])
    half = np.stack([first, second], axis=2) @ inverse / 2
    ahead, back = np.eye(3) / 2 + half, np.eye(3) / 2 - half
    by_second, by_first = factors[:, 1, None, None] * ahead, factors[:, 0, None, None] * back
    own = np.stack([by_first @ rotations[:, 0, :, :2], by_second @ rotations[:, 1, :, :2]], axis=1)
    return ahead, -by_second @ cross_matrix(second), own
