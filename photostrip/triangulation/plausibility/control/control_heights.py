"""Given heights against those of a strip: their unit and sense, groups that are off by a constant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.statistics import t_quantile
from photostrip.triangulation.plausibility.control.control_fit import KEPT, LEAST, Bent, bend, lay, upright
from photostrip.triangulation.plausibility.control.control_strip import (
    FEET_NEAR,
    FOOT,
    SPARE,
    Fitted,
    Given,
    Level,
    Seen,
    levelled,
    simplest,
    straightened,
)
from photostrip.triangulation.plausibility.finding import found

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from photostrip.notes import Finding

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

SURE = 1e-5  # probability of a finding where there is nothing to find
SCALE_LEAST = 0.03  # of the ratio of heights to plan: a smaller one harms nobody and may be a bent strip
OFFSET_LEAST = 8.0  # a-priori standard deviations of a height: a smaller constant does no harm
GROUP_LEAST = 3
ASIDE = 2  # more points that a bend leaves aside than a constant: it does not explain them
EXPLAINED_BY_FEET = 0.75  # the same, for a ratio that would be a strange coincidence
EXPLAINED = 0.5  # of what heights leave without it: what explains a bend of the strip as well explains nothing


@dataclass(frozen=True, eq=False)
class Heights:
    """Given heights against those of a strip."""

    # usable, took_part: (n,): heights that can be judged, and those that take part in the fit
    usable: Flags
    took_part: Flags
    value: Floats  # (n,): given minus height in the strip, metres
    columns: Floats  # (n, c): tilt and, where it is needed, bending
    whole: list[Floats]  # (n,): all columns of tilt and bending
    deviation: Floats  # (n,): heights in the strip, against their mean
    scaled: Bent  # fit with the scale of the heights free; its last coefficient is that scale minus one

    @property
    def ratio(self) -> tuple[float, float]:
        """Heights given over heights in the strip, and its standard deviation."""
        return 1.0 + float(self.scaled.coefficient[-1]), float(self.scaled.sigma[-1])


def compare(given: Given, fitted: Fitted, judged: Flags) -> Heights | None:
    """Compare given heights with those of a strip.

    Parameters
    ----------
    judged : ndarray of bool, shape (n,)
        Points of lists that go with each other.

    Returns
    -------
    Heights or None
        None when too few are given.
    """
    usable = given.use[:, 2] & np.isfinite(given.level[:, 2]) & np.isfinite(fitted.height)
    took_part = usable & ~given.check & judged
    agreeing = took_part & ~(np.isfinite(fitted.plan.residual) & fitted.plan.odd)
    took_part = agreeing if agreeing.sum() >= LEAST + SPARE else took_part
    if took_part.sum() <= LEAST:
        return None
    x, y = fitted.along, fitted.across
    whole = [np.where(usable, each, 0.0) for each in (np.ones(len(x)), x, y, x**2, x * y)]
    height = np.where(usable, fitted.height, 0.0)
    value = np.where(usable, given.level[:, 2], 0.0) - height
    deviation = height - height[took_part].mean()
    # a wrong scale of the heights must not pass for a bending strip
    base, _ = simplest([deviation, *whole], 4, value, took_part, fitted.floor[1])
    base = base[:, 1:]
    scaled = bend(np.column_stack([base, deviation]), value, took_part, fitted.floor[1])
    return Heights(usable, took_part, value, base, whole, deviation, scaled)


class Stretched(NamedTuple):
    """How a strip fits the heights of its control."""

    ratio: float  # heights given over heights in the strip
    misfit: float  # what is left of the heights as they are, in units of what makes sense
    # rms of the heights that no tilt and no bend explains, in the same units: what a stretch would show in
    relief: float


def stretched(given: Given, seen: Seen) -> Stretched | None:
    """Estimate by how much the heights of a strip are stretched, for a trial with another principal distance.

    Returns
    -------
    Stretched or None
        None when that cannot be told.
    """
    turn = upright(seen.axes)
    s = seen.xyz @ turn.T
    w = s[:, 0] + 1j * s[:, 1]
    took_part = given.use[:, 0] & ~given.check & np.isfinite(given.plan) & np.isfinite(w)
    laid = lay(w[took_part], given.plan[took_part])
    if laid is None:
        return None
    level = levelled(given, Level(w, s[:, 2], laid, turn, seen.depth), seen.floor[1], took_part)
    fitted = straightened(given, level, seen.floor, took_part)
    heights = compare(given, fitted, np.ones(len(w), bool))
    if heights is None or heights.took_part.sum() < LEAST + SPARE:
        return None
    tilt = np.column_stack(heights.whole[:LEAST])
    plain = bend(tilt, heights.value, heights.took_part, fitted.floor[1])
    free = bend(np.column_stack([tilt, heights.deviation]), heights.value, heights.took_part, fitted.floor[1])
    size = np.abs(plain.residual[heights.took_part])
    freedom = max(int(heights.took_part.sum()) - LEAST, 1)
    misfit = float(np.sqrt((np.minimum(size, KEPT * np.median(size)) ** 2).sum() / freedom)) / fitted.floor[1]
    whole, here = np.column_stack(heights.whole)[heights.took_part], heights.deviation[heights.took_part]
    left = here - whole @ np.linalg.lstsq(whole, here, rcond=None)[0]
    relief = float(np.sqrt((left**2).mean())) / fitted.floor[1]
    return Stretched(1.0 + float(free.coefficient[-1]), max(misfit, 1.0), relief)


def examine(given: Given, seen: Seen, heights: Heights, fit: Bent, floor: float) -> Iterator[Finding]:
    """Examine the heights: their unit and sense, groups that are off by a constant.

    Parameters
    ----------
    heights : Heights
        Their heights against those of the strip.
    fit : Bent
        What is left of them, tilt and bending taken out.
    floor : float
        Smallest standard deviation that makes sense, metres.

    Yields
    ------
    Finding
        P105, P401, P404, P405, at most one.
    """
    took_part = heights.took_part
    ratio, sigma = heights.ratio
    feet = min(abs(ratio * each - 1.0) for each in (FOOT, 1 / FOOT)) < FEET_NEAR
    explains = heights.scaled.sigma0 < (EXPLAINED_BY_FEET if feet else EXPLAINED) * fit.sigma0
    if explains and _significant(ratio - 1.0, sigma, heights.scaled.freedom, SCALE_LEAST):
        yield _other_scale(seen, ratio, sigma, took_part)
        return
    for names, inside, key in _groups(given, took_part):
        _, offset = simplest([inside.astype(float), *heights.whole], 4, heights.value, took_part, floor)
        size, sigma = float(offset.coefficient[0]), float(offset.sigma[0])
        bending = simplest(heights.whole, 3, heights.value, took_part, floor)[1]
        # a bend may leave all points with more, or some of them aside as if they were wrong
        aside = int((took_part & ~bending.used).sum()) - int((took_part & ~offset.used).sum())
        explains = offset.sigma0 < EXPLAINED * bending.sigma0 or aside >= ASIDE
        if explains and _significant(size, sigma, offset.freedom, OFFSET_LEAST * floor):
            yield _other_heights(given, seen, names, key, size, sigma, inside & took_part)
            return


def _significant(value: float, sigma: float, freedom: int, least: float) -> bool:
    if freedom < 1 or not np.isfinite(sigma):
        return False
    return bool(abs(value) > max(t_quantile(1 - SURE, freedom) * sigma, least))


def _other_scale(seen: Seen, ratio: float, sigma: float, took_part: Flags) -> Finding:
    """Say why heights are stretched against the plan."""
    evidence: dict[str, float | int | str] = {
        "heights_given_over_strip": ratio, "its_standard_deviation": sigma, "points": int(took_part.sum())
    }  # fmt: skip
    head = f"strip {seen.strip}: heights of the control are {ratio:.3f} ± {sigma:.3f} times those of the strip"
    strips = (seen.strip,)
    near = max(FEET_NEAR, 4.0 * sigma / abs(ratio))
    if ratio < 0:
        message = f"{head}: they are counted downwards"
        return found("P401", message, "give heights, positive upwards", evidence, strips=strips, key="control")
    for feet, text in ((1 / FOOT, "heights in feet, plan in metres"), (FOOT, "heights in metres, plan in feet")):
        if abs(ratio / feet - 1.0) < near:
            message = f"{head}, while the plan fits: {text}"
            fix = "bring heights and plan into one unit, or name a crs with the right unit of height"
            return found("P405", message, fix, evidence, strips=strips, key="control")
    message = f"{head}, while the plan fits: the principal distance is off by that factor"
    fix = f"is the principal distance {ratio:.3f} times as long? or is the unit of the heights another one?"
    return found("P105", message, fix, evidence, strips=strips, key="cameras")


def _groups(given: Given, took_part: Flags) -> Iterator[tuple[str, Flags, str]]:
    """Give groups of heights that may be of another kind: lists, and points without plan."""
    for number in np.unique(given.group[took_part])[1:].tolist():
        inside = given.group == number
        if min((inside & took_part).sum(), (~inside & took_part).sum()) >= GROUP_LEAST:
            yield f"control[{number}]", inside, f"control[{number}].height"
    alone = ~given.use[:, 0]
    if min((alone & took_part).sum(), (~alone & took_part).sum()) >= GROUP_LEAST:
        yield "the points given in height only", alone, "control"


def _other_heights(given: Given, seen: Seen, names: str, key: str, size: float, sigma: float, rows: Flags) -> Finding:
    message = (
        f"strip {seen.strip}: the heights of {names} differ from the others by a constant {size:+.2f} ± {sigma:.2f} m, "
        "as ellipsoidal heights differ from those above the geoid"
    )
    evidence = {"constant_m": size, "its_standard_deviation_m": sigma, "points": int(rows.sum())}
    fix = "state `height` and `geoid_undulation` of each control list"
    points = tuple(given.ids[row] for row in np.flatnonzero(rows))
    return found("P404", message, fix, evidence, points=points, strips=(seen.strip,), key=key)
