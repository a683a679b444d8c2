"""The strip method differentiated for one strip: rows of its points, photos and misclosures, operator of the fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.error_propagation import control_errors, photo_errors, strip_errors

if TYPE_CHECKING:
    from photostrip.arrays import Floats, Numbers
    from photostrip.pipeline.results import StripResult
    from photostrip.pipeline.strips.absolute import OrientedStrip
    from photostrip.points import PhotoPoints
    from photostrip.triangulation.error_propagation.derivatives import ErrorRows


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


def propagation(
    strip: StripResult, oriented: OrientedStrip[strip_errors.StripErrors], observations: PhotoPoints
) -> Propagation:
    """Differentiate the strip method for one strip; `oriented` is the strip before its deformation was corrected."""
    errors, found = oriented.errors, oriented.misclosures
    terms = [axis.terms for axis in strip.polynomial.axes] if strip.polynomial else [(), (), ()]
    fit = control_errors.fit_operator(found, oriented.weights, oriented.at_control, terms, errors.origin)
    influence = fit.influence(oriented.xyz)
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
    rows = strip.of_photos.rows
    point = np.searchsorted(strip.formed.point, observations.point[rows])
    photo = strip.of_photos.strip.positions(observations)[rows]
    focal = strip.of_photos.strip.camera.principal_distance
    return photo_errors.Sightings(photo=photo, point=point, image=rows, xyz=strip.xyz[point], focal=focal)
