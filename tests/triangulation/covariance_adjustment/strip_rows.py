"""The rows of a strip from which the adjustment by its covariance is made, written out in full."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import MOVED
from photostrip.triangulation.covariance_adjustment.strip_rows.strip_errors import StripErrors, differentiate_strip
from photostrip.triangulation.error_propagation.control_errors import Misclosures
from tests.derivatives import oriented_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.pipeline.results import Result
    from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import ErrorRows, PointRows

    Floats = NDArray[np.float64]


class StripRows(NamedTuple):
    """A strip of a result, and its control."""

    errors: StripErrors
    control: Misclosures

    def along(self, control: Misclosures) -> ErrorRows:
        """Give the rows of some control coordinates."""
        return self.errors.points.take(control.row).along(control.direction)


def errors_of(result: Result) -> StripRows:
    (strip,), observations = result.strips, result.refined.observations
    oriented, photos = oriented_of(result), strip.of_photos
    position = photos.strip.positions(observations)
    similarity = oriented.absolute.similarity
    errors = differentiate_strip(photos.orientation, photos.formed, similarity, position, observations.sigma)
    return StripRows(errors, oriented.misclosures)


def every(points: PointRows) -> ErrorRows:
    """Give the rows of all points."""
    return points.take(np.arange(len(points.first)))


def written_out(rows: ErrorRows, errors: StripErrors) -> Floats:
    """Derivatives of things by all image coordinates in units of their sigmas, shape (n, d, images * 2)."""
    images, models = errors.images, errors.models
    count = len(images.row)
    units = np.zeros((models + 3, 6, count, 2))
    for image in range(count):
        components = np.zeros((2, 18))
        components[:, MOVED] = images.components[image]
        for slot in range(3):
            model = images.photo[image] - 2 + slot
            if 0 <= model < models:
                units[model, :, image] = components[:, 6 * slot : 6 * slot + 6].T
    flat = units.reshape(models + 3, 6, -1)
    steps = np.einsum("kab,kbc->kac", errors.steps, flat[:models])
    frames = np.concatenate([np.zeros((1, 7, count * 2)), np.cumsum(steps, axis=0)])
    result = np.einsum("nda,nac->ndc", rows.by_similarity, frames[rows.first])
    for slot in range(rows.by_component.shape[1]):
        result += np.einsum("nda,nac->ndc", rows.by_component[:, slot], flat[np.minimum(rows.first + slot, models)])
    split: Floats = result.reshape(*result.shape[:2], count, 2)
    for item, image, own in zip(rows.item, rows.image, rows.by_image, strict=True):
        split[item, :, image] += own
    return split.reshape(*split.shape[:2], -1)
