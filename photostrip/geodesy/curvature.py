"""Radii of curvature of the ellipsoid, and the correction of heights for the Earth's curvature.

A tangent plane leaves the level surface the faster the farther one goes: 0.08 m at 1 km, 7.8 m at 10 km.
Ground coordinates that come through a geocentric frame contain the curvature already. Plane map coordinates
with heights, taken as if they were Cartesian (``crs: local`` with ``earth_curvature: model``), do not: their
control heights are reduced to the tangent plane before the orientation, and the results are raised back
afterwards, with the same origin and the same radius. Doing one of the two only is worse than doing neither.

Source: [001] eq. 153; that control is to be reduced as well, and which radius serves how far, is derived.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats

Ellipsoid = tuple[float, float]
"""Semi-major and semi-minor axis (a, b) of an ellipsoid of revolution, metres."""

EARTH_RADIUS = 6_371_000.0
"""Mean radius of the Earth, metres, where no ellipsoid is known or none is needed."""


def eccentricity_squared(ellipsoid: Ellipsoid) -> float:
    """First eccentricity squared of an ellipsoid, e^2 = (a^2 - b^2) / a^2."""
    a, b = ellipsoid
    return (a - b) * (a + b) / (a * a)


def meridian_radius(lat: ArrayLike, ellipsoid: Ellipsoid) -> Floats:
    """Radius of curvature of the meridian, M = a (1 - e^2) / W^3 with W = sqrt(1 - e^2 sin^2 B)."""
    e2 = eccentricity_squared(ellipsoid)
    w2 = 1.0 - e2 * np.sin(np.asarray(lat, dtype=np.float64)) ** 2
    return np.asarray(ellipsoid[0] * (1.0 - e2) / (w2 * np.sqrt(w2)))


def prime_vertical_radius(lat: ArrayLike, ellipsoid: Ellipsoid) -> Floats:
    """Radius of curvature across the meridian, N = a / W with W = sqrt(1 - e^2 sin^2 B)."""
    e2 = eccentricity_squared(ellipsoid)
    w2 = 1.0 - e2 * np.sin(np.asarray(lat, dtype=np.float64)) ** 2
    return np.asarray(ellipsoid[0] / np.sqrt(w2))


def mean_radius(lat: ArrayLike, ellipsoid: Ellipsoid) -> Floats:
    """Mean radius of curvature, sqrt(M N): D^2 / (2 R) is wrong by at most 0.06 m at 20 km, in whatever direction."""
    return np.sqrt(meridian_radius(lat, ellipsoid) * prime_vertical_radius(lat, ellipsoid))


def radius_in_azimuth(lat: ArrayLike, azimuth: ArrayLike, ellipsoid: Ellipsoid) -> Floats:
    """Radius of the normal section in a direction, R_A = M N / (N cos^2 A + M sin^2 A) (Euler's formula).

    In that direction D^2 / (2 R_A) is right to 0.3 mm at 20 km.
    """
    m, n = meridian_radius(lat, ellipsoid), prime_vertical_radius(lat, ellipsoid)
    angle = np.asarray(azimuth, dtype=np.float64)
    return np.asarray(m * n / (n * np.cos(angle) ** 2 + m * np.sin(angle) ** 2))


def curvature_correction(distance: ArrayLike, radius: ArrayLike) -> Floats:
    """How far the level surface has fallen below the tangent plane, D^2 / (2 R), at a distance D in that plane.

    Added to a coordinate above the tangent plane it gives a height; subtracted from a height it gives the coordinate.

    Source: [001] eq. 153.
    """
    return np.asarray(np.square(np.asarray(distance, dtype=np.float64)) / (2.0 * np.asarray(radius)))
