"""A strip formed once more from measurements that changed a little, with every decision kept as it was.

Which points take part, their weights, and the pass points that join models stay. Only coordinates move, so that the
new strip is the old one at another place of its measurements, and derivatives of the one continue those of the other.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.relative_orientation.solution import iterate_elements, y_parallaxes
from photostrip.triangulation.strip_formation import non_neighbours
from photostrip.triangulation.strip_formation.strip import model_points, place_models

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.points import PhotoPoints
    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.strip_formation.scale_transfer import Junctions
    from photostrip.triangulation.strip_formation.strip import FormedStrip

    Floats = NDArray[np.float64]


def oriented_again(orientation: Orientation, xy: Floats) -> Orientation:
    """Orient the pairs of a strip on other image coordinates.

    Parameters
    ----------
    orientation : Orientation
        The pairs; their elements are where the iteration starts.
    xy : ndarray, shape (k, 2)
        Image coordinates of all image points, mm.

    Returns
    -------
    Orientation
        The pairs with new coordinates, elements and parallaxes; what is said of their precision stays.
    """
    left, right = (xy[orientation.rows[:, side]] for side in (0, 1))
    pairs = replace(orientation.pairs, left=left, right=right)
    elements = iterate_elements(orientation.elements, pairs).elements
    return replace(orientation, pairs=pairs, elements=elements, parallax=y_parallaxes(elements, pairs))


def formed_again(
    formed: FormedStrip, orientation: Orientation, observations: PhotoPoints, photos: Sequence[str]
) -> FormedStrip:
    """Form a strip from pairs that were oriented again.

    Parameters
    ----------
    formed : FormedStrip
        The strip as it was formed at first.
    orientation : Orientation
        Its pairs, as ``oriented_again`` gives them.
    observations : PhotoPoints
        The image points that these were oriented on.

    Returns
    -------
    FormedStrip
        The same points and joints; ``model_xyz`` holds the points that were left out, too.
    """
    models = model_points(orientation)
    junctions = _joined(formed.junctions, orientation, models.vectors)
    there = np.asarray(np.isfinite(formed.model_xyz).all(axis=1), bool)
    again = place_models(orientation, models, junctions, orientation.used & there)
    if not len(formed.bridging):
        return again
    return non_neighbours.bridge(again, observations, photos, orientation.pairs.focal, formed.bridging)


def _joined(joined: Junctions, orientation: Orientation, vectors: Floats) -> Junctions:
    """Return the scale transfer with the same pass points and weights."""
    base, _ = orientation.relative
    before = np.linalg.norm(vectors[joined.before] - base[joined.junction], axis=1)
    ratio = before / np.linalg.norm(vectors[joined.after], axis=1)
    total = np.bincount(joined.junction, joined.weight, len(joined.factor))
    factor = np.bincount(joined.junction, joined.weight * ratio, len(joined.factor)) / total
    return replace(joined, ratio=ratio, factor=factor)
