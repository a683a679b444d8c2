"""Rotations in the angles of the field: alpha-omega-kappa, omega-phi-kappa, phi-omega-kappa.

All matrices map photo vectors (x, y, -f) to object vectors, ``X = A r``. Arrays of angles give arrays of
matrices: the functions work on leading axes of any shape.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.errors import GeometryError

SYSTEMS = ("alpha-omega-kappa", "omega-phi-kappa", "phi-omega-kappa")
GIMBAL_LIMIT = 1e-12  # 1 - |sine of the middle angle| below which the other two are not separable


def rotation_x(angle: ArrayLike) -> Floats:
    """Rotation about the x axis by angles (...), right-hand rule."""
    return _elementary(angle, 1, 2)


def rotation_y(angle: ArrayLike) -> Floats:
    """Rotation about the y axis, right-hand rule; see ``rotation_x``."""
    return _elementary(angle, 2, 0)


def rotation_z(angle: ArrayLike) -> Floats:
    """Rotation about the z axis, right-hand rule; see ``rotation_x``."""
    return _elementary(angle, 0, 1)


def _elementary(angle: ArrayLike, first: int, second: int) -> Floats:
    t = np.asarray(angle, float)
    matrix = np.zeros((*t.shape, 3, 3))
    matrix[..., range(3), range(3)] = 1.0
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
    return rotation_y(-np.asarray(alpha, float)) @ rotation_x(omega) @ rotation_z(kappa)


def alpha_omega_kappa(matrix: ArrayLike) -> Floats:
    """Angles alpha, omega, kappa (..., 3) of rotations (..., 3, 3), photo to object.

    Raises GeometryError when omega is +-90 degrees: alpha and kappa cannot be separated.

    Source: [001] eq. 129 and 135, there misprinted as sin(omega) = -b3/c3; it is -b3.
    """
    a = np.asarray(matrix, float)
    _refuse_gimbal(a[..., 1, 2], "omega", "alpha")
    alpha, omega = np.arctan2(-a[..., 0, 2], a[..., 2, 2]), np.arcsin(np.clip(-a[..., 1, 2], -1, 1))
    return np.stack([alpha, omega, np.arctan2(a[..., 1, 0], a[..., 1, 1])], axis=-1)


def _refuse_gimbal(sine: Floats, middle: str, first: str) -> None:
    if np.any(1 - np.abs(sine) < GIMBAL_LIMIT):
        msg = f"{middle} is 90 degrees: {first} and kappa cannot be separated; choose another system of angles"
        raise GeometryError(msg, code="gimbal")


def _require_system(system: str) -> None:
    if system not in SYSTEMS:
        msg = f"unknown system of angles {system!r}"
        raise ValueError(msg)


def angles(matrix: ArrayLike, system: str) -> Floats:
    """Angles (..., 3) of rotations, photo to object, in a system of ``SYSTEMS`` and in the order of its name.

    Raises GeometryError when the middle angle is +-90 degrees.
    Raises ValueError when the system is not known.
    """
    _require_system(system)
    a = np.asarray(matrix, float)
    if system == "omega-phi-kappa":
        _refuse_gimbal(a[..., 0, 2], "phi", "omega")
        omega = np.arctan2(-a[..., 1, 2], a[..., 2, 2])
        phi = np.arcsin(np.clip(a[..., 0, 2], -1, 1))
        return np.stack([omega, phi, np.arctan2(-a[..., 0, 1], a[..., 0, 0])], axis=-1)
    return alpha_omega_kappa(a) * [-1.0 if system == "phi-omega-kappa" else 1.0, 1.0, 1.0]


def from_angles(values: ArrayLike, system: str) -> Floats:
    """Rotations from angles (..., 3) in a system of ``SYSTEMS``; the inverse of ``angles``."""
    _require_system(system)
    first, second, kappa = np.moveaxis(np.asarray(values, float), -1, 0)
    if system == "omega-phi-kappa":
        return rotation_x(first) @ rotation_y(second) @ rotation_z(kappa)
    return from_alpha_omega_kappa(-first if system == "phi-omega-kappa" else first, second, kappa)


def angle_rates(values: ArrayLike, system: str) -> Floats:
    """Small rotations that small changes of the angles make: D (..., 3, 3) with ``theta = D d(angles)``.

    ``exp([theta]) R`` is the rotation of the changed angles; theta refers to the axes of the object. D is singular
    where the middle angle is 90 degrees.
    """
    _require_system(system)
    first, second, _ = np.moveaxis(np.asarray(values, float), -1, 0)
    if system == "omega-phi-kappa":
        turns, axes, sign = (rotation_x(first), rotation_y(second)), (0, 1, 2), 1.0
    else:
        sign = 1.0 if system == "phi-omega-kappa" else -1.0  # alpha turns the other way about Y
        turns, axes = (rotation_y(sign * first), rotation_x(second)), (1, 0, 2)
    columns = [
        np.broadcast_to(sign * np.eye(3)[axes[0]], turns[0].shape[:-1]),
        turns[0][..., :, axes[1]],
        (turns[0] @ turns[1])[..., :, axes[2]],
    ]
    return np.stack(columns, axis=-1)


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
