"""Errors inside pairs: what errors of the image coordinates do to the elements, the base and the points of a model.

All pairs of a strip go in one batch of flat columns. Derivatives are those of the operations as they run: the weighted
least squares of the y parallaxes (``relative``) and the intersection with the mean Y of
both rays (``intersection``).

Source: derived; [001] eq. 126-138 for the operations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.rotation import angle_rates, from_alpha_omega_kappa
from photostrip.triangulation.relative_orientation import relative

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.relative_orientation.relative import Orientation, Pairs

    Floats = NDArray[np.float64]

SYSTEM = "alpha-omega-kappa"
LEFT, RIGHT = slice(0, 2), slice(2, 5)  # elements that turn the left and the right photo


@dataclass(frozen=True, eq=False)
class PairErrors:
    """Derivatives of what pairs give, by image coordinates and by elements, in the frame of the ground."""

    # (m, 5, 4): elements of the row's pair by x and y of the left and of the right image point, radians per mm; 0 for
    # rows that took no part
    elements: Floats
    base: Floats  # (p, 3, 5): base vector by elements, the left photo held fast, metres per radian
    turn: Floats  # (p, 3, 5): small rotation of the right photo by elements, the left photo held fast
    deformation: Floats  # (m, 3, 5): model point by elements, the left photo held fast, metres per radian
    own: Floats  # (m, 3, 4): model point by its own image coordinates, the elements held fast, metres per mm
    arm: Floats  # (m, 3): model point from the left perspective centre, metres
    reach: Floats  # (p, 3): right from left perspective centre, metres


def differentiate(orientation: Orientation, rotations: Floats, scale: Floats) -> PairErrors:
    """Differentiate all pairs of a strip.

    Parameters
    ----------
    rotations : ndarray, shape (p, 3, 3)
        Left photo of each pair to the frame of the ground.
    scale : ndarray, shape (p,)
        Length of each base, metres.

    Returns
    -------
    PairErrors
        The derivatives. Rows whose rays do not meet hold numbers without meaning; they take part in nothing.
    """
    pairs = orientation.pairs
    al1, ka1, al2, om2, ka2 = orientation.elements.T
    zero = np.zeros_like(al1)
    photos = (from_alpha_omega_kappa(al1, 0.0, ka1), from_alpha_omega_kappa(al2, om2, ka2))
    left_rates = angle_rates(np.column_stack([al1, zero, ka1]), SYSTEM)[:, :, [0, 2]]  # omega1 is 0 by definition
    right_rates = angle_rates(np.column_stack([al2, om2, ka2]), SYSTEM)
    to_ground = rotations @ photos[0].transpose(0, 2, 1) * scale[:, None, None]
    turn = np.concatenate([-left_rates, right_rates], axis=2)
    with np.errstate(all="ignore"):
        point, by_elements, own = _points(orientation, photos, (left_rates, right_rates))
    ahead = np.zeros((pairs.size, 3, 5))
    ahead[:, :, LEFT] = -_crossed(left_rates, np.array([1.0, 0.0, 0.0]))  # the left photo is held, the base turns
    frame = to_ground[pairs.pair]
    return PairErrors(
        _elements(orientation, photos),
        to_ground @ ahead,
        to_ground @ turn / scale[:, None, None],
        frame @ by_elements,
        frame @ own,
        np.einsum("mij,mj->mi", frame, point),
        to_ground[:, :, 0],
    )


def _crossed(axes: Floats, vectors: Floats) -> Floats:
    """Cross products axis x vector of every column of the axes, shape (..., 3, k)."""
    return np.asarray(np.cross(axes, vectors[..., :, None], axisa=-2, axisb=-2, axisc=-2), float)


def _elements(orientation: Orientation, photos: tuple[Floats, Floats]) -> Floats:
    """Elements by image coordinates: de = -(J^T W J)^-1 J^T W B v."""
    pairs = orientation.pairs
    with np.errstate(all="ignore"):
        _, jacobian = relative.linearised(orientation.elements, pairs)
        cofactors = np.linalg.inv(relative.normal_matrices(jacobian, pairs))
        by_image = _parallax_by_image(orientation.elements, pairs, photos)
        share = np.einsum("mij,jm->mi", cofactors[pairs.pair], jacobian * pairs.weight)
        found = -share[:, :, None] * by_image[:, None, :]
    return np.where(orientation.used[:, None, None], found, 0.0)


def _parallax_by_image(elements: Floats, pairs: Pairs, photos: tuple[Floats, Floats]) -> Floats:
    """Y parallax q by (x1, y1, x2, y2), shape (m, 4), without unit."""
    left, right = relative.rays(elements, pairs)
    result = np.empty((len(pairs.pair), 4))
    for columns, sign, ray, photo in ((slice(0, 2), 1.0, left, photos[0]), (slice(2, 4), -1.0, right, photos[1])):
        turned = photo[pairs.pair][:, :, :2]
        result[:, columns] = sign * _levelled(ray, turned, pairs.focal)[:, 1]
    return result


def _levelled(ray: Floats, change: Floats, focal: float) -> Floats:
    """Change of the image coordinates of a ray brought to a level photo, shape (m, 2, k), by that of the ray."""
    slope = ray[:2] / ray[2]
    found: Floats = -focal * (change[:, :2] - slope.T[:, :, None] * change[:, 2:]) / ray[2][:, None, None]
    return found


def _points(
    orientation: Orientation, photos: tuple[Floats, Floats], rates: tuple[Floats, Floats]
) -> tuple[Floats, Floats, Floats]:
    """Model points in the base frame with base 1, by elements (the left photo held) and by their own coordinates."""
    pairs = orientation.pairs
    both = relative.rays(orientation.elements, pairs)
    level = [-pairs.focal * ray[:2] / ray[2] for ray in both]
    factor = 1 / (level[0][0] - level[1][0])  # eq. 138 with the base along x
    middle = (level[0][1] + level[1][1]) / 2
    point = np.column_stack([factor * level[0][0], factor * middle, -factor * pairs.focal])
    by_level = np.zeros((2, len(factor), 3, 2))
    by_level[0, :, :, 0] = -factor[:, None] * point
    by_level[1, :, :, 0] = factor[:, None] * point
    by_level[0, :, 0, 0] += factor
    by_level[:, :, 1, 1] = factor / 2
    by_elements, own = np.empty((len(factor), 3, 5)), np.empty((len(factor), 3, 4))
    for side, (columns, ray, photo, rate) in enumerate(zip((LEFT, RIGHT), both, photos, rates, strict=True)):
        turned = _crossed(rate[pairs.pair], ray.T)
        by_elements[:, :, columns] = by_level[side] @ _levelled(ray, turned, pairs.focal)
        image = photo[pairs.pair][:, :, :2]
        own[:, :, 2 * side : 2 * side + 2] = by_level[side] @ _levelled(ray, image, pairs.focal)
    by_elements[:, :, LEFT] -= _crossed(rates[0][pairs.pair], point)  # seen from the left photo, which is held
    return point, by_elements, own
