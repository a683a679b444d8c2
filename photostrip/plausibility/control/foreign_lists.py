"""Control lists that do not go with the largest one: in feet, in another zone, with another origin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from photostrip.arrays import Flags
from photostrip.notes import Finding
from photostrip.plausibility.control.plan_fit import PlanSimilarity, fit_similarity
from photostrip.plausibility.control.straightening import (
    FEET_TOLERANCE,
    FOOT,
    KINDS_OF_FEET,
    GivenPoints,
    LevelStrip,
    StripPoints,
    straighten,
)
from photostrip.plausibility.finding import Evidence, found

LEAST_OFFSET = 0.1  # of the distance from camera to ground: lists that lie nearer to each other go together
MOST_ODD_SHARE = 0.6  # of the points of a list: beyond it the list is wrong, not its points
UNITS = (  # scale of a list against another, what happened, and the right unit
    (FOOT, "metres read as feet", "the crs counts in feet, the numbers are metres"),
    (1 / FOOT, "feet read as metres", f"a crs in feet, or metres in the table; {KINDS_OF_FEET}"),
)


def find_foreign_lists(
    given: GivenPoints, on_strip: StripPoints, level: LevelStrip, in_fit: Flags
) -> tuple[list[int], list[Finding]]:
    """Find control lists that do not go with the largest one.

    in_fit: (n,), points on which the strip was laid.
    Returns numbers of the lists that do not go with the others.
    Returns P403, P407.
    """
    numbers, counts = np.unique(given.group[in_fit], return_counts=True)
    if len(numbers) < 2:
        return [], []
    alone = {int(n): _on_one_list(given, level, in_fit & (given.group == n)) for n in numbers}
    first = int(numbers[int(counts.argmax())])
    reference = alone[first]
    if reference is None:
        return [], []
    on_reference = replace(level, similarity=reference)
    base = straighten(given, on_reference, on_strip.floor, in_fit & (given.group == first))
    wrong, findings = [], []
    for number in (int(each) for each in numbers if each != first):
        rows = in_fit & (given.group == number)
        if rows.sum() < 2 and not np.isfinite(level.z[rows]).any():
            continue  # photos that are only laid side by side misplace single points by half the flying height
        off = base.plan.residual[rows]
        limit = np.maximum(base.plan.limit[rows], LEAST_OFFSET * np.abs(reference.turn) * level.depth)
        if (np.abs(off) > limit).mean() <= MOST_ODD_SHARE:
            continue
        wrong.append(number)
        scale = None if (of_list := alone[number]) is None else abs(of_list.turn) / abs(reference.turn)
        shift = complex(np.median(off.real), np.median(off.imag))
        names = tuple(given.ids[row] for row in np.flatnonzero(rows))
        findings.append(_other_frame(on_strip, names, number, first, shift, scale))
    return wrong, findings


def _on_one_list(given: GivenPoints, level: LevelStrip, rows: Flags) -> PlanSimilarity | None:
    """Lay the strip on one list alone; of two points their distance says the scale, if nothing else."""
    w, plan = level.w[rows], given.plan[rows]
    if len(w) == 2 and min(abs(w[1] - w[0]), abs(plan[1] - plan[0])) > 0:
        turn = complex(abs(plan[1] - plan[0]) / abs(w[1] - w[0]))
        return PlanSimilarity(turn=turn, shift=0j, mirrored=level.similarity.mirrored, median=0.0)
    return fit_similarity(w, plan, mirrored=level.similarity.mirrored)


def _other_frame(
    on_strip: StripPoints, names: tuple[str, ...], number: int, first: int, shift: complex, scale: float | None
) -> Finding:
    """Say how a list differs from the largest one: its shift, and its scale where that is known."""
    evidence: Evidence = {"points": len(names), "offset_east_m": shift.real, "offset_north_m": shift.imag}
    head = f"control[{number}] does not agree with control[{first}] on strip {on_strip.strip}"
    key = f"control[{number}]"
    if scale is not None:
        evidence["scale_against_other_list"] = scale
        for feet, text, unit in UNITS:
            if abs(scale / feet - 1.0) < FEET_TOLERANCE:
                message = f"{head}: its distances are {scale:.4f} times as long: {text}"
                fix = f"name the right unit: {unit}"
                return found("P403", message, fix, evidence, points=names, strips=(on_strip.strip,), key=key)
    message = f"{head}: its points lie {abs(shift):.5g} m away ({shift.real:+.5g} m east, {shift.imag:+.5g} m north)"
    fix = "is its crs the right one: zone, datum, false easting?"
    return found("P407", message, fix, evidence, points=names, strips=(on_strip.strip,), key=key)
