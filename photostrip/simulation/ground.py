"""The world the photos are taken of: from distances along and across the flight to points in space.

On an ellipsoid the flight follows the normals' great circle through the middle of the strips: the unit normal turns
evenly with the distance flown. Points and perspective centres lie on these normals at their heights, and everything
after that happens in geocentric Cartesian space, where rays are straight. In a flat world distances are coordinates.
``along`` and ``across`` (n,) are distances in metres from the middle of the strips in the direction of flight and to
its left; heights, metres, are above the ellipsoid, or above the plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats
from photostrip.geodesy.curvature import mean_radius
from photostrip.geodesy.ground_frame import true_axes
from photostrip.geodesy.local_frame import geocentric_from_geodetic, local_axes_matrix
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.spec import Spec

WAVES = 5  # sine waves that make up the relief


@dataclass(frozen=True, eq=False)
class World:
    """Space around the strips."""

    # (3, 3): rows: the direction of flight, its left and the vertical in the middle of the strips, in the Cartesian
    # frame
    axes: Floats
    # semi-axes (a, b), metres; None: the world is flat and the middle is the origin
    ellipsoid: tuple[float, float] | None = None
    radius: float = np.inf  # mean radius of the surface in the middle, metres

    def cartesian(self, along: Floats, across: Floats, height: Floats) -> Floats:
        """Geocentric X, Y, Z of points, or east, north, up in a flat world, shape (n, 3), metres."""
        if self.ellipsoid is None:
            return np.asarray(np.stack([along, across, height], axis=-1) @ self.axes)
        normal = self.frames(along, across)[:, :, 2]
        x, y, z = normal.T
        lon, lat = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
        return geocentric_from_geodetic(np.stack([lon, lat, height], axis=-1), self.ellipsoid)

    def frames(self, along: Floats, across: Floats) -> Floats:
        """Direction of flight, left and vertical at places: columns of (n, 3, 3) in the Cartesian frame.

        The vertical is the ellipsoid's normal.
        """
        s, t = np.asarray(along) / self.radius, np.asarray(across) / self.radius
        forward, left, up = self.axes
        (sin_s, cos_s), (sin_t, cos_t) = ((np.sin(x)[:, None], np.cos(x)[:, None]) for x in (s, t))
        ahead = cos_s * forward - sin_s * up
        inward = cos_s * up + sin_s * forward
        return np.stack([ahead, cos_t * left - sin_t * inward, cos_t * inward + sin_t * left], axis=-1)


def world(spec: Spec, ellipsoid: tuple[float, float] | None) -> World:
    """Lay the world out around the middle of the strips; without semi-axes of an ellipsoid it is flat."""
    heading = np.radians(spec.flight.heading_deg)
    turn = local_axes_matrix(heading).T  # rows forward, left, up in east, north, up
    if ellipsoid is None:
        return World(turn)
    center = np.radians(spec.ground.center_deg)
    radius = float(mean_radius(center[1], ellipsoid)) + spec.terrain.height
    return World(turn @ true_axes(center[None])[0], ellipsoid, radius)


@dataclass(frozen=True, eq=False)
class Surface:
    """Heights of the terrain: a plane and sine waves of random directions and phases."""

    height: float  # mean height, metres
    slope: tuple[float, float]  # rise along and across, metres per metre
    amplitude: Floats  # (m,): amplitudes of the waves, metres
    wave: Floats  # (m, 2): wave numbers along and across, radians per metre
    phase: Floats  # (m,): phases, radians

    def __call__(self, along: Floats, across: Floats) -> Floats:
        plane = self.height + self.slope[0] * along + self.slope[1] * across
        angle = np.multiply.outer(along, self.wave[:, 0]) + np.multiply.outer(across, self.wave[:, 1]) + self.phase
        return np.asarray(plane + np.sin(angle) @ self.amplitude)


def surface(spec: Spec) -> Surface:
    """Make the terrain; the amplitudes of its waves add up to the relief, so that no hill is higher.

    Draws (`Purpose.TERRAIN`): direction, wavelength, phase of each wave.
    """
    drawn = Draws(spec.seed, Purpose.TERRAIN).uniform(WAVES, 3)
    direction, phase = 2.0 * np.pi * drawn[:, 0], 2.0 * np.pi * drawn[:, 2]
    wavelength = (spec.terrain.wavelength or 3.0 * spec.base) * (0.6 + 0.8 * drawn[:, 1])
    number = 2.0 * np.pi / wavelength
    along, across = spec.terrain.slope_percent
    return Surface(
        height=spec.terrain.height,
        slope=(along / 100.0, across / 100.0),
        amplitude=np.full(WAVES, spec.terrain.relief / WAVES),
        wave=np.stack([number * np.cos(direction), number * np.sin(direction)], axis=-1),
        phase=phase,
    )
