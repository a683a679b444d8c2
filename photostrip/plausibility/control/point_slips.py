"""Single given points that do not go with the others: exchanged ones, slips of the pen in one coordinate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import permutations
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.geodesy.curvature import EARTH_RADIUS
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.notes import Finding
from photostrip.plausibility.control.plan_fit import RobustFit
from photostrip.plausibility.control.straightening import GivenPoints, StraightenedStrip, StripPoints
from photostrip.plausibility.finding import Evidence, found

EXCHANGED = "P408"
SCALE_CHANGE = 3e-4  # of a large error: the scale of a map is not the same where the point came to lie
NOWHERE = 1e7  # metres, a quarter of the Earth's circumference: no map reaches so far
LEAST_RAYS = 2
CLEARER_SIGMAS = 6.0  # times as large as otherwise a slip must be where a wrong image coordinate explains it as well
# standard deviations within which the slip must fit where a wrong image coordinate explains it as well
NEAR_SIGMAS = 3.5
SOUND_SIGMAS = 4.5  # within which the other coordinates of a point with a slip of the pen lie
RIDGE_SHARE = 1e-9  # of a variance: no computer knows them better
UNKNOWN_HEIGHT_SIGMAS = 1e3  # standard deviations in plan: that of a height that is not given
HEIGHT = 2
DOUBT = "; or a coordinate along the base is wrong on one of its photos"


class Misclosures(NamedTuple):
    """What is left at given points after a strip was laid on them."""

    plan: RobustFit
    height: RobustFit | None  # None where too few heights are given to say
    usable: Flags  # (n,): points whose height can be tested
    consistent: Flags  # (n,): points of lists that go with each other

    def heights(self) -> tuple[Floats, Floats]:
        """Residual and standard deviation of each height, NaN where it cannot be tested, shape (n,), metres."""
        if self.height is None:
            unknown = np.full(len(self.usable), np.nan)
            return unknown, unknown
        residual, spread = (np.where(self.usable, x, np.nan) for x in (self.height.residual, self.height.spread))
        return residual, spread


def find_plan_slips(
    given: GivenPoints, on_strip: StripPoints, fitted: StraightenedStrip, left: Misclosures
) -> Iterator[Finding]:
    """Name points that do not go with the others in plan, and the slip that explains it."""
    fit = left.plan
    odd = left.consistent & given.use[:, 0] & np.isfinite(fit.residual) & fit.odd
    rows = np.flatnonzero(odd & _between_control(fitted)).tolist()
    exchanged = _exchanged(given, fit, rows, np.flatnonzero(odd).tolist())
    for one, other in exchanged:
        names = (given.ids[one], given.ids[other])
        message = f"given points {names[0]} and {names[1]} fit when their coordinates are exchanged"
        evidence = {
            "misclosure_as_given_m": float(max(abs(fit.residual[one]), abs(fit.residual[other]))),
            "misclosure_exchanged_m": _after_exchange(given, fit, one, other),
        }
        fix = "were their ids exchanged, in the table or on the photos?"
        yield found(EXCHANGED, message, fix, evidence, points=names, strips=(on_strip.strip,))
    done = {row for pair in exchanged for row in pair}
    for row in np.flatnonzero((given.moved[:, :2] != 0).any(axis=1)).tolist():
        if (order := _order_of_columns(given, row)) is not None:
            done.add(row)
            yield _in_other_columns(given, row, order, on_strip.strip)
    height, spread = left.heights()
    for row in rows:
        far = _curved(fitted, abs(fit.residual[row]))
        if row in done or abs(height[row]) > SOUND_SIGMAS * spread[row] + far:
            continue  # a wrong measurement along the base moves both
        difference = np.array([fit.residual[row].real, fit.residual[row].imag, 0.0])
        if not _one_ray_is_wrong(given, on_strip, fitted, left, row):
            yield from _slips(given, on_strip, row, difference, (float(fit.spread[row]), float(fit.limit[row])), (0, 1))


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


def _in_other_columns(given: GivenPoints, row: int, order: tuple[int, ...], strip: str) -> Finding:
    role = "check" if given.check[row] else "control"
    message = (
        f"{role} point {given.ids[row]} lies far from all others; with what is called east, north, up read as "
        f"{', '.join(GROUND_AXES[each] for each in order)} it lies among them"
    )
    fix = f"put the coordinates of {given.ids[row]} into their columns"
    evidence: Evidence = {
        "given_east": float(given.written[row, 0]),
        "east_that_would_fit": float(given.written[row, order[0]]),
    }
    return found("P406", message, fix, evidence, points=(given.ids[row],), strips=(strip,))


def _between_control(fitted: StraightenedStrip) -> Flags:
    """Points (n,) whose place a strip predicts: photos that are only laid side by side curl away beyond its control."""
    if np.isfinite(fitted.height).any():
        return np.ones(len(fitted.along), bool)
    ends = fitted.along[fitted.plan.used]
    return np.asarray((fitted.along >= ends.min(initial=np.inf)) & (fitted.along <= ends.max(initial=-np.inf)))


def find_height_slips(
    given: GivenPoints, on_strip: StripPoints, fitted: StraightenedStrip, left: Misclosures
) -> Iterator[Finding]:
    """Name points that do not go with the others in height only, and the slip that explains it."""
    fit, plan = left.height, left.plan
    if fit is None:
        return
    for row in np.flatnonzero(left.usable & left.consistent & fit.odd).tolist():
        far = _curved(fitted, abs(fit.residual[row]))
        if abs(plan.residual[row]) > SOUND_SIGMAS * plan.spread[row] + far:
            continue  # a wrong measurement along the base moves both
        difference = np.array([0.0, 0.0, fit.residual[row]])
        spread, limit, doubt = float(fit.spread[row]), float(fit.limit[row]), ""
        if _one_ray_is_wrong(given, on_strip, fitted, left, row):
            if len(on_strip.rays_of(given.ids[row])) > LEAST_RAYS:
                continue
            # below a photo a wrong height goes with that photo's ray too: two rays cannot tell
            limit, spread = min(limit, NEAR_SIGMAS * spread), CLEARER_SIGMAS * spread
            doubt = DOUBT
        yield from _slips(given, on_strip, row, difference, (spread, limit), (2,), doubt)


def _one_ray_is_wrong(
    given: GivenPoints, on_strip: StripPoints, fitted: StraightenedStrip, left: Misclosures, row: int
) -> bool:
    """Whether all rays of a point but one go with it as it is given."""
    rays = on_strip.rays_of(given.ids[row])
    if len(rays) < LEAST_RAYS:
        return False
    plan, (height, spread) = left.plan.residual[row], left.heights()
    off = np.array([plan.real, plan.imag, height[row]])
    place = on_strip.xyz[row] + fitted.strip_from_level @ np.nan_to_num(off)
    if not rays.shown(place):
        return False  # off by more than the flying height
    residual, jacobian = rays.residuals(place)
    of_plan = float(left.plan.spread[row])
    of_height = float(spread[row]) if np.isfinite(spread[row]) else UNKNOWN_HEIGHT_SIGMAS * of_plan
    # what chance moves all rays of a point by: the strip under it; and each ray by itself
    common = (jacobian @ fitted.strip_from_level).reshape(-1, 3) * [of_plan, of_plan, of_height]
    covariance = common @ common.T + np.diag(np.repeat(rays.sigma**2, 2))
    size = np.sqrt(np.diag(covariance))
    test, within = residual.ravel() / size, covariance / np.outer(size, size) + RIDGE_SHARE * np.eye(len(size))
    limit = float(left.plan.limit[row] / of_plan) ** 2
    for ray in range(len(rays)):
        others = np.delete(np.arange(2 * len(rays)), [2 * ray, 2 * ray + 1])
        if test[others] @ np.linalg.solve(within[np.ix_(others, others)], test[others]) < limit:
            return True
    return False


def _curved(fitted: StraightenedStrip, off: float) -> float:
    """How much an error of one coordinate moves the others, metres: the ground is curved."""
    return off * (off + float(np.ptp(fitted.along[np.isfinite(fitted.along)]))) / EARTH_RADIUS


def _exchanged(given: GivenPoints, fit: RobustFit, rows: list[int], others: list[int]) -> list[tuple[int, int]]:
    pairs = []
    for one in rows:
        for other in others:
            if one == other or (other in rows and other < one):
                continue
            limit = max(fit.limit[one], fit.limit[other])
            if given.group[one] == given.group[other] and _after_exchange(given, fit, one, other) < limit:
                pairs.append((one, other))
    return pairs


def _after_exchange(given: GivenPoints, fit: RobustFit, one: int, other: int) -> float:
    step = given.plan[other] - given.plan[one]
    return float(max(abs(fit.residual[one] + step), abs(fit.residual[other] - step)))


def _slips(
    given: GivenPoints,
    on_strip: StripPoints,
    row: int,
    difference: Floats,
    spread: tuple[float, float],
    columns: tuple[int, ...],
    doubt: str = "",
) -> Iterator[Finding]:
    """Name the slip of the pen in the one coordinate that is off.

    `difference` is given minus predicted in the level frame, `spread` its standard deviation and largest value by
    chance; a slip leaves the point's other coordinates right.
    """
    by_axis = given.steps.axes[row] @ difference
    for axis in columns:
        others = [each for each in columns if each != axis]
        off = float(by_axis[axis])
        if others and max(abs(by_axis[each]) for each in others) > max(spread[1], 0.02 * abs(off)):
            continue
        found_ = slip_in(given, row, axis, off, spread, on_strip.strip)
        if found_ is not None:
            yield replace(found_, message=f"{found_.message}{doubt}")
            return


def slip_in(
    given: GivenPoints, row: int, axis: int, off: float, spread: tuple[float, float], strip: str
) -> Finding | None:
    """Name the slip of the pen that explains why a coordinate is off; None when none does.

    off: given (where a far point was moved to) minus predicted along the axis as it is written, metres.
    spread: its standard deviation and its largest value by chance, metres.
    """
    written, unit = float(given.written[row, axis]), float(given.steps.unit[row, axis])
    if not np.isfinite(written):
        return None
    moved = float(given.moved[row, axis])
    predicted, near = written - moved - off / unit, spread[1]
    off += moved * unit
    nowhere = abs(off) > NOWHERE
    if not nowhere and not moved and axis != HEIGHT:
        near += SCALE_CHANGE * abs(off)
    exact = np.spacing(abs(written)) * unit < spread[0]  # whether the computer holds digits that could be compared
    from photostrip.plausibility.control.digits import slip

    fits = slip(written, predicted, spread[0] / unit, near / unit) if exact else None
    role = "check" if given.check[row] else "control"
    evidence: Evidence = {"axis": GROUND_AXES[axis], "given": written, "off_m": off, "standard_deviation_m": spread[0]}
    if fits is not None:
        message = (
            f"{role} point {given.ids[row]} is off by {off:+.2f} m in {GROUND_AXES[axis]}: looks like {fits.text}; "
            f"{fits.meant:.10g} would fit within {abs(fits.meant - predicted) * unit:.2g} m"
        )
        evidence["would_fit"] = fits.meant
    elif nowhere:
        message = (
            f"{role} point {given.ids[row]} has {written:.10g} for {GROUND_AXES[axis]}, {abs(off) / 1000:.6g} km from "
            "where the photos show it: no place on the Earth is so far away"
        )
    else:
        return None
    fix = f"look {given.ids[row]} up in the records"
    return found("P406", message, fix, evidence, points=(given.ids[row],), strips=(strip,))
