"""Points where the rays of two photos meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Flags, Floats

LEAST_X_PARALLAX = 1e-6  # of the principal distance: a smaller x parallax intersects nothing
EXCHANGED = [1, 0, 2]  # X and Y


@dataclass(frozen=True, eq=False)
class Intersection:
    """Model points from two photos."""

    xyz: Floats  # (m, 3): coordinates relative to the left perspective centre, in the unit of the base
    ray_factor: Floats  # (m,): ray factor N of the left ray (model unit per mm)
    # (m,): left minus right Y of the two rays, or X where the base lies along Y; in the unit of the base
    gap: Floats
    # (m,): false where the rays are parallel or meet behind a camera; the coordinates are NaN there
    sound: Flags


def intersect(base: Floats, left: Floats, right: Floats, focal: float, *, left_ray: bool = False) -> Intersection:
    """Forward intersection of the rays of two photos.

    base: (3,) or (3, m), base components BX, BY, BZ.
    left, right: (3, m), rays of the left and right photo, turned into the frame of the base, mm.
    left_ray: Y of the left ray, as [001] has it, instead of the mean of both, which the theory of errors of [000]
        assumes too.

    Source: [001] eq. 137 (second line corrected to y2) and 138; where the base is nearer to Y, X and Y change places.
    """
    across = lies_across(base)
    base, left, right = (_exchanged(vectors, across) for vectors in (base, left, right))
    bx, by, bz = base
    with np.errstate(divide="ignore", invalid="ignore"):
        x1, y1 = -focal * left[0] / left[2], -focal * left[1] / left[2]
        x2, y2 = -focal * right[0] / right[2], -focal * right[1] / right[2]
        parallax = x1 - x2
        n1 = (bx + x2 * bz / focal) / parallax  # eq. 138
        n2 = n1 + bz / focal
        y_left, y_right = n1 * y1, by + n2 * y2
        sound = (np.abs(parallax) > LEAST_X_PARALLAX * focal) & (n1 > 0) & (n2 > 0) & (left[2] < 0) & (right[2] < 0)
        y = y_left if left_ray else (y_left + y_right) / 2
        xyz = np.column_stack([*_exchanged(np.stack([n1 * x1, y, -n1 * focal]), across)])
    xyz[~sound] = np.nan
    return Intersection(xyz=xyz, ray_factor=n1, gap=y_left - y_right, sound=sound)


def lies_across(base: Floats) -> Flags:
    """Whether a base (3, ...) is nearer to Y than to X: there is no x parallax along Y, and eq. 138 divides by it."""
    return np.asarray(np.abs(base[1]) > np.abs(base[0]))


def _exchanged(vectors: Floats, where: Flags) -> Floats:
    """Exchange X and Y of vectors (3, m)."""
    return np.asarray(np.where(where, vectors[EXCHANGED], vectors), float)
