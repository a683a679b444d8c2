"""Differences of attitudes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.rotation import about

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from photostrip.arrays import Floats


def rotation_x(angle: ArrayLike) -> Floats:
    return about(0, angle)


def rotation_y(angle: ArrayLike) -> Floats:
    return about(1, angle)


def rotation_z(angle: ArrayLike) -> Floats:
    return about(2, angle)


def angle_between(first: ArrayLike, second: ArrayLike) -> Floats:
    """Angle, 0 to pi, of the rotation from one attitude to another, exact also when it is tiny."""
    a, b = np.asarray(first, float), np.asarray(second, float)
    chord = np.linalg.norm(a - b, axis=(-2, -1)) / np.sqrt(8.0)
    angle: Floats = 2 * np.arcsin(np.clip(chord, 0, 1))
    return angle
