"""Gross errors in relative orientation: the methods by name, the tests of single residuals, the log.

``parallax+grubbs`` tests the residual y parallax against a limit, then by Grubbs' test; ``tau`` tests studentised
residuals. Every round takes at most one point from a pair, the worst, and orients that pair again: removing several
at once also throws out good points that a bad neighbour has pulled. All pairs go through a round together. No
rejection of theirs leaves a pair or a standard zone without support.

``deletion``, ``robust`` and ``auto`` are in ``pair_search``.

Source: [004a]; the two-sided form and the order of work are chosen here, see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import InputError
from photostrip.rejection import Rejection
from photostrip.statistics import grubbs_limit, tau_limit
from photostrip.strip.pair_search import PairSearch, ParallaxScatter, rejection, residual_sigma, search
from photostrip.strip.relative_orientation.orientation import (
    LEAST_IN_FRONT,
    SCREENINGS,
    Orientation,
    RelativeSettings,
    orient_again,
    unusable_pairs,
)
from photostrip.strip.relative_orientation.pairs import MINIMUM_POINTS
from photostrip.strip.relative_orientation.solution import rays_meet_in_front
from photostrip.strip.relative_orientation.standard_points import MINIMUM_LEFT, Support, zones

SEARCHES = {"auto": (True, True), "deletion": (False, True), "robust": (True, False)}  # robust start, sets of points
NEGLIGIBLE = 1e-9  # mm; residuals of error-free data are rounding, not measurements
LIMIT_FACTOR = 4.0  # a-priori standard deviations of a y parallax
DETECTABLE = 4.13  # shift of a normal variable found in 80 % of cases by a two-sided test at 0.1 %


@dataclass(frozen=True, eq=False)
class ScreenedPairs:
    """Oriented pairs after the search for gross errors, and how far errors can be seen in them."""

    orientation: Orientation  # pairs oriented without the rejected points
    rejections: tuple[Rejection, ...]  # rows of pairs that were rejected, in order; with the error of the y parallax
    scatter: ParallaxScatter  # standard deviations of a y parallax of weight one
    # (p,): pairs that fail the global test with nothing left to reject: errors that hide each other are suspected
    masked: Flags
    converged: Flags  # (p,): whether the orientation of each pair converged

    @cached_property
    def zone(self) -> Numbers:
        """Standard zone of every point, 1 to 6, shape (m,)."""
        return zones(self.orientation.elements, self.orientation.pairs)

    @property
    def counts(self) -> Numbers:
        """Points that take part, by pair and zone, shape (p, 6)."""
        return Support.of(self.orientation, self.zone).counts

    @property
    def detectable(self) -> Floats:
        """Smallest error of each point's y parallax that a test finds in 80 % of cases, mm, shape (m,).

        Infinite where a point has no redundancy, NaN where it takes no part.
        """
        pairs = self.orientation.pairs
        with np.errstate(divide="ignore", invalid="ignore"):
            sigma = self.scatter.by_pair[pairs.pair] / np.sqrt(pairs.weight)
            size: Floats = DETECTABLE * sigma / np.sqrt(np.maximum(self.orientation.redundancy, 0.0))
        return np.where(self.orientation.used, size, np.nan)


def screen_pairs(
    orientation: Orientation, settings: RelativeSettings, sigma: float, converged: Flags | None = None
) -> ScreenedPairs:
    """Reject points with gross errors, and say what can and what cannot be seen in each pair.

    With ``auto`` and ``robust`` the pairs need not make sense yet; ``converged`` (p,) says whose orientation converged,
    all by default. ``sigma`` is that of an image coordinate, mm.
    """
    if settings.screening not in SCREENINGS:
        msg = f"screening method {settings.screening!r} is not available; choose one of {', '.join(SCREENINGS)}"
        raise InputError(msg)
    sound = np.ones(orientation.pairs.size, bool) if converged is None else converged
    doubtful = unusable_pairs(orientation, sound)
    behind = ~rays_meet_in_front(*orientation.rays)
    start, sets = SEARCHES.get(settings.screening, SEARCHES["auto"])
    with np.errstate(all="ignore"):
        found = search(orientation, max(np.sqrt(2.0) * sigma, NEGLIGIBLE), doubtful, start=start, sets=sets)
    if settings.screening in SEARCHES:
        result, log = _searched(orientation, found, behind)
        # a pair that was lost at first and now fits its points has converged after all; any other is refused
        sound = sound | (doubtful & ~found.test.failing(result))
        lost = np.flatnonzero(doubtful & unusable_pairs(result, sound))
        result = result.with_pairs(lost, orientation.take(lost))
    else:
        result, log = _sequential(orientation, settings, sigma, behind)
    return ScreenedPairs(
        orientation=result,
        rejections=_completed(log, result),
        scatter=found.scatter,
        masked=found.test.failing(result),
        converged=sound,
    )


def _searched(given: Orientation, found: PairSearch, behind: Flags) -> tuple[Orientation, list[Rejection]]:
    """Write the log of a search, and take out what lies behind a camera."""
    result = found.orientation
    if result is not given:
        behind = ~rays_meet_in_front(*result.rays)
    result, dropped = _drop_behind(result, behind)
    return result, [*found.removed, *dropped]


def _sequential(
    orientation: Orientation, settings: RelativeSettings, sigma: float, behind: Flags
) -> tuple[Orientation, list[Rejection]]:
    """Test single residuals, one stage after the other."""
    result, log = _drop_behind(orientation, behind)
    for test, bound in stages(settings, sigma):
        result, found = _stage(result, test, bound)
        log += found
    return result, log


def stages(settings: RelativeSettings, sigma: float) -> list[tuple[str, float]]:
    """Return the tests of single residuals in their order, each with its limit, mm, or its level."""
    limit, level = settings.parallax_limit, settings.grubbs_alpha
    first = LIMIT_FACTOR * sigma * np.sqrt(2.0) if limit is None else limit
    known = {"tau": [("tau", level)], "parallax+grubbs": [("parallax", first), ("grubbs", level)]}
    return known.get(settings.screening, [])


def _completed(log: list[Rejection], result: Orientation) -> tuple[Rejection, ...]:
    """Add to each rejection what only the final orientation can say."""
    parallax, used = result.parallax, result.used
    return tuple(replace(each, size=(float(parallax[each.row]),), readmitted=bool(used[each.row])) for each in log)


def _drop_behind(orientation: Orientation, behind: Flags) -> tuple[Orientation, list[Rejection]]:
    """Take out the points that come out behind a camera; no measurement of theirs can be right."""
    pairs, used = orientation.pairs, orientation.used
    rows = np.flatnonzero(behind & used)
    # with most of its points behind, the pair itself is wrong, and refuse_unusable says so
    most = pairs.sums((~behind & used).astype(float)) > LEAST_IN_FRONT * orientation.points_used
    rows = rows[most[pairs.pair[rows]]]
    if not len(rows):
        return orientation, []
    log = [rejection(row, "in front", np.nan, np.nan) for row in rows.tolist()]
    return _without(orientation, rows), log


def _without(orientation: Orientation, rows: Numbers) -> Orientation:
    weight = orientation.pairs.weight.copy()
    weight[rows] = 0.0
    return orient_again(orientation, weight, np.unique(orientation.pairs.pair[rows]))


def _stage(orientation: Orientation, test: str, bound: float) -> tuple[Orientation, list[Rejection]]:
    """Repeat one test, worst point first, until no pair has anything to reject."""
    result = orientation
    log: list[Rejection] = []
    while True:
        value, limit, _ = tested(result, test, bound)
        value[~result.used] = -np.inf
        peak = np.maximum.reduceat(value, result.pairs.starts)
        spare = Support.of(result).spare(result.pairs.pair)
        worst = (value == peak[result.pairs.pair]) & (value > limit) & spare
        rows = np.flatnonzero(worst)
        if not len(rows):
            return result, log
        _, first = np.unique(result.pairs.pair[rows], return_index=True)  # of equal values the first
        rows = rows[first]
        log += [rejection(row, test, value[row], limit[row]) for row in rows.tolist()]
        result = _without(result, rows)


class Tested(NamedTuple):
    """Every row of the pairs as a test sees it."""

    value: Floats
    limit: Floats  # infinite where nothing can be told
    unit: Floats  # millimetres of one unit of both


def tested(orientation: Orientation, test: str, bound: float) -> Tested:
    """Test single residuals.

    bound: the limit of the test ``parallax``, mm; the level of ``grubbs``, deviation from the mean of the pair, and of
        ``tau``, studentised residual.
    """
    pairs, count, size = orientation.pairs, orientation.points_used, orientation.parallax
    if test == "parallax":
        return Tested(np.abs(size), np.full(len(size), bound), np.ones(len(size)))
    if test == "grubbs":
        mean = pairs.sums(np.where(orientation.used, size, 0.0)) / count
        size = np.where(orientation.used, size - mean[pairs.pair], 0.0)
        spread = np.sqrt(pairs.sums(size**2) / (count - 1))
        unit, least, limit = spread[pairs.pair], MINIMUM_LEFT + 1, partial(grubbs_limit, alpha=bound)
    else:
        spread = np.sqrt(2.0) * orientation.sigma0
        unit, least = residual_sigma(orientation, spread), MINIMUM_POINTS + 3
        limit = partial(tau_limit, unknowns=MINIMUM_POINTS, alpha=bound)
    limits = np.where(count >= least, limit(np.maximum(count, least)), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.nan_to_num(np.abs(size) / unit, posinf=0.0)
    return Tested(value, np.where(spread > NEGLIGIBLE, limits, np.inf)[pairs.pair], unit)
