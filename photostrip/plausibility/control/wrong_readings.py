"""What given coordinates say against themselves, compared with a strip whose own coordinates are known.

The strip is laid on its control (``plan_fit``) as it is and as a mirror image, then its bending is taken out
(``straightening``); what is left says which list (``foreign_lists``), which kind of heights
(``wrong_heights``) and which point (``point_slips``) does not go with the others. Points are tested by what
the others predict, check points too, but no check point ever takes part in a fit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from photostrip.arrays import Flags
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.notes import Finding
from photostrip.plausibility.control import foreign_lists, point_slips, wrong_heights
from photostrip.plausibility.control.plan_fit import (
    LEAST_POINTS,
    PlanSimilarity,
    fit_similarity,
    upright,
)
from photostrip.plausibility.control.point_slips import Misclosures
from photostrip.plausibility.control.straightening import (
    GivenPoints,
    LevelStrip,
    StripPoints,
    straighten,
    turn_level,
    upright_coordinates,
)
from photostrip.plausibility.control.wrong_heights import HeightComparison
from photostrip.plausibility.finding import Evidence, found

Complex = NDArray[np.complex128]

NO_FIT = "P409"
MIRRORED_SHARE = 0.15  # of the misclosure of the strip as it is, left when it is mirrored
FIT_SHARE = 0.1  # of the extent of the control: a misclosure above it is no fit


class Reading(NamedTuple):
    """Given points as a strip reads them."""

    findings: list[Finding]  # P103, P105, P401, P403 to P410
    heights: HeightComparison | None = None  # None where too few go with the strip


def find_wrong_readings(
    given: GivenPoints,
    on_strip: StripPoints,
    *,
    axes_are_right: bool | None = None,
    exchanged: Callable[[], GivenPoints | None] = lambda: None,
) -> Reading:
    """Compare given points with a strip.

    axes_are_right: whether the place on the Earth shows the axes of the control to be right (True) or wrong (False).
    exchanged: gives the points with east and north exchanged before anything else is done with them: longitudes read as
        latitudes are no mirror image of the ground, a degree of the one being shorter.
    """
    turn = upright(on_strip.axes)
    s = upright_coordinates(on_strip.xyz, turn)
    w = s[:, 0] + 1j * s[:, 1]
    in_fit = given.use[:, 0] & ~given.check & np.isfinite(given.plan) & np.isfinite(w)
    normal, mirror = (fit_similarity(w[in_fit], given.plan[in_fit], mirrored=each) for each in (False, True))
    if normal is None or mirror is None:
        return Reading([])
    findings: list[Finding] = []
    extent = float(np.abs(given.plan[in_fit] - given.plan[in_fit].mean()).max())
    best = normal
    if mirror.median < min(MIRRORED_SHARE * normal.median, FIT_SHARE * extent):
        best = mirror
        findings.append(_mirror(on_strip, normal, mirror, extent, axes_are_right=axes_are_right))
    elif normal.median > FIT_SHARE * extent:
        columns = _columns(given, exchanged(), on_strip, w, in_fit, normal)
        return Reading(
            columns or _rows(given, on_strip, w, normal, extent) or _of_other_points(on_strip, in_fit, normal, extent)
        )
    elif rows := _rows(given, on_strip, w, normal, extent):
        return Reading(rows)
    level = turn_level(
        given, LevelStrip(w=w, z=s[:, 2], similarity=best, turn=turn, depth=on_strip.depth), on_strip.floor[1], in_fit
    )
    wrong_lists, lists = foreign_lists.find_foreign_lists(given, on_strip, level, in_fit)
    findings += lists
    if wrong_lists:
        in_fit = in_fit & ~np.isin(given.group, wrong_lists)
        again = fit_similarity(level.w[in_fit], given.plan[in_fit], mirrored=level.similarity.mirrored)
        if again is None:
            return Reading(findings)
        level = replace(level, similarity=again)
    fitted = straighten(given, level, on_strip.floor, in_fit)
    consistent = ~np.isin(given.group, wrong_lists)
    heights = wrong_heights.compare_heights(given, fitted, consistent)
    if heights is None:
        left = Misclosures(fitted.plan, height=None, usable=np.zeros(len(consistent), bool), consistent=consistent)
        return Reading([*findings, *point_slips.find_plan_slips(given, on_strip, fitted, left)])
    left = Misclosures(plan=fitted.plan, height=heights.as_given, usable=heights.usable, consistent=consistent)
    findings += point_slips.find_plan_slips(given, on_strip, fitted, left)
    whole = list(wrong_heights.find_wrong_heights(given, on_strip, heights, fitted.floor[1]))
    return Reading(findings + (whole or list(point_slips.find_height_slips(given, on_strip, fitted, left))), heights)


def _mirror(
    on_strip: StripPoints, normal: PlanSimilarity, mirror: PlanSimilarity, extent: float, *, axes_are_right: bool | None
) -> Finding:
    evidence: Evidence = {
        "misclosure_as_given_m": normal.median,
        "misclosure_mirrored_m": mirror.median,
        "extent_of_control_m": extent,
        "base_direction_on_photos_deg": float(np.degrees(on_strip.base_angle)),
    }
    fit = (
        f"strip {on_strip.strip} fits its control only as a mirror image: median misclosure in plan "
        f"{normal.median:.4g} m as given, {mirror.median:.3g} m mirrored"
    )
    if axes_are_right:
        message = f"{fit}; the control lies where its coordinate reference system is, so the image coordinates are "
        message += f"mirrored; {_how(on_strip.base_angle)}"
        fix = "correct `observations.y_axis`, the columns x and y, or the side from which the photos were measured"
        return found("P103", message, fix, evidence, strips=(on_strip.strip,), key="observations.y_axis")
    cause = "" if axes_are_right is None else ", and it lies outside its coordinate reference system"
    message = f"{fit}{cause}; the control is left-handed: its axes are exchanged or one of them counts backwards"
    if axes_are_right is None:
        message += f"; or else the image coordinates are mirrored ({_how(on_strip.base_angle)})"
    fix = "put `control.axes` into the order of the columns, [north, east, up] where x points north"
    return found("P401", message, fix, evidence, strips=(on_strip.strip,), key="control")


def _how(angle: float) -> str:
    """Say which way of mirroring goes with photos whose x axis was meant to point along the flight."""
    quarter = round(np.degrees(angle) / 90.0) % 4
    names = ("y counted the other way", "x and y exchanged", "negatives read as positives", "x and y exchanged")
    return f"most likely {names[quarter]}"


def _columns(
    given: GivenPoints,
    exchanged: GivenPoints | None,
    on_strip: StripPoints,
    w: Complex,
    in_fit: Flags,
    normal: PlanSimilarity,
) -> list[Finding]:
    """Try other orders of the columns, when the strip fits the control neither way."""
    full = in_fit & given.use.all(axis=1)
    orders = [(given, order) for order in ((2, 1, 0), (0, 2, 1), (1, 2, 0), (2, 0, 1))]
    if exchanged is not None:
        orders.insert(0, (exchanged, (0, 1, 2)))
    for read, order in orders:
        plan = read.xyz[full][:, order[0]] + 1j * read.xyz[full][:, order[1]]
        fits = [fit_similarity(w[full], plan, mirrored=each) for each in (False, True)]
        middle = min((each.median for each in fits if each is not None), default=np.inf)
        spread = float(np.abs(plan - plan.mean()).max(initial=0.0)) if len(plan) else 0.0
        if (
            middle < MIRRORED_SHARE * normal.median
            and middle < FIT_SHARE * FIT_SHARE * spread
            and full.sum() > LEAST_POINTS
        ):
            names = [GROUND_AXES[each] for each in (order if read is given else (1, 0, 2))]
            message = (
                f"strip {on_strip.strip} does not fit its control in plan (median misclosure {normal.median:.4g} m), "
                f"but fits within {middle:.3g} m when what is called east, north, up is read as {', '.join(names)}"
            )
            evidence = {
                "misclosure_as_given_m": normal.median,
                "misclosure_m": middle,
                "extent_of_control_m": spread,
            }
            fix = "put `control.axes` into the order of the columns"
            return [found("P401", message, fix, evidence, strips=(on_strip.strip,), key="control")]
    return []


def _rows(
    given: GivenPoints, on_strip: StripPoints, w: Complex, normal: PlanSimilarity, extent: float
) -> list[Finding]:
    """Try ids that were written one row too high or too low, where many points are far off."""

    def far(plan: Complex, fit: PlanSimilarity) -> int:
        return int((np.abs(fit(w) - plan) > FIT_SHARE * extent).sum())

    before = far(given.plan, normal)
    for rows, way in ((1, "down"), (-1, "up")) if before else ():
        plan = np.roll(given.plan, rows)
        counts = np.isfinite(w) & np.isfinite(plan)
        fit = fit_similarity(w[counts], plan[counts])
        if fit is not None and fit.median < min(normal.median, FIT_SHARE * extent) and far(plan, fit) < before:
            message = (
                f"strip {on_strip.strip} does not fit its control in plan (median misclosure {normal.median:.4g} m), "
                f"but fits within {fit.median:.3g} m with the coordinates moved {way} by one row"
            )
            evidence: Evidence = {"misclosure_as_given_m": normal.median, "misclosure_m": fit.median}
            fix = "put the ids into the rows of their coordinates"
            return [found(NO_FIT, message, fix, evidence, strips=(on_strip.strip,), key="control")]
    return []


def _of_other_points(on_strip: StripPoints, in_fit: Flags, normal: PlanSimilarity, extent: float) -> list[Finding]:
    """Say that a formed strip fits its control in no way; photos side by side under an oblique mount do not, either."""
    if np.isfinite(on_strip.xyz[in_fit]).all(axis=1).sum() <= LEAST_POINTS:  # one wrong point of three is a slip
        return []
    message = (
        f"strip {on_strip.strip} does not fit its control, however it is laid on it: half of the control points are "
        f"more than {normal.median:.4g} m off in plan, and the control reaches {extent:.4g} m from its middle"
    )
    evidence: Evidence = {"misclosure_m": normal.median, "extent_of_control_m": extent}
    fix = "do its ids and coordinates belong to these photos, and to the points that were measured?"
    return [found(NO_FIT, message, fix, evidence, strips=(on_strip.strip,), key="control")]
