"""Photo coordinates of a phototheodolite to horizontal and vertical directions, and back.

Directions (..., 2) are azimuths lambda, clockwise from the ground's Y axis in (-pi, pi], and elevations beta. ``xz``
(..., 2) are image coordinates in mm, reduced to the principal point; ``rotation`` (3, 3) takes the photo to the ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.terrestrial.frame import direction_gradient, directions_of, rays, vectors_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from photostrip.arrays import Floats


BEHIND = 1e-6  # cosine of the angle to the optical axis below which a direction cannot be on the photo


@dataclass(frozen=True, slots=True)
class Phototheodolite:
    """What a terrestrial camera is made of."""

    name: str
    principal_distance: float  # principal distance f in mm
    principal_point: tuple[float, float] = (0.0, 0.0)  # x0, z0 in mm in the system of the image coordinates
    format: tuple[float, float] | None = None  # width and height in mm of the field in which points are measured


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
