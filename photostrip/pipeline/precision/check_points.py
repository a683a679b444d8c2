"""Errors at check points against what the covariances let expect of all of them together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.pipeline.given_points import rows_of_given
from photostrip.triangulation import absolute_orientation
from photostrip.triangulation.error_propagation import control_errors, covariances
from photostrip.triangulation.error_propagation.check_errors import CheckErrors
from photostrip.triangulation.error_propagation.derivatives import ErrorRows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Floats, Numbers
    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline.results import StripResult
    from photostrip.points import ControlPoints, PhotoPoints
    from photostrip.triangulation.covariance_adjustment.adjust import CovarianceAdjustment
    from photostrip.triangulation.error_propagation.control_errors import Misclosures
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors

LARGEST = 100  # check points of a strip that are tested together, spread over it


@dataclass(frozen=True, eq=False)
class Propagation:
    """Rows of derivatives of one strip in its intermediate frame, and what the fit to the control takes away."""

    errors: StripErrors
    control: control_errors.Misclosures  # control coordinates that count
    fit: control_errors.FitOperator
    influence: Floats  # (q, 3, t): points by the parameters of the fit
    photos: ErrorRows  # photos that could be oriented
    photo_influence: Floats  # (k, 6, t): the same of them
    oriented: Numbers  # (k,): their places in the strip


class CheckPoints(NamedTuple):
    """Check points that a strip holds, and their rows (c,) in ``strip.formed.point``."""

    points: ControlPoints
    rows: Numbers


def check_points(strip: StripResult, control: ControlPoints, observations: PhotoPoints) -> CheckPoints:
    """Check points of a strip among all given points; the observations name its points."""
    rows = rows_of_given(control.ids, strip.formed.point, observations.point_ids)
    found = np.flatnonzero(control.check & (rows >= 0) & control.use.any(axis=1))
    found = found[np.argsort(strip.xyz[rows[found], 0], kind="stable")]
    if len(found) > LARGEST:
        found = found[np.linspace(0, len(found) - 1, LARGEST).round().astype(int)]
    return CheckPoints(control.take(found), rows[found])


@dataclass(frozen=True, eq=False)
class CheckDifferences:
    """How a strip differs from its check points."""

    checks: CheckPoints
    coordinates: Misclosures
    difference: Floats  # (w,): adjusted minus given, metres


def compare_with_checks(
    strip: StripResult, errors: StripErrors, checks: CheckPoints, frames: Sequence[GroundFrame]
) -> CheckDifferences | None:
    """Compare a strip with its check points, in the ground frames of the given points; None without any."""
    if not len(checks.rows):
        return None
    xyz = strip.xyz[checks.rows]
    targets = absolute_orientation.Targets(checks.points, frames, strip.intermediate)
    found = control_errors.misclosures(errors.points, targets.turned(xyz), checks.rows, targets.axes(xyz))
    return CheckDifferences(checks, found, targets.misclosures(xyz)[found.point, found.axis])


def by_fit(found: Propagation, compared: CheckDifferences, factor: float) -> CheckErrors:
    """Return the errors at the check points of a strip that was fitted to the control.

    factor: variance factor of the image coordinates.
    """
    at = compared.coordinates
    by_parameters = np.einsum("wi,wit->wt", at.direction, found.influence[compared.checks.rows][at.point])
    subtracted = _Subtracted(found.control.rows, found.control.variance, by_parameters @ found.fit.operator)
    return _errors(compared, found.errors, at.rows, subtracted, factor)


def by_covariance(adjusted: CovarianceAdjustment, compared: CheckDifferences) -> CheckErrors:
    """Return the errors at the check points of a strip that was adjusted with its own covariance."""
    from photostrip.triangulation.covariance_adjustment import prediction  # no other adjustment needs it

    system, at = adjusted.system, compared.coordinates
    wanted = system.conditions
    operator = prediction.influence(system, at.rows, np.arange(len(wanted.value)))[:, 0]
    # the similarities of the models are unknowns of this adjustment, not errors
    subtracted = _Subtracted(wanted.rows.without_similarity(), wanted.noise, operator)
    return _errors(compared, system.errors, at.rows.without_similarity(), subtracted, adjusted.factor)


class _Subtracted(NamedTuple):
    """What the adjustment subtracts from check coordinates: errors with their rows and variances, times an operator."""

    rows: ErrorRows
    variance: Floats
    operator: Floats


def _errors(
    compared: CheckDifferences, errors: StripErrors, rows: ErrorRows, subtracted: _Subtracted, factor: float
) -> CheckErrors:
    """Return all differences; their covariance is that of their rows minus what is subtracted, and of the given."""
    operator = np.concatenate([-subtracted.operator, np.eye(len(rows.first))], axis=1)
    covariance = factor * covariances.sums_of(errors, ErrorRows.joined([subtracted.rows, rows]), operator)
    covariance = covariance + (subtracted.operator * subtracted.variance) @ subtracted.operator.T
    covariance = covariance + np.diag(compared.coordinates.variance)
    return CheckErrors(
        ids=compared.checks.points.ids,
        point=compared.coordinates.point,
        difference=compared.difference,
        covariance=covariance,
    )
