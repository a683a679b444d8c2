"""How precise points and perspective centres of independent models are: covariances from the model coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.arrays import Floats, median
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.pipeline.precision.check_points import (
    CheckPoints,
    check_points,
    compare_with_checks,
    errors_at_checks,
)
from photostrip.pipeline.precision.strip_precision import StripPrecision
from photostrip.pipeline.results import StripResult
from photostrip.pipeline.strips.absolute import OrientedStrip
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.strip.error_propagation.check_errors import CheckErrors
from photostrip.strip.error_propagation.control_errors import FitOperator
from photostrip.strip.error_propagation.image_variance import variance_factor
from photostrip.strip.independent_models import model_errors, model_misclosures, perspective_centers
from photostrip.strip.independent_models.formation import FormedModels
from photostrip.strip.independent_models.model_errors import ModelErrors
from photostrip.strip.polynomial.terms import POWERS


def variance_of_models(formed: FormedModels) -> tuple[float, str]:
    """Variance of the model coordinates found over that stated, 1 unless the links contradict it; and which it is."""
    solved = formed.links.solved
    return variance_factor(float(solved.squares.sum()), int(solved.redundancy.sum()))


def of_models(
    strip: StripResult, oriented: OrientedStrip[ModelErrors], observations: PhotoPoints, given: ControlPoints
) -> StripPrecision:
    """Covariances of one strip of independent models; the rotations of the photos are not known.

    given: all given points; the check points among them are compared with what is found.
    """
    formed, axes = strip.of_models.formed, strip.intermediate.axes
    found, control = oriented.errors, oriented.misclosures
    terms = [axis.terms for axis in strip.polynomial.axes] if strip.polynomial else [(), (), ()]
    fit = oriented.fit(terms)
    factor, basis = variance_of_models(formed)
    influence = _influence(strip, fit)
    by_parameters = model_errors.sums(found, *model_misclosures.weights(control, strip.control_rows, fit.operator))
    spread = model_errors.covariance_of_sums(found, by_parameters)
    spread += (fit.operator * (control.variance / factor)) @ fit.operator.T
    mixed = model_errors.with_sums(found, by_parameters) @ influence.transpose(0, 2, 1)
    nodes = model_errors.covariances(found) - mixed - mixed.transpose(0, 2, 1)
    nodes = (nodes + influence @ spread @ influence.transpose(0, 2, 1)) * factor
    nodes = axes @ nodes @ axes.T
    points = len(formed.point)
    sigma = float(np.sqrt(median(formed.models.sigma**2) * factor))
    return StripPrecision(
        points=nodes[:points],
        photos=_of_photos(formed, nodes),
        by_control=lambda rows, columns: axes @ influence[rows] @ fit.operator[:, columns],
        control=np.column_stack([formed.point[strip.control_rows][control.point], control.axis]),
        variance=control.variance,
        sigma=sigma,
        basis=basis,
        check=_check(strip, oriented, fit, influence, check_points(strip, given, observations).spread(), factor),
    )


def _of_photos(formed: FormedModels, nodes: Floats) -> Floats:
    """Covariances of the photos: of their centres alone."""
    photos = np.full((len(formed.photos), 6, 6), np.nan)
    row = np.searchsorted(formed.node, formed.photos)
    for photo in np.flatnonzero(np.isfinite(formed.centers).all(axis=1)).tolist():
        photos[photo, :3, :3] = nodes[row[photo]]
    return photos


def _influence(strip: StripResult, fit: FitOperator) -> Floats:
    """Displacement of points and centres by the parameters of the fit, shape (k, 3, t)."""
    formed = strip.of_models.formed
    nodes = strip.absolute.similarity(formed.node_xyz)
    influence = fit.influence(nodes)
    points = len(formed.point)
    if points < len(nodes) and any(fit.terms):
        above = perspective_centers.heights_above(nodes[points:], nodes[:points])
        unit = np.array([fit.reach, fit.breadth, 1.0])
        start = SIMILARITY_PARAMETERS
        for columns in _scaled_rows(nodes[points:], above, fit.terms, unit):
            influence[points:, :, start : start + columns.shape[2]] = columns
            start += columns.shape[2]
    return influence


def _scaled_rows(xyz: Floats, above: Floats, terms: Sequence[tuple[str, ...]], unit: Floats) -> list[Floats]:
    """Displacements of centres by coefficients of X and Y divided by lengths, as the fit has them."""
    rows = perspective_centers.displacement_rows(xyz, above, terms)
    return [
        row / np.array([unit[0] ** i * unit[1] ** j for i, j in (POWERS[name] for name in names)])
        for row, names in zip(rows, terms, strict=True)
    ]


def _check(
    strip: StripResult,
    oriented: OrientedStrip[ModelErrors],
    fit: FitOperator,
    influence: Floats,
    checks: CheckPoints,
    factor: float,
) -> CheckErrors | None:
    """Return the errors at the check points with their covariance; None without any."""
    found, control = oriented.errors, oriented.misclosures
    compared = compare_with_checks(strip, checks, oriented.frames)
    if compared is None:
        return None
    at = compared.coordinates
    by_control = np.einsum("wi,wit->wt", at.direction, influence[at.row]) @ fit.operator
    sums = model_errors.sums(found, *model_misclosures.weights(at, checks.rows))
    sums = sums - model_errors.sums(found, *model_misclosures.weights(control, strip.control_rows, by_control))
    spread = model_errors.covariance_of_sums(found, sums) * factor + (by_control * control.variance) @ by_control.T
    return errors_at_checks(compared, spread)
