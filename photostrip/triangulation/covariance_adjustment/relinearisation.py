"""Relinearisation: a long strip formed again from corrected image coordinates, and its equations solved again there.

The adjustment is linear in the errors of the image coordinates. In a long strip these turn the last models by so much
that squares of the turns count. The strip is then formed once more from corrected image coordinates, with every
decision kept: which points take part, their weights, the pass points that join models. Its misclosures there go through
the equations that were eliminated already: Newton's method with the first derivatives, which lessens what is left by
the size of the turns every time.

Source: derived; see docs/precision.md, eq. 3 and 7.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.arrays import Floats, median, pieces
from photostrip.frozen import replace
from photostrip.points import PhotoPoints
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import (
    COMPONENTS,
    ELEMENTS,
    MOVED,
    SHARING,
    SPAN,
    ErrorRows,
    add_rows,
)
from photostrip.triangulation.covariance_adjustment.strip_rows.strip_errors import StripErrors
from photostrip.triangulation.covariance_adjustment.strip_rows.sums import by_components
from photostrip.triangulation.covariance_adjustment.system import System
from photostrip.triangulation.relative_orientation.orientation import Orientation
from photostrip.triangulation.relative_orientation.solution import iterate_elements
from photostrip.triangulation.strip_formation import non_neighbours
from photostrip.triangulation.strip_formation.scale_transfer import Junctions
from photostrip.triangulation.strip_formation.strip import FormedStrip, model_points, place_models


def image_errors(found: System) -> Floats:
    """Errors of the image coordinates that the adjustment finds, H^T lambda, shape (n, 2).

    In their stated standard deviations, in the order of ``errors.images``.
    """
    rows = found.conditions.rows
    result = by_components(found.errors, -found.component_correlates)
    add_rows(result, rows.image, rows.by_image[:, 0] * found.correlates[rows.item][:, None])
    return result


def component_errors(errors: StripErrors, images: Floats) -> Floats:
    """Errors (p, 6) of the components by those of image coordinates (k, 2) in their stated standard deviations."""
    points, photos = errors.images, errors.models + 1
    moved = np.zeros((photos, SPAN, COMPONENTS))
    flat = moved.reshape(photos, -1)
    for piece in pieces(len(images)):
        add_rows(flat[:, MOVED], points.photo[piece], np.einsum("ni,nic->nc", images[piece], points.components[piece]))
    components = np.zeros((SHARING + photos, COMPONENTS))  # from model -SHARING on
    for slot in range(SPAN):
        components[slot : slot + photos] += moved[:, slot]
    return components[SHARING:-1]


def own_displacements(rows: ErrorRows, images: Floats) -> Floats:
    """Displace rows by errors of their own image points, the error components held fast: E v, shape (n, d)."""
    result = np.zeros(rows.by_similarity.shape[:2])
    add_rows(result, rows.item, np.einsum("edi,ei->ed", rows.by_image, images[rows.image]))
    return result


def displacements(components: Floats, rows: ErrorRows, images: Floats) -> Floats:
    """Displace rows by errors of components (p, 6) and of their own image points (k, 2): shape (n, d).

    The first model of each row is held fast: dX = sum K(s) u(first + s) + D v (eq. 3).
    """
    slots = rows.by_component.shape[1]
    components = np.concatenate([components, np.zeros((slots, COMPONENTS))])
    result = own_displacements(rows, images)
    for slot in range(slots):
        result += np.einsum("ndc,nc->nd", rows.by_component[:, slot], components[rows.first + slot])
    return result


def largest_turn(found: System) -> float:
    """Largest turn of a model, radians: half of its square is the angle that it leaves in the images.

    It is that of its similarity, with the change of scale, or that of its photos against each other, which counts more
    the longer the rays are beside the base: by an error e of its elements the depth of points is off by e times that
    ratio, and what is left are squares of it.
    """
    errors = found.errors
    base = np.linalg.norm(np.diff(errors.centers, axis=0), axis=1)
    first = errors.points.first
    ratio = median(np.linalg.norm(errors.points.xyz - errors.centers[first], axis=1) / base[first])
    of_models = np.sqrt(np.square(found.unknowns[:, 3:]).sum(axis=1).max())
    of_photos = np.sqrt(np.square(found.component_changes[:, ELEMENTS]).sum(axis=1).max())
    return float(max(of_models, np.sqrt(2 * ratio) * of_photos))


def oriented_again(orientation: Orientation, xy: Floats) -> Orientation:
    """Orient the pairs of a strip on other image coordinates (k, 2), starting at the elements they have.

    Their parallaxes and what is said of their precision stay.
    """
    left, right = (xy[orientation.rows[:, side]] for side in (0, 1))
    pairs = replace(orientation.pairs, left=left, right=right)
    return replace(orientation, pairs=pairs, elements=iterate_elements(orientation.elements, pairs).elements)


def formed_again(
    formed: FormedStrip, orientation: Orientation, observations: PhotoPoints, photos: Sequence[str]
) -> FormedStrip:
    """Form a strip from pairs that were oriented again.

    Points and junctions are those of ``formed``; ``model_xyz`` holds the points that were left out, too.
    """
    models = model_points(orientation, formed.first, left_ray=formed.left_ray)
    junctions = _joined(formed.junctions, orientation, models.vectors)
    there = np.asarray(np.isfinite(formed.model_xyz).all(axis=1), bool)
    again = place_models(orientation, models, junctions, orientation.used & there, formed.first)
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
