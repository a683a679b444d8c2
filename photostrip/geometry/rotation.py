"""Rotations in the angles of the field: alpha-omega-kappa, omega-phi-kappa, phi-omega-kappa, yaw-pitch-roll.

All matrices map photo vectors (x, y, -f) to object vectors, ``X = A r``. Arrays of angles give arrays of
matrices: the functions work on leading axes of any shape.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.errors import GeometryError

# systems of angles: the axes about which one turns after the other, each as the turns before have left it, and the
# sign of the first angle
AXES = {
    "alpha-omega-kappa": ((1, 0, 2), -1.0),
    "omega-phi-kappa": ((0, 1, 2), 1.0),
    "phi-omega-kappa": ((1, 0, 2), 1.0),
    # of an aircraft, yaw clockwise from north, pitch nose up, roll right wing down, with a camera that looks down and
    # has the top of its photos ahead: Rz(yaw) Ry(pitch) Rx(roll) of axes ahead, right, down, in east, north, up
    "yaw-pitch-roll": ((2, 0, 1), -1.0),
}
SYSTEMS = tuple(AXES)
GIMBAL_LIMIT = 1e-12  # 1 - |sine of the middle angle| below which the other two are not separable


def about(axis: int, angle: ArrayLike) -> Floats:
    """Rotation about the axis x (0), y (1) or z (2) by angles (...), right-hand rule."""
    t, first, second = np.asarray(angle, float), (axis + 1) % 3, (axis + 2) % 3
    matrix = np.zeros((*t.shape, 3, 3))
    matrix[..., axis, axis] = 1.0
    matrix[..., first, first] = matrix[..., second, second] = np.cos(t)
    matrix[..., second, first] = np.sin(t)
    matrix[..., first, second] = -matrix[..., second, first]
    return matrix


def from_alpha_omega_kappa(alpha: ArrayLike, omega: ArrayLike, kappa: ArrayLike) -> Floats:
    """Rotations ``A = Ry(-alpha) Rx(omega) Rz(kappa)``, photo to object, (..., 3, 3), of angles in radians.

    Alpha positive looks forward (+X), omega positive looks left (+Y), kappa positive turns the x axis counter-clockwise
    seen from above.

    Source: [001] eq. 127, 132, 133.
    """
    al, om, ka = np.broadcast_arrays(*(np.asarray(a, float) for a in (alpha, omega, kappa)))
    sa, ca, so, co, sk, ck = np.sin(al), np.cos(al), np.sin(om), np.cos(om), np.sin(ka), np.cos(ka)
    matrix = np.empty((*al.shape, 3, 3))
    matrix[..., 0, 0] = ca * ck - sa * so * sk
    matrix[..., 0, 1] = -ca * sk - sa * so * ck
    matrix[..., 0, 2] = -sa * co
    matrix[..., 1, 0] = co * sk
    matrix[..., 1, 1] = co * ck
    matrix[..., 1, 2] = -so
    matrix[..., 2, 0] = sa * ck + ca * so * sk
    matrix[..., 2, 1] = -sa * sk + ca * so * ck
    matrix[..., 2, 2] = ca * co
    return matrix


def alpha_omega_kappa(matrix: ArrayLike) -> Floats:
    """Angles alpha, omega, kappa (..., 3) of rotations (..., 3, 3); see ``angles``.

    Source: [001] eq. 129 and 135, there misprinted as sin(omega) = -b3/c3; it is -b3.
    """
    return angles(matrix, "alpha-omega-kappa")


def _axes_of(system: str) -> tuple[tuple[int, int, int], float]:
    if system not in AXES:
        msg = f"unknown system of angles {system!r}"
        raise ValueError(msg)
    return AXES[system]


def angles(matrix: ArrayLike, system: str) -> Floats:
    """Angles (..., 3) of rotations, photo to object, in a system of ``SYSTEMS`` and in the order of its name.

    Raises GeometryError when the middle angle is +-90 degrees: the others cannot be separated.
    """
    a = np.asarray(matrix, float)
    (i, j, k), sign = _axes_of(system)
    hand = 1.0 if (i + 1) % 3 == j else -1.0
    sine = hand * a[..., i, k]
    if np.any(1 - np.abs(sine) < GIMBAL_LIMIT):
        first, middle, last = system.split("-")
        msg = f"{middle} is 90 degrees: {first} and {last} cannot be separated; choose another system of angles"
        raise GeometryError(msg, code="gimbal")
    first_angle = sign * np.arctan2(-hand * a[..., j, k], a[..., k, k])
    last_angle = np.arctan2(-hand * a[..., i, j], a[..., i, i])
    return np.stack([first_angle, np.arcsin(np.clip(sine, -1, 1)), last_angle], axis=-1)


def separable_angles(matrix: ArrayLike) -> tuple[str, Floats]:
    """Give the first system of ``SYSTEMS`` in which the angles of all rotations can be told apart, and these."""
    *others, last = SYSTEMS
    for system in others:
        try:
            return system, angles(matrix, system)
        except GeometryError:
            continue
    return last, angles(matrix, last)


def from_angles(values: ArrayLike, system: str) -> Floats:
    """Rotations from angles (..., 3) in a system of ``SYSTEMS``; the inverse of ``angles``."""
    (i, _, _), sign = _axes_of(system)
    if i == 1:
        return from_alpha_omega_kappa(*np.moveaxis(np.asarray(values, float) * [-sign, 1, 1], -1, 0))
    first, middle, last = _turns(values, system)
    return first @ middle @ last


def angle_rates(values: ArrayLike, system: str) -> Floats:
    """Small rotations that small changes of the angles make: D (..., 3, 3) with ``theta = D d(angles)``.

    ``exp([theta]) R`` is the rotation of the changed angles; theta refers to the axes of the object. D is singular
    where the middle angle is 90 degrees.
    """
    axes, sign = _axes_of(system)
    first, middle, _ = _turns(values, system)
    fixed = np.broadcast_to(sign * np.eye(3)[axes[0]], first.shape[:-1])
    return np.stack([fixed, first[..., axes[1]], (first @ middle)[..., axes[2]]], axis=-1)


def _turns(values: ArrayLike, system: str) -> list[Floats]:
    """Give the three turns whose product is a rotation."""
    axes, sign = _axes_of(system)
    return [
        about(axis, angle)
        for axis, angle in zip(axes, np.moveaxis(np.asarray(values, float) * [sign, 1, 1], -1, 0), strict=True)
    ]


def from_vector(vector: ArrayLike) -> Floats:
    """Rotation about a vector (..., 3) by its length in radians (Rodrigues' formula)."""
    v = np.asarray(vector, float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    k = cross_matrix(v)
    safe = np.where(angle < 1e-9, 1.0, angle)  # noqa: PLR2004  below it the series' first terms are exact
    first = np.where(angle < 1e-9, 1.0, np.sin(safe) / safe)  # noqa: PLR2004
    second = np.where(angle < 1e-9, 0.5, (1 - np.cos(safe)) / safe**2)  # noqa: PLR2004
    return np.eye(3) + first * k + second * (k @ k)


def cross_matrix(vector: ArrayLike) -> Floats:
    """Matrix [v] with ``[v] w = v x w``."""
    v = np.asarray(vector, float)
    matrix = np.zeros((*v.shape[:-1], 3, 3))
    matrix[..., 2, 1] = v[..., 0]
    matrix[..., 0, 2] = v[..., 1]
    matrix[..., 1, 0] = v[..., 2]
    matrix[..., 1, 2] = -v[..., 0]
    matrix[..., 2, 0] = -v[..., 1]
    matrix[..., 0, 1] = -v[..., 2]
    return matrix


def to_vector(matrix: ArrayLike) -> Floats:
    """Vector (..., 3) of a rotation by less than 180 degrees; the inverse of ``from_vector``."""
    a = np.asarray(matrix, float)
    twice = a - a.swapaxes(-1, -2)
    sine = 0.5 * np.stack([twice[..., 2, 1], twice[..., 0, 2], twice[..., 1, 0]], axis=-1)
    length = np.linalg.norm(sine, axis=-1)
    angle = np.arctan2(length, 0.5 * (np.trace(a, axis1=-2, axis2=-1) - 1.0))
    small = length < 1e-9  # noqa: PLR2004  there the vector and its sines are the same
    factor = np.where(small, 1.0, angle / np.where(small, 1.0, length))
    return sine * factor[..., None]
