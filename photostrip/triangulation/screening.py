"""Gross errors in relative orientation: residual y parallax against a limit, then Grubbs' test or Pope's tau.

Every round takes at most one point from a pair, the worst, and orients that pair again: removing several at once
also throws out good points that a bad neighbour has pulled. All pairs go through a round together.

Source: [004a]; the two-sided form and the order of work are chosen here, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import InputError
from photostrip.statistics import grubbs_limit, tau_limit
from photostrip.triangulation import relative

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.relative import Orientation, Settings

    Floats = NDArray[np.float64]

METHODS = ("auto", "parallax+grubbs", "tau", "none")
MINIMUM_LEFT = 6  # a pair keeps at least one redundant point
GRUBBS_MINIMUM = 7  # below it the test is meaningless: G cannot exceed (n-1)/sqrt(n)
NEGLIGIBLE = 1e-9  # mm; residuals of error-free data are rounding, not measurements
LIMIT_FACTOR = 4.0  # a-priori standard deviations of a y parallax
TAU_REDUNDANCY = 0.01  # a residual with less redundancy says nothing about its point


@dataclass(frozen=True, slots=True)
class Rejection:
    """One point taken out of a pair.

    Parameters
    ----------
    row : int
        Row in the pairs' table.
    test : str
        ``"in front"``, ``"parallax"``, ``"grubbs"`` or ``"tau"``.
    value, limit : float
        Test value and critical value; mm for a parallax, otherwise without unit.
    parallax : float
        Residual y parallax in mm when it was rejected.
    """

    row: int
    test: str
    value: float
    limit: float
    parallax: float


def screen(orientation: Orientation, settings: Settings, sigma: float) -> tuple[Orientation, tuple[Rejection, ...]]:
    """Reject points with gross errors from all pairs and orient those pairs again.

    Parameters
    ----------
    orientation : Orientation
        All pairs, oriented with all points.
    settings : relative.Settings
        Method, significance and limit.
    sigma : float
        A-priori standard deviation of an image coordinate in mm, for the automatic limit.

    Returns
    -------
    Orientation
        Pairs oriented without the rejected points.
    tuple of Rejection
        What was rejected, in order.

    Raises
    ------
    InputError
        For a method that does not exist.
    """
    if settings.screening not in METHODS:
        msg = f"screening method {settings.screening!r} is not available; choose one of {', '.join(METHODS)}"
        raise InputError(msg)
    result, log = _drop_behind(orientation)
    if settings.screening == "none":
        return result, tuple(log)
    limit = settings.parallax_limit if settings.parallax_limit is not None else LIMIT_FACTOR * sigma * np.sqrt(2.0)
    stages = [("tau", settings.grubbs_alpha)]
    if settings.screening != "tau":
        stages = [("parallax", limit), ("grubbs", settings.grubbs_alpha)]
    for test, bound in stages:
        result, found = _stage(result, test, bound)
        log += found
    return result, tuple(log)


def _drop_behind(orientation: Orientation) -> tuple[Orientation, list[Rejection]]:
    """Take out the points that come out behind a camera; no measurement of theirs can be right."""
    front = relative.in_front(orientation.elements, orientation.pairs)
    rows = np.flatnonzero(~front & orientation.used)
    if not len(rows):
        return orientation, []
    log = [Rejection(int(row), "in front", np.nan, np.nan, float(orientation.parallax[row])) for row in rows]
    return _without(orientation, rows), log


def _without(orientation: Orientation, rows: NDArray[np.intp]) -> Orientation:
    weight = orientation.pairs.weight.copy()
    weight[rows] = 0.0
    return relative.refine(orientation, weight, np.unique(orientation.pairs.pair[rows]))


def _stage(orientation: Orientation, test: str, bound: float) -> tuple[Orientation, list[Rejection]]:
    """Repeat one test, worst point first, until no pair has anything to reject."""
    result = orientation
    log: list[Rejection] = []
    while True:
        value, limit = _values(result, test, bound)
        value[~result.used] = -np.inf
        peak = np.maximum.reduceat(value, result.pairs.starts)
        enough = result.points_used > MINIMUM_LEFT
        worst = (value == peak[result.pairs.pair]) & (value > limit) & enough[result.pairs.pair]
        rows = np.flatnonzero(worst)
        if not len(rows):
            return result, log
        _, first = np.unique(result.pairs.pair[rows], return_index=True)  # of equal values the first
        rows = rows[first]
        log += [Rejection(int(r), test, float(value[r]), float(limit[r]), float(result.parallax[r])) for r in rows]
        result = _without(result, rows)


def _values(orientation: Orientation, test: str, bound: float) -> tuple[Floats, Floats]:
    """Test value and limit of every row."""
    if test == "parallax":
        return np.abs(orientation.parallax), np.full(len(orientation.parallax), bound)
    return _grubbs(orientation, bound) if test == "grubbs" else _tau(orientation, bound)


def _grubbs(orientation: Orientation, alpha: float) -> tuple[Floats, Floats]:
    """Deviation from the pair's mean residual in units of its standard deviation."""
    pairs, used = orientation.pairs, orientation.used
    count = orientation.points_used
    mean = pairs.sums(np.where(used, orientation.parallax, 0.0)) / count
    deviation = np.where(used, orientation.parallax - mean[pairs.pair], 0.0)
    spread = np.sqrt(pairs.sums(deviation**2) / (count - 1))
    tested = (count >= GRUBBS_MINIMUM) & (spread > NEGLIGIBLE)
    limits = np.array([grubbs_limit(int(n), alpha) if ok else np.inf for n, ok in zip(count, tested, strict=True)])
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.abs(deviation) / spread[pairs.pair]
    return np.where(np.isfinite(value), value, 0.0), limits[pairs.pair]


def _tau(orientation: Orientation, alpha: float) -> tuple[Floats, Floats]:
    """Studentised residual: each in units of its own standard deviation."""
    pairs = orientation.pairs
    count = orientation.points_used
    unknowns = relative.MINIMUM_POINTS
    tested = (count - unknowns >= 3) & (orientation.sigma0 > NEGLIGIBLE)
    limits = np.array(
        [tau_limit(int(n), unknowns, alpha) if ok else np.inf for n, ok in zip(count, tested, strict=True)]
    )
    sigma = np.sqrt(2.0) * orientation.sigma0[pairs.pair]
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.abs(orientation.parallax) * np.sqrt(pairs.weight) / (sigma * np.sqrt(orientation.redundancy))
    value[~(orientation.redundancy > TAU_REDUNDANCY)] = 0.0
    return np.where(np.isfinite(value), value, 0.0), limits[pairs.pair]
