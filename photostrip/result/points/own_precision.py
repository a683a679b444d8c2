"""Check points against the precision of the points themselves: differences over standard deviations, probabilities."""

from __future__ import annotations

from math import erfc, sqrt

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.pipeline.given_points import axes_of
from photostrip.pipeline.results import Result


def turned(covariances: Floats, axes: Floats) -> Floats:
    """Turn covariances from the Cartesian frame to other axes, the rows of `axes`; both of shape (n, 3, 3)."""
    return np.asarray(axes @ covariances @ axes.transpose(0, 2, 1), float)


def normalised(result: Result) -> tuple[Numbers, Floats]:
    """Check points with coordinates, and their differences in units of their standard deviations.

    In plan the length of the difference in the metric of its covariance, in height the difference with its sign.
    """
    control = result.inputs.control
    rows = np.flatnonzero(control.check & (result.control_rows >= 0))
    values = np.full((len(rows), 2), np.nan)
    if result.precision is None or not result.frames:  # a free network has nothing to be compared with
        return rows, values
    numbers, place = control.frame[rows], result.points.cartesian[result.control_rows[rows]]
    axes = axes_of(numbers, result.frames, place)
    covariances = turned(result.precision.points[result.control_rows[rows]], axes)
    covariances += np.nan_to_num(control.sigma[rows] ** 2)[:, :, None] * np.eye(3)
    differences = result.control_differences[rows]
    turn = np.flatnonzero([result.frames[number].kind == "geocentric" for number in numbers])
    if len(turn):
        level = axes_of(numbers[turn], result.frames, place[turn], level=True) @ axes[turn].transpose(0, 2, 1)
        differences[turn] = (level @ differences[turn, :, None])[:, :, 0]
        covariances[turn] = turned(covariances[turn], level)
    known = np.flatnonzero(~np.isnan(differences[:, :2]).any(axis=1))
    plan = differences[known, :2]
    values[known, 0] = np.sqrt(
        (plan * np.linalg.solve(covariances[known, :2, :2], plan[:, :, None])[:, :, 0]).sum(axis=1)
    )
    values[:, 1] = differences[:, 2] / np.sqrt(covariances[:, 2, 2])
    return rows, values


def chances(normalised: Floats) -> dict[str, Floats]:
    """Return the probabilities of larger differences in plan and in height, from those (n, 2) of ``normalised``."""
    height = np.array([erfc(abs(z) / sqrt(2)) for z in normalised[:, 1]])
    return {"p_plan": np.exp(-(normalised[:, 0] ** 2) / 2), "p_height": height}
