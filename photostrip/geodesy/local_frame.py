"""Radii of curvature of the ellipsoid, and the correction of heights for the Earth's curvature.

A tangent plane leaves the level surface the faster the farther one goes: 0.08 m at 1 km, 7.8 m at 10 km.
Ground coordinates that come through a geocentric frame contain the curvature already. Plane map coordinates
with heights, taken as if they were Cartesian (``crs: local`` with ``earth_curvature: model``), do not: their
control heights are reduced to the tangent plane before the orientation, and the results are raised back
afterwards, with the same origin and the same radius. Doing one of the two only is worse than doing neither.

Source: [001] eq. 153; that control is to be reduced as well, and which radius serves how far, is derived.

The ellipsoid in Cartesian coordinates, and the intermediate frame in which a strip is adjusted.

The intermediate frame has its origin at the middle of the control points, Z along the ellipsoid's normal there,
X in a chosen azimuth (along the strip: the polynomials need that) and Y to the left of X. It is right-handed and
truly Cartesian, so a similarity can map a strip into it whatever map projection the control came in.

Source: [001] eq. 142-144 and 152, with eq. 143 corrected (the last terms of a2 and b1 have plus signs; as printed
the matrix is not orthogonal).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import about

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


_ITERATIONS = 10  # the Earth stops after 2 or 3, a body as flat as Saturn after a few more
_CONVERGED = 1e-15  # radians, 6 nanometres on the Earth


def geocentric_from_geodetic(geodetic: ArrayLike, ellipsoid: Ellipsoid) -> Floats:
    """Geocentric coordinates (n, 3) of points given by longitude, latitude (radians) and height above the ellipsoid.

    X runs towards the zero meridian, Z towards the north pole: X = (N + H) cos B cos L, Y = (N + H) cos B sin L,
    Z = (N (1 - e^2) + H) sin B.
    """
    lon, lat, height = np.asarray(geodetic, dtype=np.float64).reshape(-1, 3).T
    return np.stack(geocentric_columns(lon, lat, height, ellipsoid), axis=-1)


def geocentric_columns(
    lon: Floats, lat: Floats, height: Floats | float, ellipsoid: Ellipsoid
) -> tuple[Floats, Floats, Floats]:
    """Return the same column by column: many points have theirs one behind the other."""
    radius = prime_vertical_radius(lat, ellipsoid)
    across = (radius + height) * np.cos(lat)
    along = (radius * (1.0 - eccentricity_squared(ellipsoid)) + height) * np.sin(lat)
    return across * np.cos(lon), across * np.sin(lon), along


def geodetic_from_geocentric(xyz: ArrayLike, ellipsoid: Ellipsoid) -> Floats:
    """Longitude in (-pi, pi], latitude (radians) and height above the ellipsoid, (n, 3), of geocentric coordinates.

    On the axis of rotation the longitude is 0. Made for points near the surface; towards the centre of the body, nearer
    than a tenth of the radius, latitude and height mean nothing.

    Source: [Bowring 1976], iterated.
    """
    x, y, z = np.asarray(xyz, dtype=np.float64).reshape(-1, 3).T
    a, b = ellipsoid
    e2 = eccentricity_squared(ellipsoid)
    p = np.hypot(x, y)
    theta = np.arctan2(z * a, p * b)
    lat = theta
    for _ in range(_ITERATIONS):
        sin, cos = np.sin(theta), np.cos(theta)
        before = lat
        lat = np.arctan2(z + e2 * (a * a / b) * sin**3, p - e2 * a * cos**3)
        if not np.any(np.abs(lat - before) > _CONVERGED):
            break
        theta = np.arctan2(b / a * np.sin(lat), np.cos(lat))
    sin = np.sin(lat)
    height = p * np.cos(lat) + z * sin - a * np.sqrt(1.0 - e2 * sin**2)
    return np.stack([np.arctan2(y, x), lat, height], axis=-1)


def axes_matrix(lat: float, lon: float, azimuth: float) -> Floats:
    """Direction cosines M = Rz(L0) Ry(90 deg - B0) Rz(180 deg - A0) of the axes of an intermediate frame.

    Its columns are X (in azimuth A0, clockwise from north), Y (90 degrees to the left of X) and Z (the normal, up), in
    geocentric components. With A0 = 0, X is north and Y is west.

    Source: [001] eq. 143, corrected.
    """
    sin_b, cos_b = np.sin(lat), np.cos(lat)
    sin_l, cos_l = np.sin(lon), np.cos(lon)
    sin_a, cos_a = np.sin(azimuth), np.cos(azimuth)
    return np.array(  # eq. 143; a2 and b1 corrected
        [
            [-cos_l * sin_b * cos_a - sin_l * sin_a, -cos_l * sin_b * sin_a + sin_l * cos_a, cos_l * cos_b],
            [-sin_l * sin_b * cos_a + cos_l * sin_a, -sin_l * sin_b * sin_a - cos_l * cos_a, sin_l * cos_b],
            [cos_b * cos_a, cos_b * sin_a, sin_b],
        ]
    )


def local_axes_matrix(azimuth: float) -> Floats:
    """Direction cosines of the axes of an intermediate frame in a flat world, in east, north, up components.

    A rotation about the vertical: columns as in ``axes_matrix``.
    """
    sin_a, cos_a = np.sin(azimuth), np.cos(azimuth)
    return np.array([[sin_a, -cos_a, 0.0], [cos_a, sin_a, 0.0], [0.0, 0.0, 1.0]])


def mean_position(lat: ArrayLike, lon: ArrayLike, height: ArrayLike) -> tuple[float, float, float]:
    """Mean latitude, longitude in [-pi, pi) and height of the control points.

    Longitudes are counted from the direction of their mean unit vector, so that 179 and -179 degrees have the mean 180
    and not 0.

    Source: [001] eq. 142, the longitude by way of directions.
    """
    lat, lon, height = (np.asarray(column, dtype=np.float64) for column in (lat, lon, height))
    middle = np.arctan2(np.mean(np.sin(lon)), np.mean(np.cos(lon)))
    middle += np.mean((lon - middle + np.pi) % (2.0 * np.pi) - np.pi)
    middle = (middle + np.pi) % (2.0 * np.pi) - np.pi
    return float(np.mean(lat)), float(middle), float(np.mean(height))  # eq. 142


def strip_azimuth(first: ArrayLike, last: ArrayLike) -> float:
    """Azimuth A0 = atan2(-DY, DX), clockwise from north in (-pi, pi], of the strip from its end centres.

    first, last: (3,), the two perspective centres in the intermediate frame of azimuth 0 (X north, Y west, Z up).
    Raises GeometryError if the two centres lie above each other: then the strip has no direction.
    """
    dx, dy, _ = np.asarray(last, dtype=np.float64) - np.asarray(first, dtype=np.float64)
    if not np.hypot(dx, dy) > 0.0:
        message = "the first and the last perspective centre have the same plan position: the strip has no direction"
        raise GeometryError(message, code="strip-direction")
    return float(np.arctan2(-dy, dx))


@dataclass(frozen=True, eq=False)
class IntermediateFrame:
    """The Cartesian frame Pi in which a strip is adjusted. Source: [001] eq. 142-144, 152."""

    origin: Floats  # (3,): origin, in the project's Cartesian frame, metres
    axes: Floats  # (3, 3): M: columns are the axes X, Y, Z in the project's Cartesian frame
    azimuth: float = 0.0  # azimuth A0 of the X axis, clockwise from north, radians

    @classmethod
    def at_centre(cls, cartesian_control: ArrayLike, lat: float, lon: float, azimuth: float) -> Self:
        """Frame at the middle of control points on an ellipsoid, given by geocentric coordinates (n, 3).

        The origin lies below the surface by the mean sagitta of the network, a few metres for 20 km; that does no harm.
        The mean latitude and longitude (``mean_position``) give only the directions.

        Source: [001] eq. 142, 143.
        """
        origin = np.mean(np.asarray(cartesian_control, dtype=np.float64), axis=0)
        return cls(origin, axes_matrix(lat, lon, azimuth), azimuth)

    @classmethod
    def at_local_centre(cls, cartesian_control: ArrayLike, azimuth: float) -> Self:
        """Frame at the middle of control points in a local Cartesian frame, turned about the vertical."""
        origin = np.mean(np.asarray(cartesian_control, dtype=np.float64), axis=0)
        return cls(origin, local_axes_matrix(azimuth), azimuth)

    def with_azimuth(self, azimuth: float) -> Self:
        """Turn the frame about Z, so that X runs in another azimuth."""
        return type(self)(self.origin, self.axes @ about(2, self.azimuth - azimuth), azimuth)

    def intermediate_from_cartesian(self, xyz: ArrayLike) -> Floats:
        """Points (..., 3) from the project's Cartesian frame into this frame. Source: [001] eq. 144."""
        return np.asarray((np.asarray(xyz, dtype=np.float64) - self.origin) @ self.axes)  # eq. 144

    def cartesian_from_intermediate(self, points: ArrayLike) -> Floats:
        """Points (..., 3) from this frame back into the Cartesian frame. Source: [001] eq. 152."""
        return np.asarray(self.origin + np.asarray(points, dtype=np.float64) @ self.axes.T)  # eq. 152

    def intermediate_rotations(self, rotations: ArrayLike) -> Floats:
        """Rotations (..., 3, 3) from image axes to Cartesian axes, turned to lead to the axes of this frame."""
        return np.asarray(self.axes.T @ np.asarray(rotations, dtype=np.float64))

    def cartesian_rotations(self, rotations: ArrayLike) -> Floats:
        """Rotations (..., 3, 3) from image axes to the axes of this frame, turned to lead to Cartesian axes."""
        return np.asarray(self.axes @ np.asarray(rotations, dtype=np.float64))
