"""Refinement of image coordinates: principal point, lens distortion, atmospheric refraction."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Which corrections beyond principal point and lens distortion are applied.

    Parameters
    ----------
    refraction : bool
        Correct for atmospheric refraction.
    flying_height, ground_height : float or None
        Mean heights of the perspective centers and of the ground above sea level, in metres; None: derived
        from camera and control.
    """

    refraction: bool = False
    flying_height: float | None = None
    ground_height: float | None = None
