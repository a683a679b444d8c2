"""Single given points that do not go with the others: exchanged ones, slips of the pen in one coordinate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.plausibility.control_strip import AXES
from photostrip.triangulation.plausibility.digits import slip
from photostrip.triangulation.plausibility.finding import found

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from photostrip.notes import Finding
    from photostrip.triangulation.plausibility.control_fit import Bent
    from photostrip.triangulation.plausibility.control_strip import Fitted, Given, Seen

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

SCALE_CHANGE = 3e-4  # of a large error: the scale of a map is not the same where the point came to lie


def examine(
    given: Given, seen: Seen, fitted: Fitted, judged: Flags, height_fits: Callable[[int, float], bool]
) -> Iterator[Finding]:
    """Name points that do not go with the others in plan, and the slip that explains it.

    `height_fits` says of a point, by its row and by how much it is off in plan, whether its height fits.
    """
    fit = fitted.plan
    odd = judged & given.use[:, 0] & np.isfinite(fit.residual) & fit.odd
    rows = np.flatnonzero(odd).tolist()
    exchanged = _exchanged(given, fit, rows)
    for one, other in exchanged:
        names = (given.ids[one], given.ids[other])
        message = f"given points {names[0]} and {names[1]} fit when their coordinates are exchanged"
        evidence = {
            "misclosure_as_given_m": float(max(abs(fit.residual[one]), abs(fit.residual[other]))),
            "misclosure_exchanged_m": _after_exchange(given, fit, one, other),
        }
        fix = "were their ids exchanged, in the table or on the photos?"
        yield found("P408", message, fix, evidence, points=names, strips=(seen.strip,))
    done = {row for pair in exchanged for row in pair}
    for row in rows:
        if row in done:
            continue
        difference = np.array([fit.residual[row].real, fit.residual[row].imag, 0.0])
        if height_fits(row, abs(fit.residual[row])):
            yield from slips(given, seen, row, difference, (float(fit.spread[row]), float(fit.limit[row])), (0, 1))


def _exchanged(given: Given, fit: Bent, rows: list[int]) -> list[tuple[int, int]]:
    pairs = []
    for place, one in enumerate(rows):
        for other in rows[place + 1 :]:
            limit = max(fit.limit[one], fit.limit[other])
            if given.group[one] == given.group[other] and _after_exchange(given, fit, one, other) < limit:
                pairs.append((one, other))
    return pairs


def _after_exchange(given: Given, fit: Bent, one: int, other: int) -> float:
    step = given.plan[other] - given.plan[one]
    return float(max(abs(fit.residual[one] + step), abs(fit.residual[other] - step)))


def slips(
    given: Given, seen: Seen, row: int, difference: Floats, spread: tuple[float, float], columns: tuple[int, ...]
) -> Iterator[Finding]:
    """Name the slip of the pen in the one coordinate that is off.

    `difference` is given minus predicted in the level frame, `spread` its standard deviation and largest value by
    chance; a slip leaves the point's other coordinates right.
    """
    by_axis = given.axes[row] @ difference
    for axis in columns:
        others = [each for each in columns if each != axis]
        off, unit = float(by_axis[axis]), float(given.unit[row, axis])
        if others and max(abs(by_axis[each]) for each in others) > max(spread[1], 0.02 * abs(off)):
            continue
        written = float(given.written[row, axis])
        if not np.isfinite(written):
            continue
        near = spread[1] + SCALE_CHANGE * abs(off)
        fits = slip(written, written - off / unit, spread[0] / unit, near / unit)
        if fits is None:
            continue
        role = "check" if given.check[row] else "control"
        message = (
            f"{role} point {given.ids[row]} is off by {off:+.2f} m in {AXES[axis]}: looks like {fits.text}; "
            f"{fits.meant:.10g} would fit within {abs(fits.meant - written + off / unit) * unit:.2g} m"
        )
        evidence = {
            "given": written,
            "off_m": off,
            "would_fit": fits.meant,
            "standard_deviation_m": spread[0],
        }
        fix = f"look {given.ids[row]} up in the records"
        yield found("P406", message, fix, evidence, points=(given.ids[row],), strips=(seen.strip,))
        return
