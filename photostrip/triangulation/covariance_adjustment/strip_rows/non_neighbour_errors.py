"""Errors of points that stand in no model: where two rays of photos that are no neighbours come nearest.

Source: derived; see docs/precision.md, eq. 3.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import NamedTuple
from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import similarity_derivatives
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import COMPONENTS, PlacedStrip, PointRows


def with_bridges(points: PointRows, strip: PlacedStrip) -> PointRows:
    """Complete the rows of the points of a strip by those without a model, which move with their first model so far."""
    ends = _ends(strip)
    photo = strip.images.photo[ends.image]
    rays = np.concatenate([ends.xy, np.full((*photo.shape, 1), -strip.orientation.pairs.focal)], axis=2)
    turned = np.einsum("nkij,nkj->nki", strip.rotations[photo], rays)
    middle = _middle(strip.centers[photo], turned, strip.rotations[photo])
    slots = int((photo[:, 1] - photo[:, 0]).max())
    have = points.by_component.shape[1]
    by_component = np.zeros((len(points.first), max(have, slots), 3, COMPONENTS))
    by_component[:, :have] = points.by_component
    first = points.first.copy()
    first[ends.item] = np.minimum(photo[:, 0], len(strip.steps) - 1)
    moved = middle.by_center @ similarity_derivatives(strip.centers[photo[:, 1]], np.zeros(3))
    moved[:, :, 3:6] += middle.by_turn
    for slot in range(slots):
        inside = np.flatnonzero(photo[:, 0] + slot < photo[:, 1])
        by_component[ends.item[inside], slot] = moved[inside] @ strip.steps[photo[inside, 0] + slot]
    counts = np.diff(points.starts)
    item = np.concatenate([np.repeat(np.arange(len(counts)), counts), np.repeat(ends.item, 2)])
    order = np.argsort(item, kind="stable")
    image = ends.image.ravel()
    by_image = middle.by_image.reshape(-1, 3, 2) * strip.images.sigma[image][:, None, :]
    return PointRows(
        xyz=points.xyz,
        first=first,
        by_component=by_component,
        starts=np.searchsorted(item[order], np.arange(len(counts) + 1)),
        image=np.concatenate([points.image, image])[order],
        by_image=np.concatenate([points.by_image, by_image])[order],
    )


class _Ends(NamedTuple):
    """First and last image point of each point without a model."""

    image: Numbers  # (n, 2): rows of the image points
    item: Numbers  # (n,): its row in the strip
    xy: Floats  # (n, 2, 2): mm


def _ends(strip: PlacedStrip) -> _Ends:
    """Order the image points of each point along the flight; its place is the middle between the outermost two rays."""
    orientation, images = strip.orientation, strip.images
    xy, point = np.zeros((len(images.row), 2)), np.zeros(len(images.row), np.intp)
    place = images.rows_of(orientation.rows)
    for side, measured in ((0, orientation.pairs.left), (1, orientation.pairs.right)):
        xy[place[:, side]] = measured
        point[place[:, side]] = orientation.point
    rows = np.flatnonzero(np.isin(images.row, strip.formed.bridging))
    rows = rows[np.lexsort((images.photo[rows], point[rows]))]
    number, begin, count = np.unique(point[rows], return_index=True, return_counts=True)
    ends = rows[np.column_stack([begin, begin + count - 1])]
    return _Ends(ends, np.searchsorted(strip.formed.point, number), xy[ends])


class _Middle(NamedTuple):
    """Derivatives of the middle between two rays."""

    by_center: Floats  # (n, 3, 3): by the second centre
    by_turn: Floats  # (n, 3, 3): by a small turn of the second photo
    by_image: Floats  # (n, 2, 3, 2): by the image coordinates on both photos


def _middle(centers: Floats, rays: Floats, rotations: Floats) -> _Middle:
    """Differentiate (l1 r1 + b + l2 r2) / 2 with the factors (l1, l2) = G b, G the left inverse of [r1, -r2]."""
    first, second = rays[:, 0], rays[:, 1]
    inverse = np.linalg.pinv(np.stack([first, -second], axis=2))
    factors = np.einsum("nij,nj->ni", inverse, centers[:, 1] - centers[:, 0])
    half = np.stack([first, second], axis=2) @ inverse / 2
    ahead, back = np.eye(3) / 2 + half, np.eye(3) / 2 - half
    by_second, by_first = factors[:, 1, None, None] * ahead, factors[:, 0, None, None] * back
    by_image = np.stack([by_first @ rotations[:, 0, :, :2], by_second @ rotations[:, 1, :, :2]], axis=1)
    return _Middle(ahead, -by_second @ cross_matrix(second), by_image)
