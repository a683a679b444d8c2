"""Control and check points of a project: what may influence the result, and how the result differs from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Floats, Numbers
    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline.results import Adjusted
    from photostrip.points import ControlPoints, PhotoPoints


def measured_control(control: ControlPoints, observations: PhotoPoints) -> ControlPoints:
    """Control that may influence the result: neither check points nor unmeasured ones ever get past here."""
    measured = set(observations.point_ids)
    kept = [
        row
        for row, name in enumerate(control.ids)
        if name in measured and not control.check[row] and control.use[row].any()
    ]
    return control.take(np.array(kept, np.intp))


def rows_of_given(control: ControlPoints, numbers: Numbers, observations: PhotoPoints) -> Numbers:
    """Row of each given point among points by their numbers in the observations; -1 for none."""
    number = {name: n for n, name in enumerate(observations.point_ids)}
    row_of = {int(n): row for row, n in enumerate(numbers)}
    return np.array([row_of.get(number.get(name, -1), -1) for name in control.ids], np.intp)


@dataclass(frozen=True, eq=False)
class AtGivenPoints:
    """The result at control and check points."""

    rows: Numbers  # (c,): row of each given point in the adjusted points; -1 where it has no coordinates
    # (c, 3): adjusted minus given in metres along east, north, up of the point's own ground frame; NaN where it is not
    # given, does not count or has no result
    differences: Floats


def compare_with_given(
    control: ControlPoints, frames: Sequence[GroundFrame], points: Adjusted, observations: PhotoPoints
) -> AtGivenPoints:
    """Compare adjusted with given coordinates at control and check points, each in its own ground frame."""
    rows = rows_of_given(control, points.number, observations)
    differences = np.full((len(control), 3), np.nan)
    for index, frame in enumerate(frames):
        inside = np.flatnonzero((control.frame == index) & (rows >= 0))
        if len(inside):
            adjusted = frame.ground_from_cartesian(points.cartesian[rows[inside]])
            given = np.where(np.isnan(control.enu[inside]), adjusted, control.enu[inside])
            differences[inside] = frame.difference(adjusted, given)
    return AtGivenPoints(rows, np.where(control.use, differences, np.nan))
