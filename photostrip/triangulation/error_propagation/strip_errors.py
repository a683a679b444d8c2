"""Errors of the formed strip: sparse rows of derivatives by the image coordinates, one for every step and point.

The error of a model is an infinitesimal similarity (shift, rotation, scale) plus its deformation. From model to model
the similarities differ by *steps* (eq. 2). All of them hang on six *error components* of each model: the errors of the
five elements of its pair, and of the logarithm of the scale handed on to the next model. Every row is kept as
coefficients of a similarity, of a few components, and of a few image coordinates (eq. 3); the covariances among
components and image coordinates are exact products of their rows. Components of models i and k have image coordinates
in common when |i - k| <= 2: pairs share a photo, a scale transfer uses three.

All coordinates refer to the frame of the ground after the plain similarity; image coordinates count in their stated
standard deviations.

Source: derived; see docs/precision.md, eq. 2 and 3.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial

import numpy as np

from photostrip.arrays import Floats, Numbers, distinct
from photostrip.frozen import dataclass, replace
from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, Similarity, similarity_derivatives
from photostrip.triangulation.error_propagation import pair_errors
from photostrip.triangulation.error_propagation.derivatives import (
    COMPONENTS,
    ELEMENTS,
    MOVED,
    SCALE,
    SHARING,
    SPAN,
    ErrorRows,
    ImagePoints,
    PlacedStrip,
    add_rows,
)
from photostrip.triangulation.error_propagation.pair_errors import PairErrors
from photostrip.triangulation.relative_orientation.orientation import Orientation
from photostrip.triangulation.resection.resection import runs
from photostrip.triangulation.strip_formation.strip import FormedStrip

IMAGES = 4096  # image points whose products are summed together: what fits into the processor's cache


@dataclass(frozen=True, eq=False)
class StripErrors:
    """Everything that covariances of a strip are made of."""

    images: ImagePoints
    # (p, 7, 6): step from the similarity of each model to the next by the model's error components; after the last
    # model that of the last photo
    steps: Floats
    component_covariances: Floats  # (p, 3, 6, 6): Q, of each model with itself, the next and the one after
    points: ErrorRows
    make_pairs: Callable[[], PairErrors]
    origin: Floats  # (3,): common origin of all similarities

    @cached_property
    def pairs(self) -> PairErrors:
        """Errors inside the pairs, found again: as much memory as a quarter of all else, and not always asked for."""
        return self.make_pairs()

    @property
    def models(self) -> int:
        return len(self.steps)

    def with_doubt(self, scale: Floats) -> StripErrors:
        """Add standard deviations (j,) to the logarithms of the scales handed on, beside the image coordinates'."""
        found = self.component_covariances.copy()
        found[: len(scale), 0, SCALE, SCALE] += scale**2
        return replace(self, component_covariances=found)


def differentiate_strip(
    orientation: Orientation, formed: FormedStrip, similarity: Similarity, position: Numbers, sigma: Floats
) -> StripErrors:
    """Rows of derivatives of a formed strip.

    similarity: from the strip to the frame of the ground.
    position: (k,), place in the strip of the photo of every image point in the observations.
    sigma: (k, 2), standard deviations of all image points in the observations, mm.
    """
    rotations = similarity.rotation @ formed.rotations
    across = formed.rotations[:-1, 1] if formed.left_ray else None
    scale = similarity.scale * formed.scale
    make_pairs = partial(pair_errors.differentiate_pairs, orientation, rotations[:-1], scale, across)
    pairs = make_pairs()
    centers = similarity(formed.centers)
    origin = centers.mean(axis=0)
    strip = PlacedStrip(
        orientation=orientation,
        formed=formed,
        xyz=similarity(formed.xyz) - origin,
        centers=centers - origin,
        rotations=rotations,
        pairs=pairs,
        images=_image_points(orientation, formed, pairs, position, sigma),
        steps=_steps(pairs, centers[1:] - origin),
    )
    points = _point_rows(strip)
    if len(formed.bridging):
        from photostrip.triangulation.error_propagation.non_neighbour_errors import with_bridges

        points = with_bridges(points, strip)
    return StripErrors(
        images=strip.images,
        steps=strip.steps,
        component_covariances=_component_covariances(strip.images, len(strip.steps)),
        points=points,
        make_pairs=make_pairs,
        origin=origin,
    )


