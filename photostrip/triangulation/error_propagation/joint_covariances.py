"""Joint covariances of single coordinates of a formed strip: each with every other.

What two rows have in common are the similarity of the earlier one's first model, the steps from there on, and image
coordinates near by. Beyond a few models a row's covariance with the similarity of a later model no longer changes: of
rows further apart it is a product of seven numbers each.

Source: derived; see docs/precision.md, eq. 3 and 4.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.error_propagation.covariances import (
    NearImages,
    ParameterCovariances,
    SimilarityCovariances,
    around_models,
    by_model,
    covariances_of_models,
    steps_before,
    with_parameters,
)
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, SHARING, ErrorRows, same_images
from photostrip.triangulation.error_propagation.strip_errors import StripErrors


def joint_covariance(errors: StripErrors, rows: ErrorRows, along: SimilarityCovariances) -> Floats:
    """Covariances (n, n) of rows with d = 1, for a variance factor of 1 of the image coordinates.

    ``along``: covariances along the strip of the same errors.
    """
    order = np.argsort(rows.first, kind="stable")
    rows = rows.take(order)
    count, slots, _, _ = rows.by_component.shape
    similar, by_component, reach = rows.by_similarity[:, 0], rows.by_component[:, :, 0], slots + SHARING
    images = NearImages.of(errors, rows).with_components[:, 0]
    models, place = np.unique(rows.first, return_inverse=True)
    before = steps_before(errors, models)[place]
    # of each row, the components from two models before its first on: its coefficients, and its covariances from that
    # model on with them
    coefficients = np.concatenate([np.einsum("nkci,ni->nkc", before, similar), by_component], axis=1)
    mixed = by_model(rows) @ covariances_of_models(errors, along, models, slots, SHARING)[place]
    ahead = mixed[:, 0, SIMILARITY_PARAMETERS:].reshape(count, reach, COMPONENTS) + images[:, SHARING:]
    # its covariances with the similarities of its first model and of those that follow, until nothing changes
    with_similarity = np.empty((count, reach + 1, SIMILARITY_PARAMETERS))
    of_first = np.einsum("nkci,nkc->ni", before, images[:, :SHARING])
    with_similarity[:, 0] = mixed[:, 0, :SIMILARITY_PARAMETERS] + of_first
    with_similarity[:, 1:] = np.einsum("nkic,nkc->nki", around_models(errors.steps, models, 0, reach)[place], ahead)
    with_similarity = np.cumsum(with_similarity, axis=1)

    upper = np.triu(with_similarity[:, -1] @ similar.T)
    apart = np.where(np.triu(np.ones((count, count), bool)), rows.first - rows.first[:, None], reach)
    for distance in range(reach):
        i, j = np.nonzero(apart == distance)
        beyond = min(slots, reach - distance)
        upper[i, j] = (
            np.einsum("ni,ni->n", with_similarity[i, distance], similar[j])
            + np.einsum("nkc,nkc->n", ahead[i, distance : distance + beyond], by_component[j, :beyond])
            + np.einsum("nkc,nkc->n", coefficients[i, distance:], images[j, : reach - distance])
        )
    whole = upper + np.triu(upper, 1).T + by_same_images(rows)
    result: Floats = np.empty_like(whole)
    result[np.ix_(order, order)] = whole
    return result


def after_fit(errors: StripErrors, rows: ErrorRows, fit: ParameterCovariances, influence: Floats) -> Floats:
    """Covariances (n, n) of rows with d = 1 less what the fit to the control takes away, as eq. 6 has them.

    ``influence``: (n, t), what each fitted parameter subtracts.
    """
    order = np.argsort(rows.first, kind="stable")
    ordered = rows.take(order)
    mixed = np.empty((len(order), len(order)))
    mixed[order] = with_parameters(ordered, NearImages.of(errors, ordered), fit)[:, 0] @ influence.T
    return joint_covariance(errors, rows, fit.along) - mixed - mixed.T + influence @ fit.parameters @ influence.T


def by_same_images(rows: ErrorRows) -> Floats:
    """Covariances (n, n) of rows with d = 1 by the image points alone that enter two of them directly."""
    count, shared = len(rows.first), same_images(rows, rows)
    place = shared.first * count + shared.second
    return np.asarray(np.bincount(place, shared.value[:, 0, 0], count**2).reshape(count, count), float)
