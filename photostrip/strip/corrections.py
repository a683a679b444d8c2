"""Lens distortion, in both directions of definition, and its inverse.

A calibration gives a shift D of image points, as a function of the image point or of the ideal one; the other
direction is found by iteration. Both models have the form
``D = X g(r) + decentering``, X reduced to the principal point.

Between the radii of a table stands a cubic spline made for what is tabulated: distortion is an odd function of the
radius, so the spline starts with value and curvature zero in the middle, and it is smooth. Of a lens with 8 um of
distortion, tabulated every 20 mm, it is 0.1 um off; a monotone interpolation, which flattens where the curve turns,
0.5 um, straight lines 1.1 um. Beyond the last radius nothing is known, and nothing is computed.

What is asked of the interior orientation and of the corrections of image coordinates.

Refinement: from photo coordinates to ideal image coordinates, as a pinhole in vacuum would have made them.

The order of the corrections, from the image to the ideal, is that in which light collects the errors, backwards:

1. principal point: coordinates are reduced to it;
2. lens distortion;
3. atmospheric refraction;
4. Earth curvature, only where the ground frame does not carry it and it is asked for in image space.

Film deformation is corrected before, by the interior orientation. ``distort`` goes the other way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera, Distortion
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.points import PhotoPoints

INVERSE_CONVERGED = 1e-12  # mm
INVERSE_ITERATIONS = 30
FORWARD = "image_to_ideal"
RADII, AZIMUTHS = 201, 24  # of the points in which a distortion is tried
EDGE = 1e-9  # mm beyond the last radius of a table that rounding may cost


class _Radial(NamedTuple):
    """Radial distortion at some radii: ``g = d / r``, and its derivative by the radius over the radius."""

    factor: Floats
    slope: Floats


def ideal_from_image(xy: ArrayLike, distortion: Distortion) -> Floats:
    """Remove the distortion of image points (n, 2) reduced to the principal point, exact to 1e-9 mm.

    Raises InputError when a point lies beyond the last radius of a table.
    Raises GeometryError when no ideal point has this image.

    Source: [Brown 1966] for the polynomials.
    """
    points = np.asarray(xy, float)
    _refuse_beyond(points, distortion_reach(distortion)[0])
    return (
        points + distortion_shift(points, distortion)
        if distortion.direction == FORWARD
        else _inverse(points, distortion)
    )


def image_from_ideal(xy: ArrayLike, distortion: Distortion) -> Floats:
    """Apply the distortion to ideal points (n, 2); the inverse of ``ideal_from_image``, with the same errors."""
    points = np.asarray(xy, float)
    _refuse_beyond(points, distortion_reach(distortion)[1])
    return (
        _inverse(points, distortion)
        if distortion.direction == FORWARD
        else points + distortion_shift(points, distortion)
    )


def distortion_shift(xy: Floats, distortion: Distortion) -> Floats:
    """Distortion D as the calibration gives it, mm, at points (n, 2) of the kind in which it is defined.

    Beyond the last radius of a table its last piece is continued, which only iterations may use.

    Source: [Brown 1966], radial and decentering distortion; [Fraser 1997], affinity and shear.
    """
    x, y = xy[..., 0], xy[..., 1]
    square = x**2 + y**2
    p1, p2 = distortion.p
    b1, b2 = distortion.b
    factor = _radial(np.sqrt(square), distortion).factor
    dx = x * factor + p1 * (square + 2 * x**2) + 2 * p2 * x * y + b1 * x + b2 * y
    dy = y * factor + p2 * (square + 2 * y**2) + 2 * p1 * x * y
    return np.stack([dx, dy], -1)


def distortion_jacobian(xy: Floats, distortion: Distortion) -> Floats:
    """Differentiate ``X + D(X)`` by X, (n, 2, 2)."""
    x, y = xy[..., 0], xy[..., 1]
    p1, p2 = distortion.p
    b1, b2 = distortion.b
    factor, slope = _radial(np.hypot(x, y), distortion)
    xx = 1 + factor + slope * x**2 + 6 * p1 * x + 2 * p2 * y + b1
    yy = 1 + factor + slope * y**2 + 6 * p2 * y + 2 * p1 * x
    xy_ = slope * x * y + 2 * p1 * y + 2 * p2 * x
    return np.stack([np.stack([xx, xy_ + b2], -1), np.stack([xy_, yy], -1)], -2)


def distortion_reach(distortion: Distortion) -> tuple[float, float]:
    """Return the radii up to which the distortion of image and of ideal points is known; infinite for polynomials."""
    if distortion.model != "radial-table":
        return np.inf, np.inf
    last = distortion.radius[-1]
    shifted = last + distortion.distortion[-1]
    return (last, shifted) if distortion.direction == FORWARD else (shifted, last)


def distortion_faults(camera: Camera, farthest: float = 0.0) -> list[Fault]:
    """Find what is wrong with the distortion of a camera.

    Tables that are no tables, and distortion that folds the photo up to the radius `farthest` and the corners of the
    format: two ideal points with one image, or the other way round, so that it has no inverse.
    """
    distortion = camera.distortion
    if distortion is None:
        return []
    key = f"cameras.{camera.name}.distortion"
    if distortion.model == "radial-table" and (text := _bad_table(distortion)):
        return [Fault(f"camera {camera.name}: {text}", code="distortion-table", key=key)]
    radius = _fold(distortion, max(farthest, _format_reach(camera)))
    if radius is None:
        return []
    at = camera.length(radius, ".1f", ".0f")
    message = f"camera {camera.name}: the distortion has no inverse: the image folds {at} from the principal point"
    fix = "check signs and units of the coefficients: k1 in mm^-2, k2 in mm^-4, k3 in mm^-6, p in mm^-1, tables in mm"
    if camera.unit == "px":
        fix = "check signs and order of the coefficients, and the convention"
    return [Fault(message, code="distortion-folds", key=key, fix=fix)]


def _bad_table(distortion: Distortion) -> str:
    radius, values = np.array(distortion.radius, float), np.array(distortion.distortion, float)
    if len(radius) != len(values) or not radius.any():
        return f"{len(radius)} radii and {len(values)} distortions: equally many are needed, and a radius above 0"
    if radius[0] < 0 or (np.diff(radius) <= 0).any():
        return "the radii of the distortion table must increase from 0 or above"
    if radius[0] == 0 and values[0] != 0:
        return f"the distortion at radius 0 is {values[0]:g} mm; it must be 0"
    return ""


def _format_reach(camera: Camera) -> float:
    """Distance of the farthest corner of the format from the principal point, mm; 0 when the format is unknown."""
    if camera.format is None:
        return 0.0
    return float(np.hypot(*(np.array(camera.format) / 2 + np.abs(camera.principal_point))))


def _fold(distortion: Distortion, farthest: float) -> float | None:
    """Find the radius at which ``X + D(X)`` folds, out to an image radius of `farthest`; None when it does not."""
    if farthest <= 0:
        return None
    forward = distortion.direction == FORWARD
    # an ideal radius may be larger than that of its image, but not twice: such a lens is no central projection
    radii = np.linspace(0, min(farthest if forward else 2 * farthest, _last_radius(distortion)), RADII)
    azimuth = np.linspace(0, 2 * np.pi, AZIMUTHS, endpoint=False)
    direction = np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    points = radii[:, None, None] * direction
    slopes = distortion_jacobian(points, distortion)
    radial = np.einsum("ai,raij,aj->ra", direction, slopes, direction)
    folded = ((np.linalg.det(slopes) <= 0) | (radial <= 0)).any(1)
    if not folded.any():
        return None
    first = int(np.argmax(folded))
    image = np.linalg.norm(points + (0 if forward else distortion_shift(points, distortion)), axis=-1).min(1)
    if not forward and image[:first].max(initial=0.0) >= farthest:
        return None
    return float(radii[first])


def _last_radius(distortion: Distortion) -> float:
    return distortion.radius[-1] if distortion.model == "radial-table" else np.inf


def _refuse_beyond(points: Floats, limit: float) -> None:
    radius = np.hypot(points[..., 0], points[..., 1])
    if (radius > limit + EDGE).any():
        raise InputError(
            f"a point {radius.max():.3f} mm from the principal point lies beyond the distortion table, {limit:.3f} mm"
        )


def _inverse(target: Floats, distortion: Distortion) -> Floats:
    """Solve ``X + D(X) = target`` by Newton's iteration, from the inverse of the radial part."""
    radius = np.hypot(target[..., 0], target[..., 1])
    farthest = 2 * float(radius.max(initial=0.0))
    if farthest == 0:
        return target.copy() if not np.any((distortion.p, distortion.b)) else _newton(target, target, distortion)
    radii = np.linspace(0, min(farthest, _last_radius(distortion)), RADII)
    images = np.maximum.accumulate(radii * (1 + _radial(radii, distortion).factor))
    scale = np.interp(radius, images, radii) / np.where(radius > 0, radius, 1.0)
    return _newton(target * scale[..., None], target, distortion)


