"""The steps of the method one by one, with arrays: what a run does in one walk.

Image coordinates are millimetres, x to the right and y up, reduced to the principal point but in ``interior`` and
``refine``; the principal distance is in millimetres, angles in radians. Models have the unit of the base that is given;
ground coordinates are Cartesian, metres: tangent plane, geocentric, or a map where its curvature does not matter.
Rotations take image axes, or those of a model, to the axes named beside them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.camera import Camera, Distortion
from photostrip.errors import GeometryError, InputError
from photostrip.geometry import plane
from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.library.step_arguments import rows, same, sigma0_of
from photostrip.library.steps_of_strips import Absolute, Bundle, Strip, absolute, bundle, polynomial, strip
from photostrip.strip.corrections import Bending, refraction_constant, undistort
from photostrip.strip.formed_strip import Intersection, hand_on_rotations, intersect
from photostrip.strip.relative_orientation import MINIMUM_POINTS, Pairs, orient_pairs
from photostrip.strip.resection import OrientedPhoto, space_resection

__all__ = [
    "Absolute",
    "Bundle",
    "Camera",
    "Distortion",
    "Interior",
    "Intersection",
    "OrientedPhoto",
    "Relative",
    "Strip",
    "absolute",
    "bundle",
    "chain",
    "interior",
    "intersection",
    "polynomial",
    "refine",
    "relative",
    "resection",
    "scale_transfer",
    "strip",
]


@dataclass(frozen=True, eq=False)
class Interior:
    """Measured coordinates to photo coordinates, and how well the marks fit."""

    transform: plane.PlaneTransform  # to be called with measured coordinates (n, 2)
    residuals: Floats  # (n, 2): transformed minus calibrated coordinates of the marks, mm
    sigma0: float  # standard deviation of a coordinate of a mark, mm; NaN without redundancy
    redundancy: int


def interior(
    measured: ArrayLike,
    calibrated: ArrayLike,
    kind: Literal["conformal", "affine", "bilinear", "projective"] = "affine",
) -> Interior:
    """Interior orientation: the transformation of measured fiducial marks (n, 2) to calibrated ones (n, 2), mm.

    Raises GeometryError where the marks do not determine the transformation.
    """
    source, target = rows(measured, 2), rows(calibrated, 2)
    same(source, target)
    if kind not in plane.KINDS:
        raise InputError(f"there is no transformation {kind!r}: {', '.join(plane.KINDS)}")
    fitted = plane.KINDS[kind].fit(source, target, np.ones(len(source)))
    residuals = fitted.residuals(source, target)
    redundancy = 2 * len(source) - plane.KINDS[kind].unknowns
    return Interior(fitted, residuals, sigma0=sigma0_of(residuals, redundancy), redundancy=redundancy)


def refine(xy: ArrayLike, camera: Camera, *, flying_height: float | None = None, ground_height: float = 0.0) -> Floats:
    """Refine photo coordinates (n, 2): principal point, lens distortion, with heights in metres refraction, too.

    camera: ``steps.Camera(name="film", principal_distance=153.0, principal_point=(0.01, 0.02))``, its ``distortion`` a
        ``steps.Distortion``.
    Returns ideal image coordinates, reduced to the principal point, shape (n, 2).
    """
    refraction = 0.0 if flying_height is None else refraction_constant(flying_height, ground_height)
    return undistort(rows(xy, 2), camera, Bending(refraction=refraction))


@dataclass(frozen=True, eq=False)
class Relative:
    """Relative orientation of two photos, and the model that they form."""

    elements: Floats  # (5,): alpha1, kappa1, alpha2, omega2, kappa2 relative to the base, radians
    sigmas: Floats  # (5,): their standard deviations; NaN without redundancy
    sigma0: float  # standard deviation of an image coordinate, mm; NaN without redundancy
    parallax: Floats  # (n,): residual y parallaxes, mm
    base: Floats  # (3,): direction of the base in the system of the left photo, a unit vector: bx, by, bz
    rotation: Floats  # (3, 3): right photo to the system of the left photo
    model: Floats  # (n, 3): points in the base frame (X along the base), in the unit of the base; NaN behind a camera
    iterations: int


def relative(
    left: ArrayLike, right: ArrayLike, principal_distance: float, *, base: float = 1.0, weights: ArrayLike | None = None
) -> Relative:
    """Relative orientation of two photos by their y parallaxes, without approximate values and any search for errors.

    left, right: (n, 2), the same points on both photos.
    base: length of the base, in the unit that the model shall have.
    weights: (n,), of the y parallaxes; 0 leaves a point out.
    Raises GeometryError with fewer than five points, or where they do not determine the elements.

    Source: [001] eq. 131-137.
    """
    one, other = rows(left, 2), rows(right, 2)
    same(one, other)
    pair = one_pair(one, other, principal_distance, None if weights is None else np.asarray(weights, float))
    if np.count_nonzero(pair.weight) < MINIMUM_POINTS:
        message = f"{np.count_nonzero(pair.weight)} common points cannot orient a pair; five are needed"
        raise GeometryError(message, code="too-few-common-points")
    found = orient_pairs(pair, ("left", "right"))
    alpha1, kappa1, alpha2, omega2, kappa2 = found.elements[0]
    rotations = (from_alpha_omega_kappa(alpha1, 0.0, kappa1), from_alpha_omega_kappa(alpha2, omega2, kappa2))
    directions, turned = found.relative
    return Relative(
        elements=found.elements[0],
        sigmas=found.sigmas[0],
        sigma0=float(found.sigma0[0]),
        parallax=found.parallax,
        base=directions[0],
        rotation=turned[0],
        model=intersection(one, other, principal_distance, base=(base, 0.0, 0.0), rotations=rotations).xyz,
        iterations=int(found.iterations[0]),
    )


def one_pair(left: Floats, right: Floats, principal_distance: float, weights: Floats | None = None) -> Pairs:
    """Return the common points (n, 2) of two photos as the pair that relative orientation takes."""
    number = np.arange(len(left))
    return Pairs(
        starts=np.zeros(1, np.intp),
        pair=np.zeros(len(left), np.intp),
        left=left,
        right=right,
        weight=np.ones(len(left)) if weights is None else weights,
        focal=principal_distance,
        point=number,
        rows=np.column_stack([number, number]),
    )


def intersection(
    left: ArrayLike,
    right: ArrayLike,
    principal_distance: float,
    *,
    base: ArrayLike,
    rotations: tuple[ArrayLike, ArrayLike],
    left_ray: bool = False,
) -> Intersection:
    """Intersect the rays of two photos whose orientation is known.

    base: (3,), from the left to the right perspective centre.
    rotations: (3, 3) each, photo to the frame of the base.
    left_ray: Y of the left ray, as the textbook has it, instead of the mean of both.
    Returns coordinates relative to the left perspective centre, and the gap in Y between the rays. Where the base is
    nearer to Y than to X, these two are exchanged in all this.

    Source: [001] eq. 137, 138.
    """
    rays = []
    for xy, rotation in zip((rows(left, 2), rows(right, 2)), rotations, strict=True):
        rays.append(np.asarray(rotation, float) @ np.vstack([xy.T, np.full(len(xy), -principal_distance)]))
    return intersect(np.asarray(base, float), rays[0], rays[1], principal_distance, left_ray=left_ray)


def chain(rotations: ArrayLike, first: ArrayLike | None = None) -> Floats:
    """Hand the orientation on from photo to photo.

    rotations: (p, 3, 3), of each right photo in the system of its left one (``Relative.rotation``).
    first: (3, 3), rotation of the first photo; default: none.
    Returns rotations of all photos to the system of the first, or to that of `first`: (p + 1, 3, 3).

    Source: [001] eq. 131-134.
    """
    start = None if first is None else np.asarray(first, float)
    return hand_on_rotations(np.asarray(rotations, float).reshape(-1, 3, 3), start)


def scale_transfer(first: ArrayLike, second: ArrayLike) -> tuple[float, Floats]:
    """Bring the second of two models to the scale of the first.

    first, second: (n, 3), common points in each model, from the perspective centre of the photo that both share.
    Returns the factor that the second model is multiplied by, the mean over the points, and what each point departs
        from it, as a part of it (n,).

    Source: [001] eq. 139-141.
    """
    one, other = rows(first, 3), rows(second, 3)
    same(one, other)
    ratios = np.linalg.norm(one, axis=1) / np.linalg.norm(other, axis=1)
    factor = float(ratios.mean())
    return factor, ratios / factor - 1


def resection(xy: ArrayLike, ground: ArrayLike, principal_distance: float, *, sigma: float = 0.005) -> OrientedPhoto:
    """Orient one photo on known points, at any attitude and without approximate values.

    xy, ground: (n, 2) image coordinates and (n, 3) their points.
    sigma: standard deviation of an image coordinate, mm.
    Returns centre, rotation (photo to ground), their covariance, and residuals (n, 2).
    Raises GeometryError with fewer than four points, with points on one line, or where no orientation fits.
    """
    image, points = rows(xy, 2), rows(ground, 3)
    same(image, points)
    return space_resection(image, np.full(image.shape, sigma), points, principal_distance)
