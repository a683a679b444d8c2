"""Errors of the formed strip: sparse rows of derivatives by the image coordinates, one for every step and point.

The error of a model is an infinitesimal similarity (shift, rotation, scale) plus its deformation. From model to
model the similarities differ by *steps*. All of them hang on six numbers for each model, its *units*: the errors of
the five elements of its pair, and of the logarithm of the scale handed on to the next model. Every row is kept as
coefficients of a similarity, of a few units, and of a few image coordinates; the covariances among units and image
coordinates are exact products of their own rows. Units of models i and k have image coordinates in common when
|i - k| <= 2: pairs share a photo, a scale transfer uses three.

All coordinates refer to the frame of the ground after the plain similarity; image coordinates count in units of their
stated standard deviation.

Source: derived; see docs/precision.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.rotation import cross_matrix
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.triangulation.error_propagation import pair_errors
from photostrip.triangulation.error_propagation.derivatives import ELEMENTS, REACH, SCALE, SPAN, UNITS, Images, Rows
from photostrip.triangulation.error_propagation.non_neighbour_errors import with_bridges

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.geometry.similarity import Similarity
    from photostrip.triangulation.error_propagation.pair_errors import PairErrors
    from photostrip.triangulation.relative_orientation.relative import Orientation
    from photostrip.triangulation.strip_formation.formation import FormedStrip

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class StripErrors:
    """Everything that covariances of a strip are made of."""

    images: Images
    # (p, 7, 6): step from the similarity of each model to the next by the model's units; after the last model that of
    # the last photo
    steps: Floats
    # (p, 3, 6, 6): covariances of the units of each model with those of itself, the next and the one after
    covariances: Floats
    points: Rows
    pairs: PairErrors
    origin: Floats  # (3,): common origin of all similarities

    @property
    def models(self) -> int:
        """Number of models."""
        return len(self.steps)


def strip_errors(
    orientation: Orientation, formed: FormedStrip, similarity: Similarity, position: Numbers, sigma: Floats
) -> StripErrors:
    """Rows of derivatives of a formed strip.

    Parameters
    ----------
    similarity : Similarity
        From the strip to the frame of the ground.
    position : ndarray of int, shape (k,)
        Place in the strip of the photo of every image point in the observations.
    sigma : ndarray, shape (k, 2)
        Standard deviations of all image points in the observations, mm.

    Returns
    -------
    StripErrors
        Units, steps and rows of the points.
    """
    rotations = similarity.rotation @ formed.rotations[:-1]
    derivatives = pair_errors.differentiate(orientation, rotations, similarity.scale * formed.scale)
    centers = similarity(formed.centers)
    origin = centers.mean(axis=0)
    images, place = _images(orientation, position, sigma)
    units = _units(orientation, formed, derivatives, images, place)
    images = Images(images.row, images.photo, images.sigma, units * images.sigma[:, None, None, :])
    steps = _steps(derivatives, centers[1:] - origin)
    points = _point_rows(orientation, formed, derivatives, similarity(formed.xyz) - origin, (images, place, steps))
    if len(formed.bridging):
        photos = (centers - origin, similarity.rotation @ formed.rotations)
        points = with_bridges(points, (orientation, formed), (images, place), photos, steps)
    return StripErrors(images, steps, _unit_covariances(images, len(steps)), points, derivatives, origin)


def _images(orientation: Orientation, position: Numbers, sigma: Floats) -> tuple[Images, Numbers]:
    """Image points of the pairs' table by photo, and the place of each pair's two points among them."""
    rows = np.unique(orientation.rows)
    rows = rows[np.argsort(position[rows], kind="stable")]
    lookup = np.full(len(position), -1)
    lookup[rows] = np.arange(len(rows))
    return Images(rows, position[rows], sigma[rows], np.zeros((0, 3, 6, 2))), lookup[orientation.rows]


def scale_shares(orientation: Orientation, formed: FormedStrip, derivatives: PairErrors) -> tuple[Floats, Floats]:
    """Share of every pass point in the logarithm of the scale handed on, by its vectors from the common centre.

    Returns
    -------
    before, after : ndarray, shape (t, 3)
        Derivatives by the point in the model before and after the joint, 1/metres, for the used rows of the junctions
        and 0 for others.
    """
    joined = formed.junctions
    shares = np.where(joined.used, joined.weight * joined.ratio, 0.0)
    shares = shares / np.bincount(joined.joint, shares, max(orientation.pairs.size - 1, 1))[joined.joint]
    vectors = (derivatives.arm[joined.before] - derivatives.reach[joined.joint], derivatives.arm[joined.after])
    before, after = (shares[:, None] * u / (u**2).sum(axis=1)[:, None] for u in vectors)
    return before, after


def _units(
    orientation: Orientation, formed: FormedStrip, derivatives: PairErrors, images: Images, place: Numbers
) -> Floats:
    """Units by image coordinates in mm, shape (n, 3, 6, 2)."""
    units = np.zeros((len(images.row), 3, UNITS, 2))
    units[place[:, 0], 2, ELEMENTS] = derivatives.elements[:, :, :2]
    units[place[:, 1], 1, ELEMENTS] = derivatives.elements[:, :, 2:]
    joined, models = formed.junctions, orientation.pairs.size
    before, after = scale_shares(orientation, formed, derivatives)
    near, far = (np.zeros((models, 5)) for _ in range(2))
    by_pair = np.einsum("ti,tij->tj", before, derivatives.deformation[joined.before] - derivatives.base[joined.joint])
    by_next = -np.einsum("ti,tij->tj", after, derivatives.deformation[joined.after])
    np.add.at(near, joined.joint, by_pair)
    np.add.at(far, joined.joint, by_next)
    own_before = np.einsum("ti,tij->tj", before, derivatives.own[joined.before])
    own_after = np.einsum("ti,tij->tj", after, derivatives.own[joined.after])
    units[place[joined.before, 0], 2, SCALE] += own_before[:, :2]
    units[place[joined.before, 1], 1, SCALE] += own_before[:, 2:] - own_after[:, :2]
    units[place[joined.after, 1], 0, SCALE] -= own_after[:, 2:]
    photo = images.photo
    padded_near, padded_far = (np.concatenate([a, np.zeros((SPAN, 5))]) for a in (near, far))  # no model: no share
    units[:, 2, SCALE] += np.einsum("ni,nij->nj", padded_near[photo], units[:, 2, ELEMENTS])
    units[:, 1, SCALE] += np.einsum("ni,nij->nj", padded_near[photo - 1], units[:, 1, ELEMENTS])
    units[:, 1, SCALE] += np.einsum("ni,nij->nj", padded_far[photo - 1], units[:, 2, ELEMENTS])
    units[:, 0, SCALE] += np.einsum("ni,nij->nj", padded_far[photo - 2], units[:, 1, ELEMENTS])
    return units


def _steps(derivatives: PairErrors, next_centers: Floats) -> Floats:
    """Derive steps by units: t = dB - theta x (S - O) - mu (S - O), theta, mu; S the centre that joins the models."""
    steps = np.zeros((len(next_centers), SIMILARITY_PARAMETERS, UNITS))
    steps[:, :3, ELEMENTS] = derivatives.base + cross_matrix(next_centers) @ derivatives.turn
    steps[:, :3, SCALE] = -next_centers
    steps[:, 3:6, ELEMENTS] = derivatives.turn
    steps[:, 6, SCALE] = 1.0
    return steps


def _unit_covariances(images: Images, models: int) -> Floats:
    """Exact products of the units' rows: (p, 3, 6, 6), with the own model, the next and the one after."""
    photos = models + 1
    counts = np.bincount(images.photo, minlength=photos)
    rank = np.arange(len(images.photo)) - np.concatenate([[0], np.cumsum(counts)])[images.photo]
    padded = np.zeros((photos, int(counts.max()), 2, SPAN * UNITS))
    padded[images.photo, rank] = images.units.transpose(0, 3, 1, 2).reshape(len(rank), 2, -1)
    flat = padded.reshape(photos, -1, SPAN * UNITS)
    gram = (flat.transpose(0, 2, 1) @ flat).reshape(photos, SPAN, UNITS, SPAN, UNITS)
    result = np.zeros((models, SPAN, UNITS, UNITS))
    for apart in range(SPAN):
        for slot in range(SPAN - apart):  # the earlier model is photo - 2 + slot
            shift = REACH - slot
            seen = gram[shift:, slot, :, slot + apart]
            result[: len(seen), apart] += seen[:models]
    return result