def _newton(start: Floats, target: Floats, distortion: Distortion) -> Floats:
    found = start
    for _ in range(INVERSE_ITERATIONS):
        slopes = distortion_jacobian(found, distortion)
        if not (np.linalg.det(slopes) > 0).all():
            break
        step = np.linalg.solve(slopes, (found + distortion_shift(found, distortion) - target)[..., None])[..., 0]
        found = found - step
        if (np.abs(step) <= INVERSE_CONVERGED).all():
            return found
    raise GeometryError("the distortion has no inverse at some point", code="distortion-folds")


def _radial(radius: Floats, distortion: Distortion) -> _Radial:
    if distortion.model == "radial-table":
        return _spline(radius, distortion)
    k1, k2, k3 = distortion.k
    square = radius**2
    return _Radial(
        square * (k1 + square * (k2 + square * k3)),
        2 * (k1 + square * (2 * k2 + square * 3 * k3)),
    )


def _spline(radius: Floats, distortion: Distortion) -> _Radial:
    """Evaluate the cubic spline through a table; the first interval is odd, so that its division by r is exact."""
    from scipy.interpolate import CubicSpline

    nodes, values = np.array(distortion.radius, float), np.array(distortion.distortion, float)
    if nodes[0] > 0:
        nodes, values = np.append(0.0, nodes), np.append(0.0, values)
    spline = CubicSpline(nodes, values, bc_type=("natural", "not-a-knot"))
    cubic, _, linear, _ = spline.c[:, 0]
    inner = radius < nodes[1]
    safe = np.where(inner, 1.0, radius)
    factor = np.where(inner, linear + radius**2 * cubic, spline(radius) / safe)
    return _Radial(factor, np.where(inner, 2 * cubic, (spline(radius, 1) - factor) / safe**2))


