"""Errors inside pairs: what errors of the image coordinates do to the elements, the base and the points of a model.

Source: derived, docs/precision.md, eq. 1; [001] eq. 126-138 for the operations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers, pieces
from photostrip.geometry.rotation import angle_rates, cross_matrix, from_alpha_omega_kappa
from photostrip.strip.relative_orientation.orientation import Orientation
from photostrip.strip.relative_orientation.solution import normal_matrices

SYSTEM = "alpha-omega-kappa"
ROWS = 2048  # worked on together: what fits into the processor's cache
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
    parallax_by_elements: Floats  # (5, m): y parallax in the base frame, mm per radian
    parallax_by_image: Floats  # (m, 4): without unit
    point: Floats  # (m, 3): model point from the left perspective centre, metres
    base: Floats  # (p, 3): right from left perspective centre, metres


def differentiate_pairs(
    orientation: Orientation, rotations: Floats, scale: Floats, across: Floats | None = None
) -> PairErrors:
    """Differentiate all pairs of a strip.

    ``rotations`` (p, 3, 3) bring the left photo of each pair to the frame of the ground, ``scale`` (p,) is the length
    of each base in metres; ``across`` (p, 3), for points on left rays, is as in ``FormedStrip``.
    Rows whose rays do not meet hold numbers without meaning; they take part in nothing.
    """
    pairs = orientation.pairs
    left, right = _turns(orientation.elements)
    to_ground = rotations @ left.rotation.transpose(0, 2, 1) * scale[:, None, None]
    turn = np.concatenate([-left.rates, right.rates], axis=2)
    held, count = to_ground @ left.rates / scale[:, None, None], len(pairs.pair)
    point, by_elements, by_image = np.empty((count, 3)), np.empty((count, 3, 5)), np.empty((count, 3, 4))
    parallax_by_elements, parallax_by_image = np.empty((5, count)), np.empty((count, 4))
    for rows in pieces(count, ROWS):
        pair = pairs.pair[rows]
        of_row = _by_row(to_ground, pair)
        with np.errstate(all="ignore"):
            levels = [
                _levelled(ray[:, rows], photo, pair, pairs.focal)
                for ray, photo in zip(orientation.rays, (left, right), strict=True)
            ]
            if across is None:
                met, by_levels = _on_both_rays(levels[0].xy, levels[1].xy, pairs.focal)
            else:
                seen_along = (left.rotation @ across[:, :, None])[pair, :, 0]
                met, by_levels = _on_left_rays(levels[0].xy, levels[1].xy, pairs.focal, seen_along)
            for level, by_level, elements, image, sign in zip(
                levels, by_levels, (LEFT, RIGHT), (slice(0, 2), slice(2, 4)), (1.0, -1.0), strict=True
            ):
                in_ground = _product(of_row, by_level)
                by_elements[rows, :, elements] = _product(in_ground, level.by_elements).transpose(2, 0, 1)
                by_image[rows, :, image] = _product(in_ground, level.by_image).transpose(2, 0, 1)
                parallax_by_elements[elements, rows] = sign * level.by_elements[1]
                parallax_by_image[rows, image] = sign * level.by_image[1].T
            # in the frame of the left photo, which is held: (p x) turned to the ground
            point[rows] = (of_row * met).sum(axis=1).T
            by_elements[rows, :, LEFT] += cross_matrix(point[rows]) @ held[pair]
    base = np.zeros((pairs.size, 3, 5))
    base[:, :, LEFT] = cross_matrix(np.array([1.0, 0.0, 0.0])) @ left.rates  # the left photo is held, the base turns
    return PairErrors(
        base_by_elements=to_ground @ base,
        rotation_by_elements=to_ground @ turn / scale[:, None, None],
        point_by_elements=by_elements,
        point_by_image=by_image,
        parallax_by_elements=parallax_by_elements,
        parallax_by_image=parallax_by_image,
        point=point,
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


class _Level(NamedTuple):
    """Image points of one photo of every pair, brought to a level photo in the base frame, and their derivatives."""

    xy: Floats  # (2, m): image coordinates, mm
    by_elements: Floats  # (2, k, m): by the photo's angles among the elements
    by_image: Floats  # (2, 2, m)


def elements_by_parallax(orientation: Orientation, jacobian: Floats) -> Floats:
    """Elements by the y parallax of each row, (m, 5), radians per mm, 0 if not used: -(J^T W J)^-1 J^T W (eq. 1).

    jacobian: (5, m), y parallaxes by the elements.
    """
    pairs = orientation.pairs
    with np.errstate(all="ignore"):
        cofactors = np.linalg.inv(normal_matrices(jacobian, pairs))
        found = np.zeros(jacobian.shape[::-1])
        for row, weighted in zip(cofactors.transpose(1, 0, 2), jacobian * pairs.weight, strict=True):
            found -= row[pairs.pair] * weighted[:, None]
    found[~orientation.used] = 0.0
    return found


def _by_row(of_pairs: Floats, pair: Numbers) -> Floats:
    """Bring matrices of pairs (p, i, j) to the rows, (i, j, m), as all below has them: products run along the rows."""
    return of_pairs.transpose(1, 2, 0).take(pair, axis=2)


def _product(first: Floats, second: Floats) -> Floats:
    """Multiply matrices of rows, (i, j, m) and (j, k, m)."""
    return np.asarray(np.einsum("ijm,jkm->ikm", first, second), float)


def _levelled(ray: Floats, photo: _Turns, pair: Numbers, focal: float) -> _Level:
    """Bring rays (3, m) to a level photo: x = -f X/Z, y = -f Y/Z, by small turns of the photo and by its images."""
    x, y = xy = -focal * ray[:2] / ray[2]
    by_turn = np.stack([x * y, -(focal**2) - x * x, -y * focal, focal**2 + y * y, -x * y, x * focal]) / focal
    by_ray = np.zeros((2, 3, len(x)))
    by_ray[0, 0] = by_ray[1, 1] = -focal / ray[2]
    by_ray[:, 2] = -xy / ray[2]
    by_elements = _product(by_turn.reshape(2, 3, -1), _by_row(photo.rates, pair))
    return _Level(xy, by_elements, _product(by_ray, _by_row(photo.rotation[:, :, :2], pair)))


def _on_both_rays(left: Floats, right: Floats, focal: float) -> tuple[Floats, Floats]:
    """Intersect level image points (2, m): N = 1 / (x1 - x2), X = N x1, Y = N (y1 + y2) / 2, Z = -N f.

    Returns points (3, m), the base being 1, and their derivatives (2, 3, 2, m) by both image points.
    """
    factor = 1 / (left[0] - right[0])  # eq. 138 with the base along x
    point = np.stack([factor * left[0], factor * (left[1] + right[1]) / 2, -factor * focal])
    by_level = np.zeros((2, 3, 2, len(factor)))
    by_level[1, :, 0] = factor * point
    by_level[0, :, 0] = -by_level[1, :, 0]
    by_level[0, 0, 0] += factor
    by_level[:, 1, 1] = factor / 2
    return point, by_level


def _on_left_rays(left: Floats, right: Floats, focal: float, across: Floats) -> tuple[Floats, Floats]:
    """Intersect along the left rays: P = N l, N = w . (b x r) / w . (l x r) with b = (1, 0, 0); see ``_on_both_rays``.

    The rays l and r meet, seen along w, ``across`` (m, 3). Where a y parallax is left over, w matters to the point; how
    the elements turn it is of second order.
    """
    first, second = (np.column_stack([*each, np.full(len(across), -focal)]) for each in (left, right))
    base = np.cross(across, np.array([1.0, 0.0, 0.0]))
    size = np.einsum("mi,mi->m", across, np.cross(first, second))[:, None]
    factor = np.einsum("mi,mi->m", base, second)[:, None] / size
    by_first = -factor * np.cross(second, across) / size
    by_second = (base - factor * np.cross(across, first)) / size
    by_level = np.stack([first.T[:, None] * each.T[:2] for each in (by_first, by_second)])
    by_level[0, [0, 1], [0, 1]] += factor[:, 0]
    return (factor * first).T, by_level
