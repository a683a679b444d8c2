"""Rows over the photos around their points: by the correlates of the error components, and by the unknowns.

The unknowns y of neighbouring photos say what the components of their model are. So a row of coefficients by
similarity, components and image points becomes one by the unknowns of a few photos, and its covariances with the
components' own image points stand beside these: a window of 14 numbers for each photo, from two photos before the first
model of its point on.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.covariance_adjustment.similarities import PhotoSimilarities
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, SHARING, ErrorRows

# of a photo: seven correlates of what its unknowns and those of the next say of their model, and its unknowns
STEP, UNKNOWN = slice(0, SIMILARITY_PARAMETERS), slice(SIMILARITY_PARAMETERS, 2 * SIMILARITY_PARAMETERS)
PLACES = UNKNOWN.stop


def windows(similarities: PhotoSimilarities, rows: ErrorRows, images: Floats, base: Numbers, photos: int) -> Floats:
    """Give the windows (n, d, w, 14) of rows.

    images: covariances of their image points with components, as ``NearImages`` has them.
    base: (n,), first model of the point of each.
    photos: w, of a window.
    """
    count, slots, size, _ = rows.by_component.shape
    first, models, places = rows.first, len(similarities.size), images.shape[2]
    later = first - base
    result = np.zeros((count, size, max(photos, places) + int(later.max(initial=0)), PLACES))
    for place in range(places):
        model = np.clip(first - SHARING + place, 0, models - 1)  # beyond the ends there are no covariances
        np.divide(images[:, :, place], -similarities.size[model, None], out=result[:, :, place, :COMPONENTS])
    unknowns = result[:, :, SHARING:, UNKNOWN]
    unknowns[:, :, 0] = rows.by_similarity @ similarities.to_common[first]
    for slot in range(slots):
        model = np.minimum(first + slot, models - 1)
        by_component = rows.by_component[:, slot] * similarities.size[model, None]
        unknowns[:, :, slot] += by_component @ similarities.own[model, :COMPONENTS]
        unknowns[:, :, slot + 1] = by_component @ similarities.following[model, :COMPONENTS]
    for number in range(1, int(later.max(initial=0)) + 1):
        some = np.flatnonzero(later == number)
        result[some, :, number:] = result[some, :, :-number]
        result[some, :, :number] = 0.0
    return result[:, :, :photos]