def _point_rows(
    orientation: Orientation,
    formed: FormedStrip,
    derivatives: PairErrors,
    arm: Floats,
    parts: tuple[Images, Numbers, Floats],
) -> Rows:
    """Rows of the points: means over their models, each seen from the first of them."""
    images, place, steps = parts
    rows = np.flatnonzero(orientation.used & np.isfinite(formed.model_xyz).all(axis=1))
    item = np.searchsorted(formed.point, orientation.point[rows])
    model, count = orientation.pairs.pair[rows], len(formed.point)
    first = np.full(count, len(steps))
    np.minimum.at(first, item, model)
    if len(formed.home):
        first = np.where(formed.models == 0, formed.home, first)
    slot = model - first[item]
    slots = int(slot.max()) + 1
    share = 1 / formed.models[item]
    core = np.zeros((count, slots, 3, UNITS))
    core[item, slot, :, ELEMENTS] = share[:, None, None] * derivatives.deformation[rows]
    held = np.zeros((count, slots + 1))
    held[item, slot] = share
    beyond = np.cumsum(held[:, ::-1], axis=1)[:, ::-1][:, 1:]  # share of the models after each slot
    frame = similarity_derivatives(arm, np.zeros(3))
    for s in range(slots):
        moved = np.flatnonzero(beyond[:, s] > 0)
        core[moved, s] += beyond[moved, s, None, None] * (frame[moved] @ steps[first[moved] + s])
    own = np.zeros((len(images.row), 3, 2))
    point_of = np.full(len(images.row), -1)
    for side, columns in ((0, slice(0, 2)), (1, slice(2, 4))):
        own[place[rows, side]] += share[:, None, None] * derivatives.own[rows][:, :, columns]
        point_of[place[rows, side]] = item
    entries = np.flatnonzero(point_of >= 0)
    entries = entries[np.argsort(point_of[entries], kind="stable")]
    return Rows(first, frame, core, point_of[entries], entries, own[entries] * images.sigma[entries][:, None, :])
