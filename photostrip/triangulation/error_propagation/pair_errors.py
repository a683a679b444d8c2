"""Errors inside pairs: what errors of the image coordinates do to the elements, the base and the points of a model.

Source: derived, docs/precision.md, eq. 1; [001] eq. 126-138 for the operations.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from photostrip.arrays import Floats
from photostrip.frozen import NamedTuple, dataclass
from photostrip.geometry.rotation import angle_rates, from_alpha_omega_kappa
from photostrip.triangulation.relative_orientation.orientation import Orientation
from photostrip.triangulation.relative_orientation.pairs import Pairs
from photostrip.triangulation.relative_orientation.solution import base_rays, linearised_parallaxes, normal_matrices

_ByRay = Callable[[Floats], Floats]  # from changes of a ray, (m, 3, k), to those of the points

SYSTEM = "alpha-omega-kappa"
LEFT, RIGHT = slice(0, 2), slice(2, 5)  # elements that turn the left and the right photo


@dataclass(frozen=True, eq=False)
class PairErrors:
    """Derivatives of p pairs with m points, in the frame of the ground, the left photo of each pair held fast.

    Image coordinates are x and y of the left, then of the right image point.
    """

    base_by_elements: Floats  # (p, 3, 5): metres per radian
    rotation_by_elements: Floats  # (p, 3, 5): small rotation of the right photo
    point_by_elements: Floats  # (m, 3, 5): metres per radian
    point_by_image: Floats  # (m, 3, 4): the elements held fast, metres per mm
    point: Floats  # (m, 3): model point from the left perspective centre, metres
    base: Floats  # (p, 3): right from left perspective centre, metres


def differentiate_pairs(
    orientation: Orientation, rotations: Floats, scale: Floats, across: Floats | None = None
) -> PairErrors:
    """Differentiate all pairs of a strip.

    ``rotations`` (p, 3, 3) bring the left photo of each pair to the frame of the ground, ``scale`` (p,) is the length
    of each base in metres; ``across`` (p, 3), for points on left rays, is the strip's Y in the frames of left photos.
    Rows whose rays do not meet hold numbers without meaning; they take part in nothing.
    """
    pairs = orientation.pairs
    left, right = _turns(orientation.elements)
    to_ground = rotations @ left.rotation.transpose(0, 2, 1) * scale[:, None, None]
    turn = np.concatenate([-left.rates, right.rates], axis=2)
    with np.errstate(all="ignore"):
        points = _points(orientation, left, right, across)
    base = np.zeros((pairs.size, 3, 5))
    base[:, :, LEFT] = -_crossed(left.rates, np.array([1.0, 0.0, 0.0]))  # the left photo is held, the base turns
    of_row = to_ground[pairs.pair]
    return PairErrors(
        base_by_elements=to_ground @ base,
        rotation_by_elements=to_ground @ turn / scale[:, None, None],
        point_by_elements=of_row @ points.by_elements,
        point_by_image=of_row @ points.by_image,
        point=np.einsum("mij,mj->mi", of_row, points.point),
        base=to_ground[:, :, 0],
    )


class _Turns(NamedTuple):
    """One photo of every pair against its base."""

    rotation: Floats  # (p, 3, 3)
    rates: Floats  # (p, 3, k): small rotation by the photo's angles among the elements


def _turns(elements: Floats) -> tuple[_Turns, _Turns]:
    """Rotations of left and right photos to the base, and their rates by alpha1, kappa1; alpha2, omega2, kappa2."""
    al1, ka1, al2, om2, ka2 = elements.T
    zero = np.zeros_like(al1)
    left = _Turns(
        from_alpha_omega_kappa(al1, 0.0, ka1),
        angle_rates(np.column_stack([al1, zero, ka1]), SYSTEM)[:, :, [0, 2]],  # omega1 is 0 by definition
    )
    right = _Turns(
        from_alpha_omega_kappa(al2, om2, ka2),
        angle_rates(np.column_stack([al2, om2, ka2]), SYSTEM),
    )
    return left, right


class _Points(NamedTuple):
    """Model points in the base frame with base 1, the left photo held."""

    point: Floats  # (m, 3)
    by_elements: Floats  # (m, 3, 5)
    by_image: Floats  # (m, 3, 4)


def _crossed(axes: Floats, vectors: Floats) -> Floats:
    """Cross products axis x vector of every column of the axes, shape (..., 3, k)."""
    return np.asarray(np.cross(axes, vectors[..., :, None], axisa=-2, axisb=-2, axisc=-2), float)


def elements_by_image(orientation: Orientation) -> Floats:
    """Elements of each row's pair, (m, 5, 4), radians per mm, 0 if not used: de = -(J^T W J)^-1 J^T W B v (eq. 1)."""
    pairs = orientation.pairs
    with np.errstate(all="ignore"):
        _, jacobian = linearised_parallaxes(orientation.elements, pairs)
        cofactors = np.linalg.inv(normal_matrices(jacobian, pairs))
        by_image = _parallax_by_image(orientation.elements, pairs, *_turns(orientation.elements))
        share = np.einsum("mij,jm->mi", cofactors[pairs.pair], jacobian * pairs.weight)
        found = -share[:, :, None] * by_image[:, None, :]
    found[~orientation.used] = 0.0
    return found


