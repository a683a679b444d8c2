"""Given heights against those of a strip: their unit and sense, groups that are off by a constant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.geodesy.curvature import EARTH_RADIUS
from photostrip.notes import Finding
from photostrip.plausibility.control.plan_fit import (
    KEPT_SIGMAS,
    LEAST_POINTS,
    RobustFit,
    fit_robustly,
    fit_similarity,
    upright,
)
from photostrip.plausibility.control.straightening import (
    FEET_TOLERANCE,
    FOOT,
    LEAST_REDUNDANCY,
    GivenPoints,
    LevelStrip,
    StraightenedStrip,
    StripPoints,
    fit_simplest,
    straighten,
    turn_level,
)
from photostrip.plausibility.finding import Evidence, found
from photostrip.statistics import t_quantile

FALSE_ALARM = 1e-5  # probability of a finding where there is nothing to find
LEAST_SCALE_ERROR = 0.03  # of the ratio of heights to plan: a smaller one harms nobody and may be a bent strip
LEAST_OFFSET_SIGMAS = 8.0  # a-priori standard deviations of a height: a smaller constant does no harm
LEVEL_SIGMAS = 3.0  # a-priori standard deviations that heights which are all the same must leave: a lake leaves none
LEAST_GROUP = 3
MORE_ASIDE = 2  # more points that a bend leaves aside than a constant: it does not explain them
EXPLAINED_SHARE_IN_FEET = 0.75  # the same, for a ratio that would be a strange coincidence
EXPLAINED_SHARE = 0.5  # of what heights leave without it: what explains a bend of the strip as well explains nothing

# ratios of heights to plan, and by how much each may be off: a principal distance off by a hundred shows in its field
HEIGHT_UNITS = (
    (1 / FOOT, FEET_TOLERANCE, "heights in feet, plan in metres"),
    (FOOT, FEET_TOLERANCE, "heights in metres, plan in feet"),
    (1000.0, EXPLAINED_SHARE, "heights in millimetres, plan in metres"),
    (100.0, EXPLAINED_SHARE, "heights in centimetres, plan in metres"),
    (0.001, EXPLAINED_SHARE, "heights in kilometres, plan in metres"),
)


@dataclass(frozen=True, eq=False)
class HeightComparison:
    """Given heights against those of a strip."""

    # usable, in_fit: (n,): heights that can be tested, and those that take part in the fit
    usable: Flags
    in_fit: Flags
    value: Floats  # (n,): given minus height in the strip, metres
    whole: list[Floats]  # (n,): all columns of tilt and bending
    deviation: Floats  # (n,): heights in the strip, against their mean
    # (n,): heights given, without the curvature of the Earth, against their mean: a strip that bends has heights where
    # the ground has none
    relief: Floats
    floor: float  # smallest standard deviation that makes sense, metres

    @property
    def columns(self) -> Floats:
        """Tilt and, where it is needed, bending, shape (n, c); a wrong scale must not pass for a bending strip."""
        return np.asarray(self._with_scale[0][:, 1:])

    @property
    def scaled(self) -> RobustFit:
        """Fit with the scale of the heights free; its first coefficient is that scale minus one."""
        return self._with_scale[1]

    @cached_property
    def as_given(self) -> RobustFit:
        """Fit of tilt and bending, the scale being right."""
        return fit_robustly(self.columns, self.value, self.in_fit, self.floor)

    @cached_property
    def _with_scale(self) -> tuple[Floats, RobustFit]:
        return fit_simplest([self.deviation, *self.whole], 4, self.value, self.in_fit, self.floor)


def compare_heights(given: GivenPoints, fitted: StraightenedStrip, consistent: Flags) -> HeightComparison | None:
    """Compare given heights with those of a strip; None when too few are given."""
    usable = given.use[:, 2] & np.isfinite(given.xyz[:, 2]) & np.isfinite(fitted.height)
    in_fit = usable & ~given.check & consistent
    agreeing = in_fit & ~(np.isfinite(fitted.plan.residual) & fitted.plan.odd)
    in_fit = agreeing if agreeing.sum() >= LEAST_POINTS + LEAST_REDUNDANCY else in_fit
    if in_fit.sum() <= LEAST_POINTS:
        return None
    x, y = fitted.along, fitted.across
    whole = [np.where(usable, each, 0.0) for each in (np.ones(len(x)), x, y, x**2, x * y)]
    height = np.where(usable, fitted.height, 0.0)
    value = np.where(usable, given.xyz[:, 2], 0.0) - height
    deviation = height - height[in_fit].mean()
    relief = value + height + np.where(usable, x**2 + y**2, 0.0) / (2.0 * EARTH_RADIUS)
    return HeightComparison(
        usable=usable,
        in_fit=in_fit,
        value=value,
        whole=whole,
        deviation=deviation,
        relief=relief - relief[in_fit].mean(),
        floor=fitted.floor[1],
    )


@dataclass(frozen=True, eq=False)
class HeightStretch:
    """How a strip fits the heights of its control."""

    heights: HeightComparison

    @cached_property
    def ratio(self) -> float:
        """Heights given over heights in the strip."""
        return 1.0 + float(self._fit([*self._tilt, self.heights.deviation]).coefficient[-1])

    @cached_property
    def misfit(self) -> float:
        """What is left of the heights as they are, in units of what makes sense."""
        return self._left(self._fit(self._tilt).residual, LEAST_POINTS)

    @cached_property
    def in_relief(self) -> float:
        """The same of what is left when the strip may bend."""
        return self._left(self._fit(self.heights.whole).residual, len(self.heights.whole))

    @property
    def _tilt(self) -> list[Floats]:
        return self.heights.whole[:LEAST_POINTS]

    def _fit(self, columns: list[Floats]) -> RobustFit:
        h = self.heights
        return fit_robustly(np.column_stack(columns), h.value, h.in_fit, h.floor)

    def _left(self, residual: Floats, unknowns: int) -> float:
        """Rms of what a fit leaves; what is far off counts less."""
        size = np.abs(residual[self.heights.in_fit])
        freedom = max(len(size) - unknowns, 1)
        rms = float(np.sqrt((np.minimum(size, KEPT_SIGMAS * np.median(size)) ** 2).sum() / freedom))
        return max(rms / self.heights.floor, 1.0)


def height_stretch(given: GivenPoints, on_strip: StripPoints) -> HeightStretch | None:
    """Estimate by how much the heights of a strip are stretched, for a trial with another principal distance."""
    turn = upright(on_strip.axes)
    s = on_strip.xyz @ turn.T
    w = s[:, 0] + 1j * s[:, 1]
    in_fit = given.use[:, 0] & ~given.check & np.isfinite(given.plan) & np.isfinite(w)
    laid = fit_similarity(w[in_fit], given.plan[in_fit])
    if laid is None:
        return None
    level = turn_level(
        given, LevelStrip(w=w, z=s[:, 2], similarity=laid, turn=turn, depth=on_strip.depth), on_strip.floor[1], in_fit
    )
    fitted = straighten(given, level, on_strip.floor, in_fit)
    heights = compare_heights(given, fitted, np.ones(len(w), bool))
    return stretch_of(heights)


def stretch_of(heights: HeightComparison | None) -> HeightStretch | None:
    """Give the stretch of compared heights; None where too few are given."""
    if heights is None or heights.in_fit.sum() < LEAST_POINTS + LEAST_REDUNDANCY:
        return None
    return HeightStretch(heights)


def find_wrong_heights(
    given: GivenPoints, on_strip: StripPoints, heights: HeightComparison, floor: float
) -> Iterator[Finding]:
    """Find heights of another unit or sense, and groups of heights that are off by a constant.

    floor: smallest standard deviation that makes sense, metres.
    Yields P105, P401, P404, P405, P410, at most one.
    """
    in_fit, fit = heights.in_fit, heights.as_given
    if np.ptp(given.written[in_fit, 2]) == 0 and fit.sigma0 > LEVEL_SIGMAS * floor:
        yield _all_alike(given, on_strip, in_fit, fit.sigma0)
        return
    ratio, sigma = 1.0 + float(heights.scaled.coefficient[0]), float(heights.scaled.sigma[0])
    feet = min(abs(ratio * each - 1.0) for each in (FOOT, 1 / FOOT)) < FEET_TOLERANCE
    explains = heights.scaled.sigma0 < (EXPLAINED_SHARE_IN_FEET if feet else EXPLAINED_SHARE) * fit.sigma0
    stretched = explains and _significant(ratio - 1.0, sigma, heights.scaled.freedom, LEAST_SCALE_ERROR)
    if stretched and _shows_in_relief(heights, floor):
        yield _other_scale(on_strip, ratio, sigma, in_fit)
        return
    for names, inside, key in _groups(given, in_fit):
        _, offset = fit_simplest([inside.astype(float), *heights.whole], 4, heights.value, in_fit, floor)
        size, sigma = float(offset.coefficient[0]), float(offset.sigma[0])
        bending = fit_simplest(heights.whole, 3, heights.value, in_fit, floor)[1]
        # a bend may leave all points with more, or some of them aside as if they were wrong
        aside = int((in_fit & ~bending.used).sum()) - int((in_fit & ~offset.used).sum())
        explains = offset.sigma0 < EXPLAINED_SHARE * bending.sigma0 or aside >= MORE_ASIDE
        if explains and _significant(size, sigma, offset.freedom, LEAST_OFFSET_SIGMAS * floor):
            yield _other_heights(given, on_strip, names, key, size, sigma, inside & in_fit)
            return


def _all_alike(given: GivenPoints, on_strip: StripPoints, in_fit: Flags, left: float) -> Finding:
    height = float(given.written[in_fit, 2][0])
    message = (
        f"strip {on_strip.strip}: all {int(in_fit.sum())} heights of the control are {height:g} m, and the photos show "
        f"a relief of {left:.2g} m (standard deviation)"
    )
    evidence: Evidence = {"height_m": height, "left_m": left, "points": int(in_fit.sum())}
    fix = "give the heights, or `use: xy` where they are not known"
    return found("P410", message, fix, evidence, strips=(on_strip.strip,), key="control")


def _shows_in_relief(heights: HeightComparison, floor: float) -> bool:
    """Whether the heights given show the stretch as well: they have no part in a bend of the strip."""
    agreeing = heights.in_fit & heights.scaled.used
    _, fit = fit_simplest([heights.relief, *heights.whole], 4, heights.value, agreeing, floor)
    return _significant(float(fit.coefficient[0]), float(fit.sigma[0]), fit.freedom, LEAST_SCALE_ERROR)


def _significant(value: float, sigma: float, freedom: int, least: float) -> bool:
    if freedom < 1 or not np.isfinite(sigma):
        return False
    return bool(abs(value) > max(t_quantile(1 - FALSE_ALARM, freedom) * sigma, least))


def _other_scale(on_strip: StripPoints, ratio: float, sigma: float, in_fit: Flags) -> Finding:
    evidence: Evidence = {
        "heights_given_over_strip": ratio,
        "its_standard_deviation": sigma,
        "points": int(in_fit.sum()),
    }
    head = f"strip {on_strip.strip}: heights of the control are {ratio:.3f} ± {sigma:.3f} times those of the strip"
    strips = (on_strip.strip,)
    if ratio < 0:
        message = f"{head}: they are counted downwards"
        return found("P401", message, "give heights, positive upwards", evidence, strips=strips, key="control")
    for unit, near, text in HEIGHT_UNITS:
        if abs(ratio / unit - 1.0) < max(near, 4.0 * sigma / abs(ratio)):
            message = f"{head}, while the plan fits: {text}"
            fix = "bring heights and plan into one unit, or name a crs with the right unit of height"
            return found("P405", message, fix, evidence, strips=strips, key="control")
    message = f"{head}, while the plan fits: the principal distance is off by that factor"
    fix = f"is the principal distance {ratio:.3f} times as long? or is the unit of the heights another one?"
    return found("P105", message, fix, evidence, strips=strips, key="cameras")


def _groups(given: GivenPoints, in_fit: Flags) -> Iterator[tuple[str, Flags, str]]:
    """Give groups of heights that may be of another kind: lists, and points without plan."""
    for number in np.unique(given.group[in_fit])[1:].tolist():
        inside = given.group == number
        if min((inside & in_fit).sum(), (~inside & in_fit).sum()) >= LEAST_GROUP:
            yield f"control[{number}]", inside, f"control[{number}].height"
    alone = ~given.use[:, 0]
    if min((alone & in_fit).sum(), (~alone & in_fit).sum()) >= LEAST_GROUP:
        yield "the points given in height only", alone, "control"


def _other_heights(
    given: GivenPoints, on_strip: StripPoints, names: str, key: str, size: float, sigma: float, rows: Flags
) -> Finding:
    message = (
        f"strip {on_strip.strip}: the heights of {names} differ from the others by a constant "
        f"{size:+.2f} ± {sigma:.2f} m, as ellipsoidal heights differ from those above the geoid"
    )
    evidence = {"constant_m": size, "its_standard_deviation_m": sigma, "points": int(rows.sum())}
    fix = "state `height` and `geoid_undulation` of each control list"
    points = tuple(given.ids[row] for row in np.flatnonzero(rows))
    return found("P404", message, fix, evidence, points=points, strips=(on_strip.strip,), key=key)
