"""What given coordinates say against themselves, seen from a strip whose own coordinates are known.

The strip is laid on its control (:mod:`control_fit`) as it is and as a mirror image, then its bending is taken out, in
plan by a conformal polynomial and in height by a quadratic one; what is left says which list, which kind of heights and
which point does not go with the others. Points are judged by what the others predict, check points too, but no check
point ever takes part in a fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from photostrip.statistics import t_quantile
from photostrip.triangulation.plausibility.control_fit import KEPT, LEAST, SMALL, Bent, Laid, bend, lay, upright
from photostrip.triangulation.plausibility.digits import slip
from photostrip.triangulation.plausibility.finding import found

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from photostrip.notes import Finding

    Floats = NDArray[np.float64]
    Complex = NDArray[np.complex128]
    Flags = NDArray[np.bool_]
    Numbers = NDArray[np.intp]

FOOT, SURVEY_FOOT = 0.3048, 1200.0 / 3937.0  # metres; they differ by 2 ppm
MIRRORED = 0.15  # of the plain to the mirrored middle misclosure
FITS = 0.1  # of the extent of the control: a misclosure above it is no fit
FEET_NEAR = 0.04  # relative, of a ratio to that of foot and metre
SIMPLE = 2.5  # times what makes sense that a fit may leave before bending is taken out
SPARE = 2  # redundancy that must be left then
SURE = 1e-5  # probability of a finding where there is nothing to find
SCALE_LEAST = 0.03  # of the ratio of heights to plan: a smaller one harms nobody and may be a bent strip
OFFSET_LEAST = 8.0  # a-priori standard deviations of a height: a smaller constant does no harm
GROUP_LEAST = 3
SOUND = 4.5  # standard deviations within which the other coordinates of a point with a slip of the pen lie
EARTH_RADIUS = 6.37e6  # metres
EXPLAINED = 0.5  # of what heights leave without it: what explains a bend of the strip as well explains nothing
SCALE_CHANGE = 3e-4  # of a large error: the scale of a map is not the same where the point came to lie
MOST_ODD = 0.6  # of the points of a list: beyond it the list is wrong, not its points
AXES = ("east", "north", "up")


@dataclass(frozen=True, eq=False)
class Given:
    """Given points that a strip shows.

    Parameters
    ----------
    ids : tuple of str
        Their ids.
    level : ndarray, shape (n, 3)
        East, north, up in metres in a level frame in the middle of the control; NaN where not given.
    use : ndarray of bool, shape (n, 3)
        Which coordinates count.
    check : ndarray of bool, shape (n,)
        Check points.
    group : ndarray of int, shape (n,)
        Control list of each.
    written : ndarray, shape (n, 3)
        The coordinates as they are written, east, north, up; NaN where slips of the pen cannot be sought in them.
    unit : ndarray, shape (n, 3)
        Metres in a unit of the written coordinates.
    axes : ndarray, shape (n, 3, 3)
        Directions of the written axes in the level frame, as rows.
    sigma : tuple of float
        Usual standard deviation of the given coordinates in plan and in height, metres.
    """

    ids: tuple[str, ...]
    level: Floats
    use: Flags
    check: Flags
    group: Numbers
    written: Floats
    unit: Floats
    axes: Floats
    sigma: tuple[float, float]

    @property
    def plan(self) -> Complex:
        """Given places E + iN, metres."""
        result: Complex = self.level[:, 0] + 1j * self.level[:, 1]
        return result


@dataclass(frozen=True, eq=False)
class Seen:
    """The same points as a strip sees them.

    Parameters
    ----------
    strip : str
        Id of the strip.
    xyz : ndarray, shape (n, 3)
        Strip coordinates; the third may be NaN, when only a mosaic is known.
    axes : ndarray, shape (p, 3)
        Third axes of its photos, from the ground to the camera.
    centers : ndarray, shape (p, 3)
        Perspective centres.
    floor : tuple of float
        A-priori standard deviation of the difference between strip and given coordinates in plan and in height, as a
        share of the distance from camera to ground.
    depth : float
        Distance from camera to ground, in units of the strip.
    base_angle : float
        Direction of the bases on the photos, radians from the x axis; a mean.
    """

    strip: str
    xyz: Floats
    axes: Floats
    centers: Floats
    floor: tuple[float, float]
    depth: float
    base_angle: float = 0.0


@dataclass(frozen=True, eq=False)
class Fitted:
    """A strip on its control, bending taken out.

    Parameters
    ----------
    laid : Laid
        Its similarity in plan.
    along, across : ndarray, shape (n,)
        Places of the points along and across the strip, metres.
    height : ndarray, shape (n,)
        Heights in the strip, metres.
    floor : tuple of float
        A-priori standard deviations in plan and height, metres.
    plan : Bent
        What is left in plan.
    """

    laid: Laid
    along: Floats
    across: Floats
    height: Floats
    floor: tuple[float, float]
    plan: Bent


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
    given : Given
        Given points.
    seen : Seen
        The same points in the strip.
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
    s = seen.xyz @ turn.T if np.isfinite(seen.xyz).all() else _rotated(seen.xyz, turn)
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
    seen, w, z, best = _levelled(given, seen, w, s[:, 2], best, took_part)
    fitted = _fit(best, w, z, given, seen, took_part)
    wrong_lists, lists = _lists(given, seen, w, fitted, took_part)
    told += lists
    if wrong_lists:
        took_part = took_part & ~np.isin(given.group, wrong_lists)
        again = lay(w[took_part], given.plan[took_part], mirrored=best.mirrored)
        if again is None:
            return told
        fitted = _fit(again, w, z, given, seen, took_part)
    judged = ~np.isin(given.group, wrong_lists)
    told += _in_plan(given, seen, fitted, judged, _heights(given, fitted, judged))
    told += _in_height(given, seen, fitted, judged)
    return told


def _rotated(xyz: Floats, turn: Floats) -> Floats:
    """Turn coordinates of a mosaic, which are upright already, or of a strip with points that have none."""
    flat = np.isfinite(xyz[:, :2]).all(axis=1) & ~np.isfinite(xyz[:, 2])
    result = xyz @ turn.T
    result[flat] = xyz[flat]
    return result


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


def _levelled(
    given: Given, seen: Seen, w: Complex, z: Floats, laid: Laid, took_part: Flags
) -> tuple[Seen, Complex, Floats, Laid]:
    """Turn a strip by the tilt that the heights of its control show; the cameras look down within degrees only.

    Relief times that tilt is a displacement in plan. Where the heights do not help, all stays as it is.
    """
    unchanged = seen, w, z, laid
    scale = abs(laid.turn)
    place, height = laid(w), scale * z
    usable = given.use[:, 2] & ~given.check & np.isfinite(given.level[:, 2]) & np.isfinite(height) & np.isfinite(place)
    if usable.sum() <= LEAST:
        return unchanged
    mean = float(height[usable].mean())
    columns = [np.ones(len(w)), place.real, place.imag]
    columns += [height - mean] if usable.sum() >= LEAST + 2 * SPARE else []  # a wrong unit of the heights is no tilt
    design = np.where(usable[:, None], np.column_stack(columns), 0.0)
    value = np.where(usable, given.level[:, 2] - height, 0.0)
    floor = max(seen.floor[1] * seen.depth * scale, given.sigma[1], SMALL)
    tilt = bend(design, value, usable, floor).coefficient[1:3]
    turned = np.column_stack([place.real, place.imag, height]) @ upright(np.array([[tilt[0], tilt[1], 1.0]])).T
    level = turned[:, 0] + 1j * turned[:, 1]
    again = lay(level[took_part], given.plan[took_part])
    if again is None or again.middle > laid.middle:
        return unchanged
    return replace(seen, depth=seen.depth * scale), level, turned[:, 2], again


def _fit(laid: Laid, w: Complex, z: Floats, given: Given, seen: Seen, took_part: Flags) -> Fitted:
    """Take the bending out of the plan."""
    scale = abs(laid.turn)
    distance = seen.depth * scale
    floor = (
        max(float(np.hypot(seen.floor[0] * distance, given.sigma[0])), SMALL),
        max(float(np.hypot(seen.floor[1] * distance, given.sigma[1])), SMALL),
    )
    place = laid(w)
    axis = _direction(place[took_part])
    middle = place[took_part].mean()
    local = (place - middle) / axis
    known = np.isfinite(given.plan)
    columns = [np.where(np.isfinite(local), local, 0.0) ** k for k in range(3)]
    fit = _simplest(columns, 2, np.where(known, given.plan, 0.0), took_part, floor[0])[1]
    residual = np.where(known & np.isfinite(w), fit.residual, np.nan)
    return Fitted(laid, local.real, local.imag, scale * z, floor, replace(fit, residual=residual))


def _simplest(
    columns: list[NDArray[Any]],
    least: int,
    values: NDArray[Any],
    took_part: Flags,
    floor: float,
) -> tuple[NDArray[Any], Bent]:
    """Fit as few columns as leave no more than makes sense, at least some of them."""
    number = least
    while True:
        chosen = np.column_stack(columns[:number])
        fit = bend(chosen, values, took_part, floor)
        spare = int(took_part.sum()) - number - 1
        if number == len(columns) or spare < SPARE or fit.sigma0 <= SIMPLE * floor:
            return chosen, fit
        number += 1


def _direction(place: Complex) -> complex:
    """Direction of the largest extent, of length one."""
    d = place - place.mean()
    axis = complex(np.sqrt((d**2).sum()))
    return axis / abs(axis) if abs(axis) > SMALL else 1.0 + 0.0j


# ---------------------------------------------------------------------------------------------- the lists


def _lists(given: Given, seen: Seen, w: Complex, fitted: Fitted, took_part: Flags) -> tuple[list[int], list[Finding]]:
    """Find control lists that do not go with the largest one."""
    numbers, counts = np.unique(given.group[took_part], return_counts=True)
    if len(numbers) < 2:
        return [], []
    own = {int(n): lay(w[took_part & (given.group == n)], given.plan[took_part & (given.group == n)],
                       mirrored=fitted.laid.mirrored) for n in numbers}  # fmt: skip
    first = int(numbers[int(counts.argmax())])
    reference = own[first]
    if reference is None:
        return [], []
    base = _fit(reference, w, np.zeros(len(w)), given, seen, took_part & (given.group == first))
    wrong, told = [], []
    for number in (int(each) for each in numbers if each != first):
        rows = took_part & (given.group == number)
        off = base.plan.residual[rows]
        limit = np.maximum(base.plan.limit[rows], FITS * np.abs(reference.turn) * seen.depth)
        if (np.abs(off) > limit).mean() <= MOST_ODD:
            continue
        wrong.append(number)
        told.append(_other_frame(given, seen, own[number], reference, number, first, rows, off))
    return wrong, told


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


# ---------------------------------------------------------------------------------------------- single points


def _in_plan(given: Given, seen: Seen, fitted: Fitted, judged: Flags, heights: Heights | None) -> Iterator[Finding]:
    """Name points that do not go with the others in plan, and the slip that explains it."""
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
        if _height_fits(fitted, row, abs(fit.residual[row]), heights):
            yield from _slips(given, seen, row, difference, (float(fit.spread[row]), float(fit.limit[row])), (0, 1))


def _height_fits(fitted: Fitted, row: int, off: float, heights: Heights | None) -> bool:
    """Whether the height of a point that is off in plan fits: a wrong measurement along the base moves both."""
    if heights is None or not heights.usable[row]:
        return True
    fit = bend(heights.columns, heights.value, heights.took_part, fitted.floor[1])
    return bool(abs(fit.residual[row]) <= SOUND * fit.spread[row] + _curved(fitted, off))


def _curved(fitted: Fitted, off: float) -> float:
    """How much an error of one coordinate moves the others, metres: the ground is curved."""
    return off * (off + float(np.ptp(fitted.along[np.isfinite(fitted.along)]))) / EARTH_RADIUS


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


def _slips(
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


# ---------------------------------------------------------------------------------------------- the heights


@dataclass(frozen=True, eq=False)
class Heights:
    """Given heights against those of a strip.

    Parameters
    ----------
    usable, took_part : ndarray of bool, shape (n,)
        Heights that can be judged, and those that take part in the fit.
    value : ndarray, shape (n,)
        Given minus height in the strip, metres.
    columns : ndarray, shape (n, c)
        Tilt and, where it is needed, bending.
    whole : list of ndarray, shape (n,)
        All columns of tilt and bending.
    deviation : ndarray, shape (n,)
        Heights in the strip, against their mean.
    scaled : Bent
        Fit with the scale of the heights free; its last coefficient is that scale minus one.
    """

    usable: Flags
    took_part: Flags
    value: Floats
    columns: Floats
    whole: list[Floats]
    deviation: Floats
    scaled: Bent

    @property
    def ratio(self) -> tuple[float, float]:
        """Heights given over heights in the strip, and its standard deviation."""
        return 1.0 + float(self.scaled.coefficient[-1]), float(self.scaled.sigma[-1])


def _heights(given: Given, fitted: Fitted, judged: Flags) -> Heights | None:
    """Compare given heights with those of a strip; None when too few are given."""
    usable = given.use[:, 2] & np.isfinite(given.level[:, 2]) & np.isfinite(fitted.height)
    took_part = usable & ~given.check & judged
    agreeing = took_part & ~(np.isfinite(fitted.plan.residual) & fitted.plan.odd)
    took_part = agreeing if agreeing.sum() > LEAST else took_part
    if took_part.sum() <= LEAST:
        return None
    x, y = fitted.along, fitted.across
    whole = [np.where(usable, each, 0.0) for each in (np.ones(len(x)), x, y, x**2, x * y)]
    height = np.where(usable, fitted.height, 0.0)
    value = np.where(usable, given.level[:, 2], 0.0) - height
    deviation = height - height[took_part].mean()
    # a wrong scale of the heights must not pass for a bending strip
    base, _ = _simplest([deviation, *whole], 4, value, took_part, fitted.floor[1])
    base = base[:, 1:]
    scaled = bend(np.column_stack([base, deviation]), value, took_part, fitted.floor[1])
    return Heights(usable, took_part, value, base, whole, deviation, scaled)


class Stretched(NamedTuple):
    """How a strip fits the heights of its control.

    Parameters
    ----------
    ratio : float
        Heights given over heights in the strip.
    misfit : float
        What is left of the heights as they are, in units of what makes sense.
    """

    ratio: float
    misfit: float


def stretched(given: Given, seen: Seen) -> Stretched | None:
    """Estimate by how much the heights of a strip are stretched, for a trial with another principal distance.

    Parameters
    ----------
    given : Given
        Given points.
    seen : Seen
        The same points in the strip.

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
    seen, w, z, laid = _levelled(given, seen, w, s[:, 2], laid, took_part)
    fitted = _fit(laid, w, z, given, seen, took_part)
    heights = _heights(given, fitted, np.ones(len(w), bool))
    if heights is None or heights.took_part.sum() < LEAST + SPARE:
        return None
    tilt = np.column_stack(heights.whole[:LEAST])
    plain = bend(tilt, heights.value, heights.took_part, fitted.floor[1])
    free = bend(np.column_stack([tilt, heights.deviation]), heights.value, heights.took_part, fitted.floor[1])
    size = np.abs(plain.residual[heights.took_part])
    freedom = max(int(heights.took_part.sum()) - LEAST, 1)
    misfit = float(np.sqrt((np.minimum(size, KEPT * np.median(size)) ** 2).sum() / freedom)) / fitted.floor[1]
    return Stretched(1.0 + float(free.coefficient[-1]), max(misfit, 1.0))


