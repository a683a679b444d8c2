"""The world the photos are taken of: from distances along and across the flight to points in space.

On an ellipsoid the flight follows the normals' great circle through the middle of the strips: the unit normal turns
evenly with the distance flown. Points and perspective centres lie on these normals at their heights, and everything
after that happens in geocentric Cartesian space, where rays are straight. In a flat world distances are coordinates.
``along`` and ``across`` (n,) are distances in metres from the middle of the strips in the direction of flight and to
its left; heights, metres, are above the ellipsoid, or above the plane.

The photos: where they are taken, in which attitude, and what they show.

``photo`` (n,) is the number of the photo of each row; rays (n, 3) lead from its perspective centre, Cartesian frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.geodesy.ground_frame import true_axes
from photostrip.geodesy.local_frame import geocentric_from_geodetic, local_axes_matrix, mean_radius
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.spec import Spec
from photostrip.strip import corrections
from photostrip.strip.corrections import refraction_constant

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


CUT_SIGMAS = 3.0  # standard deviations beyond which no photo is displaced or tilted: a pilot would fly again
BASE_SCATTER = (0.02, 0.02, 0.01)  # of the base: along, across, height
USABLE = 0.97  # part of the width and height of the photo that is measured in
BENDING_STEPS = 6  # each gains four digits


@dataclass(frozen=True, eq=False)
class Photos:
    """The true exterior orientations, strip after strip, each in flight order."""

    ids: tuple[str, ...]
    strips: tuple[tuple[str, tuple[str, ...]], ...]  # each strip's id and its photos in flight order
    # along, across, height: (n,): places of the perspective centres from the middle of the strips and heights above the
    # ellipsoid, metres
    along: Floats
    across: Floats
    height: Floats
    centers: Floats  # (n, 3): perspective centres in the Cartesian frame, metres
    rotations: Floats  # (n, 3, 3): rotations that take image axes to the Cartesian frame
    up: Floats  # (n, 3): the vertical at the perspective centres, in the Cartesian frame


def strip_id(number: int) -> str:
    """Letter or letters of a strip, counted from 0: A to Z, then AA, AB and so on."""
    head, last = divmod(number, 26)
    return (strip_id(head - 1) if head else "") + chr(ord("A") + last)


def position_sigma(spec: Spec) -> tuple[float, float, float]:
    """Scatter of the perspective centres along, across and in height: standard deviations, metres."""
    if spec.flight.position_sigma is not None:
        return spec.flight.position_sigma
    along, across, height = (part * spec.base for part in BASE_SCATTER)
    return along, across, height


def fly(spec: Spec, space: World) -> Photos:
    """Take the photos of all strips; ids are the number of the strip and the number of the photo in flight order.

    Draws (`Purpose.FLIGHT`): for each photo along, across, height, alpha, omega, kappa.
    """
    flight = spec.flight
    n, strips = flight.photos, flight.strips
    scatter = np.clip(Draws(spec.seed, Purpose.FLIGHT).normal(strips, n, 6), -CUT_SIGMAS, CUT_SIGMAS)
    sigma = position_sigma(spec)
    back = np.arange(strips) % 2 == 1 if flight.alternate else np.zeros(strips, dtype=bool)
    sign = np.where(back, -1.0, 1.0)[:, None]
    along = sign * (np.arange(n) - (n - 1) / 2) * spec.base + sigma[0] * scatter[..., 0]
    across = (np.arange(strips)[:, None] - (strips - 1) / 2) * spec.strip_distance + sigma[1] * scatter[..., 1]
    height = spec.terrain.height + spec.flying_height + sigma[2] * scatter[..., 2]
    tilt = np.radians(flight.attitude_sigma_deg) * scatter[..., 3:]
    kappa = tilt[..., 2] + np.radians(flight.photo_rotation_deg) + np.pi * back[:, None]
    attitude = from_alpha_omega_kappa(sign * tilt[..., 0], sign * tilt[..., 1], kappa).reshape(-1, 3, 3)
    along, across, height = along.ravel(), across.ravel(), height.ravel()
    frames = space.frames(along, across)
    digits = max(3, len(str(n)))
    names = tuple((strip_id(j), tuple(f"{j + 1}{i + 1:0{digits}d}" for i in range(n))) for j in range(strips))
    return Photos(
        ids=tuple(photo for _, photos in names for photo in photos),
        strips=names,
        along=along,
        across=across,
        height=height,
        centers=space.cartesian(along, across, height),
        rotations=frames @ attitude,
        up=frames[:, :, 2],
    )


def project(photos: Photos, photo: Numbers, ray: Floats, principal_distance: float) -> tuple[Floats, Floats]:
    """Central projection of rays (of any length) into photos, one for each row.

    Returns xy: (n, 2), ideal image coordinates from the principal point, mm.
    Returns depth: (n,), part of the ray along the camera's axis; negative for what lies behind the camera.
    """
    turned = np.einsum("ni,nij->nj", ray, photos.rotations[photo])
    depth = -turned[:, 2]
    safe = np.where(depth > 0.0, depth, np.inf)
    return principal_distance * turned[:, :2] / safe[:, None], depth


def bent(photos: Photos, photo: Numbers, ray: Floats, ground_height: float) -> Floats:
    """Directions in which the cameras see the ends of rays, metres, through the standard atmosphere.

    `ground_height` is the mean height of the terrain above sea level.

    Source: derived, refraction in plane layers: tan(alpha) = tan(theta) (1 - K / cos(theta)^2) for the straight line
    alpha and the direction theta in which it is seen, both from the nadir, whatever the tilt of the photo.
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


def sees(spec: Spec, photos: Photos, photo: Numbers, xyz: Floats) -> Flags:
    """Whether a photo shows a point (n, 3), Cartesian frame, well within its format, one point for each row."""
    xy, depth = project(photos, photo, xyz - photos.centers[photo], spec.camera.principal_distance)
    inside = (np.abs(xy + spec.camera.principal_point) <= USABLE / 2.0 * np.asarray(spec.format)).all(axis=1)
    if spec.camera.distortion is not None:
        inside &= np.hypot(xy[:, 0], xy[:, 1]) <= USABLE * corrections.distortion_reach(spec.camera.distortion)[1]
    return np.asarray(inside & (depth > 0.0))