def scale_shares(orientation: Orientation, formed: FormedStrip, pairs: PairErrors) -> tuple[Floats, Floats]:
    """Differentiate the logarithm of the scale handed on by the pass points, seen from the common centre.

    The scale k is the weighted mean of the ratios r = |b| / |a| of the vectors before and after: d ln k = sum p r
    (b . db / |b|^2 - a . da / |a|^2) / sum p r. The shares of ``after`` come without their sign.

    Returns before, after: (t, 3), by the point in the model before and after the junction, 1/metres; 0 for pass points
        that are not used.
    """
    joined = formed.junctions
    shares = np.where(joined.used, joined.weight * joined.ratio, 0.0)
    shares = shares / np.bincount(joined.junction, shares, max(orientation.pairs.size - 1, 1))[joined.junction]
    vectors = (pairs.point[joined.before] - pairs.base[joined.junction], pairs.point[joined.after])
    before, after = (shares[:, None] * u / (u**2).sum(axis=1)[:, None] for u in vectors)
    return before, after


def _image_points(
    orientation: Orientation, formed: FormedStrip, pairs: PairErrors, position: Numbers, sigma: Floats
) -> ImagePoints:
    """Image points of the pairs, ordered by photo, with the error components that depend on them.

    A point on photo i enters the elements of the models i - 1 and i directly, and the scale of the models i - 2 to i:
    by its own ray, and by the elements of both models of a junction.
    """
    row = distinct(orientation.rows)
    row = row[np.argsort(position[row], kind="stable")]
    components = np.zeros((len(row), 2, MOVED.stop - MOVED.start))
    images = ImagePoints(row=row, photo=position[row], sigma=sigma[row], components=components)
    joined, models = formed.junctions, orientation.pairs.size
    before, after = scale_shares(orientation, formed, pairs)
    # elements of a model, and of the next, by which the scale is handed on from it; after the last model it is not
    of_scale, of_scale_before = (np.zeros((models, 5)) for _ in range(2))
    center_to_point = pairs.point_by_elements[joined.before] - pairs.base_by_elements[joined.junction]
    add_rows(of_scale, joined.junction, (before[:, None] @ center_to_point)[:, 0])
    by_next = after[:, None] @ pairs.point_by_elements[joined.after]
    add_rows(of_scale_before, joined.junction + 1, -by_next[:, 0])
    place, stated = images.rows_of(orientation.rows), sigma[orientation.rows].reshape(-1, 4)
    by_parallax = pair_errors.elements_by_parallax(orientation, pairs.parallax_by_elements)
    parallax = np.where(orientation.used[:, None], pairs.parallax_by_image * stated, 0.0)
    scale, scale_before = (
        (by_parallax * shares[orientation.pairs.pair]).sum(axis=1) for shares in (of_scale, of_scale_before)
    )
    by_parallax = np.column_stack([by_parallax, scale])
    of_model = np.split(components, [1, 1 + COMPONENTS], axis=2)  # photo - 2, photo - 1, photo: the last is the scale
    sides = (parallax[:, :2], place[:, 0], 2), (parallax[:, 2:], place[:, 1], 1)
    for by_image, image, slot in sides:
        of_model[slot][image] = by_image[:, :, None] * by_parallax[:, None, :]
    for by_image, image, slot in sides:
        of_model[slot - 1][image, :, -1] += by_image * scale_before[:, None]
    by_before = (before[:, None] @ pairs.point_by_image[joined.before])[:, 0] * stated[joined.before]
    by_after = (after[:, None] @ pairs.point_by_image[joined.after])[:, 0] * stated[joined.after]
    of_model[2][place[joined.before, 0], :, -1] += by_before[:, :2]
    of_model[1][place[joined.before, 1], :, -1] += by_before[:, 2:] - by_after[:, :2]
    of_model[0][place[joined.after, 1], :, -1] -= by_after[:, 2:]
    return images


