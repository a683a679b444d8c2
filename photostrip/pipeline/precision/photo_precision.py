"""How precise points and photos of a strip of photos are: covariances from the image coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, pieces
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.pipeline.precision import check_points
from photostrip.pipeline.precision.check_points import CheckPoints, Propagation
from photostrip.pipeline.precision.strip_precision import StripPrecision
from photostrip.pipeline.results import StripResult
from photostrip.pipeline.strips.absolute import OrientedStrip
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.triangulation.error_propagation import control_errors, covariances, photo_errors
from photostrip.triangulation.error_propagation.strip_errors import StripErrors

if TYPE_CHECKING:
    from photostrip.triangulation.covariance_adjustment.adjust import CovarianceAdjustment


def of_photos(
    strip: StripResult,
    oriented: OrientedStrip[StripErrors],
    observations: PhotoPoints,
    given: ControlPoints,
    *,
    of_checks: bool,
) -> StripPrecision:
    """Covariances of one strip of photos, or ``of_checks`` alone.

    oriented: the same strip before its deformation was corrected.
    observations: ideal image coordinates of the project.
    given: all given points; the check points among them are compared with what is found.
    """
    checks = check_points.check_points(strip, given, observations)
    if strip.of_photos.solved is not None:
        return _of_covariance(strip, strip.of_photos.solved, checks, oriented.frames, of_checks=of_checks)
    found = propagation(strip, oriented, observations)
    errors, fit, xyz, control, operator = found.errors, found.fit, found.xyz, found.control, found.fit.operator
    stated = strip.of_photos.sigma
    factor, basis = covariances.image_variance(strip.of_photos.orientation, stated)
    parameters = covariances.of_parameters(errors, found.control, operator, factor)
    compared = check_points.compare_with_checks(strip, errors, checks.spread(), oriented.frames)
    wanted = checks.rows if of_checks else None
    del checks  # of tens of thousands a hundred are compared
    check = None if compared is None else check_points.by_fit(found, compared, parameters, factor)
    photos = np.full((len(strip.strip.photos), 6, 6), np.nan)
    for some in () if wanted is not None else found.photos():
        of_some = covariances.covariances(errors, some.rows, parameters, some.influence.__getitem__)
        photos[some.photos] = of_some * factor
    del found  # with the rays of all photos: the largest table comes last, when what the others take is free again
    table, at = (errors.points, xyz) if wanted is None else (errors.points.take(wanted), xyz[wanted])
    points = covariances.covariances(errors, table, parameters, lambda rows: fit.influence(at[rows]))
    points *= factor
    if wanted is not None:
        of_checked, points = points, np.full((len(xyz), 3, 3), np.nan)
        points[wanted] = of_checked
    axes = strip.intermediate.axes
    return StripPrecision(
        points=_points_turned(axes, points),
        photos=_turned(strip, photos),
        by_control=lambda rows, columns: axes @ fit.influence(xyz[rows]) @ operator[:, columns],
        control=np.column_stack([strip.formed.point[strip.control_rows][control.point], control.axis]),
        variance=control.variance,
        sigma=stated * float(np.sqrt(factor)),
        basis=basis,
        check=check,
    )


def _of_covariance(
    strip: StripResult,
    adjusted: CovarianceAdjustment,
    checks: CheckPoints,
    frames: Sequence[GroundFrame],
    *,
    of_checks: bool,
) -> StripPrecision:
    """Covariances from the system that the adjustment with the strip's own covariance has solved."""
    compared = check_points.compare_with_checks(strip, adjusted.system.errors, checks.spread(), frames)
    control, axes = adjusted.figures.control, strip.intermediate.axes
    if of_checks:
        points, photos = np.full((len(strip.xyz), 3, 3), np.nan), np.full((len(strip.strip.photos), 6, 6), np.nan)
        if compared is not None:
            points[checks.rows] = adjusted.of_points(checks.rows)
    else:
        points, photos = adjusted.points, adjusted.photos
    return StripPrecision(
        points=_points_turned(axes, points),
        photos=_turned(strip, photos),
        by_control=lambda rows, columns: np.asarray(axes @ adjusted.by_control(rows, columns), float),
        control=np.column_stack([strip.formed.point[strip.control_rows][control.point], control.axis]),
        variance=control.variance,
        sigma=adjusted.figures.sigma,
        basis=adjusted.figures.basis,
        check=None if compared is None else check_points.by_covariance(adjusted, compared),
    )


def _points_turned(axes: Floats, points: Floats) -> Floats:
    """Turn covariances of points to other axes, in place and piece by piece: all at once take twice as much again."""
    for piece in pieces(len(points)):
        points[piece] = axes @ points[piece] @ axes.T
    return points


def _turned(strip: StripResult, photos: Floats) -> Floats:
    """Covariances of photos from the intermediate to the Cartesian frame."""
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = strip.intermediate.axes
    return turn @ photos @ turn.T


def propagation(strip: StripResult, oriented: OrientedStrip[StripErrors], observations: PhotoPoints) -> Propagation:
    """Differentiate the strip method for one strip; `oriented` is the strip before its deformation was corrected."""
    errors, found = oriented.errors, oriented.misclosures
    terms = [axis.terms for axis in strip.polynomial.axes] if strip.polynomial else [(), (), ()]
    fit = control_errors.fit_operator(found, oriented.weights, oriented.at_control, terms, errors.origin)
    rows, flown = strip.of_photos.rows, strip.of_photos.strip
    sightings = photo_errors.UsedRays(
        photo=flown.positions(observations)[rows],
        image=rows,
        numbers=observations.point,
        known=strip.formed.point,
        points=strip.xyz,
        focal=flown.camera.principal_distance,
    )
    return Propagation(
        errors=errors,
        control=found,
        fit=fit,
        xyz=oriented.xyz,
        sightings=sightings,
        resection=strip.of_photos.resection,
    )
