"""How precise points and photos of a strip of photos are: covariances from the image coordinates."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.pipeline.precision import check_points
from photostrip.pipeline.precision.strip_precision import StripPrecision
from photostrip.pipeline.results import StripResult
from photostrip.pipeline.strips.photos_on_control import OrientedPhotos
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.strip.error_propagation.fitted_strip import FittedStrip
from photostrip.strip.error_propagation.image_variance import image_variance
from photostrip.strip.error_propagation.photo_errors import PhotoErrors, differentiate_photos
from photostrip.strip.error_propagation.strip_errors import StripErrors

MOST_PHOTOS = 400  # of a strip fitted to its control: the work grows by the square of their number, to 1 s


def of_photos(
    strip: StripResult,
    on_control: OrientedPhotos,
    observations: PhotoPoints,
    given: ControlPoints,
    *,
    of_checks: bool,
) -> StripPrecision:
    """Covariances of one strip of photos, or ``of_checks`` alone.

    on_control: the same strip before its deformation was corrected.
    observations: ideal image coordinates of the project.
    given: all given points; the check points among them are compared with what is found.
    """
    checks = check_points.check_points(strip, given, observations)
    compared = check_points.compare_with_checks(strip, checks.spread(), on_control.oriented.frames)
    points = np.full((len(strip.xyz), 3, 3), np.nan)
    photos = np.full((len(strip.strip.photos), 6, 6), np.nan)
    stated = strip.of_photos.sigma
    factor, basis = image_variance(strip.of_photos.orientation, stated)
    found = fitted(strip, on_control, factor)
    if of_checks:
        points[checks.rows] = found.covariances_of_points(checks.rows)
    else:
        points = found.covariances_of_points(np.arange(len(points)))
        solved = np.flatnonzero(strip.of_photos.resection.solved)
        by_photo = photo_errors(strip, on_control.errors, observations)
        photos[solved] = found.covariances_of_photos(by_photo, solved)
    axes, fit = strip.intermediate.axes, found.fit
    return StripPrecision(
        points=axes @ points @ axes.T,
        photos=_turned(strip, photos),
        by_control=lambda rows, columns: axes @ fit.influence(found.xyz[rows]) @ fit.operator[:, columns],
        control=_control_of(strip, found.control.point, found.control.axis),
        variance=found.control.variance,
        sigma=stated * float(np.sqrt(factor)),
        basis=basis,
        check=None if compared is None else check_points.by_fit(found, compared),
    )


def too_long(strip: StripResult) -> bool:
    """Whether a strip was fitted to its control that has too many photos for the covariances of all its points."""
    stages = strip.photo_stages
    return stages is not None and len(stages.strip.photos) > MOST_PHOTOS


def _control_of(strip: StripResult, point: Numbers, axis: Numbers) -> Numbers:
    return np.column_stack([strip.formed.point[strip.control_rows][point], axis])


def _turned(strip: StripResult, photos: Floats) -> Floats:
    """Covariances of photos from the intermediate to the Cartesian frame."""
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = strip.intermediate.axes
    return turn @ photos @ turn.T


def fitted(strip: StripResult, on_control: OrientedPhotos, factor: float) -> FittedStrip:
    """Carry the errors of a strip over the fit to its control, before which it was ``on_control``."""
    terms = [axis.terms for axis in strip.polynomial.axes] if strip.polynomial else [(), (), ()]
    oriented = on_control.oriented
    return FittedStrip(
        errors=on_control.errors,
        control=oriented.misclosures,
        fit=on_control.fit(terms),
        xyz=oriented.xyz,
        factor=factor,
    )


def photo_errors(strip: StripResult, errors: StripErrors, observations: PhotoPoints) -> PhotoErrors:
    """Differentiate the orientation of the photos on their adjusted points."""
    rows = strip.of_photos.rows
    photo = strip.of_photos.strip.positions(observations)[rows]
    point = np.searchsorted(strip.formed.point, observations.point[rows])
    return differentiate_photos(errors, strip.of_photos.resection, strip.xyz, photo, point, rows)
