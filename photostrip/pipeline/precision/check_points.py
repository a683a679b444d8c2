"""Errors at check points against what the covariances let expect of all of them together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation import absolute_orientation
from photostrip.triangulation.covariance_adjustment import prediction
from photostrip.triangulation.error_propagation import control_errors, covariances
from photostrip.triangulation.error_propagation.derivatives import ErrorRows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Floats, Numbers
    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline.precision.propagation import Propagation
    from photostrip.pipeline.results import StripResult
    from photostrip.points import ControlPoints, PhotoPoints
    from photostrip.triangulation.covariance_adjustment.adjust import CovarianceAdjustment
    from photostrip.triangulation.error_propagation.control_errors import Misclosures
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors


LARGEST = 100  # check points of a strip that are tested together, spread over it


def check_points(
    strip: StripResult, control: ControlPoints, observations: PhotoPoints
) -> tuple[ControlPoints, Numbers]:
    """Check points that a strip holds, and their rows in its points.

    observations: image points of the project, which name its points.
    Returns rows: (c,), their rows in ``strip.formed.point``.
    """
    number = {name: n for n, name in enumerate(observations.point_ids)}
    row_of = {int(n): row for row, n in enumerate(strip.formed.point)}
    rows = np.array([row_of.get(number.get(name, -1), -1) for name in control.ids], np.intp)
    found = np.flatnonzero(control.check & (rows >= 0) & control.use.any(axis=1))
    found = found[np.argsort(strip.xyz[rows[found], 0], kind="stable")]
    if len(found) > LARGEST:
        found = found[np.linspace(0, len(found) - 1, LARGEST).round().astype(int)]
    return control.take(found), rows[found]


def by_fit(found: Propagation, given: Given, rows: Numbers, factor: float) -> covariances.CheckTest:
    """Test the check points of a strip that was fitted to the control.

    found: rows and operators of the strip method.
    rows: (c,), their rows in the points of the strip.
    factor: variance factor of the image coordinates.
    """
    seen = given.seen
    by_parameters = np.einsum("wi,wit->wt", seen.direction, found.influence[rows][seen.point])
    taken = by_parameters @ found.fit.operator
    joint = _joint(found.errors, seen.rows, (found.control.rows, found.control.variance, taken), factor)
    return _tested(given, joint)


def by_covariance(own: CovarianceAdjustment, given: Given) -> covariances.CheckTest:
    """Test the check points of a strip that was adjusted with its own covariance."""
    wanted = own.system.conditions
    taken = prediction.influence(own.system, given.seen.rows, np.arange(len(wanted.value)))[:, 0]
    # the similarities of the models are unknowns of this adjustment, not errors
    parts = (wanted.rows.without_similarity(), wanted.noise, taken)
    return _tested(given, _joint(own.system.errors, given.seen.rows.without_similarity(), parts, own.factor))


@dataclass(frozen=True, eq=False)
class Given:
    """What check points say."""

    points: int
    seen: Misclosures
    difference: Floats  # (w,): adjusted minus given, metres


def given_at(
    strip: StripResult, errors: StripErrors, checks: tuple[ControlPoints, Numbers], frames: Sequence[GroundFrame]
) -> Given:
    """Compare a strip with its check points.

    checks: the check points and their rows in the strip.
    frames: ground frames of the given points.
    """
    points, rows = checks
    xyz = strip.xyz[rows]
    targets = absolute_orientation.Targets(points, frames, strip.intermediate)
    seen = control_errors.misclosures(errors.points, targets.turned(xyz), rows, targets.axes(xyz))
    return Given(len(points), seen, targets.misclosures(xyz)[seen.point, seen.axis])


def _tested(given: Given, joint: Floats) -> covariances.CheckTest:
    joint = joint + np.diag(given.seen.variance)
    squares = float(given.difference @ np.linalg.solve(joint, given.difference))
    return covariances.CheckTest(given.points, len(given.difference), squares)


def _joint(errors: StripErrors, own: ErrorRows, by: tuple[ErrorRows, Floats, Floats], factor: float) -> Floats:
    """Joint covariance of the errors at check coordinates: their own rows minus what is taken away by others."""
    rows, variance, taken = by
    operator = np.concatenate([-taken, np.eye(len(own.first))], axis=1)
    joint = factor * covariances.sums_of(errors, ErrorRows.joined([rows, own]), operator)
    return np.asarray(joint + (taken * variance) @ taken.T, float)
