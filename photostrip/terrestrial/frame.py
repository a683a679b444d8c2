"""How a camera on a tripod looks at the ground: its rotation, its rays, their directions, and back to its photo.

The ground has X to the right of Y and Z up (east, north, up). The photo has x to the right, z up; the third axis of its
rays points away from the object, as everywhere in this program: a ray is (x, z, -f). The rotation from the photo to
the ground is that of an aerial photo, alpha-omega-kappa, with the axes of the ground renamed: what lies ahead of an
aerial camera, to its left and above it, lies to the right of a terrestrial one, above it and behind it.

- alpha: azimuth of the optical axis, clockwise from the ground's Y axis (north);
- omega: elevation of the optical axis, positive when the camera looks up;
- kappa: roll about the optical axis, positive when the photo's x axis turns counter-clockwise for the photographer.

Directions (..., 2) are azimuths lambda, clockwise from the ground's Y axis in (-pi, pi], and elevations beta. ``xz``
(..., 2) are image coordinates in mm, reduced to the principal point; ``rotation`` (3, 3) takes the photo to the ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.geometry.rotation import alpha_omega_kappa, from_alpha_omega_kappa

GROUND_FROM_HOUSE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
# what small turns of a camera in its own axes are as a vector: (alpha, omega, kappa) -> (omega, -alpha, kappa)
TURN_AXES = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
GIMBAL = 1e-6  # cosine of the elevation of the camera below which azimuth and roll are one
BEHIND = 1e-6  # cosine of the angle to the optical axis below which a direction cannot be on the photo


def ground_from_photo(alpha: ArrayLike, omega: ArrayLike = 0.0, kappa: ArrayLike = 0.0) -> Floats:
    """Rotation (..., 3, 3) of a terrestrial photo with azimuth, elevation and roll of the camera.

    Takes a ray (x, z, -f) to the ground; its columns are the ground components of the photo's x axis, of its z axis and
    of the optical axis turned round.

    Source: [002] eq. 1 and 2 for omega = kappa = 0; the angles of the general form are not defined there, derived.
    """
    return GROUND_FROM_HOUSE @ from_alpha_omega_kappa(alpha, omega, kappa)


def angles_of(rotation: ArrayLike) -> Floats:
    """Azimuth, elevation, roll (..., 3), not straight up or down; the inverse of ``ground_from_photo``."""
    return alpha_omega_kappa(GROUND_FROM_HOUSE.T @ np.asarray(rotation, float))


def small_turn(turn: ArrayLike) -> Floats:
    """Rotation of a camera that turned a little in its own axes: to the right, up, and counter-clockwise (..., 3).

    It takes rays after the turn to the camera before it; ``rotation @ small_turn(turn)`` is the rotation after it.
    """
    return from_alpha_omega_kappa(*np.moveaxis(np.asarray(turn, float), -1, 0))


def rays(xz: ArrayLike, principal_distance: ArrayLike) -> Floats:
    """Rays (x, z, -f) of image points (..., 2), mm, reduced to the principal point, in the frame of the photo."""
    points = np.asarray(xz, float)
    depth = np.broadcast_to(-np.asarray(principal_distance, float), points.shape[:-1])
    return np.concatenate([points, depth[..., None]], axis=-1)


def directions_of(vector: ArrayLike) -> Floats:
    """Azimuth clockwise from the Y axis, in (-pi, pi], and elevation of vectors (..., 3) on the ground."""
    u = np.asarray(vector, float)
    level = np.hypot(u[..., 0], u[..., 1])
    return np.stack([np.arctan2(u[..., 0], u[..., 1]), np.arctan2(u[..., 2], level)], axis=-1)


def vectors_of(directions: ArrayLike) -> Floats:
    """Give unit vectors of directions; the inverse of ``directions_of``."""
    horizontal, vertical = np.moveaxis(np.asarray(directions, float), -1, 0)
    level = np.cos(vertical)
    return np.stack([level * np.sin(horizontal), level * np.cos(horizontal), np.sin(vertical)], axis=-1)


def direction_gradient(vector: ArrayLike) -> Floats:
    """Return the derivative (..., 2, 3) of azimuth and elevation of a vector, none of them vertical, by the vector.

    Source: derived; tested against differences.
    """
    u = np.asarray(vector, float)
    east, north, up = u[..., 0], u[..., 1], u[..., 2]
    level2 = east**2 + north**2
    level = np.sqrt(level2)
    length2 = level2 + up**2
    gradient = np.zeros((*u.shape[:-1], 2, 3))
    gradient[..., 0, 0] = north / level2
    gradient[..., 0, 1] = -east / level2
    gradient[..., 1, 0] = -up * east / (level * length2)
    gradient[..., 1, 1] = -up * north / (level * length2)
    gradient[..., 1, 2] = level / length2
    return gradient


@dataclass(frozen=True)
class Phototheodolite:
    """What a terrestrial camera is made of."""

    name: str
    principal_distance: float  # principal distance f in mm
    principal_point: tuple[float, float] = (0.0, 0.0)  # x0, z0 in mm in the system of the image coordinates
    format: tuple[float, float] | None = None  # width and height in mm of the field in which points are measured


class Attitude(NamedTuple):
    """How a camera looks."""

    angles: tuple[float, float, float]  # alpha, omega, kappa, radians
    rotation: Floats  # (3, 3): photo to ground
    unit: str  # in which angles and directions are reported: ``"deg"`` or ``"gon"``


@dataclass(frozen=True, eq=False)
class Partials:
    """Derivatives of the directions of image points."""

    by_xz: Floats  # (..., 2, 2): rows lambda and beta, columns x and z, rad/mm
    by_f: Floats  # (..., 2): by the principal distance, rad/mm


def directions_from_photo(xz: ArrayLike, principal_distance: float, rotation: ArrayLike) -> Floats:
    """Horizontal and vertical directions of image points.

    Source: [002] eq. 1 turned round; for omega = kappa = 0 eq. 3 with cos(lambda') where sec(lambda') is printed.
    """
    return directions_of(rays(xz, principal_distance) @ np.asarray(rotation, float).T)


def photo_from_directions(directions: ArrayLike, principal_distance: float, rotation: ArrayLike) -> Floats:
    """Image coordinates of directions; NaN where the direction is 90 degrees or more from the optical axis.

    Source: [002] eq. 1; eq. 2 for omega = kappa = 0.
    """
    ray = vectors_of(directions) @ np.asarray(rotation, float)
    depth = np.where(-ray[..., 2] > BEHIND, -ray[..., 2], np.nan)
    return np.asarray(principal_distance * ray[..., :2] / depth[..., None], float)


def partials(xz: ArrayLike, principal_distance: float, rotation: ArrayLike) -> Partials:
    """Return the derivatives of the directions by what is measured in the photo.

    Source: derived; for omega = kappa = 0 they are [002] eq. 4 with the error of eq. 3 removed.
    """
    turn = np.asarray(rotation, float)
    gradient = direction_gradient(rays(xz, principal_distance) @ turn.T) @ turn
    return Partials(gradient[..., :2], -gradient[..., 2])
