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

Two photos of any orientation brought to the normal case, and displacements of points between two epochs in it.

The normal case has X along the base from the left to the right station, Y at right angles to it in the mean direction
of the optical axes, Z completing them; both photos have the principal distance of the left camera. A point is a
quadruple of coordinates: x and z of the left photo, x and z of the right one. A pseudo-parallax is the difference of a
coordinate on two photos taken from the same station at different times.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import alpha_omega_kappa, from_alpha_omega_kappa
from photostrip.statistics import chi2_quantile

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


LEFT, RIGHT = 0, 1
SIDES = ("left", "right")
PARALLAX = 1e-3  # of the principal distance: a smaller x parallax is refused
LEAST_SINE = 0.05  # sine of the angle between the base and the mean optical axis below which there is no normal case
LEAST_COSINE_AHEAD = 1e-3  # cosine of the angle to the normal direction below which a ray cannot be transformed
CONDITION = np.array([0.0, 1.0, 0.0, -1.0])  # the z coordinates of both photos are equal in the normal case
SPACE = 3  # components of a displacement
SINGULAR = 1e-12  # reciprocal condition of a covariance matrix below which there is no test


@dataclass(frozen=True, eq=False)
class StereoPair:
    """Two stations from which the same object is photographed again and again."""

    principal_distances: tuple[float, float]  # of the left and right camera, mm
    centers: Floats  # (2, 3): perspective centres of the left and right camera on the ground, metres
    rotations: Floats  # (2, 3, 3): photo to ground in the reference epoch

    @property
    def base(self) -> float:
        """Length of the base in metres."""
        return float(np.linalg.norm(self.centers[RIGHT] - self.centers[LEFT]))

    def ground_from_normal(self) -> Floats:
        """Rotation from the axes of the normal case to the ground; its columns are X, Y, Z.

        Raises GeometryError when there is no base, or the cameras look along it.
        """
        if self.base == 0:
            msg = "the left and the right station are at the same place: there is no base"
            raise GeometryError(msg, photos=SIDES, code="no-base")
        along = (self.centers[RIGHT] - self.centers[LEFT]) / self.base
        mean = -(self.rotations[LEFT, :, 2] + self.rotations[RIGHT, :, 2])
        across = mean - (mean @ along) * along
        if np.linalg.norm(across) < LEAST_SINE * max(float(np.linalg.norm(mean)), 1.0):
            msg = "the cameras look along the base, or away from each other: there is no normal case"
            raise GeometryError(msg, photos=SIDES, code="along-base")
        across /= np.linalg.norm(across)
        return np.column_stack([along, across, np.cross(along, across)])


def normal_pair(principal_distance: float, base: float) -> StereoPair:
    """Give two cameras in the normal case, the left one at the origin; ground axes: X to the right, Y ahead, Z up."""
    centers = np.array([[0.0, 0.0, 0.0], [base, 0.0, 0.0]])
    return StereoPair((principal_distance,) * 2, centers, np.array([GROUND_FROM_HOUSE] * 2))


@dataclass(frozen=True, eq=False)
class Normal:
    """Coordinates of points in the normal case, with their derivatives."""

    # (n, 4): x, z of the left and x, z of the right photo in mm; both z equal: the rays meet. NaN where a ray is
    # missing or cannot be transformed
    coordinates: Floats
    by_measured: Floats  # (n, 4, 4): derivatives by the measured coordinates
    # (n, 4, 6): derivatives by small turns (alpha, omega, kappa) of the left and of the right camera, mm/rad
    by_turn: Floats
    # (n,): vertical parallax z_left - z_right before the rays were made to meet, mm; NaN where z was not measured on
    # the right photo
    parallax: Floats
    parallax_by_measured: Floats  # (n, 4): its derivatives
    parallax_by_turn: Floats  # (n, 6): its derivatives by the turns, mm/rad


