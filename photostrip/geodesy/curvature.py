"""Radii of curvature of the ellipsoid, and the correction of heights for the Earth's curvature.

A tangent plane leaves the level surface the faster the farther one goes: 0.08 m at 1 km, 7.8 m at 10 km.
Ground coordinates that come through a geocentric frame contain the curvature already. Plane map coordinates
with heights, taken as if they were Cartesian (``crs: local`` with ``earth_curvature: model``), do not: their
control heights are reduced to the tangent plane before the orientation, and the results are raised back
afterwards, with the same origin and the same radius. Doing one of the two only is worse than doing neither.

Source: [001] eq. 153; that control is to be reduced as well, and which radius serves how far, is derived.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

Ellipsoid = tuple[float, float]
"""Semi-major and semi-minor axis (a, b) of an ellipsoid of revolution, metres."""


def eccentricity_squared(ellipsoid: Ellipsoid) -> float:
    """First eccentricity squared of an ellipsoid.

    Parameters
    ----------
    ellipsoid : tuple of float
        Semi-axes (a, b), metres.

    Returns
    -------
    float
        e^2 = (a^2 - b^2) / a^2.
    """
    a, b = ellipsoid
    return (a - b) * (a + b) / (a * a)


def meridian_radius(lat: ArrayLike, ellipsoid: Ellipsoid) -> NDArray[np.float64]:
    """Radius of curvature of the meridian, M.

    Parameters
    ----------
    lat : array_like
        Geodetic latitude, radians.
    ellipsoid : tuple of float
        Semi-axes (a, b), metres.

    Returns
    -------
    ndarray
        M, metres, in the shape of `lat`.

    Notes
    -----
    Source: derived, M = a (1 - e^2) / W^3 with W = sqrt(1 - e^2 sin^2 B).
    """
    e2 = eccentricity_squared(ellipsoid)
    w2 = 1.0 - e2 * np.sin(np.asarray(lat, dtype=np.float64)) ** 2
    return np.asarray(ellipsoid[0] * (1.0 - e2) / (w2 * np.sqrt(w2)))


def prime_vertical_radius(lat: ArrayLike, ellipsoid: Ellipsoid) -> NDArray[np.float64]:
    """Radius of curvature across the meridian, N.

    Parameters
    ----------
    lat : array_like
        Geodetic latitude, radians.
    ellipsoid : tuple of float
        Semi-axes (a, b), metres.

    Returns
    -------
    ndarray
        N, metres, in the shape of `lat`.

    Notes
    -----
    Source: derived, N = a / W with W = sqrt(1 - e^2 sin^2 B).
    """
    e2 = eccentricity_squared(ellipsoid)
    w2 = 1.0 - e2 * np.sin(np.asarray(lat, dtype=np.float64)) ** 2
    return np.asarray(ellipsoid[0] / np.sqrt(w2))


def mean_radius(lat: ArrayLike, ellipsoid: Ellipsoid) -> NDArray[np.float64]:
    """Mean radius of curvature, sqrt(M N).

    Parameters
    ----------
    lat : array_like
        Geodetic latitude, radians.
    ellipsoid : tuple of float
        Semi-axes (a, b), metres.

    Returns
    -------
    ndarray
        Radius, metres, in the shape of `lat`.

    Notes
    -----
    Source: derived. Good enough where the points lie in all directions: the correction is wrong by at most 0.06 m
    at 20 km.
    """
    return np.sqrt(meridian_radius(lat, ellipsoid) * prime_vertical_radius(lat, ellipsoid))


def radius_in_azimuth(lat: ArrayLike, azimuth: ArrayLike, ellipsoid: Ellipsoid) -> NDArray[np.float64]:
    """Radius of curvature of the normal section in a direction (Euler's formula).

    Parameters
    ----------
    lat : array_like
        Geodetic latitude, radians.
    azimuth : array_like
        Direction clockwise from north, radians.
    ellipsoid : tuple of float
        Semi-axes (a, b), metres.

    Returns
    -------
    ndarray
        R_A, metres, in the common shape of `lat` and `azimuth`.

    Notes
    -----
    Source: derived, R_A = M N / (N cos^2 A + M sin^2 A).
    """
    m, n = meridian_radius(lat, ellipsoid), prime_vertical_radius(lat, ellipsoid)
    angle = np.asarray(azimuth, dtype=np.float64)
    return np.asarray(m * n / (n * np.cos(angle) ** 2 + m * np.sin(angle) ** 2))


def curvature_correction(distance: ArrayLike, radius: ArrayLike) -> NDArray[np.float64]:
    """How far the level surface has fallen below the tangent plane.

    Parameters
    ----------
    distance : array_like
        Distance from the point of tangency in the plane, metres.
    radius : array_like
        Radius of the Earth there, metres.

    Returns
    -------
    ndarray
        D^2 / (2 R), metres, never negative. Added to a coordinate above the tangent plane it gives a height;
        subtracted from a height it gives the coordinate.

    Notes
    -----
    Source: [001] eq. 153.
    """
    return np.asarray(np.square(np.asarray(distance, dtype=np.float64)) / (2.0 * np.asarray(radius)))


def height_from_tangent(z: ArrayLike, distance: ArrayLike, radius: ArrayLike) -> NDArray[np.float64]:
    """Height above the level surface from the coordinate above the tangent plane.

    Parameters
    ----------
    z : array_like
        Coordinate above the tangent plane, metres.
    distance : array_like
        Distance from the point of tangency in the plane, metres.
    radius : array_like
        Radius of the Earth there, metres.

    Returns
    -------
    ndarray
        H = Z + D^2 / (2 R), metres. The result of an orientation is raised by this, afterwards.

    Notes
    -----
    Source: [001] eq. 153.
    """
    return np.asarray(z, dtype=np.float64) + curvature_correction(distance, radius)  # eq. 153


def tangent_from_height(height: ArrayLike, distance: ArrayLike, radius: ArrayLike) -> NDArray[np.float64]:
    """Coordinate above the tangent plane from the height above the level surface.

    Parameters
    ----------
    height : array_like
        Height above the level surface, metres.
    distance : array_like
        Distance from the point of tangency in the plane, metres.
    radius : array_like
        Radius of the Earth there, metres.

    Returns
    -------
    ndarray
        Z = H - D^2 / (2 R), metres. Control is lowered by this, before the orientation.

    Notes
    -----
    Source: the inverse of [001] eq. 153.
    """
    return np.asarray(height, dtype=np.float64) - curvature_correction(distance, radius)  # eq. 153


def height_on_sphere(z: ArrayLike, distance: ArrayLike, radius: ArrayLike) -> NDArray[np.float64]:
    """Height above a sphere from the coordinate above its tangent plane, without approximation.

    Parameters
    ----------
    z : array_like
        Coordinate above the tangent plane, metres.
    distance : array_like
        Distance from the point of tangency in the plane, metres.
    radius : array_like
        Radius of the sphere, metres.

    Returns
    -------
    ndarray
        h = sqrt(D^2 + (R + Z)^2) - R, metres.

    Notes
    -----
    Source: derived. It shows what [001] eq. 153 neglects: 5 mm at 20 km for terrain 1000 m above the
    point of tangency.
    """
    up = np.asarray(z, dtype=np.float64)
    square = np.square(np.asarray(distance, dtype=np.float64))
    level = np.asarray(radius) + up
    # The same as the formula above, without the difference of two numbers of the size of R.
    return np.asarray(up + square / (np.sqrt(square + level**2) + level))


def largest_correction(plan: ArrayLike, origin: ArrayLike, radius: float) -> float:
    """Size of the curvature correction over a set of points: the number the report prints.

    Parameters
    ----------
    plan : array_like, shape (n, 2) or (n, 3)
        East and north (further columns are ignored), metres, local frame.
    origin : array_like, shape (2,) or (3,)
        Point of tangency, the same frame.
    radius : float
        Radius of the Earth, metres.

    Returns
    -------
    float
        Largest D^2 / (2 R), metres; 0 without points.
    """
    offsets = np.asarray(plan, dtype=np.float64)[:, :2] - np.asarray(origin, dtype=np.float64)[:2]
    distance = np.hypot(offsets[:, 0], offsets[:, 1])
    return float(np.max(curvature_correction(distance, radius), initial=0.0))