@dataclass(frozen=True)
class InteriorSettings:
    """How photo coordinates are formed from measured fiducial marks."""

    # ``"conformal"`` (two marks or more), ``"affine"`` (three or more), ``"bilinear"`` or ``"projective"`` (four or
    # more); ``"auto"``: affine from four marks on, so that one redundant mark for each axis is left, conformal with two
    # or three
    transform: str = "auto"
    # ``"interpolate"`` the residuals of the marks to the points, for film that is deformed in other ways than the
    # transformation has, or ``"ignore"`` them
    residuals: str = "ignore"


@dataclass(frozen=True)
class ImageCorrectionSettings:
    # principal_point, distortion: reduce to the principal point of the camera; take out its lens distortion
    principal_point: bool = True
    distortion: bool = True
    refraction: bool = False
    # flying_height, ground_height: mean heights of the perspective centers and of the ground above sea level, in
    # metres; None: derived from camera and control
    flying_height: float | None = None
    ground_height: float | None = None
    earth_radius: float | None = None  # radius of the Earth in metres for the correction in image space; None: none

    def applied_to(self, camera: Camera) -> Camera:
        """Return a camera with its principal point in the middle, or without distortion, where that is switched off."""
        point = camera.principal_point if self.principal_point else (0.0, 0.0)
        return replace(camera, principal_point=point, distortion=camera.distortion if self.distortion else None)

    @property
    def needs_heights(self) -> bool:
        """Whether a correction depends on the heights of camera and ground."""
        return self.refraction or self.earth_radius is not None


