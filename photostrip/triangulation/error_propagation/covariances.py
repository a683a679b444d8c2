"""Precision of the strip method: covariances of points and photos from the image coordinates and the control.

The error of a point is that of the formed strip minus what the fit to the control takes away of it, which is made of
errors of the same image coordinates and of the control. Everything is a sum over rows that reach over a few models;
what runs through the whole strip comes from sums over all models before, in time and memory that grow with its length.

Source: derived; see docs/precision.md, eq. 4-6.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Self

import numpy as np

from photostrip.arrays import Floats, Numbers, distinct, pieces
from photostrip.frozen import NamedTuple, dataclass
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.statistics import chi2_quantile
from photostrip.triangulation.error_propagation.control_errors import Misclosures
from photostrip.triangulation.error_propagation.derivatives import (
    COMPONENTS,
    MOVED,
    SHARING,
    SPAN,
    ErrorRows,
    PointRows,
    add_products,
    add_rows,
)
from photostrip.triangulation.error_propagation.strip_errors import StripErrors
from photostrip.triangulation.relative_orientation.orientation import Orientation
from photostrip.triangulation.relative_orientation.pairs import MINIMUM_POINTS

A_PRIORI, A_POSTERIORI = "a-priori", "a-posteriori"
SIGMA_LEVEL = 0.01  # of the test that keeps the stated standard deviation of the image coordinates
COEFFICIENTS = 100_000  # of rows worked on at a time: what fits into the processor's cache


def image_variance(orientation: Orientation, sigma: float) -> tuple[float, str]:
    """Variance factor of the image coordinates, and its basis: 1 unless the y parallaxes contradict what is stated.

    A y parallax of weight one has twice the variance of an image coordinate (``sigma``, mm): f = q^T W q / (2 sigma^2
    r).
    """
    redundancy = int((orientation.points_used - MINIMUM_POINTS).sum())
    squares = float((orientation.pairs.weight * orientation.parallax**2)[orientation.used].sum()) / (2 * sigma**2)
    return variance_factor(squares, redundancy)


def variance_factor(squares: float, redundancy: int) -> tuple[float, str]:
    """Variance found over that stated, and its basis: 1 unless the weighted sum of squares contradicts it."""
    if redundancy < 1:
        return 1.0, A_PRIORI
    low, high = (chi2_quantile(p, redundancy) for p in (SIGMA_LEVEL / 2, 1 - SIGMA_LEVEL / 2))
    return (1.0, A_PRIORI) if low <= squares <= high else (squares / redundancy, A_POSTERIORI)


@dataclass(frozen=True, eq=False)
class SimilarityCovariances:
    """Covariances of the similarities of the models, relative to the first."""

    similarities: Floats  # (p + 1, 7, 7): P, of each model, and last of the last photo
    with_components: Floats  # (p + 1, 2, 7, 6): of each with the error components of its own model and of the next


@dataclass(frozen=True, eq=False)
class ParameterCovariances:
    """Covariances of the t parameters fitted to the control."""

    similarities: Floats  # (p + 1, 7, t): with the similarities of the models
    sums: Sums  # what the parameters are made of
    parameters: Floats  # (t, t): among themselves
    along: SimilarityCovariances  # of the formed strip


def along_strip(errors: StripErrors) -> SimilarityCovariances:
    """Add up the steps from model to model (eq. 4): they correlate over two models, not one.

    P(m+1) = P(m) + S Q(m,m) S^T + c + c^T, c = [S(m-1) Q(m-1,m) + S(m-2) Q(m-2,m)] S^T.
    """
    steps, models = errors.steps, errors.models
    with_components = np.zeros((models + 1, 2, SIMILARITY_PARAMETERS, COMPONENTS))
    for apart in range(1, SPAN):
        mixed = steps @ errors.component_covariances[:, apart]
        for slot in range(apart):  # of the steps before model m, those of m - 1 and m - 2 reach components from m on
            before = apart - slot
            with_components[before:, slot] += mixed[: models + 1 - before]
    added = np.zeros((models + 1, SIMILARITY_PARAMETERS, SIMILARITY_PARAMETERS))
    cross = with_components[:models, 0] @ steps.transpose(0, 2, 1)
    added[1:] = steps @ errors.component_covariances[:, 0] @ steps.transpose(0, 2, 1) + cross + cross.transpose(0, 2, 1)
    return SimilarityCovariances(np.cumsum(added, axis=0), with_components)


def of_parameters(
    errors: StripErrors, found: Misclosures, operator: Floats, factor: float = 1.0
) -> ParameterCovariances:
    """Covariances of the parameters M w fitted to the control, for a variance factor of 1 of the image coordinates.

    operator: (t, w), M, parameters by misclosures.
    factor: variance factor of the image coordinates; that of the control is 1.
    """
    sums = _sums(errors, found.rows, operator)
    similarities = np.zeros((errors.models + 1, SIMILARITY_PARAMETERS, len(operator)))
    similarities[1:] = np.cumsum(errors.steps @ sums.with_components, axis=0)
    parameters = sums.products() + (operator * (found.variance / factor)) @ operator.T
    return ParameterCovariances(
        similarities=similarities,
        sums=sums,
        parameters=(parameters + parameters.T) / 2,
        along=along_strip(errors),
    )


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


class Sums(NamedTuple):
    """Sums of rows with d = 1."""

    by_component: Floats  # (p, 6, t)
    image: Numbers  # (e,): image points that enter directly
    by_image: Floats  # (e, 2, t)
    images: Floats  # (p, 6, t): covariances of these with the components
    with_components: Floats  # (p, 6, t): covariances of the whole with the components

    def products(self) -> Floats:
        """Covariances (t, t) of the sums."""
        mixed = np.tensordot(self.by_component, self.images, ((0, 1), (0, 1)))
        of_components = np.tensordot(self.by_component, self.with_components - self.images, ((0, 1), (0, 1)))
        direct = np.tensordot(self.by_image, self.by_image, ((0, 1), (0, 1)))
        return np.asarray(of_components + mixed + mixed.T + direct, float)


def _sums(errors: StripErrors, rows: ErrorRows, operator: Floats) -> Sums:
    """Sum rows with weights, ``operator`` (t, k): what goes through error components, and what enters directly.

    Both parts depend on the same image coordinates: ``images`` are the covariances between them, D_direct D_comp^T,
    model by model, of the image points on the photos around it.
    """
    images = errors.images
    coefficients = by_model(rows)
    by_first = np.zeros((errors.models + 1, coefficients.shape[2], len(operator)))
    add_products(by_first, rows.first, coefficients, operator.T[:, None])
    by_component = _summed_components(errors, by_first)
    image, entry = np.unique(rows.image, return_inverse=True)
    by_image = np.zeros((len(image), 2, len(operator)))
    add_rows(by_image, entry, rows.by_image[:, 0, :, None] * operator.T[rows.item][:, None, :])
    of_photos = np.zeros((errors.models + 1, SPAN * COMPONENTS, len(operator)))
    add_products(of_photos[:, MOVED], images.photo[image], images.components[image], by_image)
    of_images = np.zeros_like(by_component)
    for slot, part in enumerate(np.split(of_photos, SPAN, axis=1)):  # of the models photo - 2 + slot
        of_slot = part[SHARING - slot :][: errors.models]
        of_images[: len(of_slot)] += of_slot
    return Sums(
        by_component=by_component,
        image=image,
        by_image=by_image,
        images=of_images,
        with_components=_times_covariances(errors, by_component) + of_images,
    )


def _summed_components(errors: StripErrors, by_first: Floats) -> Floats:
    """Coefficients of the components (p, 6, t) in sums of rows with d = 1.

    by_first: (p + 1, 7 + 6 s, t), for each first model the sum of what ``by_model`` gives of its rows.
    """
    by_similarity, *by_component = np.split(
        by_first, range(SIMILARITY_PARAMETERS, by_first.shape[1], COMPONENTS), axis=1
    )
    after = np.cumsum(by_similarity[::-1], axis=0)[::-1][1:]  # rows whose first model comes after each model
    result: Floats = errors.steps.transpose(0, 2, 1) @ after
    for slot, part in enumerate(by_component):
        result[slot:] += part[: max(errors.models - slot, 0)]
    return result


def _times_covariances(errors: StripErrors, by_component: Floats) -> Floats:
    """Covariances of the components with sums of components, shape (p, 6, t)."""
    result: Floats = errors.component_covariances[:, 0] @ by_component
    for apart in range(1, min(SPAN, errors.models)):
        mixed = errors.component_covariances[:-apart, apart]
        result[:-apart] += mixed @ by_component[apart:]
        result[apart:] += mixed.transpose(0, 2, 1) @ by_component[:-apart]
    return result


def covariances(
    errors: StripErrors, rows: ErrorRows | PointRows, fit: ParameterCovariances, influence: Callable[[Numbers], Floats]
) -> Floats:
    """Covariances (n, d, d) of corrected points or photos, for a variance factor of 1 of the image coordinates.

    ``influence`` gives Phi (k, d, t) of some rows, what each fitted parameter subtracts (eq. 6): Cov = S - C Phi^T -
    Phi C^T + Phi Sigma Phi^T with S of the formed strip, C with the parameters.
    """
    _, slots, size, _ = rows.by_component.shape
    result = np.empty((len(rows.first), size, size))
    order, own = np.argsort(rows.first, kind="stable"), SIMILARITY_PARAMETERS + slots * COMPONENTS
    for some in _slices(rows):
        part, phi = rows.take(order[some]), influence(order[some])
        near, models = NearImages.of(errors, part), distinct(part.first)
        by = _coefficients(part, near)
        matrices = np.zeros((len(models), by.shape[2], own + len(fit.parameters)))
        _put_halves(matrices[:, :, :own], errors, fit.along, models, slots)
        _put_with_parameters(matrices[:, :, own:], fit, models, slots)
        found = _by_model(by, part.first, matrices)
        _add_same_images(found[:, :, own:], part, fit.sums)
        found[:, :, own:] -= (phi.reshape(-1, len(fit.parameters)) @ (fit.parameters / 2)).reshape(phi.shape)
        found = found @ np.concatenate([by[:, :, :own], -phi], axis=2).transpose(0, 2, 1)
        found += near.by_image @ near.by_image.transpose(0, 2, 1) / 2
        result[order[some]] = found + found.transpose(0, 2, 1)
    return result


def _slices(rows: ErrorRows | PointRows) -> list[slice]:
    """Cut many rows into parts of bounded memory."""
    count, slots, size, components = rows.by_component.shape
    size *= SIMILARITY_PARAMETERS + 2 * (slots + SHARING) * components  # of ``_coefficients``
    return [slice(start, start + COEFFICIENTS // size) for start in range(0, count, COEFFICIENTS // size)]


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


def _put_halves(
    matrices: Floats, errors: StripErrors, along: SimilarityCovariances, models: Numbers, slots: int
) -> None:
    """Fill zeros (m, k, 7 + 6 s) with what writes S of rows as G H^T + H G^T, products of image points left out.

    G (n, d, 7 + 6 s) are the coefficients of y(first) and of the components from there on, H = G K / 2 + X with K the
    covariances of these, and X those of the image points with them: what ``_coefficients`` gives, times the matrices.
    """
    own = SIMILARITY_PARAMETERS + slots * COMPONENTS
    before = own + SHARING * COMPONENTS
    np.divide(covariances_of_models(errors, along, models, slots), 2, out=matrices[:, :own])
    matrices[:, own:before, :SIMILARITY_PARAMETERS] = _stacked(steps_before(errors, models))
    matrices[:, before : before + slots * COMPONENTS, SIMILARITY_PARAMETERS:] = np.eye(slots * COMPONENTS)


def by_model(rows: ErrorRows) -> Floats:
    """Put the coefficients of y(first) and of the components from there on side by side, (n, d, 7 + 6 s)."""
    return np.concatenate([rows.by_similarity, *rows.by_component.transpose(1, 0, 2, 3)], axis=2)


def _coefficients(rows: ErrorRows, near: NearImages) -> Floats:
    """Put these and the covariances of the image points with components side by side, (n, d, k)."""
    return np.concatenate([by_model(rows), near.with_components.reshape(*rows.by_similarity.shape[:2], -1)], axis=2)


def covariances_of_models(
    errors: StripErrors, along: SimilarityCovariances, models: Numbers, slots: int, ahead: int = 0
) -> Floats:
    """Covariances (m, 7 + 6 s, 7 + 6 (s + ahead)) of y(model) and the components from there on among each other."""
    parts = [slice(start, start + COMPONENTS) for start in range(0, (slots + ahead) * COMPONENTS, COMPONENTS)]
    result = np.zeros((len(models), SIMILARITY_PARAMETERS + slots * COMPONENTS, SIMILARITY_PARAMETERS + parts[-1].stop))
    result[:, :SIMILARITY_PARAMETERS, :SIMILARITY_PARAMETERS] = along.similarities[models]
    of_similarity = result[:, :SIMILARITY_PARAMETERS, SIMILARITY_PARAMETERS:]
    with_similarity = result[:, SIMILARITY_PARAMETERS:, :SIMILARITY_PARAMETERS]
    among = result[:, SIMILARITY_PARAMETERS:, SIMILARITY_PARAMETERS:]
    for slot, part in enumerate(parts[:SHARING]):
        of_similarity[:, :, part] = along.with_components[models, slot]
    for slot, part in enumerate(parts[: min(SHARING, slots)]):
        with_similarity[:, part] = along.with_components[models, slot].transpose(0, 2, 1)
    around = around_models(errors.component_covariances, models, 0, slots + ahead)
    for slot, part in enumerate(parts):
        for apart, other in enumerate(parts[slot : slot + SPAN]):
            if slot < slots:
                among[:, part, other] = around[:, slot, apart]
            if apart and slot + apart < slots:
                among[:, other, part] = around[:, slot, apart].transpose(0, 2, 1)
    return result


def steps_before(errors: StripErrors, models: Numbers) -> Floats:
    """Give the steps (m, 2, 6, 7), transposed, of the two models before each."""
    return around_models(errors.steps.transpose(0, 2, 1), models, SHARING, 0)


def around_models(of_models: Floats, models: Numbers, before: int, after: int) -> Floats:
    """Give what belongs to the models around each, (m, before + after, ...), 0 beyond the ends."""
    number = models[:, None] + np.arange(-before, after)
    found = of_models.take(number, axis=0, mode="clip")
    found[(number < 0) | (number >= len(of_models))] = 0.0
    return np.asarray(found, float)


def with_parameters(rows: ErrorRows, near: NearImages, fit: ParameterCovariances) -> Floats:
    """C: covariances (n, d, t) of rows that are ordered by their first models with the fitted parameters."""
    models, by = distinct(rows.first), _coefficients(rows, near)
    matrices = np.empty((len(models), by.shape[2], len(fit.parameters)))
    _put_with_parameters(matrices, fit, models, rows.by_component.shape[1])
    result = _by_model(by, rows.first, matrices)
    _add_same_images(result, rows, fit.sums)
    return result


def _put_with_parameters(matrices: Floats, fit: ParameterCovariances, models: Numbers, slots: int) -> None:
    """Fill (m, k, t) with what gives C of rows but for the image points that the fit has directly, too."""
    own = SIMILARITY_PARAMETERS + slots * COMPONENTS
    matrices[:, :SIMILARITY_PARAMETERS] = fit.similarities[models]
    matrices[:, SIMILARITY_PARAMETERS:own] = _stacked(around_models(fit.sums.with_components, models, 0, slots))
    matrices[:, own:] = _stacked(around_models(fit.sums.by_component, models, SHARING, slots + SHARING))


def _add_same_images(result: Floats, rows: ErrorRows, sums: Sums) -> None:
    """Add to C the products of the image points that enter rows and the fit directly."""
    of_fit = np.searchsorted(sums.image, rows.image)
    entry = np.flatnonzero(sums.image[np.minimum(of_fit, len(sums.image) - 1)] == rows.image)
    add_products(result, rows.item[entry], rows.by_image[entry].transpose(0, 2, 1), sums.by_image[of_fit[entry]])


def _stacked(around: Floats) -> Floats:
    """Stack the matrices of the models around each, (m, w, k, t), to (m, w k, t)."""
    models, width, height, count = around.shape
    return around.reshape(models, width * height, count)


def _by_model(coefficients: Floats, model: Numbers, matrices: Floats) -> Floats:
    """Multiply rows (n, d, k) by a matrix (k, t) for each model, the models ascending: one product for each."""
    n, size, _ = coefficients.shape
    result = np.empty((n * size, matrices.shape[2]))
    flat = coefficients.reshape(n * size, -1)
    starts = np.flatnonzero(np.diff(model, prepend=-1))
    ends = [*(starts * size).tolist(), n * size]
    for matrix, (start, stop) in zip(matrices, pairwise(ends), strict=True):
        np.matmul(flat[start:stop], matrix, out=result[start:stop])
    return result.reshape(n, size, -1)
