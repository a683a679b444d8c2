"""Where the control of a strip lies: at one end, on one line, with points far beyond it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import Finding
from photostrip.plausibility.finding import Evidence, found

ONE_END_SHARE = 0.4  # of the strip's length: control that spans less, all in one half, is at one end
HALF_SHARE = 0.55
BEYOND_SHARE = 0.5  # of the control's length: what lies farther out is extrapolated by more than half of it
LEAST_BREADTH = 0.08  # rms distance of the control from a line, in half breadths of the strip: errors grow 12-fold
LEAST_PHOTOS = 4  # photos of a strip that has ends
LEAST_POINTS = 2


def find_weak_ends(place: Floats, photos: Sequence[str], strip: str, ids: Sequence[str]) -> Iterator[Finding]:
    """Find control of a strip that lies at one end, or far from an end.

    place: (n,), where control points lie along the strip, bases.
    Yields P501, P503.
    """
    last = len(photos) - 1
    if len(ids) < LEAST_POINTS or len(photos) < LEAST_PHOTOS:
        return
    low, high = float(np.clip(place, 0, last).min()), float(np.clip(place, 0, last).max())
    evidence: Evidence = {
        "first_control_at_photo": low + 1,
        "last_control_at_photo": high + 1,
        "photos": len(photos),
    }
    at_begin, at_end = high <= HALF_SHARE * last, low >= (1 - HALF_SHARE) * last
    if high - low < ONE_END_SHARE * last and (at_begin or at_end):
        end = "beginning" if at_begin else "end"
        message = (
            f"strip {strip}: all control lies at its {end}, within {high - low:.1f} of {last} bases; beyond it the "
            "strip is unsupported, and its errors grow with the 1.5th power of the length"
        )
        fix = "add control at the other end"
        yield found("P501", message, fix, evidence, points=ids, strips=(strip,))
        return
    for gap, end in ((low, photos[0]), (last - high, photos[-1])):
        if gap > max(BEYOND_SHARE * (high - low), 1.0):
            message = (
                f"strip {strip}: its end at photo {end} lies {gap:.1f} bases beyond the control, which spans "
                f"{high - low:.1f}; what is there is extrapolated"
            )
            fix = f"add control near photo {end}, or leave the photos beyond it out"
            yield found("P503", message, fix, evidence, photos=(end,), strips=(strip,))


def find_line(
    plan: Floats, half_breadth: float, ids: Sequence[str], what: str, strips: Sequence[str]
) -> Iterator[Finding]:
    """Tell control that stands on one line: nothing holds the rotation about it.

    plan: (n, 2), control points, and with them cameras that hold as well, metres.
    ids: control points.
    what: what they hold, a strip or a block.
    Yields P502.
    """
    if len(ids) <= LEAST_POINTS or half_breadth <= 0:  # points measured along one line only have no breadth
        return
    values = np.linalg.svd(plan - plan.mean(axis=0), compute_uv=False)
    breadth = float(values[-1] / np.sqrt(len(plan) - LEAST_POINTS) / half_breadth)
    if breadth > LEAST_BREADTH:
        return
    message = (
        f"{what}: its control lies on one line, within {100 * breadth:.1f} % (rms) of half the breadth of "
        f"{'a' if len(strips) > 1 else 'the'} strip: an error in one height turns the "
        f"{'block' if len(strips) > 1 else 'strip'} about it"
    )
    fix = "add a control point at some distance from that line"
    yield found("P502", message, fix, {"rms_distance_over_half_breadth": breadth}, points=ids, strips=strips)
