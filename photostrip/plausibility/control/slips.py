"""Single given points that do not go with the others: exchanged ones, slips of the pen in one coordinate.

What says so is a prediction: of an adjustment in which the coordinate took no part, or of a formed strip on its other
control. This module finds out what may have happened.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, permutations

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.notes import Finding
from photostrip.plausibility.control.digits import slip
from photostrip.plausibility.control.given_points import GivenPoints
from photostrip.plausibility.finding import Evidence, found
from photostrip.statistics import normal_quantile

ODD_PROBABILITY = 1e-6  # that a good coordinate is called odd
LIMIT = normal_quantile(1 - ODD_PROBABILITY / 2)
SCALE_CHANGE = 3e-4  # of a large error: the scale of a map is not the same where the point came to lie
NOWHERE = 1e7  # metres, a quarter of the Earth's circumference: no map reaches so far
HEIGHT = 2


def find_slips(
    given: GivenPoints, off: Floats, sigma: Floats, strips: Sequence[str] = (), *, asked: Flags | None = None
) -> Iterator[Finding]:
    """Name exchanged points (P408), and points of which one coordinate alone is off, with its slip (P406).

    off, sigma: (n, 3), given minus predicted along the axes as they are written, metres, and standard deviations; NaN
        where nothing is predicted.
    asked: (n, 3), coordinates that are asked about; all that are predicted, if not said.
    """
    odd = np.abs(off) > LIMIT * sigma
    odd &= True if asked is None else asked
    far = (given.moved[:, :2] != 0.0).any(axis=1)
    done: set[int] = set()
    for row in np.flatnonzero(far).tolist():
        if (order := _order_of_columns(given, row)) is not None:
            done.add(row)
            yield _in_other_columns(given, row, order, strips)
    in_plan = np.flatnonzero(odd[:, :HEIGHT].any(axis=1) & ~far & given.use[:, 0]).tolist()
    for one, other in combinations(in_plan, 2):
        left = max(_left_if_exchanged(given, off, sigma, *pair) for pair in ((one, other), (other, one)))
        if given.group[one] == given.group[other] and left < 1.0 and not done & {one, other}:
            done |= {one, other}
            yield _exchanged(given, off, (one, other), strips)
    for row in [each for each in np.flatnonzero(odd.any(axis=1)).tolist() if each not in done]:
        axes = np.flatnonzero(odd[row]).tolist()
        if len(axes) == 1 and (wrong := slip_in(given, row, axes[0], off[row], sigma[row], strips)) is not None:
            yield wrong


def _left_if_exchanged(given: GivenPoints, off: Floats, sigma: Floats, one: int, other: int) -> float:
    """Misclosure of a point with the plan of another, over its largest value by chance."""
    step = given.steps.axes[one] @ np.nan_to_num(given.xyz[other] - given.xyz[one])
    near = LIMIT * sigma[one, :HEIGHT] + SCALE_CHANGE * np.linalg.norm(step)
    return float(np.max(np.abs(off[one, :HEIGHT] + step[:HEIGHT]) / near, initial=0.0))


def _exchanged(given: GivenPoints, off: Floats, rows: tuple[int, int], strips: Sequence[str]) -> Finding:
    names = (given.ids[rows[0]], given.ids[rows[1]])
    message = f"given points {names[0]} and {names[1]} fit when their coordinates are exchanged"
    evidence: Evidence = {"misclosure_as_given_m": float(np.linalg.norm(off[list(rows), :HEIGHT], axis=1).max())}
    fix = "were their ids exchanged, in the table or on the photos?"
    return found("P408", message, fix, evidence, points=names, strips=strips)


def _order_of_columns(given: GivenPoints, row: int) -> tuple[int, ...] | None:
    """Order in which the coordinates of a far point would lie among the others of its list."""
    others = (given.group == given.group[row]) & (given.moved == 0).all(axis=1) & np.isfinite(given.written).all(axis=1)
    if not others.any():
        return None
    low, high = given.written[others].min(axis=0), given.written[others].max(axis=0)
    reach = np.append(np.full(2, float((high - low)[:2].max())), float(np.ptp(given.xyz[others, :2], axis=0).max()))
    for order in list(permutations(range(3)))[1:]:
        read = given.written[row, list(order)]
        if ((read > low - reach) & (read < high + reach)).all():
            return order
    return None


def _in_other_columns(given: GivenPoints, row: int, order: tuple[int, ...], strips: Sequence[str]) -> Finding:
    message = (
        f"{_role(given, row)} point {given.ids[row]} lies far from all others; with what is called east, north, up "
        f"read as {', '.join(GROUND_AXES[each] for each in order)} it lies among them"
    )
    fix = f"put the coordinates of {given.ids[row]} into their columns"
    evidence: Evidence = {
        "given_east": float(given.written[row, 0]),
        "east_that_would_fit": float(given.written[row, order[0]]),
    }
    return found("P406", message, fix, evidence, points=(given.ids[row],), strips=strips)


def _role(given: GivenPoints, row: int) -> str:
    return "check" if given.check[row] else "control"


def slip_in(
    given: GivenPoints, row: int, axis: int, off: Floats, sigma: Floats, strips: Sequence[str]
) -> Finding | None:
    """Name the slip of the pen that explains why one coordinate of a point is off; None when none does.

    off, sigma: (3,), given minus predicted along the axes as they are written, and standard deviations, metres.
    """
    written, unit = float(given.written[row, axis]), float(given.steps.unit[row, axis])
    spread, size = float(sigma[axis]), float(off[axis])
    if not np.isfinite(written):
        return None
    near, predicted = LIMIT * spread, written - size / unit
    nowhere = abs(size) > NOWHERE
    if not nowhere and not given.moved[row, axis] and axis != HEIGHT:
        near += SCALE_CHANGE * abs(size)
    exact = np.spacing(abs(written)) * unit < spread  # whether the computer holds digits that could be compared
    fits = slip(written, predicted, spread / unit, near / unit) if exact else None
    evidence: Evidence = {"axis": GROUND_AXES[axis], "given": written, "off_m": size, "standard_deviation_m": spread}
    head = f"{_role(given, row)} point {given.ids[row]}"
    if fits is not None:
        message = (
            f"{head} is off by {size:+.2f} m in {GROUND_AXES[axis]}: looks like {fits.text}; {fits.meant:.10g} would "
            f"fit within {abs(fits.meant - predicted) * unit:.2g} m"
        )
        evidence["would_fit"] = fits.meant
    elif nowhere:
        message = (
            f"{head} has {written:.10g} for {GROUND_AXES[axis]}, {abs(size) / 1000:.6g} km from where the photos show "
            "it: no place on the Earth is so far away"
        )
    else:
        return None
    fix = f"look {given.ids[row]} up in the records"
    return found("P406", message, fix, evidence, points=(given.ids[row],), strips=strips)
