"""The strip method differentiated for one strip: rows of its points, photos and misclosures, operator of the fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.pipeline.covariance_adjustment import measured
from photostrip.triangulation import absolute_orientation
from photostrip.triangulation.error_propagation import control_errors, photo_errors, strip_errors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline.results import StripResult
    from photostrip.points import PhotoPoints
    from photostrip.triangulation.error_propagation.derivatives import ErrorRows

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Propagation:
    """Rows of derivatives of one strip in its intermediate frame, and what the fit to the control takes away."""

    errors: strip_errors.StripErrors
    control: control_errors.Misclosures  # control coordinates that count
    fit: control_errors.FitOperator
    influence: Floats  # (q, 3, t): points by the parameters of the fit
    photos: ErrorRows  # photos that could be oriented
    photo_influence: Floats  # (k, 6, t): the same of them
    oriented: Numbers  # (k,): their places in the strip


def propagation(strip: StripResult, observations: PhotoPoints, frames: Sequence[GroundFrame]) -> Propagation:
    """Differentiate the strip method for one strip.

    Parameters
    ----------
    strip : StripResult
        The strip with all its stages.
    observations : PhotoPoints
        Ideal image coordinates of the project.

    Returns
    -------
    Propagation
        Everything that covariances are made of.
    """
    position = measured(strip.of_photos.strip, observations)
    similarity = strip.absolute.similarity
    errors = strip_errors.differentiate_strip(
        strip.of_photos.orientation, strip.of_photos.formed, similarity, position, observations.sigma
    )
    xyz = similarity(strip.formed.xyz)
    found, fit = _fit_to_control(strip, errors, xyz, frames)
    influence = fit.influence(xyz)
    photos = photo_errors.differentiate_photos(
        errors, sightings(strip, observations), strip.of_photos.resection, influence
    )
    return Propagation(
        errors=errors,
        control=found,
        fit=fit,
        influence=influence,
        photos=photos.rows,
        photo_influence=photos.influence,
        oriented=photos.photos,
    )


def sightings(strip: StripResult, observations: PhotoPoints) -> photo_errors.Sightings:
    """Collect the image points on which the photos of a strip were oriented."""
    point = np.searchsorted(strip.formed.point, observations.point[strip.of_photos.rows])
    focal = strip.of_photos.strip.camera.principal_distance
    photo = measured(strip.of_photos.strip, observations)[strip.of_photos.rows]
    return photo_errors.Sightings(photo, point, strip.of_photos.rows, strip.xyz[point], focal)


def _fit_to_control(
    strip: StripResult, errors: strip_errors.StripErrors, xyz: Floats, frames: Sequence[GroundFrame]
) -> tuple[control_errors.Misclosures, control_errors.FitOperator]:
    """Misclosures at the control and the operator of the fit, with the weights that were in force."""
    targets = absolute_orientation.Targets(strip.control, frames, strip.intermediate)
    at_control = xyz[strip.control_rows]
    control = targets.turned(at_control)
    found = control_errors.misclosures(errors.points, control, strip.control_rows, targets.axes(at_control))
    terms = [axis.terms for axis in strip.polynomial.axes] if strip.polynomial else [(), (), ()]
    weight = absolute_orientation.weights(control, strip.precision)
    return found, control_errors.fit_operator(found, weight, at_control, terms, errors.origin)