def to_normal(measured: Floats, variances: Floats, pair: StereoPair, rotations: Floats) -> Normal:
    """Bring measured image coordinates to the normal case, with z_left = z_right.

    measured: (n, 4), x, z of the left and x, z of the right photo in mm, reduced to the principal points. Where the
        last is NaN, it is what makes the rays meet.
    variances: (n, 4), variances of the measured coordinates, in any unit: they say which coordinates give way when the
        rays do not meet.
    rotations: (n, 2, 3, 3), photo to ground, for each point and camera.
    """
    turn = np.einsum("ki,nskj->nsij", pair.ground_from_normal(), rotations)
    focal = pair.principal_distances
    complete = measured.copy()
    without = np.isnan(measured[:, 3])
    complete[without, 3] = meeting_z(measured[without], pair, rotations[without])
    ray = np.stack([rays(complete[:, :2], focal[LEFT]), rays(complete[:, 2:], focal[RIGHT])], axis=1)
    turned = np.einsum("nsij,nsj->nsi", turn, ray)
    with np.errstate(invalid="ignore"):
        bad = (turned[..., 1] < LEAST_COSINE_AHEAD * np.linalg.norm(turned, axis=-1)).any(axis=1)
    turned[bad] = np.nan
    common = focal[LEFT]
    scale = common / turned[..., 1]
    raw = (turned[..., [0, 2]] * scale[..., None]).reshape(-1, 4)
    # derivative of (x, z) by the turned ray: scale * (unit axis - (x, z)/f * Y axis)
    by_ray = np.zeros((len(raw), 2, 2, 3))
    by_ray[:, :, 0, 0] = by_ray[:, :, 1, 2] = scale
    by_ray[..., 1] = -scale[..., None] * raw.reshape(-1, 2, 2) / common
    by_photo = np.einsum("nsij,nsjk->nsik", by_ray, turn)
    by_measured = _blocks(by_photo[..., :2])
    axes = np.cross(TURN_AXES.T, ray[:, :, None, :])  # what a turn about each axis adds to the ray
    by_turn = _blocks(np.einsum("nsij,nsaj->nsia", by_photo, axes))
    parallax = raw @ CONDITION
    # the rays are made to meet: along the covariance of the coordinates, or by the z that was not measured
    way = np.einsum("nij,nj,nkj,k->ni", by_measured, variances, by_measured, CONDITION)
    way[without] = by_measured[without, :, 3]
    by_measured[without, :, 3] = 0.0
    onto = np.eye(4) - way[:, :, None] * CONDITION / (way @ CONDITION)[:, None, None]
    return Normal(
        coordinates=np.einsum("nij,nj->ni", onto, raw),
        by_measured=onto @ by_measured,
        by_turn=onto @ by_turn,
        parallax=np.where(without, np.nan, parallax),
        parallax_by_measured=CONDITION @ by_measured,
        parallax_by_turn=CONDITION @ by_turn,
    )


def meeting_z(measured: Floats, pair: StereoPair, rotations: Floats) -> Floats:
    """Give z of the right photo, shape (n,), for which the rays meet: both rays and the base lie in one plane.

    Arguments are those of ``to_normal``; the last column of `measured` is not used.

    Source: derived.
    """
    focal = pair.principal_distances
    turn = np.einsum("ki,nskj->nsij", pair.ground_from_normal(), rotations)
    left = np.einsum("nij,nj->ni", turn[:, LEFT], rays(measured[:, :2], focal[LEFT]))
    x_part = np.einsum("nij,nj->ni", turn[:, RIGHT], rays(measured[:, [2, 2]] * [1.0, 0.0], focal[RIGHT]))
    z_part = turn[:, RIGHT, :, 1]
    # the base is the X axis: coplanar when Y_left Z_right = Z_left Y_right
    along = left[:, 1] * z_part[:, 2] - left[:, 2] * z_part[:, 1]
    value: Floats = (left[:, 2] * x_part[:, 1] - left[:, 1] * x_part[:, 2]) / np.where(along == 0, np.nan, along)
    return value