def _in_height(given: Given, seen: Seen, fitted: Fitted, judged: Flags) -> Iterator[Finding]:
    """Examine the heights: their unit and sense, groups that are off by a constant, slips."""
    heights = _heights(given, fitted, judged)
    if heights is None:
        return
    took_part, floor = heights.took_part, fitted.floor[1]
    ratio, sigma = heights.ratio
    plain = bend(heights.columns, heights.value, took_part, floor)
    explains = heights.scaled.sigma0 < EXPLAINED * plain.sigma0
    if explains and _significant(ratio - 1.0, sigma, heights.scaled.freedom, SCALE_LEAST):
        yield _other_scale(seen, ratio, sigma, took_part)
        return
    for names, inside, key in _groups(given, took_part):
        _, offset = _simplest([inside.astype(float), *heights.whole], 4, heights.value, took_part, floor)
        size, sigma = float(offset.coefficient[0]), float(offset.sigma[0])
        explains = offset.sigma0 < EXPLAINED * _simplest(heights.whole, 3, heights.value, took_part, floor)[1].sigma0
        if explains and _significant(size, sigma, offset.freedom, OFFSET_LEAST * floor):
            yield _other_heights(given, seen, names, key, size, sigma, inside & took_part)
            return
    fit = bend(heights.columns, heights.value, took_part, floor)
    for row in np.flatnonzero(heights.usable & judged & fit.odd).tolist():
        difference = np.array([0.0, 0.0, fit.residual[row]])
        plan = fitted.plan
        far = _curved(fitted, abs(fit.residual[row]))
        if np.isfinite(plan.residual[row]) and abs(plan.residual[row]) > SOUND * plan.spread[row] + far:
            continue  # a wrong measurement along the base moves both
        yield from _slips(given, seen, row, difference, (float(fit.spread[row]), float(fit.limit[row])), (2,))


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