MICROMETRE = 1e-3  # mm
SHOWN = 20  # points beyond the distortion table that are named one by one

CONVERGED = 1e-15  # relative to the radius
ITERATIONS = 20
# Standard atmosphere, ICAO Doc 7488 (ISO 2533): layers to 11 km and above.
LAPSE = 6.5 / 288.15  # relative fall of temperature per km
PRESSURE_EXPONENT = 5.25588  # of pressure; one less for density
TROPOPAUSE = 11.0  # km
STRATOSPHERE_SCALE = 6.341616  # km, height in which the pressure above the tropopause falls to 1/e
SCALE_HEIGHT = 8.43450  # km, pressure over density and gravity at sea level
# Refractivity of dry air at sea level in the standard atmosphere, visible light; Saastamoinen 1972.
REFRACTIVITY = 277e-6


@dataclass(frozen=True)
class Bending:
    """How far light and Earth bend away from straight line and plane, over the depth from camera to ground."""

    refraction: float = 0.0  # constant of ``refraction_constant``; 0: none
    curvature: float = 0.0  # constant of ``curvature_constant``; 0: none

    def __bool__(self) -> bool:
        return bool(self.refraction or self.curvature)


NOTHING_BENT = Bending()


@dataclass(frozen=True, eq=False)
class Refined:
    # ideal image coordinates, reduced to the principal point, mm; every measured row, also what is rejected later
    observations: PhotoPoints
    # largest shift by each effect that was corrected, micrometres: ``"principal point"``, ``"distortion"``,
    # ``"refraction"``, ``"earth curvature"``
    largest_um: dict[str, float]


def refine(
    observations: PhotoPoints, camera_of_photo: Mapping[str, Camera], settings: ImageCorrectionSettings
) -> Refined:
    """Refine photo coordinates of all photos: principal point, distortion, refraction and Earth curvature.

    observations: photo coordinates, mm, in the system in which the principal point of the camera is given.
    Returns ideal coordinates in the same rows with the same standard deviations; the same table when no camera has
        anything to correct.
    Raises InputError when a distortion has no inverse over the format, or refraction or curvature is asked for without
        heights, or a point lies beyond the radii of a distortion table: with photo, point and radius.
    """
    cameras = {camera_of_photo[photo].name: camera_of_photo[photo] for photo in observations.photo_ids}
    cameras = {name: settings.applied_to(camera) for name, camera in cameras.items()}
    number = {name: row for row, name in enumerate(cameras)}
    camera_of = np.array([number[camera_of_photo[photo].name] for photo in observations.photo_ids], np.intp)
    bending = _bending(settings)
    rows_of = {name: np.flatnonzero(camera_of[observations.photo] == row) for name, row in number.items()}
    _refuse_distortion(observations, cameras, rows_of)
    xy = observations.xy
    largest: dict[str, float] = {}
    for name, camera in cameras.items():
        if not (any(camera.principal_point) or camera.distortion is not None or bending):
            continue
        if xy is observations.xy:
            xy = xy.copy()
        xy[rows_of[name]], shifts = _corrected(xy[rows_of[name]], camera, bending)
        for effect, length in shifts.items():
            largest[effect] = max(largest.get(effect, 0.0), length / MICROMETRE)
    if not largest:
        return Refined(observations, largest)
    return Refined(replace(observations, xy=xy), largest)


def undistort(image_xy: ArrayLike, camera: Camera, bending: Bending = NOTHING_BENT) -> Floats:
    """Ideal points, reduced to the principal point, of image points (n, 2) of one camera."""
    return _corrected(np.asarray(image_xy, float), camera, bending)[0]


