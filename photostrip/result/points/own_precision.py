"""Check points against the precision of the points themselves: differences over standard deviations, probabilities."""

from __future__ import annotations

from math import erfc, sqrt

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.pipeline.given_points import axes_of
from photostrip.pipeline.results import Precision, Result


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
    numbers, at = control.frame[rows], result.control_rows[rows]
    covariances = _along_given_axes(result, result.precision, numbers, at)
    covariances += np.nan_to_num(control.sigma[rows] ** 2)[:, :, None] * np.eye(3)
    differences = result.control_differences[rows]
    turn = np.flatnonzero([result.frames[number].kind == "geocentric" for number in numbers])
    if len(turn):
        level = axes_of(numbers[turn], result.frames, result.points.cartesian[at[turn]], level=True)
        differences[turn] = (level @ differences[turn, :, None])[:, :, 0]
        covariances[turn] = turned(covariances[turn], level)
    known = np.flatnonzero(~np.isnan(differences[:, :2]).any(axis=1))
    plan = differences[known, :2]
    values[known, 0] = np.sqrt(
        (plan * np.linalg.solve(covariances[known, :2, :2], plan[:, :, None])[:, :, 0]).sum(axis=1)
    )
    values[:, 1] = differences[:, 2] / np.sqrt(covariances[:, 2, 2])
    return rows, values


def _along_given_axes(result: Result, precision: Precision, numbers: Numbers, at: Numbers) -> Floats:
    """Covariances (n, 3, 3) of the points in rows `at` along the axes of the frames of these numbers."""
    found, level = np.empty((len(at), 3, 3)), result.level_covariances
    for number, frame in enumerate(result.frames):
        inside = numbers == number
        rows = at[inside]
        if frame is result.output and frame.kind != "geocentric" and level is not None:  # all points have these
            found[inside] = level[rows]
        elif len(rows):
            found[inside] = turned(precision.points[rows], frame.axes_at(result.points.cartesian[rows]))
    return found


def chances(normalised: Floats) -> dict[str, Floats]:
    """Return the probabilities of larger differences in plan and in height, from those (n, 2) of ``normalised``."""
    height = np.fromiter((erfc(abs(z) / sqrt(2)) for z in normalised[:, 1].tolist()), float)
    return {"p_plan": np.exp(-(normalised[:, 0] ** 2) / 2), "p_height": height}
