"""Single steps of the method: the keys that can be set beside a table of points."""

from __future__ import annotations

from typing import Annotated

from photostrip.project.sections import (
    After,
    FirstSchema,
    Flag,
    Number,
    Pair,
    Positive,
    Section,
    Triple,
    Words,
    key,
    one_of,
)
from photostrip.strip.polynomial import POWERS


class StepKeys(Section):
    """A step that needs nothing but its table."""

    photostrip_step: FirstSchema = key("Number of this schema: 1")


class InteriorKeys(StepKeys):
    """The transformation of measured fiducial marks to calibrated ones, mm."""

    transform: Annotated[Words, After(one_of("conformal", "affine", "bilinear", "projective"))] = key(
        "From measured to photo coordinates: conformal, affine, bilinear, projective", "affine"
    )


class FocalKeys(StepKeys):
    """A step with photos of one camera."""

    principal_distance: Positive = key("Principal distance", unit="mm")


class RefineKeys(FocalKeys):
    """Photo coordinates reduced to the principal point, lens distortion and refraction corrected."""

    principal_point: Pair = key("Principal point", (0.0, 0.0), unit="mm")
    k: Triple = key("Radial distortion k1, k2, k3, from image to ideal coordinates", (0.0, 0.0, 0.0))
    flying_height: Number | None = key("Above sea level; corrects refraction", None, unit="m")
    ground_height: Number = key("Of the terrain, above sea level", 0.0, unit="m")


class RelativeKeys(FocalKeys):
    """Two photos oriented relative to each other, and their model."""

    base: Positive = key("Length of the first base", 100.0, unit="unit")
    unit: Words = key("What model coordinates are in", "mm")


class IntersectionKeys(FocalKeys):
    """The rays of two photos of known orientation."""

    base: Triple = key("From the left to the right perspective centre", unit="unit")
    left: Triple = key("Omega, phi, kappa of the left photo", (0.0, 0.0, 0.0), unit="deg")
    right: Triple = key("Omega, phi, kappa of the right photo", (0.0, 0.0, 0.0), unit="deg")
    unit: Words = key("What coordinates are in", "m")
    left_ray: Flag = key("Y of the left ray, as printed, instead of the mean of both", False)  # noqa: FBT003


class StripKeys(RelativeKeys):
    """A strip formed from photos alone."""

    scale_transfer: Annotated[Words, After(one_of("least_squares", "distances"))] = key(
        "Weights of the pass points: least_squares or distances", "least_squares"
    )


class AbsoluteKeys(StepKeys):
    """A model fitted to known points."""

    unit: Words = key("What ground coordinates are in", "m")


class PolynomialKeys(AbsoluteKeys):
    """The deformation of a strip along one axis."""

    terms: list[Annotated[Words, After(one_of(*POWERS))]] = key(f"Of {', '.join(POWERS)}", ["1", "X", "Y"])


class ResectionKeys(FocalKeys):
    """One photo oriented on known points."""

    sigma_um: Positive = key("Standard deviation of an image coordinate", 5.0, unit="um")
    unit: Words = key("What ground coordinates are in", "m")


class BundleKeys(ResectionKeys):
    """All photos and points adjusted at once."""

    base: Positive = key("Length of the first base, without control", 100.0, unit="unit")
    control: Words | None = key("Table of given points: point, x_ground, y_ground, z_ground", None)
    control_sigma: Positive = key("Standard deviation of a given coordinate", 0.05, unit="unit")
