"""Errors at check points against what the covariances let expect of all of them together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.pipeline.given_points import rows_of_given
from photostrip.pipeline.results import StripResult
from photostrip.points import ControlPoints, PhotoPoints
from photostrip.strip import absolute_orientation
from photostrip.strip.error_propagation import control_errors
from photostrip.strip.error_propagation.check_errors import CheckErrors
from photostrip.strip.error_propagation.control_errors import Misclosures
from photostrip.strip.error_propagation.fitted_strip import FittedStrip

MOST_TESTED = 100  # check points of a strip that are tested together, spread over it


class CheckPoints(NamedTuple):
    """Check points that a strip holds, along it."""

    control: ControlPoints  # all given points
    chosen: Numbers  # (c,): rows of the check points there
    rows: Numbers  # (c,): their rows in ``strip.formed.point``

    @property
    def points(self) -> ControlPoints:
        return self.control.take(self.chosen)

    def spread(self) -> CheckPoints:
        """Those that are tested together."""
        count = len(self.rows)
        if count <= MOST_TESTED:
            return self
        some = np.linspace(0, count - 1, MOST_TESTED).round().astype(int)
        return self._replace(chosen=self.chosen[some], rows=self.rows[some])


def check_points(strip: StripResult, control: ControlPoints, observations: PhotoPoints) -> CheckPoints:
    """Check points of a strip among all given points; the observations name its points."""
    rows = rows_of_given(control.ids, strip.formed.point, observations.point_ids)
    found = np.flatnonzero(control.check & (rows >= 0) & control.use.any(axis=1))
    found = found[np.argsort(strip.xyz[rows[found], 0], kind="stable")]
    return CheckPoints(control, found, rows[found])


@dataclass(frozen=True, eq=False)
class CheckDifferences:
    """How a strip differs from its check points."""

    checks: CheckPoints
    coordinates: Misclosures
    difference: Floats  # (w,): adjusted minus given, metres


def compare_with_checks(
    strip: StripResult, checks: CheckPoints, frames: Sequence[GroundFrame]
) -> CheckDifferences | None:
    """Compare a strip with its check points, in the ground frames of the given points; None without any."""
    if not len(checks.rows):
        return None
    xyz = strip.xyz[checks.rows]
    targets = absolute_orientation.Targets(checks.points, frames, strip.intermediate)
    axes = targets.axes(xyz)
    found = control_errors.misclosures(targets.turned(xyz), checks.rows, axes)
    return CheckDifferences(checks, found, targets.misclosures(xyz, axes)[found.point, found.axis])


def by_fit(found: FittedStrip, compared: CheckDifferences) -> CheckErrors:
    """Return the errors at the check points of a strip that was fitted to the control."""
    at = compared.coordinates
    return errors_at_checks(compared, found.joint_covariance(at.row, at.direction))


def errors_at_checks(compared: CheckDifferences, covariance: Floats) -> CheckErrors:
    """Return all differences; their covariance is that of the adjusted coordinates and of the given ones."""
    return CheckErrors(
        ids=compared.checks.points.ids,
        point=compared.coordinates.point,
        axis=compared.coordinates.axis,
        difference=compared.difference,
        covariance=covariance + np.diag(compared.coordinates.variance),
    )
