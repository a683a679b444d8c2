"""Constants of atmospheric refraction, and of Earth curvature in image space, from the heights of camera and ground."""

from __future__ import annotations

import numpy as np

from photostrip.errors import Fault, InputError

# Standard atmosphere, ICAO Doc 7488 (ISO 2533): layers to 11 km and above.
LAPSE = 6.5 / 288.15  # relative fall of temperature per km
PRESSURE_EXPONENT = 5.25588  # of pressure; one less for density
TROPOPAUSE = 11.0  # km
STRATOSPHERE_SCALE = 6.341616  # km, height in which the pressure above the tropopause falls to 1/e
SCALE_HEIGHT = 8.43450  # km, pressure over density and gravity at sea level
# Refractivity of dry air at sea level in the standard atmosphere, visible light; Saastamoinen 1972.
REFRACTIVITY = 277e-6


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
