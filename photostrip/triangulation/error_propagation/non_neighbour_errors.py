"""Errors of points that stand in no model: where two rays of photos that are no neighbours come nearest.

Source: derived; see docs/precision.md, eq. 3.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.triangulation.error_propagation.strip_errors import StripErrors, blocks, entries_of

if TYPE_CHECKING:
    from scipy.sparse import csr_array


def points_between(errors: StripErrors, place: Numbers, shape: tuple[int, int]) -> csr_array:
    """Sparse rows of points without a model, each in the middle between the first and the last of its rays.

    place: (q,), the place of each point of the strip among those asked for, -1 for all others.

    Such a point moves with the frame of the first photo, and by what moves the last one more than that.
    """
    item, image, photo, xy = _ends(errors, place)
    rays = np.concatenate([xy, np.full((*photo.shape, 1), -errors.orientation.pairs.focal)], axis=2)
    turns, centers = errors.rotations[photo], errors.centers[photo]
    ahead, by_turn, by_image = _middle(centers, np.einsum("nkij,nkj->nki", turns, rays), turns)
    by_last = ahead @ similarity_derivatives(centers[:, 1], np.zeros(3))
    by_last[:, :, 3:6] += by_turn
    by_first = similarity_derivatives(errors.xyz[item], np.zeros(3)) - by_last
    by_image *= errors.sigma[image][:, :, None, :]
    columns = [
        entries_of(photo[:, 0], SIMILARITY_PARAMETERS),
        entries_of(photo[:, 1], SIMILARITY_PARAMETERS),
        errors.first_error + errors.image_columns(image).reshape(-1, 4),
    ]
    values = np.concatenate([by_first, by_last, by_image[:, 0], by_image[:, 1]], axis=2)
    return blocks(entries_of(place[item], 3), np.concatenate(columns, axis=1), values, shape)


def _ends(errors: StripErrors, place: Numbers) -> tuple[Numbers, Numbers, Numbers, Floats]:
    """Points (n,) as rows of the strip; image points (n, 2), photos (n, 2) and coordinates (n, 2, 2) of both rays."""
    orientation, formed = errors.orientation, errors.formed
    pairs = orientation.pairs
    image = orientation.rows.ravel()
    item = np.searchsorted(formed.point, np.repeat(orientation.point, 2))
    photo = (pairs.pair[:, None] + np.arange(2)).ravel()
    xy = np.stack([pairs.left, pairs.right], axis=1).reshape(-1, 2)
    some = np.flatnonzero(np.isin(image, formed.bridging))
    some = some[place[item[some]] >= 0]
    some = some[np.lexsort((photo[some], item[some]))]
    points, begin, count = np.unique(item[some], return_index=True, return_counts=True)
    ends = some[np.column_stack([begin, begin + count - 1])]
    return points, image[ends], photo[ends], xy[ends]


def _middle(centers: Floats, rays: Floats, rotations: Floats) -> tuple[Floats, Floats, Floats]:
    """Differentiate (l1 r1 + b + l2 r2) / 2 with the factors (l1, l2) = G b, G the left inverse of [r1, -r2].

    Returns the derivatives by the second centre (n, 3, 3), by a small turn of the second photo (n, 3, 3), and by the
    image coordinates on both photos (n, 2, 3, 2).
    """
    first, second = rays[:, 0], rays[:, 1]
    inverse = np.linalg.pinv(np.stack([first, -second], axis=2))
    factors = np.einsum("nij,nj->ni", inverse, centers[:, 1] - centers[:, 0])
    half = np.stack([first, second], axis=2) @ inverse / 2
    ahead, back = np.eye(3) / 2 + half, np.eye(3) / 2 - half
    by_second, by_first = factors[:, 1, None, None] * ahead, factors[:, 0, None, None] * back
    by_image = np.stack([by_first @ rotations[:, 0, :, :2], by_second @ rotations[:, 1, :, :2]], axis=1)
    return ahead, -by_second @ cross_matrix(second), by_image
