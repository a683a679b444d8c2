"""Junctions whose pass points contradict each other: the control on either side knows the scale handed on.

A wrong scale moves all that lies behind the junction away from its perspective centre, in proportion to the distance.
This one more column beside the similarity, fitted to the misclosures at the control near by with their covariance,
gives the error of the scale and its standard deviation.

Source: derived.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.rejection import Rejection
from photostrip.statistics import normal_quantile
from photostrip.triangulation.gross_errors.rays.point_decisions import SEVERAL_RAYS
from photostrip.triangulation.strip_formation.scale_transfer import pass_points, scale_ratios

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.triangulation.relative_orientation.orientation import Orientation
    from photostrip.triangulation.strip_formation.strip import FormedStrip

ALPHA = 0.01  # probability that the control contradicts any junction of a strip without gross errors
UNKNOWN = 1e-6  # share of the column that the similarity must leave


@dataclass(frozen=True)
class ScaleError:
    """By how much the strip behind a junction is too large, as the control has it."""

    value: float  # error of the logarithm of the scale
    sigma: float  # its standard deviation, not smaller than what the misclosures show
    limit: float  # factor of the standard deviation beyond which a deviation is significant

    @property
    def test(self) -> float:
        """Error in standard deviations."""
        return abs(self.value) / self.sigma

    def agreeing(self, ratio: Floats) -> Flags:
        """Which ratios of the scales, logarithms from that of the junction, the control confirms."""
        return np.asarray(np.abs(ratio + self.value) <= self.limit * self.sigma, bool)


@dataclass(frozen=True, eq=False)
class DecidedJunction:
    """A junction that the control joins by other pass points than the strip did."""

    junction: int
    error: ScaleError  # of the scale that the strip handed on
    right: Numbers  # rows of the pairs' table, in both models, of the pass points that the control confirms
    wrong: Numbers  # the same of those that it contradicts


def scale_error(
    misclosures: Floats, similarity: Floats, behind: Floats, covariance: Floats, *, doubt: float, junctions: int
) -> ScaleError | None:
    """Estimate the error of a scale; None where the control does not tell, or does not check itself.

    misclosures: (w,), strip minus control near the junction, metres.
    similarity: (w, 7), their derivatives by a similarity of all.
    behind: (w,), their derivatives by the logarithm of the scale; 0 before the junction.
    covariance: (w, w), with the standard deviation `doubt` of this scale in it.
    junctions: how many are tested.
    """
    root = np.linalg.cholesky(covariance)
    columns = np.linalg.solve(root, np.column_stack([similarity, behind, misclosures]))
    fitted, rest = columns[:, :-2] / np.linalg.norm(columns[:, :-2], axis=0), columns[:, -2:]
    parameters, _, rank, _ = np.linalg.lstsq(fitted, rest, rcond=None)
    column, left = (rest - fitted @ parameters).T
    information, redundancy = float(column @ column), len(left) - int(rank) - 1
    if redundancy < 1 or information <= UNKNOWN * float(rest[:, 0] @ rest[:, 0]):
        return None
    value = float(column @ left) / information
    unit = max(1.0, float(left @ left - value**2 * information) / redundancy)
    variance = 1 / information - doubt**2
    if variance <= UNKNOWN * doubt**2:
        return None  # lost in rounding
    return ScaleError(value, float(np.sqrt(unit * variance)), normal_quantile(1 - ALPHA / (2 * junctions)))


def decide(orientation: Orientation, formed: FormedStrip, errors: Mapping[int, ScaleError]) -> list[DecidedJunction]:
    """Find the junctions whose scale the control contradicts, where it confirms that of another pass point."""
    every, (base, _) = pass_points(orientation, formed.vectors), orientation.relative
    off = np.log(scale_ratios(every, base, formed.vectors) / formed.junctions.factor[every.junction])
    decided = []
    for junction, error in errors.items():
        here = every.junction == junction
        right = here & error.agreeing(off)
        if error.test > error.limit and right.any():
            rows = [np.append(every.before[some], every.after[some]) for some in (right, here & ~right)]
            decided.append(DecidedJunction(junction=junction, error=error, right=rows[0], wrong=rows[1]))
    return decided


def aside(orientation: Orientation, formed: FormedStrip, decided: Sequence[DecidedJunction]) -> Flags:
    """Rows of the pairs' table (m,) that must not place their point, after the control has decided."""
    found = orientation.used & np.isnan(formed.model_xyz[:, 0])
    for each in decided:
        found[each.right] = False
    for each in decided:
        found[each.wrong] = True
    return found


def wrong_rays(
    orientation: Orientation, decided: Sequence[DecidedJunction], before: Sequence[Rejection]
) -> tuple[Rejection, ...]:
    """Take back the rays of the pass points that the control confirms, and reject those that it contradicts."""
    found = {each.row: each for each in before}
    for each in decided:
        for row in np.unique(orientation.rows[each.right]).tolist():
            found.pop(row, None)
    for each in decided:
        for row in np.unique(orientation.rows[each.wrong]).tolist():
            value, limit = each.error.test, each.error.limit
            wrong = Rejection(kind="image", row=row, test="strip", value=value, limit=limit, cause=SEVERAL_RAYS)
            found.setdefault(row, wrong)
    return tuple(found[row] for row in sorted(found))
