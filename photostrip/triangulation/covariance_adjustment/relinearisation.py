"""What an adjusted strip says about its measurements, and whether its linear equations were good enough.

The adjustment is linear in the errors of the image coordinates. In a long strip these turn the last models by so much
that squares of the turns count. The strip is then formed once more from corrected image coordinates, and the
misclosures it has there go through the equations that were eliminated already: Newton's method with the first
derivatives, which lessens what is left by the size of the turns at every pass.

Source: derived; see docs/precision.md.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.error_propagation.covariances import by_images
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, REACH, SPAN, ErrorRows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.covariance_adjustment.conditions import Conditions
    from photostrip.triangulation.covariance_adjustment.system import System
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors

    Floats = NDArray[np.float64]


def without_frame(rows: ErrorRows) -> ErrorRows:
    """Leave out the similarity of the first model, which is an unknown of the adjustment and no error."""
    return replace(rows, by_similarity=np.zeros_like(rows.by_similarity))


def image_errors(errors: StripErrors, wanted: Conditions, found: System) -> Floats:
    """Return the errors of the image coordinates that the adjustment finds.

    Returns
    -------
    ndarray, shape (n, 2)
        H^T lambda, in units of the stated standard deviations, in the order of ``errors.images``.
    """
    correlates = found.solution[found.layout.block, found.layout.position]
    return by_images(errors, without_frame(wanted.rows), correlates)


def displacements(errors: StripErrors, rows: ErrorRows, images: Floats) -> Floats:
    """Return what errors of image coordinates do to things, their first models held fast.

    Parameters
    ----------
    images : ndarray, shape (k, 2)
        Errors, in units of the stated standard deviations.

    Returns
    -------
    ndarray, shape (n, d)
        Displacements.
    """
    units = np.zeros((errors.models + rows.by_component.shape[1], COMPONENTS))
    for slot in range(SPAN):
        model = errors.images.photo - REACH + slot
        inside = np.flatnonzero((model >= 0) & (model < errors.models))
        moved = errors.images.components[inside, slot] @ images[inside, :, None]
        np.add.at(units, model[inside], moved[:, :, 0])
    result = np.zeros(rows.by_similarity.shape[:2])
    for slot in range(rows.by_component.shape[1]):
        result += (rows.by_component[:, slot] @ units[rows.first + slot, :, None])[:, :, 0]
    np.add.at(result, rows.item, (rows.by_image @ images[rows.image, :, None])[:, :, 0])
    return result


def largest_turn(found: System, length: float) -> float:
    """Return the largest turn and change of scale of a model.

    Parameters
    ----------
    found : System
        The solved system, with the unknowns of each model about its left photo.
    length : float
        Length by which rotations and scales are multiplied in it, metres.

    Returns
    -------
    float
        Root of the sum of their squares, radians.
    """
    layout = found.layout
    models = np.arange(len(layout.start))
    columns = layout.unknown[:, None] + np.arange(3, SIMILARITY_PARAMETERS)
    unknowns = found.solution[(models // layout.width)[:, None], columns] / length
    return float(np.sqrt(np.square(unknowns).sum(axis=1).max()))
