"""Figures that norms ask of differences at check points. Sources: docs/commands/statement.md."""

from __future__ import annotations

from math import ceil, hypot, isfinite

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import Document
from photostrip.result.numbers import rms

# Radii and half widths that hold so many of normal errors, in standard deviations of one coordinate
# (FGDC-STD-007.3-1998, appendix 3-A; the 90 % circle: appendix 3-D).
CIRCLE_90, CIRCLE_95 = 2.1460, 2.4477
LINE_90, LINE_95 = 1.6449, 1.9600
RADIAL_95 = 1.7308  # of the radial rms error, where both coordinates are equally good: CIRCLE_95 / sqrt(2)
LEAST_RATIO = 0.6  # of the smaller to the larger rms error in plan: below, the mean of the two is no circle's radius
SHARE_BEYOND = 10  # one point in so many may lie beyond the 90 % error
CENTIMETRES = 100.0


def figures_of(differences: Floats, sigma: Floats) -> Document:
    """Return the figures of check points, metres.

    differences: (n, 3), tested minus given along east, north, up; NaN where a coordinate is not given.
    sigma: (n, 3), standard deviations of the given coordinates.
    """
    plan = np.hypot(differences[:, 0], differences[:, 1])
    parts = {
        "plan": _part(plan, np.hypot(sigma[:, 0], sigma[:, 1])),
        "height": _part(np.abs(differences[:, 2]), sigma[:, 2]),
    }
    level = np.where(np.isnan(plan)[:, None], np.nan, differences[:, :2])
    columns = (*level.T, differences[:, 2])
    axes = {
        axis: {"rmse": rms(column), "mean": _mean(column)}
        for axis, column in zip(("east", "north", "up"), columns, strict=True)
    }
    both = hypot(*(part["accuracy"] for part in parts.values()))
    return {
        **parts,
        "axes": axes,
        "space": {"accuracy": both, "class_cm": class_of(both)},
        "circle": _circle(axes["east"]["rmse"], axes["north"]["rmse"]),
        "line": {"le90": LINE_90 * axes["up"]["rmse"], "le95": LINE_95 * axes["up"]["rmse"]},
    }


def _part(size: Floats, sigma: Floats) -> Document:
    """Return what lengths of differences say in plan or in height."""
    known = ~np.isnan(size)
    size = np.sort(size[known])[::-1]
    rmse, survey = rms(size), rms(sigma[known])
    return {
        "count": len(size),
        "rmse": rmse,
        "survey": survey,
        "accuracy": hypot(rmse, survey),
        "class_cm": class_of(hypot(rmse, survey)),
        "mean": _mean(size),
        "p90": float(size[len(size) // SHARE_BEYOND]) if len(size) else float("nan"),
        "largest": float(size[0]) if len(size) else float("nan"),
    }


def _mean(values: Floats) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else float("nan")


def _circle(east: float, north: float) -> Document:
    """Return the circles that hold 90 and 95 % of the points in plan; NaN where the errors are too unequal for one."""
    larger = max(east, north)
    ratio = min(east, north) / larger if larger > 0 else 1.0 if larger == 0 else float("nan")
    one = 0.5 * (east + north) if ratio >= LEAST_RATIO else float("nan")
    radial = RADIAL_95 * hypot(east, north) if ratio >= LEAST_RATIO else float("nan")
    return {"ratio": ratio, "ce90": CIRCLE_90 * one, "ce95": CIRCLE_95 * one, "radial95": radial}


def class_of(accuracy: float) -> int | None:
    """Return the narrowest class of whole centimetres that an accuracy in metres keeps."""
    return max(1, ceil(round(CENTIMETRES * accuracy, 2))) if isfinite(accuracy) else None
