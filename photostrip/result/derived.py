"""Columns of a result that its other columns tell: computed when it is made and when it is read, not in result.json."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import Document
from photostrip.rejection import UNCONTROLLED
from photostrip.result.distances import level
from photostrip.result.table import Table

MIXED = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}  # places in a covariance matrix


def with_derived(document: Document) -> Document:
    """Return a document with the columns that are derived; a baseline has no rays."""
    derived = {"points": _with_ellipses(document["points"], document["frame"])}
    if "residuals" in document and {"redundancy_x", "redundancy_y"} <= {*document["residuals"].columns}:
        bundle: Document = document.get("bundle") or {}  # somebody may have edited it
        derived["residuals"] = _with_detectable(document["residuals"], bundle)
    return document | derived


def _with_detectable(rays: Table, bundle: Document) -> Table:
    """Add detectable errors: sigma / sqrt(r) times the noncentrality; sigma by which the search tests."""
    reliability, columns = bundle.get("reliability", {}), {}
    shift = _number(reliability.get("noncentrality")) * _number(bundle.get("screening", {}).get("unit"))
    for axis in "xy":
        of_axis = f"sigma_{axis}_um"
        sigma = rays[of_axis] if of_axis in rays.columns else _number(reliability.get("image_sigma_um"))
        redundancy = rays[f"redundancy_{axis}"].astype(float)
        shown = np.sqrt(np.where(redundancy >= UNCONTROLLED, redundancy, np.nan))
        columns[f"detectable_{axis}_um"] = shift * sigma / shown
    return rays.with_columns(**columns)


def _number(value: float | None) -> float:
    return np.nan if value is None else value


def _with_ellipses(points: Table, frame: Document) -> Table:
    """Add covariances, and standard error ellipses in plan, to points whose standard deviations are known."""
    known = {f"correlation_{pair}" for pair in MIXED} & {*points.columns}
    if not known:
        return points
    sigma = np.column_stack([points[f"sigma_{axis}"] for axis in "xyz"])
    covariances, columns = np.empty((len(points), 3, 3)), {}
    covariances[:, range(3), range(3)] = sigma**2
    for pair, (k, j) in MIXED.items():
        correlation = points[f"correlation_{pair}"] if f"correlation_{pair}" in known else np.nan  # somebody edited it
        size = columns[f"cov_{pair}"] = correlation * sigma[:, k] * sigma[:, j]
        covariances[:, k, j] = covariances[:, j, k] = size
    axes = level(frame, np.column_stack([points[axis] for axis in "xyz"]))
    (larger, smaller), azimuth = ellipses(axes @ covariances @ axes.transpose(0, 2, 1))
    shape = {"ellipse_a": larger, "ellipse_b": smaller, "ellipse_azimuth_deg": np.degrees(azimuth)}
    return points.with_columns(**columns, **shape)


def ellipses(covariances: Floats) -> tuple[Floats, Floats]:
    """Return standard error ellipses in plan, from covariances (n, 3, 3) along east, north and up.

    Returns axes: (2, n), semi-axes, the larger ones first. The true point lies inside with a probability of 39 %,
        inside the ellipse of 2.45 times the size with 95 %.
    Returns azimuth: (n,), direction of the larger one, clockwise from north, radians, 0 to pi.
    """
    east, north, mixed = covariances[:, 0, 0], covariances[:, 1, 1], covariances[:, 0, 1]
    middle, reach = (east + north) / 2, np.hypot((north - east) / 2, mixed)
    with np.errstate(invalid="ignore"):
        axes = np.sqrt(np.stack([middle + reach, np.maximum(middle - reach, 0.0)]))
    return axes, np.arctan2(mixed, (north - east) / 2) / 2 % np.pi
