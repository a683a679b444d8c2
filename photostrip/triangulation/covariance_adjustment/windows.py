"""Rows over the models around their points: by unknowns, and by the correlates of the error components.

A row of coefficients by similarity, components and image points becomes one by the unknowns of two consecutive blocks:
the similarity of the first one's anchor, and of each model its components beside what the row's own image points have
in common with these.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats, Numbers, runs_of
from photostrip.frozen import NamedTuple, dataclass
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.covariance_adjustment.similarities import PhotoSimilarities
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import COMPONENTS, SHARING, ErrorRows

# of a block: correlates of what joins its anchor to the next, its anchor, and its models one after the other
LINK, ANCHOR = slice(0, SIMILARITY_PARAMETERS), slice(SIMILARITY_PARAMETERS, 2 * SIMILARITY_PARAMETERS)
MODELS = ANCHOR.stop
# of a model: its error components, and their correlates
COMPONENT, CORRELATE, MODEL = slice(0, COMPONENTS), slice(COMPONENTS, 2 * COMPONENTS), 2 * COMPONENTS


@dataclass(frozen=True)
class Blocks:
    """Blocks of w models. The first begins with two models that are none, so that windows begin with their points."""

    width: int  # w
    count: int  # g

    @classmethod
    def of(cls, models: int, reach: int) -> Blocks:
        """Make them as wide as windows of points that reach over so many models need."""
        width = reach + SHARING
        return cls(width, -(-(SHARING + models + 1) // width))

    @property
    def height(self) -> int:
        """Rows of a block."""
        return MODELS + self.width * MODEL

    @property
    def anchors(self) -> Numbers:
        """Photo (g,) of each anchor."""
        return np.maximum(np.arange(self.count) * self.width - SHARING, 0)

    def places(self, models: Numbers) -> tuple[Numbers, Numbers]:
        """Blocks of models or photos, and their places there."""
        block, place = np.divmod(models + SHARING, self.width)
        return block, place


def windows(blocks: Blocks, similarities: PhotoSimilarities, rows: ErrorRows, images: Floats, base: Numbers) -> Floats:
    """Give the windows (n, d, 7 + 24 w) of rows: the anchor of a block, its models and those of the next.

    images: covariances of their image points with components, as ``NearImages`` has them.
    base: (n,), first model of the point of each, ascending; that two models before it decides about the block. Rows
        that a similarity moves begin there.
    """
    near = _near_first(similarities, rows, images)
    count, size, reach, _ = near.shape
    result = np.zeros((count, size, SIMILARITY_PARAMETERS + 2 * blocks.width * MODEL))
    of_models = result[:, :, SIMILARITY_PARAMETERS:].reshape(count, size, 2 * blocks.width, MODEL)
    place = rows.first - base // blocks.width * blocks.width  # in the block, of two models before the first
    for number in range(int(place.min(initial=0)), int(place.max(initial=-1)) + 1):
        some = np.flatnonzero(place == number)
        inside = min(reach, 2 * blocks.width - number)  # behind the window there are zeros
        of_models[some, :, number : number + inside] = near[some, :, :inside]
    moved = np.flatnonzero(rows.by_similarity.any(axis=(1, 2)))
    for start, run in runs_of(base[moved]):
        before = _Before.of(blocks, similarities, start)
        values = rows.by_similarity[moved[run]] @ before.unknowns
        result[moved[run], :, :SIMILARITY_PARAMETERS] = values[:, :, :SIMILARITY_PARAMETERS]
        by_step = values[:, :, SIMILARITY_PARAMETERS:].reshape(len(values), size, -1, COMPONENTS)
        of_models[moved[run], :, before.places, COMPONENT] = by_step
    return result


def _near_first(similarities: PhotoSimilarities, rows: ErrorRows, images: Floats) -> Floats:
    """Components and correlates (n, d, k, 12) of the models of rows, from two before the first on."""
    (count, slots, size, _), (first, last) = rows.by_component.shape, (rows.first, len(similarities.size) - 1)
    result = np.zeros((count, size, images.shape[2], MODEL))
    for slot in range(images.shape[2]):
        model = np.clip(first - SHARING + slot, 0, last)  # beyond the ends there are no covariances
        np.divide(images[:, :, slot], -similarities.size[model, None], out=result[:, :, slot, CORRELATE])
    for slot in range(slots):
        model = np.minimum(first + slot, last)
        own = result[:, :, SHARING + slot, COMPONENT]
        np.multiply(rows.by_component[:, slot], similarities.size[model, None], out=own)
    return result


class _Before(NamedTuple):
    """What makes the similarity of a model out of a block's anchor and the steps from there on."""

    unknowns: Floats  # (7, 7 + 6 k)
    places: slice  # of these models

    @classmethod
    def of(cls, blocks: Blocks, similarities: PhotoSimilarities, model: int) -> _Before:
        start = model // blocks.width * blocks.width - SHARING
        anchor = max(start, 0)
        unknowns = np.concatenate([similarities.to_common[anchor], *similarities.steps[anchor:model]], axis=1)
        return cls(unknowns, slice(anchor - start, model - start))