def distort(ideal_xy: ArrayLike, camera: Camera, bending: Bending = NOTHING_BENT) -> Floats:
    """Image points of ideal points of one camera; the inverse of ``undistort``, exact to 1e-9 mm.

    An ``InputError`` when a point lies beyond the radii of a distortion table.
    """
    xy = np.asarray(ideal_xy, float)
    f = camera.principal_distance
    if bending.curvature:
        xy = _stretched(xy, f, 0.0, bending.curvature)
    if bending.refraction:
        xy = _stretched(xy, f, -bending.refraction, -bending.refraction)
    if _distorts(camera.distortion):
        xy = image_from_ideal(xy, camera.distortion)
    return np.asarray(xy + np.array(camera.principal_point), np.float64)


def _bending(settings: ImageCorrectionSettings) -> Bending:
    if not settings.needs_heights:
        return NOTHING_BENT
    flying, ground = settings.flying_height, settings.ground_height
    if flying is None or ground is None:
        what = "refraction" if settings.refraction else "earth_curvature"
        message = f"{what}: flying height and height of the ground are not known"
        fix = "give processing.flying_height and processing.ground_height, in metres"
        raise InputError(Fault(message, code="flying-height", key=f"processing.{what}", fix=fix))
    radius = settings.earth_radius
    return Bending(
        refraction_constant(flying, ground) if settings.refraction else 0.0,
        curvature_constant(flying, ground, radius) if radius is not None else 0.0,
    )


def _distorts(distortion: Distortion | None) -> TypeGuard[Distortion]:
    return distortion is not None and any((*distortion.k, *distortion.p, *distortion.b, *distortion.distortion))


def _corrected(image: Floats, camera: Camera, bending: Bending) -> tuple[Floats, dict[str, float]]:
    """Ideal points, and the largest shift in mm by each effect."""
    shifts = {}
    xy = image
    if any(camera.principal_point):
        xy = xy - np.array(camera.principal_point)
        shifts["principal point"] = float(np.hypot(*camera.principal_point))
    if camera.distortion is not None:
        ideal = ideal_from_image(xy, camera.distortion) if _distorts(camera.distortion) else xy
        shifts["distortion"] = _longest(ideal - xy)
        xy = ideal
    if bending.refraction:
        ideal = xy * (1 - bending.refraction * (1 + _slope(xy, camera.principal_distance)))
        shifts["refraction"] = _longest(ideal - xy)
        xy = ideal
    if bending.curvature:
        ideal = xy * (1 + bending.curvature * _slope(xy, camera.principal_distance))
        shifts["earth curvature"] = _longest(ideal - xy)
        xy = ideal
    return xy, shifts


def _longest(shifts: Floats) -> float:
    return float(np.hypot(shifts[..., 0], shifts[..., 1]).max(initial=0.0))


def _slope(xy: Floats, principal_distance: float) -> Floats:
    """Square of the tangent of the angle to the optical axis, shape (..., 1)."""
    return np.asarray((xy**2).sum(-1, keepdims=True) / principal_distance**2, np.float64)


def _stretched(ideal: Floats, principal_distance: float, constant: float, cubic: float) -> Floats:
    """Solve ``s (1 + a + b s^2 q) = 1`` for the stretch s of ideal points, q = r^2 / f^2, by Newton's iteration."""
    q = _slope(ideal, principal_distance)
    stretch = np.ones_like(q)
    for _ in range(ITERATIONS):
        misclosure = stretch * (1 + constant + cubic * stretch**2 * q) - 1
        step = misclosure / (1 + constant + 3 * cubic * stretch**2 * q)
        stretch = stretch - step
        if (np.abs(step) <= CONVERGED * stretch).all():
            break
    return np.asarray(ideal * stretch, np.float64)


