"""Control lists that do not go with the largest one: in feet, in another zone, with another origin."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.plausibility.control.control_fit import Laid, lay
from photostrip.triangulation.plausibility.control.control_strip import (
    FEET_NEAR,
    FOOT,
    Given,
    Level,
    Seen,
    straightened,
)
from photostrip.triangulation.plausibility.finding import found

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.notes import Finding

    Complex = NDArray[np.complex128]
    Flags = NDArray[np.bool_]

APART = 0.1  # of the distance from camera to ground: lists that lie nearer to each other go together
PAIR = 2
MOST_ODD = 0.6  # of the points of a list: beyond it the list is wrong, not its points


def examine(given: Given, seen: Seen, level: Level, took_part: Flags) -> tuple[list[int], list[Finding]]:
    """Find control lists that do not go with the largest one.

    Parameters
    ----------
    level : Level
        The strip, level and laid on them.
    took_part : ndarray of bool, shape (n,)
        Points on which it was laid.

    Returns
    -------
    list of int
        Numbers of the lists that do not go with the others.
    list of Finding
        P403, P407.
    """
    numbers, counts = np.unique(given.group[took_part], return_counts=True)
    if len(numbers) < 2:
        return [], []
    own = {int(n): _own(given, level, took_part & (given.group == n)) for n in numbers}
    first = int(numbers[int(counts.argmax())])
    reference = own[first]
    if reference is None:
        return [], []
    base = straightened(given, level._replace(laid=reference), seen.floor, took_part & (given.group == first))
    wrong, told = [], []
    for number in (int(each) for each in numbers if each != first):
        rows = took_part & (given.group == number)
        off = base.plan.residual[rows]
        limit = np.maximum(base.plan.limit[rows], APART * np.abs(reference.turn) * level.depth)
        if (np.abs(off) > limit).mean() <= MOST_ODD:
            continue
        wrong.append(number)
        told.append(_other_frame(given, seen, own[number], reference, number, first, rows, off))
    return wrong, told


def _own(given: Given, level: Level, rows: Flags) -> Laid | None:
    """Lay the strip on one list alone; of two points their distance says the scale, if nothing else."""
    w, plan = level.w[rows], given.plan[rows]
    if len(w) == PAIR and min(abs(w[1] - w[0]), abs(plan[1] - plan[0])) > 0:
        turn = complex(abs(plan[1] - plan[0]) / abs(w[1] - w[0]))
        return Laid(turn, 0j, level.laid.mirrored, 0.0)
    return lay(w, plan, mirrored=level.laid.mirrored)


def _other_frame(
    given: Given,
    seen: Seen,
    own: Laid | None,
    reference: Laid,
    number: int,
    first: int,
    rows: Flags,
    off: Complex,
) -> Finding:
    """Say how a list differs from the largest one."""
    names = tuple(given.ids[row] for row in np.flatnonzero(rows))
    shift = complex(np.median(off.real), np.median(off.imag))
    evidence: dict[str, float | int | str] = {
        "points": len(names), "offset_east_m": shift.real, "offset_north_m": shift.imag
    }  # fmt: skip
    head = f"control[{number}] does not go with control[{first}] on strip {seen.strip}"
    key = f"control[{number}]"
    if own is not None:
        ratio = abs(own.turn) / abs(reference.turn)
        evidence["scale_against_other_list"] = ratio
        for feet, text, where in ((FOOT, "metres read as feet", "feet"), (1 / FOOT, "feet read as metres", "metres")):
            if abs(ratio / feet - 1.0) < FEET_NEAR:
                message = f"{head}: its distances are {ratio:.4f} times as long: {text}"
                fix = f"name the right unit: {_feet_fix(where)}"
                return found("P403", message, fix, evidence, points=names, strips=(seen.strip,), key=key)
    message = f"{head}: its points lie {abs(shift):.5g} m away ({shift.real:+.5g} m east, {shift.imag:+.5g} m north)"
    fix = "is its crs the right one: zone, datum, false easting?"
    return found("P407", message, fix, evidence, points=names, strips=(seen.strip,), key=key)


def _feet_fix(where: str) -> str:
    if where == "feet":
        return "the crs counts in feet, the numbers are metres"
    return (
        "a crs in feet, or metres in the table; international feet (0.3048 m) and US survey feet (1200/3937 m) differ "
        "by 2 ppm, 1.2 m at 600 km"
    )
