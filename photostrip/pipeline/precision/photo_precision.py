"""How precise points and photos of a strip of photos are: covariances from the image coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.pipeline.precision import check_points
from photostrip.pipeline.precision.propagation import propagation
from photostrip.pipeline.precision.strip_precision import StripPrecision
from photostrip.triangulation.error_propagation import covariances

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Floats, Numbers
    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline.results import StripResult
    from photostrip.pipeline.strips.absolute import OrientedStrip
    from photostrip.points import ControlPoints, PhotoPoints
    from photostrip.triangulation.covariance_adjustment.adjust import CovarianceAdjustment
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors


def of_photos(
    strip: StripResult, oriented: OrientedStrip[StripErrors], observations: PhotoPoints, given: ControlPoints
) -> StripPrecision:
    """Covariances of one strip of photos.

    oriented: the same strip before its deformation was corrected.
    observations: ideal image coordinates of the project.
    given: all given points; the check points among them are compared with what is found.
    """
    frames = oriented.frames
    checks = check_points.check_points(strip, given, observations)
    if strip.of_photos.covariance is not None:
        return _of_covariance(strip, strip.of_photos.covariance, checks, frames)
    found = propagation(strip, oriented, observations)
    errors, operator = found.errors, found.fit.operator
    stated = strip.of_photos.sigma
    factor, basis = covariances.image_variance(strip.of_photos.orientation, stated)
    parameters = covariances.of_parameters(errors, found.control, operator, factor)
    points = covariances.covariances(errors, errors.points, parameters, found.influence) * factor
    photos = np.full((len(strip.strip.photos), 6, 6), np.nan)
    photos[found.oriented] = covariances.covariances(errors, found.photos, parameters, found.photo_influence) * factor
    numbers = strip.formed.point[strip.control_rows][found.control.point]
    turned = _turned(strip, points, photos)
    test = None
    if len(checks[1]):
        test = check_points.by_fit(found, check_points.given_at(strip, errors, checks, frames), checks[1], factor)
    return StripPrecision(
        points=turned[0],
        photos=turned[1],
        by_control=lambda rows, columns: strip.intermediate.axes @ found.influence[rows] @ operator[:, columns],
        control=np.column_stack([numbers, found.control.axis]),
        variance=found.control.variance,
        sigma=stated * float(np.sqrt(factor)),
        basis=basis,
        check=test,
    )


def _of_covariance(
    strip: StripResult,
    adjusted: CovarianceAdjustment,
    checks: tuple[ControlPoints, Numbers],
    frames: Sequence[GroundFrame],
) -> StripPrecision:
    """Covariances that the adjustment with the strip's own covariance has found already."""
    numbers = strip.formed.point[strip.control_rows][adjusted.control.point]

    def by_control(rows: Numbers, columns: Numbers) -> Floats:
        axes: Floats = strip.intermediate.axes
        return np.asarray(axes @ adjusted.by_control(rows, columns), float)

    points, photos = _turned(strip, adjusted.points, adjusted.photos)
    test = None
    if len(checks[1]):
        given = check_points.given_at(strip, adjusted.system.errors, checks, frames)
        test = check_points.by_covariance(adjusted, given)
    return StripPrecision(
        points=points,
        photos=photos,
        by_control=by_control,
        control=np.column_stack([numbers, adjusted.control.axis]),
        variance=adjusted.control.variance,
        sigma=adjusted.sigma,
        basis=adjusted.basis,
        check=test,
    )


def _turned(strip: StripResult, points: Floats, photos: Floats) -> tuple[Floats, Floats]:
    """Covariances from the intermediate to the Cartesian frame."""
    axes, both = strip.intermediate.axes, np.zeros((6, 6))
    both[:3, :3] = both[3:, 3:] = axes
    return axes @ points @ axes.T, both @ photos @ both.T
