"""The steps of the method one by one, with arrays: what a run does in one walk.

Image coordinates are millimetres, x to the right and y up, reduced to the principal point but in ``interior`` and
``refine``; the principal distance is in millimetres, angles in radians. Models have the unit of the base that is given;
ground coordinates are Cartesian, metres: tangent plane, geocentric, or a map where its curvature does not matter.
Rotations take image axes, or those of a model, to the axes named beside them. ``from_angles`` makes them of angles in a
system, as ``"alpha-omega-kappa"``, ``angles`` gives these back.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.camera import Camera, Distortion
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.ground_frame import WGS84
from photostrip.geodesy.local_frame import (
    EARTH_RADIUS,
    Ellipsoid,
    IntermediateFrame,
    curvature_correction,
    geocentric_from_geodetic,
    mean_position,
)
from photostrip.geometry import plane
from photostrip.geometry.rotation import angles, from_alpha_omega_kappa, from_angles
from photostrip.geometry.similarity import PairScales, Similarity, collinearity
from photostrip.geometry.similarity import pair_scales as distances
from photostrip.network.adjustment import IterationStep, solve
from photostrip.network.problem import BundleCameras, BundleProblem, ControlObservations, ImageObservations, StartValues
from photostrip.network.reliability import cofactors_of
from photostrip.planning.closed_form import coefficients, control_sums
from photostrip.planning.deformation import Paraboloid, fit_paraboloid
from photostrip.points import PhotoPoints
from photostrip.strip.corrections import Bending, refraction_constant, undistort
from photostrip.strip.formed_strip import (
    FirstPhoto,
    Intersection,
    StripFormationSettings,
    form_from_pairs,
    hand_on_rotations,
    intersect,
)
from photostrip.strip.polynomial import POWERS, term_columns
from photostrip.strip.relative_orientation import MINIMUM_POINTS, Pairs, collect_pairs, orient_pairs
from photostrip.strip.resection import OrientedPhoto, space_resection

__all__ = [
    "Absolute",
    "Bundle",
    "Camera",
    "ClosedForm",
    "Distortion",
    "Frame",
    "Interior",
    "Intersection",
    "OrientedPhoto",
    "PairScales",
    "Paraboloid",
    "Relative",
    "Strip",
    "absolute",
    "angles",
    "bundle",
    "chain",
    "closed_form",
    "curvature",
    "deformation",
    "frame",
    "from_angles",
    "interior",
    "intersection",
    "pair_scales",
    "polynomial",
    "refine",
    "relative",
    "resection",
    "scale_transfer",
    "strip",
]

Rays = tuple[ArrayLike, ArrayLike, ArrayLike]  # photo (n,) and point (n,) as numbers from 0, coordinates (n, 2)
Names = tuple[Sequence[str], Sequence[str]]  # of photos and points

ON_A_LINE = 1e-6  # ratio of the spreads of points that lie on one line


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
    source, target = _array(measured, 2), _array(calibrated, 2)
    _same(source, target)
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
    return undistort(_array(xy, 2), camera, Bending(refraction=refraction))


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
    one, other = _array(left, 2), _array(right, 2)
    _same(one, other)
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
    for xy, rotation in zip((_array(left, 2), _array(right, 2)), rotations, strict=True):
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


def scale_transfer(first: ArrayLike, second: ArrayLike, weights: ArrayLike | None = None) -> tuple[float, Floats]:
    """Bring the second of two models to the scale of the first.

    first, second: (n, 3), common points in each model, from the perspective centre of the photo that both share.
    weights: (n,), of the points.
    Returns the factor that the second model is multiplied by, the weighted mean over the points, and what each point
        departs from it, as a part of it (n,).
    Raises InputError where weights are negative or all zero.

    Source: [001] eq. 139-141.
    """
    one, other = _array(first, 3), _array(second, 3)
    _same(one, other)
    weight = _weights(weights, len(one))
    before, after = np.linalg.norm(one, axis=1), np.linalg.norm(other, axis=1)
    if not (before.all() and after.all()):
        raise InputError("a point lies in the perspective centre: it has no ratio of distances")
    ratios = before / after
    factor = float(weight @ ratios / weight.sum())
    return factor, ratios / factor - 1


def pair_scales(model: ArrayLike, ground: ArrayLike) -> PairScales:
    """Compare the distances of all pairs of points (n, 3) in a model and on the ground (n, 3).

    Returns the rows of each pair, both distances, and as ``mean`` the scale r, sum of D_G over sum of D.

    Source: [001] eq. 147, 148.
    """
    source, target = _array(model, 3), _array(ground, 3)
    _same(source, target)
    if len(source) < 2:
        raise InputError("two points are needed, to have a distance")
    found = distances(source, target)
    if not found.source.all():
        raise InputError("two points lie at one place in the model: they have no ratio of distances")
    return found


@dataclass(frozen=True, eq=False)
class Frame:
    """Points in an intermediate frame at their middle, and the frame itself."""

    frame: IntermediateFrame  # origin, axes M, azimuth; ``cartesian_from_intermediate`` is the way back, eq. 152
    geocentric: Floats  # (n, 3), metres
    points: Floats  # (n, 3): X in the azimuth, Y to the left of it, Z up, metres


def frame(geodetic: ArrayLike, *, azimuth: float = 0.0, ellipsoid: Ellipsoid = WGS84) -> Frame:
    """Take geodetic coordinates (n, 3), longitude and latitude in radians and height, into the frame at their middle.

    azimuth: of the X axis, clockwise from north, radians.
    ellipsoid: semi-axes a and b, metres.

    Source: [001] eq. 142-144.
    """
    given = _array(geodetic, 3)
    if (np.abs(given[:, :2]) > [2 * np.pi, np.pi / 2]).any():
        raise InputError(
            "latitudes lie between -90 and 90 degrees, longitudes between -360 and 360: are they exchanged?"
        )
    cartesian = geocentric_from_geodetic(given, ellipsoid)
    lat, lon, _ = mean_position(given[:, 1], given[:, 0], given[:, 2])
    found = IntermediateFrame.at_centre(cartesian, lat, lon, azimuth)
    return Frame(found, cartesian, found.intermediate_from_cartesian(cartesian))


def curvature(xyz: ArrayLike, *, radius: float = EARTH_RADIUS, origin: ArrayLike | None = None) -> Floats:
    """Fall of the Earth below the tangent plane (n,) at plane coordinates (n, 3), D^2 / 2R: what heights exceed z by.

    radius: of the Earth, metres.
    origin: (2,) or (3,), where the plane touches; default: the middle of the points.

    Source: [001] eq. 153.
    """
    points = _array(xyz, 3)
    middle = points.mean(axis=0) if origin is None else np.asarray(origin, float)
    return curvature_correction(np.hypot(*(points[:, :2] - middle[:2]).T), radius)


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """Errors of points of an oriented model on level ground per error of each element of relative orientation."""

    sums: Floats  # (15,): c1 to c15 over the control
    coefficients: Floats  # (q, 3, 4): of x, y, height per dbz, dkappa, dalpha, domega


def closed_form(
    points: ArrayLike, control: ArrayLike, principal_distance: float, base: float, *, as_printed: bool = False
) -> ClosedForm:
    """Errors of points in closed form.

    points, control: (q, 2), (n, 2), x and y from the left nadir, mm at photo scale; control is given in full.
    principal_distance, base: the depth of the ground and the base at photo scale, mm.
    as_printed: with the misprints of the source.

    Source: [000] eq. 9-11.
    """
    xy, known = _array(points, 2), _array(control, 2)
    sums = control_sums(known)
    if len(known) < 3 or sums[0] * sums[1] - sums[2] ** 2 <= ON_A_LINE * sums[0] * sums[1]:
        message = "control on one line, or fewer than three points: the tilt about it is not determined"
        raise GeometryError(message, code="control-deficient")
    found = coefficients(xy, known, base, principal_distance, printed=as_printed)
    return ClosedForm(sums, found)


def deformation(xy: ArrayLike, dz: ArrayLike, *, sigma: float = 1.0) -> Paraboloid:
    """Fit the surface dZ = E0 + A x + B y + C x y + D x^2 that twist C and bending D make of the heights of a model.

    xy, dz: (n, 2), x along the base; (n,), heights of the model minus given ones.
    sigma: standard deviation of dz, in its unit; with a redundancy of three or more that of the residuals counts.
    Raises GeometryError where the points do not determine the surface.

    Source: [003] eq. 10.12.
    """
    place, heights = _array(xy, 2), np.asarray(dz, float)
    _same(place, heights)
    return fit_paraboloid(place, heights, np.full(len(heights), sigma))


def resection(xy: ArrayLike, ground: ArrayLike, principal_distance: float, *, sigma: float = 0.005) -> OrientedPhoto:
    """Orient one photo on known points, at any attitude and without approximate values.

    xy, ground: (n, 2) image coordinates and (n, 3) their points.
    sigma: standard deviation of an image coordinate, mm.
    Returns centre, rotation (photo to ground), their covariance, and residuals (n, 2).
    Raises GeometryError with fewer than four points, with points on one line, or where no orientation fits.
    """
    image, points = _array(xy, 2), _array(ground, 3)
    _same(image, points)
    return space_resection(image, np.full(image.shape, sigma), points, principal_distance)


@dataclass(frozen=True, eq=False)
class Strip:
    """A strip in model coordinates: the frame of its first photo."""

    centers: Floats  # (p, 3): perspective centres, in the unit of the base
    rotations: Floats  # (p, 3, 3): photos to the frame of the first
    points: Floats  # (q, 3): means over the models that hold the point; NaN for a point of no model
    models: Numbers  # (q,): number of those models
    factors: Floats  # (p - 1,): scale factor k of each model; 1 for the first
    sigma0: Floats  # (p - 1,): standard deviation of an image coordinate by pair, mm; NaN without redundancy


def strip(
    rays: Rays,
    principal_distance: float,
    *,
    base: float = 1.0,
    scale_transfer: Literal["least_squares", "distances"] = "least_squares",
    names: Names | None = None,
) -> Strip:
    """Form a strip from its photos alone: pairs, chain, intersection, scale transfer, without any search for errors.

    rays: photo (n,) in flight order and point (n,) as numbers from 0, and image coordinates (n, 2).
    base: length of the first base, in the unit that the strip shall have.
    scale_transfer: the weights of the pass points.
    names: of photos and points, for messages; without them their numbers.
    Raises GeometryError with one photo, or where a pair or a junction has too few common points or no solution.

    Source: [001] eq. 125-141.
    """
    photo, point, xy = of_rays(rays)
    photos, ids = (tuple(map(str, each)) for each in names or _counted(photo, point))
    if len(photos) < 2:
        raise GeometryError("a strip needs two photos", code="too-few-common-points")
    measured = PhotoPoints(
        photo_ids=photos, point_ids=ids, photo=photo, point=point, xy=xy, sigma=np.full(xy.shape, 1.0)
    )
    oriented = orient_pairs(collect_pairs(measured, photos, principal_distance), photos)
    settings, first = StripFormationSettings(scale_transfer=scale_transfer), FirstPhoto(np.eye(3), base)
    formed = form_from_pairs(oriented, settings, photos, first=first)
    points, models = np.full((len(ids), 3), np.nan), np.zeros(len(ids), np.intp)
    points[formed.point], models[formed.point] = formed.xyz, formed.model_count
    return Strip(
        centers=formed.centers,
        rotations=formed.rotations,
        points=points,
        models=models,
        factors=formed.scale_factor,
        sigma0=oriented.sigma0,
    )


@dataclass(frozen=True, eq=False)
class Absolute:
    """The similarity from a model to the ground, and how well it fits."""

    similarity: Similarity  # to be called with model coordinates (n, 3)
    residuals: Floats  # (n, 3): transformed minus given, metres
    sigma0: float  # standard deviation of a coordinate, metres; NaN without redundancy
    redundancy: int


def absolute(model: ArrayLike, ground: ArrayLike, weights: ArrayLike | None = None) -> Absolute:
    """Absolute orientation of a model (n, 3) on points known in all three coordinates (n, 3), by seven parameters.

    weights: (n,), of the points.
    Raises GeometryError with fewer than three points, or with all on one line.

    Source: [001] eq. 145-149.
    """
    source, target = _array(model, 3), _array(ground, 3)
    _same(source, target)
    weight = _weights(weights, len(source))
    if collinearity(source[weight > 0]) < ON_A_LINE**2:
        message = "fewer than three points, or all on one line: the rotation about it is not determined"
        raise GeometryError(message, code="control-deficient")
    found = Similarity.from_points(source, target, weight)
    residuals = found.residuals(source, target)
    redundancy = 3 * int(np.count_nonzero(weight)) - 7
    squares = residuals * np.sqrt(weight)[:, None]
    return Absolute(found, residuals, sigma0=sigma0_of(squares, redundancy), redundancy=redundancy)


def polynomial(xyz: ArrayLike, misclosures: ArrayLike, terms: Sequence[str]) -> tuple[Floats, Floats]:
    """Fit the deformation of a strip along one axis by a polynomial.

    xyz: (n, 3), control points in the intermediate frame.
    misclosures: (n,), strip minus given along the axis.
    terms: as the report names them: ``"1"``, ``"X"``, ``"Y"``, ``"XY"``, ``"X^2"``.
    Returns coefficients, one for each term, and residuals (n,). Subtract the polynomial from the strip.
    Raises GeometryError where there are fewer points than terms, or they do not determine them.

    Source: [001] eq. 151.
    """
    if unknown := [each for each in terms if each not in POWERS] or ([] if terms else [""]):
        raise InputError(f"there is no term {unknown[0]!r}: {', '.join(POWERS)}")
    design = term_columns(_array(xyz, 3), list(terms))
    size = np.linalg.norm(design, axis=0)
    values = _array(np.reshape(misclosures, (-1, 1)), 1)[:, 0]
    _same(design, values)
    if len(design) < design.shape[1] or np.linalg.matrix_rank(design / np.where(size > 0, size, 1)) < design.shape[1]:
        raise GeometryError(f"{len(design)} points do not determine {len(terms)} terms", code="control-deficient")
    found = np.linalg.lstsq(design / size, values, rcond=None)[0] / size
    return found, values - design @ found


@dataclass(frozen=True, eq=False)
class Bundle:
    """Photos and points adjusted together."""

    centers: Floats  # (p, 3): perspective centres
    rotations: Floats  # (p, 3, 3): photos to the frame of the points
    points: Floats  # (q, 3); NaN for a point that takes no part, as in the next two
    residuals: Floats  # (n, 2): measured minus computed image coordinates, mm
    sigmas: Floats  # (q, 3): standard deviations of the points, for the stated ones of the measurements
    sigma0: float  # standard deviation of unit weight; NaN without redundancy
    redundancy: int
    steps: tuple[IterationStep, ...]

    @property
    def iterations(self) -> int:
        return len(self.steps)


def bundle(
    rays: Rays,
    principal_distance: float,
    start: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    *,
    ground: ArrayLike | None = None,
    base: float = 1.0,
    sigma: float = 0.005,
    ground_sigma: float = 0.05,
    names: Names | None = None,
) -> Bundle:
    """Adjust all photos and points at once, without any search for errors.

    rays: photo (n,) and point (n,) as numbers from 0, and image coordinates (n, 2).
    start: approximate centres (p, 3), rotations (p, 3, 3) and points (q, 3), NaN for a point to be left out; without
        them what ``strip`` forms of the rays, with its first `base`, put on the ground by ``absolute``.
    ground: (q, 3), given coordinates; NaN where none is given. Without any the network is free: it stays as near to the
        points of the start as its shape lets it.
    sigma, ground_sigma: standard deviations of an image coordinate, mm, and of a given one.
    names: of photos and points, for messages; without them their numbers.
    Raises GeometryError where the rays and given coordinates do not determine the photos and points.
    """
    photo, point, xy = of_rays(rays)
    given = None if ground is None else _array(ground, 3, gaps=True)
    begun = start or _formed(rays, principal_distance, base, given, names)
    centers, rotations, points = _array(begun[0], 3), np.asarray(begun[1], float), _array(begun[2], 3, gaps=True)
    if given is None:
        given = np.full(points.shape, np.nan)
    _same(points, given)
    if not (np.isin(photo, np.arange(len(centers))).all() and np.isin(point, np.arange(len(points))).all()):
        raise InputError("a ray has a photo or a point that the start does not have")
    placed, known = np.isfinite(points.sum(axis=1)), np.isfinite(given)
    listed, number, seen = np.flatnonzero(known.any(axis=1) & placed), np.cumsum(placed) - 1, placed[point]
    origin = points[placed].mean(axis=0)
    photo_ids, point_ids = names or ((), ())
    problem = BundleProblem(
        images=ImageObservations(
            photo=photo[seen], point=number[point[seen]], xy=xy[seen], sigma=np.full(xy[seen].shape, sigma)
        ),
        cameras=BundleCameras(of_photo=np.zeros(len(centers), np.intp), focal=np.array([principal_distance])),
        start=StartValues(
            centers=centers - origin, rotations=rotations.reshape(-1, 3, 3), points=points[placed] - origin
        ),
        control=ControlObservations(
            point=number[listed],
            xyz=np.where(known, given, points)[listed] - origin,
            axes=np.broadcast_to(np.eye(3), (len(listed), 3, 3)),
            sigma=np.where(known, ground_sigma, np.inf)[listed],
        ),
        photo_ids=tuple(photo_ids),
        point_ids=tuple(compress(point_ids, placed)),
    )
    found = solve(problem)
    return Bundle(
        centers=found.centers + origin,
        rotations=found.rotations,
        points=_spread(found.points + origin, placed),
        residuals=_spread(found.image_residuals, seen),
        sigmas=_spread(np.sqrt(cofactors_of(found).points.diagonal(axis1=1, axis2=2)), placed),
        sigma0=found.sigma0,
        redundancy=found.redundancy,
        steps=found.steps,
    )


def _formed(
    rays: Rays, principal_distance: float, base: float, ground: Floats | None, names: Names | None
) -> tuple[Floats, Floats, Floats]:
    """Return the strip of the rays as approximate values, on the ground where points of it are given."""
    formed = strip(rays, principal_distance, base=base, names=names)
    if ground is None:
        return formed.centers, formed.rotations, formed.points
    _same(formed.points, ground)
    known = np.isfinite(ground).all(axis=1) & (formed.models > 0)
    to_ground = absolute(formed.points[known], ground[known]).similarity
    return to_ground(formed.centers), to_ground.rotation @ formed.rotations, to_ground(formed.points)


def _counted(*numbers: Numbers) -> Iterator[range]:
    return (range(int(each.max(initial=-1)) + 1) for each in numbers)


def _spread(values: Floats, taken: Flags) -> Floats:
    """Put values to the rows that took part; NaN to the others."""
    found = np.full((len(taken), values.shape[1]), np.nan)
    found[taken] = values
    return found


def _array(values: ArrayLike, width: int, *, gaps: bool = False) -> Floats:
    """Return coordinates as an array (n, width), or refuse them; `gaps` lets NaN pass."""
    found = np.asarray(values, float)
    if found.ndim != 2 or found.shape[1] != width or not (gaps or np.isfinite(found).all()):
        raise InputError(f"an array of finite numbers with {width} columns is needed, not one of shape {found.shape}")
    return found


def _weights(weights: ArrayLike | None, count: int) -> Floats:
    """Return weights of points, 1 where none are given, or refuse them."""
    if weights is None:
        return np.ones(count)
    found = np.asarray(weights, float)
    if found.shape != (count,) or not (np.isfinite(found).all() and found.min(initial=0.0) >= 0.0 < found.sum()):
        raise InputError(f"{count} weights are needed, 0 or more and not all zero")
    return found


def _same(one: Floats, other: Floats | Numbers) -> None:
    if len(one) != len(other):
        raise InputError(f"{len(one)} and {len(other)} rows: each point needs a row in both")


def of_rays(rays: Rays) -> tuple[Numbers, Numbers, Floats]:
    """Return photo, point and image coordinates of rays as arrays."""
    photo, point = (np.asarray(each, np.intp) for each in rays[:2])
    xy = _array(rays[2], 2)
    _same(xy, photo)
    _same(xy, point)
    return photo, point, xy


def sigma0_of(residuals: Floats, redundancy: int) -> float:
    return float(np.sqrt((residuals**2).sum() / redundancy)) if redundancy > 0 else float("nan")
