"""What all control of a strip shares, or that of one list: another principal distance, another frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.pipeline.plausibility.distance_trial import FIX, other_distance
from photostrip.triangulation.plausibility import found
from photostrip.triangulation.plausibility.control.shared_by_control import ShiftedList
from photostrip.triangulation.plausibility.finding import ERROR

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from photostrip.notes import Finding
    from photostrip.pipeline.inputs import Strip
    from photostrip.pipeline.results import StripResult
    from photostrip.points import ControlPoints
    from photostrip.triangulation.plausibility.control.shared_by_control import StretchedHeights
    from photostrip.triangulation.plausibility.finding import Evidence


def find_shared_errors(
    strips: Sequence[StripResult], findings: Sequence[Finding], *, joined: bool = False
) -> Iterator[Finding]:
    """Name what the control of strips shares (P105, P107, P404, P407).

    findings: what was found before: a strip whose distance is named already, or whose control is misread, is not named.
    joined: whether a bundle has adjusted the strips, and tested control point by point after all.
    """
    then = "" if joined else "; no control was tested by itself"
    if any(each.severity == ERROR and each.key.startswith("control[") for each in findings):
        return  # a list that is misread
    misread = {name for each in findings if each.severity == ERROR for name in each.strips}
    named = {name for each in findings if each.code == "P107" for name in each.strips}
    for each in strips:
        shared, strip = each.shared, each.of_photos.strip if each.photo_stages else None
        if shared is None or strip is None or strip.id in misread:
            continue
        if isinstance(shared, ShiftedList):
            yield shifted_list(shared, each.control, f"strip {strip.id}", (strip.id,), then)
        elif strip.id not in named:
            yield _stretched(strip, shared, then)


def shifted_list(shared: ShiftedList, control: ControlPoints, whose: str, strips: Sequence[str], then: str) -> Finding:
    """Name a control list that lies beside the other control, or beside all else that is given (P404, P407).

    control: control that counts, of all lists.
    """
    plan = GROUND_AXES[int(np.nanargmax(np.abs(shared.shift) / shared.sigma))] != "up"  # what stands out most
    steps = [
        f"{step:+.2f} m {axis} (standard deviation {sigma:.2g} m)"
        for step, sigma, axis in zip(shared.shift, shared.sigma, GROUND_AXES, strict=True)
        if np.isfinite(step)
    ]
    points = tuple(name for name, number in zip(control.ids, control.frame, strict=True) if number == shared.number)
    key = f"control[{shared.number}]"
    message = f"{key} lies beside the other control of {whose}, all of it by {', '.join(steps)}{then}"
    fix = (
        "is its crs the right one: zone, datum, false easting?"
        if plan
        else "are its heights of the same kind as those of the others: `height`, `geoid_undulation`, datum?"
    )
    evidence: Evidence = {
        f"offset_{axis}_m": float(step)
        for step, axis in zip(shared.shift, GROUND_AXES, strict=True)
        if np.isfinite(step)
    }
    code = "P407" if plan else "P404"
    return found(code, message, fix, evidence, points=points, strips=strips, key=key)


def _stretched(strip: Strip, stretch: StretchedHeights, then: str) -> Finding:
    given, factor = strip.camera.principal_distance, 1.0 / (1.0 + stretch.share)
    sigma = given * stretch.sigma * factor**2
    message = (
        f"the heights of strip {strip.id} are stretched by {100 * stretch.share:+.2f} % against its control, as by a "
        f"wrong principal distance: {given * factor:.2f} mm would fit (standard deviation {sigma:.2g} mm), "
        f"{given:g} mm is given{then}"
    )
    numbers: Evidence = {"heights_stretched": stretch.share, "standard_deviation_mm": sigma}
    return other_distance(strip.camera, given * factor, message, FIX, numbers, (strip.id,))