def _parallax_by_image(elements: Floats, pairs: Pairs, left: _Turns, right: _Turns) -> Floats:
    """B: y parallax q by (x1, y1, x2, y2), shape (m, 4), without unit."""
    rays = base_rays(elements, pairs)
    result = np.empty((len(pairs.pair), 4))
    for columns, sign, ray, photo in ((slice(0, 2), 1.0, rays[0], left), (slice(2, 4), -1.0, rays[1], right)):
        turned = photo.rotation[pairs.pair][:, :, :2]
        result[:, columns] = sign * _levelled(ray, turned, pairs.focal)[:, 1]
    return result


def _levelled(ray: Floats, change: Floats, focal: float) -> Floats:
    """Change of the image coordinates of a ray brought to a level photo, shape (m, 2, k), by that of the ray."""
    slope = ray[:2] / ray[2]
    return np.asarray(-focal * (change[:, :2] - slope.T[:, :, None] * change[:, 2:]) / ray[2][:, None, None], float)


def _points(orientation: Orientation, left: _Turns, right: _Turns, across: Floats | None) -> _Points:
    """Differentiate the intersection by both rays, and these by elements and image coordinates."""
    pairs = orientation.pairs
    rays = base_rays(orientation.elements, pairs)
    if across is None:
        point, by_ray = _on_both_rays(*rays, pairs.focal)
    else:
        point, by_ray = _on_left_rays(*rays, np.einsum("pij,pj->pi", left.rotation, across)[pairs.pair])
    by_elements, by_image = np.empty((len(point), 3, 5)), np.empty((len(point), 3, 4))
    for side, (columns, photo) in enumerate(zip((LEFT, RIGHT), (left, right), strict=True)):
        by_elements[:, :, columns] = by_ray[side](_crossed(photo.rates[pairs.pair], rays[side].T))
        by_image[:, :, 2 * side : 2 * side + 2] = by_ray[side](photo.rotation[pairs.pair][:, :, :2])
    by_elements[:, :, LEFT] -= _crossed(left.rates[pairs.pair], point)  # in the frame of the left photo, which is held
    return _Points(point, by_elements, by_image)


def _on_both_rays(left: Floats, right: Floats, focal: float) -> tuple[Floats, tuple[_ByRay, _ByRay]]:
    """Differentiate N = 1 / (x1 - x2), X = N x1, Y = N (y1 + y2) / 2, Z = -N f of image coordinates made level."""
    level = [-focal * ray[:2] / ray[2] for ray in (left, right)]
    factor = 1 / (level[0][0] - level[1][0])  # eq. 138 with the base along x
    middle = (level[0][1] + level[1][1]) / 2
    point = np.column_stack([factor * level[0][0], factor * middle, -factor * focal])
    by_level = np.zeros((2, len(factor), 3, 2))
    by_level[0, :, :, 0] = -factor[:, None] * point
    by_level[1, :, :, 0] = factor[:, None] * point
    by_level[0, :, 0, 0] += factor
    by_level[:, :, 1, 1] = factor / 2
    return point, (
        lambda change: by_level[0] @ _levelled(left, change, focal),
        lambda change: by_level[1] @ _levelled(right, change, focal),
    )


def _on_left_rays(left: Floats, right: Floats, across: Floats) -> tuple[Floats, tuple[_ByRay, _ByRay]]:
    """Differentiate P = N l with N = w . (b x r) / w . (l x r): the rays l and r meet, seen along w; b = (1, 0, 0).

    Where a y parallax is left over, w matters to the point; how the elements turn it is of second order.
    """
    first, second = left.T, right.T
    base = np.cross(across, np.array([1.0, 0.0, 0.0]))
    size = np.einsum("mi,mi->m", across, np.cross(first, second))[:, None]
    factor = np.einsum("mi,mi->m", base, second)[:, None] / size
    by_first = -factor * np.cross(second, across) / size
    by_second = (base - factor * np.cross(across, first)) / size

    def along(gradient: Floats, change: Floats) -> Floats:
        return np.asarray(first[:, :, None] * np.einsum("mi,mik->mk", gradient, change)[:, None, :], float)

    return factor * first, (
        lambda change: along(by_first, change) + factor[:, :, None] * change,
        lambda change: along(by_second, change),
    )
