"""Joint covariances of single coordinates of a formed strip: each with every other.

What two rows have in common are the steps along the strip up to the nearer of them, and image coordinates near by. The
models are gone through in parts, so that a longer strip takes more time but no more memory.

Source: derived; see docs/precision.md, eq. 3 and 4.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.error_propagation.covariances import NearImages, with_parameters
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, REACH, ErrorRows

if TYPE_CHECKING:
    from photostrip.arrays import Floats, Numbers
    from photostrip.triangulation.error_propagation.covariances import ParameterCovariances, SimilarityCovariances
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors

MODELS = 64  # models gone through at a time: what 300 rows need of them fits into the processor's cache


def joint_covariance(errors: StripErrors, rows: ErrorRows, along: SimilarityCovariances) -> Floats:
    """Covariances (n, n) of rows with d = 1, for a variance factor of 1 of the image coordinates.

    ``along``: covariances along the strip of the same errors.
    """
    order = np.argsort(rows.first, kind="stable")
    rows = rows.take(order)
    first, slots, similar = rows.first, rows.by_component.shape[1], rows.by_similarity[:, 0]
    low = max(int(first[0]) - REACH, 0)  # no image coordinate of the rows lies before the third photo from here
    high = min(int(first[-1]) + slots + REACH, errors.models)
    half = similar @ (along.similarities[low] / 2) @ similar.T + _same_images(rows) / 2
    direct = NearImages.of(errors, rows).with_components[:, :, 0]
    beyond = np.zeros((REACH, COMPONENTS, len(first)))  # components of the models after a part
    for stop in range(high, low, -MODELS):
        models = np.arange(max(stop - MODELS, low), stop)
        reached = int(np.searchsorted(first, models[0] - slots - REACH, side="right"))  # rows that come so far
        part = rows.part(reached, len(first))
        by = _components(errors, part, models)
        around = np.concatenate([by, beyond[:, :, reached:]])
        beyond[:, :, reached:] = around[:REACH]
        covariances, count = errors.component_covariances[models], len(models)
        mixed = covariances[:, 0] / 2 @ by
        for apart in range(1, REACH + 1):
            mixed += covariances[:, apart] @ around[apart : apart + count]
        for place in range(direct.shape[1]):
            row, model = _inside(part.first + place - REACH, models)
            mixed[model, :, row] += direct[reached + row, place]
        half[reached:, reached:] += by.reshape(-1, by.shape[2]).T @ mixed.reshape(-1, by.shape[2])
    if low < high:
        half += similar @ np.einsum("sij,sjn->in", along.with_components[low], beyond)
    result: Floats = np.empty_like(half)
    result[np.ix_(order, order)] = half + half.T
    return result


def after_fit(errors: StripErrors, rows: ErrorRows, fit: ParameterCovariances, influence: Floats) -> Floats:
    """Covariances (n, n) of rows with d = 1 less what the fit to the control takes away, as eq. 6 has them.

    ``influence``: (n, t), what each fitted parameter subtracts.
    """
    mixed = with_parameters(rows, NearImages.of(errors, rows), fit)[:, 0] @ influence.T
    return joint_covariance(errors, rows, fit.along) - mixed - mixed.T + influence @ fit.parameters @ influence.T


def _components(errors: StripErrors, rows: ErrorRows, models: Numbers) -> Floats:
    """Coefficients (m, 6, n) of the error components of consecutive models in each row."""
    result: Floats = errors.steps[models].transpose(0, 2, 1) @ rows.by_similarity[:, 0].T
    result *= (rows.first > models[:, None])[:, None]
    for slot in range(rows.by_component.shape[1]):
        row, model = _inside(rows.first + slot, models)
        result[model, :, row] += rows.by_component[row, slot, 0]
    return result


def _inside(model: Numbers, models: Numbers) -> tuple[Numbers, Numbers]:
    """Rows whose model is one of consecutive models, and its place there."""
    place = model - models[0]
    row = np.flatnonzero((place >= 0) & (place < len(models)))
    return row, place[row]


def _same_images(rows: ErrorRows) -> Floats:
    """Products (n, n) of the image coordinates that enter two rows directly."""
    image, entry = np.unique(rows.image, return_inverse=True)
    by_image = np.zeros((len(image), len(rows.first), 2))
    np.add.at(by_image, (entry, rows.item), rows.by_image[:, 0])
    flat = by_image.transpose(1, 0, 2).reshape(len(rows.first), -1)
    return np.asarray(flat @ flat.T, float)