def _steps(pairs: PairErrors, next_centers: Floats) -> Floats:
    """Derive steps by components: t = dB - theta x (S - O) - mu (S - O), theta, mu; S the centre joining the models."""
    steps = np.zeros((len(next_centers), SIMILARITY_PARAMETERS, COMPONENTS))
    steps[:, :3, ELEMENTS] = pairs.base_by_elements + cross_matrix(next_centers) @ pairs.rotation_by_elements
    steps[:, :3, SCALE] = -next_centers
    steps[:, 3:6, ELEMENTS] = pairs.rotation_by_elements
    steps[:, 6, SCALE] = 1.0
    return steps


def _component_covariances(images: ImagePoints, models: int) -> Floats:
    """Q(m, m + apart) = sum over common image points of their rows' products, shape (p, 3, 6, 6)."""
    photos = models + 1
    counts = np.bincount(images.photo, minlength=photos)
    rank = np.arange(len(images.photo)) - np.concatenate([[0], np.cumsum(counts)])[images.photo]
    gram = np.zeros((photos, SPAN * COMPONENTS, SPAN * COMPONENTS))
    for start, stop in runs(np.concatenate([[0], np.cumsum(counts)]), IMAGES):
        padded = np.zeros((stop - start, int(counts.max()), *images.components.shape[1:]))
        rows = slice(*np.searchsorted(images.photo, [start, stop]).tolist())
        padded[images.photo[rows] - start, rank[rows]] = images.components[rows]
        flat = padded.reshape(stop - start, -1, padded.shape[-1])
        gram[start:stop, MOVED, MOVED] = flat.transpose(0, 2, 1) @ flat
    gram = gram.reshape(photos, SPAN, COMPONENTS, SPAN, COMPONENTS)
    result = np.zeros((models, SPAN, COMPONENTS, COMPONENTS))
    for apart in range(SPAN):
        for slot in range(SPAN - apart):  # the earlier model is photo - 2 + slot
            of_photo = gram[SHARING - slot :, slot, :, slot + apart]
            result[: len(of_photo), apart] += of_photo[:models]
    return result


def _point_rows(strip: PlacedStrip) -> ErrorRows:
    """Rows of the points: means over their k models, each brought back over the steps to the first of them (eq. 3)."""
    orientation, formed, pairs, steps = strip.orientation, strip.formed, strip.pairs, strip.steps
    rows = np.flatnonzero(orientation.used & np.isfinite(formed.model_xyz).all(axis=1))
    item = np.searchsorted(formed.point, orientation.point[rows])
    model, count = orientation.pairs.pair[rows], len(formed.point)
    first = np.full(count, len(steps))
    np.minimum.at(first, item, model)
    if len(formed.home):
        first = np.where(formed.model_count == 0, formed.home, first)
    slot = model - first[item]
    slots = int(slot.max()) + 1
    share = 1 / formed.model_count[item]
    place = strip.images.rows_of(orientation.rows)
    by_image = np.zeros((len(strip.images.row), 3, 2))
    point_of = np.full(len(strip.images.row), -1)
    for side, columns in ((0, slice(0, 2)), (1, slice(2, 4))):
        by_image[place[rows, side]] += share[:, None, None] * pairs.point_by_image[rows, :, columns]
        point_of[place[rows, side]] = item
    entries = np.flatnonzero(point_of >= 0)
    entries = entries[np.argsort(point_of[entries], kind="stable")]
    by_image = by_image[entries]
    by_image *= strip.images.sigma[entries][:, None, :]
    by_component = np.zeros((count, slots, 3, COMPONENTS))
    by_component[item, slot, :, ELEMENTS] = pairs.point_by_elements[rows]
    by_component *= (1 / np.maximum(formed.model_count, 1))[:, None, None, None]
    held = np.zeros((count, slots + 1))
    held[item, slot] = share
    beyond = np.cumsum(held[:, ::-1], axis=1)[:, ::-1][:, 1:]  # share of the models after each slot
    by_similarity = similarity_derivatives(strip.xyz, np.zeros(3))
    for s in range(slots):
        moved = np.flatnonzero(beyond[:, s] > 0)
        for some in np.split(moved, range(IMAGES, len(moved), IMAGES)):  # the steps of all take twice the memory
            by_component[some, s] += beyond[some, s, None, None] * (by_similarity[some] @ steps[first[some] + s])
    return ErrorRows(
        first=first,
        by_similarity=by_similarity,
        by_component=by_component,
        item=point_of[entries],
        image=entries,
        by_image=by_image,
    )
