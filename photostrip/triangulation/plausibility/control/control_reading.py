"""What given coordinates say against themselves, seen from a strip whose own coordinates are known.

The strip is laid on its control (``control_fit``) as it is and as a mirror image, then its bending is taken out
(``control_strip``); what is left says which list (``control_lists``), which kind of heights
(``control_heights``) and which point (``control_slips``) does not go with the others. Points are judged by what
the others predict, check points too, but no check point ever takes part in a fit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.plausibility.control import control_heights, control_lists, control_slips
from photostrip.triangulation.plausibility.control.control_fit import LEAST, Laid, bend, lay, upright
from photostrip.triangulation.plausibility.control.control_slips import Left
from photostrip.triangulation.plausibility.control.control_strip import (
    AXES,
    Given,
    Level,
    Seen,
    levelled,
    rotated,
    straightened,
)
from photostrip.triangulation.plausibility.finding import found

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from photostrip.notes import Finding

    Complex = NDArray[np.complex128]
    Flags = NDArray[np.bool_]

MIRRORED = 0.15  # of the plain to the mirrored middle misclosure
FITS = 0.1  # of the extent of the control: a misclosure above it is no fit


def examine(
    given: Given,
    seen: Seen,
    *,
    axes_are_right: bool | None = None,
    exchanged: Callable[[], Given | None] = lambda: None,
) -> list[Finding]:
    """Compare given points with a strip.

    Parameters
    ----------
    axes_are_right : bool or None
        Whether the place on the Earth shows the axes of the control to be right (True) or wrong (False).
    exchanged : callable
        Gives the points with east and north exchanged before anything else is done with them: longitudes read as
        latitudes are no mirror image of the ground, a degree of the one being shorter.

    Returns
    -------
    list of Finding
        P103, P105, P401, P403 to P408.
    """
    turn = upright(seen.axes)
    s = seen.xyz @ turn.T if np.isfinite(seen.xyz).all() else rotated(seen.xyz, turn)
    w = s[:, 0] + 1j * s[:, 1]
    took_part = given.use[:, 0] & ~given.check & np.isfinite(given.plan) & np.isfinite(w)
    normal, mirror = (lay(w[took_part], given.plan[took_part], mirrored=each) for each in (False, True))
    if normal is None or mirror is None:
        return []
    told: list[Finding] = []
    extent = float(np.abs(given.plan[took_part] - given.plan[took_part].mean()).max())
    best = normal
    if mirror.middle < MIRRORED * normal.middle and mirror.middle < FITS * extent:
        best = mirror
        told.append(_mirror(seen, normal, mirror, extent, axes_are_right=axes_are_right))
    elif normal.middle > FITS * extent:
        return _columns(given, exchanged(), seen, w, took_part, normal)
    level = levelled(given, Level(w, s[:, 2], best, turn, seen.depth), seen.floor[1], took_part)
    wrong_lists, lists = control_lists.examine(given, seen, level, took_part)
    told += lists
    if wrong_lists:
        took_part = took_part & ~np.isin(given.group, wrong_lists)
        again = lay(level.w[took_part], given.plan[took_part], mirrored=level.laid.mirrored)
        if again is None:
            return told
        level = level._replace(laid=again)
    fitted = straightened(given, level, seen.floor, took_part)
    judged = ~np.isin(given.group, wrong_lists)
    heights = control_heights.compare(given, fitted, judged)
    if heights is None:
        left = Left(fitted.plan, None, np.zeros(len(judged), bool))
        return [*told, *control_slips.examine(given, seen, fitted, judged, left)]
    fit = bend(heights.columns, heights.value, heights.took_part, fitted.floor[1])
    left = Left(fitted.plan, fit, heights.usable)
    told += control_slips.examine(given, seen, fitted, judged, left)
    whole = list(control_heights.examine(given, seen, heights, fit, fitted.floor[1]))
    return told + (whole or list(control_slips.examine_heights(given, seen, fitted, judged, left)))


# ------------------------------------------------------------------------------------------ the strip as a whole


def _mirror(seen: Seen, normal: Laid, mirror: Laid, extent: float, *, axes_are_right: bool | None) -> Finding:
    evidence: dict[str, float | int | str] = {
        "misclosure_as_given_m": normal.middle,
        "misclosure_mirrored_m": mirror.middle,
        "extent_of_control_m": extent,
        "base_direction_on_photos_deg": float(np.degrees(seen.base_angle)),
    }
    fit = (
        f"strip {seen.strip} fits its control only as a mirror image: middle misclosure in plan {normal.middle:.4g} m "
        f"as given, {mirror.middle:.3g} m mirrored"
    )
    if axes_are_right:
        message = f"{fit}; the control lies where its coordinate reference system is, so the image coordinates are "
        message += f"mirrored; {_how(seen.base_angle)}"
        fix = "correct `observations.y_axis`, the columns x and y, or the side from which the photos were measured"
        return found("P103", message, fix, evidence, strips=(seen.strip,), key="observations.y_axis")
    cause = "" if axes_are_right is None else ", and it lies outside its coordinate reference system"
    message = f"{fit}{cause}; the control is left-handed: its axes are exchanged or one of them counts backwards"
    if axes_are_right is None:
        message += f"; or else the image coordinates are mirrored ({_how(seen.base_angle)})"
    fix = "put `control.axes` into the order of the columns, [north, east, up] where x points north"
    return found("P401", message, fix, evidence, strips=(seen.strip,), key="control")


def _how(angle: float) -> str:
    """Say which way of mirroring goes with photos whose x axis was meant to point along the flight."""
    quarter = round(np.degrees(angle) / 90.0) % 4
    names = ("y counted the other way", "x and y exchanged", "negatives read as positives", "x and y exchanged")
    return f"most likely {names[quarter]}"


def _columns(
    given: Given, exchanged: Given | None, seen: Seen, w: Complex, took_part: Flags, normal: Laid
) -> list[Finding]:
    """Try other orders of the columns, when the strip fits the control neither way."""
    full = took_part & given.use.all(axis=1)
    orders = [(given, order) for order in ((2, 1, 0), (0, 2, 1), (1, 2, 0), (2, 0, 1))]
    if exchanged is not None:
        orders.insert(0, (exchanged, (0, 1, 2)))
    for read, order in orders:
        plan = read.level[full][:, order[0]] + 1j * read.level[full][:, order[1]]
        fits = [lay(w[full], plan, mirrored=each) for each in (False, True)]
        middle = min((each.middle for each in fits if each is not None), default=np.inf)
        spread = float(np.abs(plan - plan.mean()).max(initial=0.0)) if len(plan) else 0.0
        if middle < MIRRORED * normal.middle and middle < FITS * FITS * spread and full.sum() > LEAST:
            names = [AXES[each] for each in (order if read is given else (1, 0, 2))]
            message = (
                f"strip {seen.strip} does not fit its control in plan (middle misclosure {normal.middle:.4g} m), but "
                f"fits within {middle:.3g} m when what is called east, north, up is read as {', '.join(names)}"
            )
            evidence = {"misclosure_as_given_m": normal.middle, "misclosure_m": middle, "extent_of_control_m": spread}
            fix = "put `control.axes` into the order of the columns"
            return [found("P401", message, fix, evidence, strips=(seen.strip,), key="control")]
    return []
