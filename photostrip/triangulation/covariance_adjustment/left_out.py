"""Control that takes no part, without eliminating again: all of it from the one system that was solved with it.

Source: derived. With Pi the part of K^-1 (docs/precision.md, eq. 7) that belongs to a group of conditions and lambda
their correlates, everything else predicts the group with the error Pi^-1 lambda, whose covariance is Pi^-1. With E the
unit vectors of the group, K^-1 - K^-1 E Pi^-1 E^T K^-1 takes the place of K^-1 where the group is left out. Without the
variances of the given coordinates Pi^-1 is the covariance of the strip at the group.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Self

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import NamedTuple, dataclass
from photostrip.triangulation.covariance_adjustment.prediction import (
    CHECKED,
    conditions_with_columns,
    part_of_inverse,
    with_columns,
)
from photostrip.triangulation.covariance_adjustment.reduced import Solved, of_conditions, solved
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import ErrorRows
from photostrip.triangulation.covariance_adjustment.system import System, solved_for
from photostrip.triangulation.error_propagation.control_errors import Misclosures

AXES = 3
UNCHECKED = 1e-9  # smallest eigenvalue of the scaled Pi of a group that the others determine


class LeftOut(NamedTuple):
    """A group of control coordinates as all the others predict it."""

    errors: Floats  # (k,): strip minus given, metres; infinite where the others do not determine it
    squares: float  # e^T Pi e, for a variance factor of 1: expected to be k


def left_out_errors(found: System, groups: Sequence[Numbers]) -> list[LeftOut]:
    """Predict groups of control coordinates (rows of the misclosures), each from all the others."""
    of_groups = [found.conditions.of_control(group) for group in groups]  # one by one: all together take their square
    return [_predicted(part_of_inverse(found, rows), found.correlates[rows]) for rows in of_groups]


class PointsLeftOut(NamedTuple):
    """Points of the control that take no part, as all else predicts them."""

    point: Numbers  # (n,): in the control, ascending
    covariance: Floats  # (n, 3, n, 3): intermediate frame, for a variance factor of 1


@dataclass(frozen=True, eq=False)
class Without:
    """A solved system without some of its control coordinates."""

    system: System  # with them
    coordinates: Numbers  # (c,): their rows in the misclosures
    rows: Numbers  # (c,): their conditions, ascending
    inverse: Floats  # (c, c): Pi^-1

    @classmethod
    def of(cls, found: System, coordinates: Numbers) -> Self:
        """Leave out control coordinates, given by their rows in the misclosures.

        Raises numpy.linalg.LinAlgError where the others do not determine them.
        """
        rows = np.sort(found.conditions.of_control(coordinates))
        inverse = _inverse(part_of_inverse(found, rows))
        if inverse is None:
            raise np.linalg.LinAlgError("the control that is left does not determine what is left out")
        return cls(system=found, coordinates=found.conditions.source[rows], rows=rows, inverse=inverse)

    @property
    def change(self) -> System:
        """The system with what leaving them out adds to its solution."""
        value = np.zeros(len(self.system.conditions.value))
        value[self.rows] = -self.inverse @ self.system.correlates[self.rows]
        return solved_for(self.system, value)

    @cached_property
    def columns(self) -> Solved:
        """What K^-1 E is made of."""
        return solved(self.system, of_conditions(self.system, self.rows))

    def points(self, control: Misclosures, factor: float) -> PointsLeftOut:
        """Predict the points of the control of which all three coordinates are left out.

        control: all coordinates of the control.
        factor: variance factor of the image coordinates.
        """
        point, noise = control.point[self.coordinates], control.variance[self.coordinates] / factor
        known = np.diag(self.inverse) > (1.0 + CHECKED) * noise  # else nothing is left without the noise
        order = np.lexsort((control.axis[self.coordinates], point))
        order = order[np.bincount(point, known)[point[order]] == AXES]
        turn = np.linalg.inv(control.direction[self.coordinates[order]].reshape(-1, AXES, AXES))
        along = (self.inverse - np.diag(noise))[np.ix_(order, order)].reshape(len(turn), AXES, len(turn), AXES)
        covariance = np.einsum("pia,paqb,qjb->piqj", turn, along, turn)
        return PointsLeftOut(point[order[::AXES]], covariance)

    def influence(self, rows: ErrorRows, conditions: Numbers) -> Floats:
        """Return the part of the influence (n, d, k) of conditions that goes through what is left out."""
        by_them = conditions_with_columns(self.system, conditions, self.columns)
        return np.asarray(with_columns(self.system, rows, self.columns) @ (self.inverse @ by_them.T), float)

    def explained(self, rows: ErrorRows) -> Floats:
        """Return what of rows (n, d) they alone explain, s: (n, d, c), and s s^T adds to their covariances."""
        return np.asarray(with_columns(self.system, rows, self.columns) @ np.linalg.cholesky(self.inverse), float)


def _predicted(cofactors: Floats, correlates: Floats) -> LeftOut:
    inverse = _inverse(cofactors)
    if inverse is None:
        return LeftOut(np.full(len(correlates), np.inf), np.inf)
    errors = inverse @ correlates
    return LeftOut(np.asarray(errors, float), float(errors @ correlates))


def _inverse(cofactors: Floats) -> Floats | None:
    """Pi^-1 of a group (k, k); None where the others do not determine it."""
    square = np.diag(cofactors)
    if not (square > 0.0).all():
        return None
    size = np.sqrt(square)
    scaled = cofactors / size / size[:, None]
    if np.linalg.eigvalsh(scaled)[0] < UNCHECKED:
        return None
    return np.asarray(np.linalg.inv(scaled) / size / size[:, None], float)