def _blocks(parts: Floats) -> Floats:
    """Set the derivatives of the two cameras into one matrix."""
    n, _, rows, columns = parts.shape
    whole = np.zeros((n, 2 * rows, 2 * columns))
    whole[:, :rows, :columns] = parts[:, LEFT]
    whole[:, rows:, columns:] = parts[:, RIGHT]
    return whole


def intersect(coordinates: Floats, principal_distance: float, base: float) -> tuple[Floats, Floats]:
    """Points (n, 3) from the left station, metres, NaN where the parallax is too small, and derivatives (n, 3, 4).

    The derivatives are by x, z of the left and of the right photo, m/mm.
    """
    x, z, x_right = coordinates[:, 0], coordinates[:, 1], coordinates[:, 2]
    p = x - x_right
    with np.errstate(invalid="ignore"):
        p = np.where(p > PARALLAX * principal_distance, p, np.nan)
    depth = base * principal_distance / p
    xyz = depth[:, None] * np.column_stack([x, np.full_like(x, principal_distance), z]) / principal_distance
    jacobian = np.zeros((len(p), 3, 4))
    jacobian[:, :, 0] = -xyz / p[:, None]
    jacobian[:, :, 2] = xyz / p[:, None]
    jacobian[:, 0, 0] += depth / principal_distance
    jacobian[:, 2, 1] = depth / principal_distance
    return xyz, jacobian


def displacements(first: Floats, second: Floats, principal_distance: float, base: float) -> Floats:
    """Displacements dX, dY, dZ in the axes of the normal case, second minus first epoch, shape (n, 3), metres.

    Exactly the difference of the intersected points, without its loss of digits.

    first, second: (n, 4), x, z of the left and x, z of the right photo in mm in two epochs.
    """
    f = principal_distance
    change = second - first
    p = first[:, 0] - first[:, 2]
    dp = change[:, 0] - change[:, 2]
    depth = base * f / p
    dy = -depth * dp / (p + dp)
    dx = (depth * change[:, 0] + dy * second[:, 0]) / f
    dz = (depth * change[:, 1] + dy * second[:, 1]) / f
    return np.column_stack([dx, dy, dz])


def statistic(displacement: Floats, covariance: Floats) -> Floats:
    """Test value d^T C^-1 d of displacements: chi-square with three degrees of freedom where nothing moved.

    NaN where the covariance (n, 3, 3) is singular or has no value.
    """
    value = np.full(len(displacement), np.nan)
    sound = np.flatnonzero(np.isfinite(displacement).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)))
    size = np.linalg.eigvalsh(covariance[sound])
    sound = sound[size[:, 0] > SINGULAR * size[:, -1]]
    d = displacement[sound]
    value[sound] = np.einsum("ni,ni->n", d, np.linalg.solve(covariance[sound], d[:, :, None])[:, :, 0])
    return value


def limit(significance: float, components: int = SPACE) -> float:
    """Critical value of ``statistic``, for the probability of calling a point moved that did not move."""
    return chi2_quantile(1 - significance, components)


class Ellipses(NamedTuple):
    """Confidence ellipses in plan."""

    # major, minor: (...): semi-axes, metres
    major: Floats
    minor: Floats
    azimuth: Floats  # (...): direction of the major axis clockwise from the second axis, in [0, pi), radians


def ellipses(covariance: ArrayLike, probability: float) -> Ellipses:
    """Confidence ellipses in plan.

    covariance: (..., 2, 2), covariance of the first two components (to the right and ahead, or east and north), m^2.
    probability: probability that the ellipse around the estimate covers the truth.
    """
    c = np.asarray(covariance, float)
    half_sum = (c[..., 0, 0] + c[..., 1, 1]) / 2
    half_difference = (c[..., 1, 1] - c[..., 0, 0]) / 2
    radius = np.hypot(half_difference, c[..., 0, 1])
    factor = chi2_quantile(probability, 2)
    azimuth = np.mod(np.arctan2(c[..., 0, 1], half_difference) / 2, np.pi)
    major, minor = (np.sqrt(factor * np.maximum(half_sum + each, 0)) for each in (radius, -radius))
    return Ellipses(major, minor, azimuth)
