"""Precision of the strip method: covariances of points and photos from the image coordinates and the control.

The error of a point is that of the formed strip minus what the fit to the control takes away of it, which is made of
errors of the same image coordinates and of the control. Everything is a sum over rows that reach over a few models;
what runs through the whole strip comes from sums over all models before, in time and memory that grow with its length.

Source: derived; see docs/precision.md, eq. 4-6.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from photostrip.frozen import dataclass
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.statistics import chi2_quantile
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, REACH, SPAN, ErrorRows
from photostrip.triangulation.relative_orientation.pairs import MINIMUM_POINTS

if TYPE_CHECKING:
    from photostrip.arrays import Floats, Numbers
    from photostrip.triangulation.error_propagation.control_errors import Misclosures
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors
    from photostrip.triangulation.relative_orientation.orientation import Orientation

A_PRIORI, A_POSTERIORI = "a-priori", "a-posteriori"
LEVEL = 0.01  # of the test that keeps the stated standard deviation of the image coordinates
ENTRIES = 9000  # coefficients of image points worked on at a time: what fits into the processor's cache


def image_variance(orientation: Orientation, sigma: float) -> tuple[float, str]:
    """Variance factor of the image coordinates, and its basis: 1 unless the y parallaxes contradict what is stated.

    A y parallax of weight one has twice the variance of an image coordinate (``sigma``, mm): f = q^T W q / (2 sigma^2
    r).
    """
    redundancy = int((orientation.points_used - MINIMUM_POINTS).sum())
    squares = float((orientation.pairs.weight * orientation.parallax**2)[orientation.used].sum()) / (2 * sigma**2)
    if redundancy < 1:
        return 1.0, A_PRIORI
    low, high = (chi2_quantile(p, redundancy) for p in (LEVEL / 2, 1 - LEVEL / 2))
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
    components: Floats  # (p, 6, t): with the error components
    images: Floats  # (n, 2, t): with the image coordinates
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
    with_images = _by_photo(errors, sums.by_component)
    with_images[sums.image] += sums.by_image
    similarities = np.zeros((errors.models + 1, SIMILARITY_PARAMETERS, len(operator)))
    similarities[1:] = np.cumsum(errors.steps @ sums.with_components, axis=0)
    parameters = sums.products(with_images[sums.image]) + (operator * (found.variance / factor)) @ operator.T
    return ParameterCovariances(
        similarities=similarities,
        components=sums.with_components,
        images=with_images,
        parameters=(parameters + parameters.T) / 2,
        along=along_strip(errors),
    )


def by_images(errors: StripErrors, rows: ErrorRows, weights: Floats) -> Floats:
    """Coefficients (k, 2) of all image coordinates in a weighted sum of rows with d = 1."""
    by_component = _summed_components(errors, rows, weights[:, None])
    result = _by_photo(errors, by_component)[:, :, 0]
    np.add.at(result, rows.image, rows.by_image[:, 0] * weights[rows.item][:, None])
    return result


class _Sums(NamedTuple):
    """Sums of rows with d = 1."""

    by_component: Floats  # (p, 6, t)
    with_components: Floats  # (p, 6, t): covariances with the components
    image: Numbers  # (e,): image points that enter directly
    by_image: Floats  # (e, 2, t)

    def products(self, with_images: Floats) -> Floats:
        """Covariances (t, t) of the sums, given those with the image coordinates (e, 2, t) that enter directly."""
        found = np.einsum("kit,kis->ts", self.by_component, self.with_components)
        return np.asarray(found + np.einsum("nit,nis->ts", self.by_image, with_images), float)


def _sums(errors: StripErrors, rows: ErrorRows, operator: Floats) -> _Sums:
    images = errors.images
    by_component = _summed_components(errors, rows, operator.T)
    image, entry = np.unique(rows.image, return_inverse=True)
    by_image = np.zeros((len(image), 2, len(operator)))
    np.add.at(by_image, entry, rows.by_image[:, 0, :, None] * operator.T[rows.item][:, None, :])
    with_components = _times_covariances(errors, by_component)
    for slot in range(SPAN):
        model = images.photo[image] - REACH + slot
        inside = (model >= 0) & (model < errors.models)
        np.add.at(
            with_components,
            model[inside],
            images.components[image[inside], :, slot].transpose(0, 2, 1) @ by_image[inside],
        )
    return _Sums(by_component=by_component, with_components=with_components, image=image, by_image=by_image)


def _summed_components(errors: StripErrors, rows: ErrorRows, weights: Floats) -> Floats:
    """Coefficients of the components in weighted sums of rows with d = 1, shape (p, 6, t)."""
    models, count = errors.models, weights.shape[1]
    by_first = np.zeros((models + 1, SIMILARITY_PARAMETERS, count))
    np.add.at(by_first, rows.first, rows.by_similarity[:, 0, :, None] * weights[:, None, :])
    after = np.cumsum(by_first[::-1], axis=0)[::-1][1:]  # rows whose first model comes after each model
    result: Floats = errors.steps.transpose(0, 2, 1) @ after
    for slot in range(rows.by_component.shape[1]):
        model = rows.first + slot
        inside = model < models
        values = rows.by_component[inside, slot, 0, :, None] * weights[inside, None, :]
        np.add.at(result, model[inside], values)
    return result


def _by_photo(errors: StripErrors, by_component: Floats) -> Floats:
    """Coefficients of all image coordinates in sums of components, shape (k, 2, t)."""
    images, count = errors.images, by_component.shape[2]
    none = np.zeros((REACH, *by_component.shape[1:]))
    padded = np.concatenate([none, by_component, none[:1]])
    around = np.concatenate([padded[slot : slot + errors.models + 1] for slot in range(SPAN)], axis=1)
    result = np.empty((len(images.row), 2, count))
    ends = np.searchsorted(images.photo, np.arange(errors.models + 2)).tolist()
    for nearby, (start, stop) in zip(around, pairwise(ends), strict=True):
        components = images.components[start:stop].reshape(-1, SPAN * COMPONENTS)
        result[start:stop] = (components @ nearby).reshape(-1, 2, count)
    return result


def _times_covariances(errors: StripErrors, by_component: Floats) -> Floats:
    """Covariances of the components with sums of components, shape (p, 6, t)."""
    result: Floats = errors.component_covariances[:, 0] @ by_component
    for apart in range(1, min(SPAN, errors.models)):
        mixed = errors.component_covariances[:-apart, apart]
        result[:-apart] += mixed @ by_component[apart:]
        result[apart:] += mixed.transpose(0, 2, 1) @ by_component[:-apart]
    return result


def covariances(errors: StripErrors, rows: ErrorRows, fit: ParameterCovariances, influence: Floats) -> Floats:
    """Covariances (n, d, d) of corrected points or photos, for a variance factor of 1 of the image coordinates.

    ``influence`` (n, d, t) is Phi, what each fitted parameter subtracts (eq. 6): Cov = S - C Phi^T - Phi C^T +
    Phi Sigma Phi^T with S of the formed strip, C with the parameters.
    """
    size = rows.by_similarity.shape[1]
    result = np.empty((len(rows.first), size, size))
    for start, stop in _slices(rows):
        part, phi = rows.part(start, stop), influence[start:stop]
        near = NearImages.of(errors, part)
        formed = _formed(errors, part, near, fit.along)
        mixed = with_parameters(part, near, fit) @ phi.transpose(0, 2, 1)
        result[start:stop] = formed - mixed - mixed.transpose(0, 2, 1) + phi @ fit.parameters @ phi.transpose(0, 2, 1)
    return result


def _slices(rows: ErrorRows) -> list[tuple[int, int]]:
    """Cut many rows into parts of bounded memory."""
    count = len(rows.first)
    size = max(1, int(ENTRIES * 3 / rows.by_similarity.shape[1] * count / max(len(rows.item), 1)))
    return [(start, min(start + size, count)) for start in range(0, count, size)]


def _formed(errors: StripErrors, rows: ErrorRows, near: NearImages, along: SimilarityCovariances) -> Floats:
    """S = F P F^T + m + m^T + local, m = F times the covariances of y(first) with components and image coordinates."""
    local = local_covariances(errors, rows, near)
    first, ahead = rows.first, along.with_components[rows.first]
    shared = ahead[:, 0] @ rows.by_component[:, 0].transpose(0, 2, 1)
    if rows.by_component.shape[1] > 1:
        shared += ahead[:, 1] @ rows.by_component[:, 1].transpose(0, 2, 1)
    for back in range(1, SPAN):
        inside = np.flatnonzero(first >= back)
        steps = errors.steps[first[inside] - back]
        shared[inside] += steps @ near.with_components[inside, REACH - back].transpose(0, 2, 1)
    moved = rows.by_similarity @ shared
    of_similarity = rows.by_similarity @ along.similarities[first] @ rows.by_similarity.transpose(0, 2, 1)
    return np.asarray(of_similarity + moved + moved.transpose(0, 2, 1) + local, float)


class NearImages(NamedTuple):
    """Image points of the photos ``first`` to ``first + s`` that enter rows directly, side by side.

    Rows with fewer than m of them have any others, with coefficients of zero.
    """

    image: Numbers  # (n, m)
    by_image: Floats  # (n, d, 2 m)
    with_components: Floats  # (n, s + 4, d, 6): covariances with components of the models from ``first - 2`` on

    @classmethod
    def of(cls, errors: StripErrors, rows: ErrorRows) -> Self:
        n, slots, size, _ = rows.by_component.shape
        photos = slots + 1
        photo = errors.images.photo[rows.image] - rows.first[rows.item]
        cell = rows.item * photos + photo
        counts = np.bincount(cell, minlength=n * photos)
        order = np.argsort(cell, kind="stable")
        place = np.empty(len(cell), np.intp)
        place[order] = np.arange(len(cell)) - (np.cumsum(counts) - counts)[cell[order]]
        most = int(counts.max(initial=0))
        image = np.zeros((n, photos, most), np.intp)
        image[rows.item, photo, place] = rows.image
        by_image = np.zeros((n, size, photos, most, 2))
        by_image[rows.item, :, photo, place] = rows.by_image
        components = errors.images.components[image].reshape(n, photos, 2 * most, SPAN * COMPONENTS)
        products = by_image.reshape(n, size, photos, 2 * most).transpose(0, 2, 1, 3) @ components
        with_components = np.zeros((n, photos + REACH + 1, size, COMPONENTS))
        for slot in range(SPAN):
            of_slot = products[..., slot * COMPONENTS : (slot + 1) * COMPONENTS]
            with_components[:, slot : slot + photos] += of_slot
        return cls(image.reshape(n, photos * most), by_image.reshape(n, size, 2 * photos * most), with_components)


def local_covariances(errors: StripErrors, rows: ErrorRows, near: NearImages) -> Floats:
    """Covariances of the rows without the similarity of their first model, shape (n, d, d)."""
    by = rows.by_component
    result: Floats = near.by_image @ near.by_image.transpose(0, 2, 1)
    for slot in range(by.shape[1]):
        mixed = near.with_components[:, slot + REACH] @ by[:, slot].transpose(0, 2, 1)
        model = np.minimum(rows.first + slot, errors.models - 1)
        for apart in range(min(SPAN, by.shape[1] - slot)):
            term = by[:, slot] @ errors.component_covariances[model, apart] @ by[:, slot + apart].transpose(0, 2, 1)
            mixed += term / 2 if apart == 0 else term
        result += mixed + mixed.transpose(0, 2, 1)
    return result


def with_parameters(rows: ErrorRows, near: NearImages, fit: ParameterCovariances) -> Floats:
    """C: covariances of the rows with the fitted parameters, shape (n, d, t)."""
    result: Floats = rows.by_similarity @ fit.similarities[rows.first]
    for slot in range(rows.by_component.shape[1]):
        model = rows.first + slot
        inside = np.flatnonzero(model < len(fit.components))
        result[inside] += rows.by_component[inside, slot] @ fit.components[model[inside]]
    return result + near.by_image @ fit.images[near.image].reshape(len(result), near.by_image.shape[2], result.shape[2])