def _refuse_distortion(
    observations: PhotoPoints, cameras: Mapping[str, Camera], rows_of: Mapping[str, Numbers]
) -> None:
    """Refuse distortion that folds the photo, and points beyond a distortion table."""
    faults = []
    for name, camera in cameras.items():
        if not _distorts(camera.distortion):
            continue
        rows = rows_of[name]
        radius = np.hypot(*(observations.xy[rows] - np.array(camera.principal_point)).T)
        found = distortion_faults(camera, float(radius.max(initial=0.0)))
        faults += found or _beyond(observations, camera, rows, radius)
    if faults:
        raise InputError(faults)


def _beyond(observations: PhotoPoints, camera: Camera, rows: Numbers, radius: Floats) -> list[Fault]:
    """Name the points beyond the last radius of a distortion table, the first ones one by one."""
    if camera.distortion is None:
        return []
    limit, _ = distortion_reach(camera.distortion)
    outside = np.flatnonzero(radius > limit + EDGE)
    key = f"cameras.{camera.name}.distortion.radius"
    fix = "continue the table to the corners of the format, or leave the point out"
    faults = []
    for i in outside[:SHOWN]:
        photo = observations.photo_ids[observations.photo[rows[i]]]
        point = observations.point_ids[observations.point[rows[i]]]
        message = f"photo {photo}, point {point}: {radius[i]:.3f} mm from the principal point, the distortion table of "
        message += f"camera {camera.name} ends at {limit:.3f} mm"
        faults.append(Fault(message, code="beyond-distortion-table", key=key, fix=fix))
    if len(outside) > SHOWN:
        message = f"{len(outside) - SHOWN} more points lie beyond the distortion table of camera {camera.name}"
        faults.append(Fault(message, code="beyond-distortion-table", key=key))
    return faults


def refraction_constant(flying_height: float, ground_height: float) -> float:
    """Constant K of atmospheric refraction of vertical photos in the standard atmosphere, without unit.

    The mean refractivity of the air between ground and camera minus that at the camera; heights above sea level.
    Positive, so that images lie too far outside. From n sin(theta) = constant in plane layers follows tan(alpha) =
    tan(theta) (1 - K / cos(theta)^2) for the direction theta at the camera and the straight line alpha to the ground.
    An ``InputError`` when the camera is not above the ground.

    Source: [Saastamoinen 1972], whose formula this is for heights to 11 km, with the factor 2335 rounded from 277 x
    8.4345, and with the layer above of the standard atmosphere, ICAO Doc 7488.
    """
    _require_above(flying_height, ground_height, "refraction")
    camera, ground = flying_height / 1000, ground_height / 1000
    fall = _pressure(ground) - _pressure(camera)
    density = _pressure(camera) / (1 - LAPSE * min(camera, TROPOPAUSE))  # over that at sea level
    return REFRACTIVITY * (SCALE_HEIGHT * fall / (camera - ground) - density)


def curvature_constant(flying_height: float, ground_height: float, radius: float) -> float:
    """Constant C of Earth curvature in image space: height above ground over the diameter of the Earth.

    A point of the plan at distance D lies D^2 / 2R below the plane, so that its image lies too far inside by dr = C r^3
    / f^2, which is added to the radius. An ``InputError`` when the camera is not above the ground.

    Source: [Kraus], influence of Earth curvature on a near-vertical photo.
    """
    _require_above(flying_height, ground_height, "earth_curvature")
    return (flying_height - ground_height) / (2 * radius)


def _require_above(flying_height: float, ground_height: float, what: str) -> None:
    if flying_height <= ground_height:
        message = f"{what}: the flying height {flying_height:g} m is not above the ground, {ground_height:g} m"
        raise InputError(
            Fault(message, code="flying-height", key="processing.flying_height", expected="heights in metres")
        )


def _pressure(height_km: float) -> float:
    """Pressure of the standard atmosphere over that at sea level; above 20 km little is left to be wrong."""
    if height_km <= TROPOPAUSE:
        return float((1 - LAPSE * height_km) ** PRESSURE_EXPONENT)
    return _pressure(TROPOPAUSE) * float(np.exp((TROPOPAUSE - height_km) / STRATOSPHERE_SCALE))
