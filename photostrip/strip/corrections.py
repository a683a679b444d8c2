"""What is asked of the interior orientation and of the corrections of image coordinates.

Refinement: from photo coordinates to ideal image coordinates, as a pinhole in vacuum would have made them.

The order of the corrections, from the image to the ideal, is that in which light collects the errors, backwards:

1. principal point: coordinates are reduced to it;
2. lens distortion, ``lens_distortion``;
3. atmospheric refraction;
4. Earth curvature, only where the ground frame does not carry it and it is asked for in image space.

Film deformation is corrected before, by the interior orientation. ``distort`` goes the other way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera, Distortion
from photostrip.errors import Fault, InputError
from photostrip.points import PhotoPoints
from photostrip.strip import lens_distortion


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
        xy = lens_distortion.image_from_ideal(xy, camera.distortion)
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
        ideal = lens_distortion.ideal_from_image(xy, camera.distortion) if _distorts(camera.distortion) else xy
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
        found = lens_distortion.faults(camera, float(radius.max(initial=0.0)))
        faults += found or _beyond(observations, camera, rows, radius)
    if faults:
        raise InputError(faults)


def _beyond(observations: PhotoPoints, camera: Camera, rows: Numbers, radius: Floats) -> list[Fault]:
    """Name the points beyond the last radius of a distortion table, the first ones one by one."""
    if camera.distortion is None:
        return []
    limit, _ = lens_distortion.reach(camera.distortion)
    outside = np.flatnonzero(radius > limit + lens_distortion.EDGE)
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
