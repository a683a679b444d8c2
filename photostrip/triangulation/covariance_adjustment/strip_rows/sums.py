"""Sums over the rows of a strip: by its error components, and by the image points that enter rows directly.

Source: derived; see docs/precision.md, eq. 4.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from photostrip.arrays import Floats, pieces
from photostrip.frozen import NamedTuple
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import (
    COMPONENTS,
    MOVED,
    SHARING,
    SPAN,
    ErrorRows,
    same_images,
)
from photostrip.triangulation.covariance_adjustment.strip_rows.strip_errors import StripErrors


def by_components(errors: StripErrors, weights: Floats) -> Floats:
    """Coefficients (k, 2) of all image coordinates in a weighted sum of error components (p, 6)."""
    none = np.zeros((SHARING, COMPONENTS))
    padded = np.concatenate([none, weights, none])
    around = np.concatenate([padded[slot : slot + errors.models + 1] for slot in range(SPAN)], axis=1)
    result = np.empty((len(errors.images.row), 2))
    for piece in pieces(len(result)):
        photos = errors.images.photo[piece]
        np.einsum("nic,nc->ni", errors.images.components[piece], around[photos, MOVED], out=result[piece])
    return result


class NearImages(NamedTuple):
    """Image points of the photos ``first`` to ``first + s`` that enter rows directly, side by side."""

    by_image: Floats  # (n, d, 2 m): rows with fewer than m of them have coefficients of zero
    with_components: Floats  # (n, d, s + 4, 6): covariances with components of the models from ``first - 2`` on

    @classmethod
    def of(cls, errors: StripErrors, rows: ErrorRows) -> Self:
        """Lay the image points of each row out by photo and place, so that products need no loop over rows."""
        n, slots, size, _ = rows.by_component.shape
        photos = slots + 1
        photo = errors.images.photo[rows.image] - rows.first[rows.item]
        cell = rows.item * photos + photo
        counts = np.bincount(cell, minlength=n * photos)
        order = np.argsort(cell, kind="stable")
        place = np.empty(len(cell), np.intp)
        place[order] = np.arange(len(cell)) - np.repeat(np.cumsum(counts) - counts, counts)
        most = int(counts.max(initial=0))
        image = np.zeros((n, photos, most), np.intp)  # empty places have any image, with coefficients of zero
        image[rows.item, photo, place] = rows.image
        by_image = np.zeros((n, photos, most, 2, size))
        by_image[rows.item, photo, place] = rows.by_image.transpose(0, 2, 1)
        with_components = np.zeros((n, size, (photos + SHARING + 1) * COMPONENTS))
        for slot in range(photos):
            components = errors.images.components.take(image[:, slot], axis=0)
            components = components.reshape(n, 2 * most, MOVED.stop - MOVED.start)
            products = by_image[:, slot].reshape(n, 2 * most, size).transpose(0, 2, 1) @ components
            moved = slice(MOVED.start + slot * COMPONENTS, MOVED.stop + slot * COMPONENTS)
            with_components[:, :, moved] += products
        return cls(
            by_image.reshape(n, 2 * photos * most, size).transpose(0, 2, 1),
            with_components.reshape(n, size, photos + SHARING + 1, COMPONENTS),
        )


def by_same_images(rows: ErrorRows) -> Floats:
    """Covariances (n, n) of rows with d = 1 by the image points alone that enter two of them directly."""
    count, shared = len(rows.first), same_images(rows, rows)
    place = shared.first * count + shared.second
    return np.asarray(np.bincount(place, shared.value[:, 0, 0], count**2).reshape(count, count), float)
