"""From points in space to image coordinates: central projection, and which points a photo shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.simulate.flight import CUT, position_sigma
from photostrip.triangulation import lens
from photostrip.triangulation.refinement import refraction_constant

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.simulate.flight import Photos
    from photostrip.simulate.placement import Placed
    from photostrip.simulate.spec import Spec

    Array = NDArray[np.float64]
    Rows = NDArray[np.intp]

USABLE = 0.97  # part of the width and height of the photo that is measured in
BENDING_STEPS = 6  # each gains four digits
STEEPEST = np.radians(75.0)  # a ray flatter than this is not looked for


def project(photos: Photos, photo: Rows, ray: Array, principal_distance: float) -> tuple[Array, Array]:
    """Central projection of rays into photos, one for each row.

    Parameters
    ----------
    photos : Photos
        Exterior orientations.
    photo : ndarray of int, shape (n,)
        Number of the photo of each row.
    ray : ndarray, shape (n, 3)
        Points minus perspective centre, or anything in their direction, in the Cartesian frame.
    principal_distance : float
        Principal distance, mm.

    Returns
    -------
    xy : ndarray, shape (n, 2)
        Ideal image coordinates from the principal point, mm.
    depth : ndarray, shape (n,)
        Part of the ray along the camera's axis; negative for what lies behind the camera.

    Notes
    -----
    Source: collinearity of (x, y, -f) with A^T (X - X0).
    """
    turned = np.einsum("ni,nij->nj", ray, photos.rotations[photo])
    depth = -turned[:, 2]
    safe = np.where(depth > 0.0, depth, np.inf)
    return principal_distance * turned[:, :2] / safe[:, None], depth


def bent(photos: Photos, photo: Rows, ray: Array, ground_height: float) -> Array:
    """Directions in which the cameras see the ends of rays through the standard atmosphere, one for each row.

    Parameters
    ----------
    photos : Photos
        Exterior orientations.
    photo : ndarray of int, shape (n,)
        Number of the photo of each row.
    ray : ndarray, shape (n, 3)
        Points minus perspective centre, in the Cartesian frame, metres.
    ground_height : float
        Mean height of the terrain above sea level, metres.

    Returns
    -------
    ndarray, shape (n, 3)
        Rays turned away from the nadir.

    Notes
    -----
    Source: refraction in plane layers, tan(alpha) = tan(theta) (1 - K / cos(theta)^2) for the straight line alpha and
    the direction theta in which it is seen, both from the nadir: whatever the tilt of the photo.
    """
    constant = np.array([refraction_constant(height, ground_height) for height in photos.height.tolist()])[photo]
    up = photos.up[photo]
    down = -np.einsum("ni,ni->n", ray, up)
    aside = ray + down[:, None] * up
    square = np.einsum("ni,ni->n", aside, aside) / down**2
    stretch = np.ones(len(ray))
    for _ in range(BENDING_STEPS):
        stretch = 1.0 / (1.0 - constant * (1.0 + square * stretch**2))
    return np.asarray(aside * stretch[:, None] - down[:, None] * up)


def sees(spec: Spec, photos: Photos, photo: Rows, xyz: Array) -> NDArray[np.bool_]:
    """Whether a photo shows a point well within its format, one point for each row.

    Parameters
    ----------
    spec : Spec
        The camera.
    photos : Photos
        Exterior orientations.
    photo : ndarray of int, shape (n,)
        Number of the photo of each row.
    xyz : ndarray, shape (n, 3)
        Points in the Cartesian frame, metres.

    Returns
    -------
    ndarray of bool, shape (n,)
        True where it does.
    """
    xy, depth = project(photos, photo, xyz - photos.centers[photo], spec.camera.principal_distance)
    inside = (np.abs(xy + spec.camera.principal_point) <= USABLE / 2.0 * np.asarray(spec.format)).all(axis=1)
    if spec.camera.distortion is not None:
        inside &= np.hypot(xy[:, 0], xy[:, 1]) <= USABLE * lens.reach(spec.camera.distortion)[1]
    return np.asarray(inside & (depth > 0.0))


def shown(spec: Spec, photos: Photos, placed: Placed) -> tuple[Rows, Rows]:
    """All image points: which photo shows which point.

    Parameters
    ----------
    spec : Spec
        The camera and the flight.
    photos : Photos
        Exterior orientations.
    placed : Placed
        The points.

    Returns
    -------
    photo, point : ndarray of int, shape (n,)
        Numbers of photo and point of each image point, by photo, then by point.

    Notes
    -----
    Points are sought only around the place of each photo in its strip, so that the time grows with the photos, not
    with their square.
    """
    n = spec.flight.photos
    reach = _reach(spec, placed)
    found_photo, found_point = [], []
    for j in range(spec.flight.strips):
        rows = np.arange(j * n, (j + 1) * n)
        backward = n > 1 and photos.along[rows[-1]] < photos.along[rows[0]]
        sign = -1.0 if backward else 1.0
        place = sign * placed.along / spec.base + (n - 1) / 2  # number in the strip, with a fraction
        first = np.maximum(np.ceil(place - reach / spec.base), 0).astype(np.intp)
        last = np.minimum(np.floor(place + reach / spec.base), n - 1).astype(np.intp)
        near = np.abs(placed.across - photos.across[rows].mean()) <= reach
        count = np.where(near, np.maximum(last - first + 1, 0), 0)
        point = np.repeat(np.arange(len(placed.along)), count)
        photo = rows[0] + np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
        good = sees(spec, photos, photo, placed.xyz[point])
        found_photo.append(photo[good])
        found_point.append(point[good])
    photo, point = np.concatenate(found_photo), np.concatenate(found_point)
    order = np.lexsort((point, photo))
    return photo[order], point[order]


def _reach(spec: Spec, placed: Placed) -> float:
    """Largest distance on the ground, metres, from a photo's planned place to what it can show."""
    tilt = CUT * np.radians(np.hypot(*spec.flight.attitude_sigma_deg[:2]))
    view = np.arctan(np.hypot(*spec.format) / 2.0 / spec.camera.principal_distance)
    moved = CUT * np.asarray(position_sigma(spec))
    depth = spec.flying_height + spec.terrain.height - placed.height.min() + moved[2]
    return float(depth * np.tan(min(view + tilt, STEEPEST)) + np.hypot(moved[0], moved[1]))
