"""Given points of a result: what is left at control and check points, what lets that be expected, what stands out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from math import erfc, sqrt

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.network.reliability import Group
from photostrip.notes import Document
from photostrip.pipeline.given_points import axes_of, rejected_control
from photostrip.pipeline.results import Bundle, Precision, Result
from photostrip.points import locate, located
from photostrip.result.numbers import natural_rank
from photostrip.result.table import Table
from photostrip.statistics import TEST_LEVEL, f_p_value


def turned(covariances: Floats, axes: Floats) -> Floats:
    """Turn covariances from the Cartesian frame to other axes, the rows of `axes`; both of shape (n, 3, 3)."""
    return np.asarray(axes @ covariances @ axes.transpose(0, 2, 1), float)


def normalised(result: Result) -> tuple[Numbers, Floats]:
    """Check points with coordinates, and their differences in units of their standard deviations.

    In plan the length of the difference in the metric of its covariance, in height the difference with its sign.
    """
    control = result.inputs.control
    rows = np.flatnonzero(control.check & (result.control_rows >= 0))
    values = np.full((len(rows), 2), np.nan)
    if result.precision is None or not result.frames:  # a free network has nothing to be compared with
        return rows, values
    numbers, at = control.frame[rows], result.control_rows[rows]
    covariances = _along_given_axes(result, result.precision, numbers, at)
    covariances += np.nan_to_num(control.sigma[rows] ** 2)[:, :, None] * np.eye(3)
    differences = result.control_differences[rows]
    turn = np.flatnonzero([result.frames[number].kind == "geocentric" for number in numbers])
    if len(turn):
        level = axes_of(numbers[turn], result.frames, result.points.cartesian[at[turn]], level=True)
        differences[turn] = (level @ differences[turn, :, None])[:, :, 0]
        covariances[turn] = turned(covariances[turn], level)
    known = np.flatnonzero(~np.isnan(differences[:, :2]).any(axis=1))
    plan = differences[known, :2]
    values[known, 0] = np.sqrt(
        (plan * np.linalg.solve(covariances[known, :2, :2], plan[:, :, None])[:, :, 0]).sum(axis=1)
    )
    values[:, 1] = differences[:, 2] / np.sqrt(covariances[:, 2, 2])
    return rows, values


def _along_given_axes(result: Result, precision: Precision, numbers: Numbers, at: Numbers) -> Floats:
    """Covariances (n, 3, 3) of the points in rows `at` along the axes of the frames of these numbers."""
    found, level = np.empty((len(at), 3, 3)), result.level_covariances
    for number, frame in enumerate(result.frames):
        inside = numbers == number
        rows = at[inside]
        if frame is result.output and frame.kind != "geocentric" and level is not None:  # all points have these
            found[inside] = level[rows]
        elif len(rows):
            found[inside] = turned(precision.points[rows], frame.axes_at(result.points.cartesian[rows]))
    return found


def chances(normalised: Floats) -> dict[str, Floats]:
    """Return the probabilities of larger differences in plan and in height, from those (n, 2) of ``normalised``."""
    height = np.fromiter((erfc(abs(z) / sqrt(2)) for z in normalised[:, 1].tolist()), float)
    return {"p_plan": np.exp(-(normalised[:, 0] ** 2) / 2), "p_height": height}


# Probability that the largest of sound differences stands out; plan and height of control, check and left-out points.
LEVEL = TEST_LEVEL / 6
ODD_POINT = 4.0  # times the rms of the others: points at the ends of a strip are not as good as those within
ODD_CHANCE = 0.0027  # of a larger difference, from its own standard deviation (3 sigma): few others may be too good
LARGEST_PART = 4  # at most one in so many points stands out


def stand_out(size: Floats, coordinates: int, chance: Floats) -> Flags:
    """Return which differences (n,) are too large for those that remain without them; NaN where there is none.

    The k largest stand out when the least of them does, by the F test of its square against the mean square of the
    n - k others: two wrong points must not hide each other.

    coordinates: coordinates in a difference, 2 in plan.
    chance: (n,), probability of a larger difference, from the standard deviation of each.
    """
    found = np.zeros(len(size), bool)
    known = np.flatnonzero(np.isfinite(size))
    order = known[np.argsort(-np.abs(size[known]), kind="stable")]
    count, squares = len(order), size[order] ** 2
    number = np.arange(1, min(max(1, count // LARGEST_PART), count - 1) + 1)
    rest = np.cumsum(squares[::-1])[::-1][number] / (count - number)
    far = (squares[number - 1] > ODD_POINT**2 * rest) & (chance[order[number - 1]] < ODD_CHANCE)
    for k, mean in zip(number[far].tolist(), rest[far].tolist(), strict=True):
        among = f_p_value(squares[k - 1] / mean, coordinates, coordinates * (count - k)) if mean else 0.0
        if among * (count - k + 1) < LEVEL:
            found[order[:k]] = True
    return found


PARTS = "plan", "height"
COUNTED = "x", "y", "xy", "z", "xz", "yz", "xyz"  # words of the project file for the coordinates that count
PLACES = np.array([1, 2, 4])  # what each coordinate adds to the place of the word, counted from 1
CONTROL = "control"  # kind of observations of a bundle adjustment
LEAST_SHARE = 0.1  # of its standard deviation that a control point shows of itself at least


@dataclass(frozen=True, eq=False)
class Differences:
    """Adjusted minus given at every given point, in the order of the inputs' control."""

    axes: Floats  # (c, 3): metres in the order of the result's axes; NaN where it does not count or is not known
    parts: Floats  # (c, 3): metres to the east, to the north and up at the point
    # (c, 3): standard deviation of each difference along the axes of the point in the fit, metres: of the given
    # coordinate and of a point of one model together
    sigma: Floats
    normalised: Floats  # (c,): the largest difference of a point in units of that standard deviation
    checks: tuple[Numbers, Floats]  # check points, and their differences over standard deviations (``normalised``)
    chance: Floats  # (c, 2): probability of a larger difference in plan, in height
    scale: Floats  # (c,): denominator of the photo scale at the point; NaN where it has no coordinates
    held: Flags  # (s, c): which strip holds which point
    rejected: Flags  # (c, 3): coordinates east, north, up of the control that were found wrong and not used
    # (c, 2): whether the difference in plan, in height, is too large beside those of the other points of its role
    stands_out: Flags

    @property
    def plan(self) -> Floats:
        """Lengths of the differences in plan, metres."""
        return np.hypot(self.parts[:, 0], self.parts[:, 1])

    @property
    def height(self) -> Floats:
        return self.parts[:, 2]


def differences(result: Result) -> Differences:
    """Differences at control and check points, in the axes of the result and in plan and height.

    A point that is given in geocentric coordinates and wanted in east, north and up, or the other way round, needs all
    three differences to be turned.
    """
    control = result.inputs.control
    axes, parts = np.full((len(control), 3), np.nan), np.full((len(control), 3), np.nan)
    for number, frame in enumerate(result.frames):
        rows = np.flatnonzero((control.frame == number) & (result.control_rows >= 0))
        if len(rows):
            place = result.points.cartesian[result.control_rows[rows]]
            found = result.control_differences[rows]
            level = frame.kind != "geocentric"
            parts[rows] = found if level else _turned(found, frame, place, frame.level_axes_at(place))
            same = (frame.kind == "geocentric") == (result.output.kind == "geocentric")
            axes[rows] = found if same else _turned(found, frame, place, result.output.axes_at(place))
    held = _held(result)
    sigma = _expected(result, held)
    with np.errstate(invalid="ignore"):
        ratio = np.abs(result.control_differences) / sigma
    ratios = np.where(np.isnan(ratio).all(axis=1), np.nan, np.nan_to_num(ratio).max(axis=1, initial=0.0))
    rejected, checks = rejected_control(result), normalised(result)
    chance = _likely(ratios, *checks)
    return Differences(
        axes=result.output.user_from_internal(axes),
        parts=parts,
        sigma=sigma,
        normalised=ratios,
        checks=checks,
        chance=chance,
        scale=_scale(result, held),
        held=held,
        rejected=rejected,
        stands_out=_stands_out(control.check, np.where(rejected, np.nan, parts), chance),
    )


def _likely(ratio: Floats, rows: Numbers, values: Floats) -> Floats:
    """Return the probability (c, 2) of a larger difference in plan and in height at every given point.

    At check points from the precision of the point itself, where it is known; elsewhere from the ratio of the
    difference to its standard deviation.
    """
    found = np.repeat(np.fromiter((erfc(each / sqrt(2.0)) for each in ratio.tolist()), float)[:, None], 2, axis=1)
    own = chances(values)
    for part, column in zip(PARTS, found.T, strict=True):
        known = np.isfinite(own[f"p_{part}"])
        column[rows[known]] = own[f"p_{part}"][known]
    return found


def _stands_out(check: Flags, parts: Floats, chance: Floats) -> Flags:
    """Return which points do not go with the others of their role, in plan and in height."""
    found = np.zeros((len(check), 2), bool)
    for role in (check, ~check):
        found[role, 0] = stand_out(np.hypot(parts[role, 0], parts[role, 1]), 2, chance[role, 0])
        found[role, 1] = stand_out(parts[role, 2], 1, chance[role, 1])
    return found


def of_used(result: Result, found: Differences) -> Differences:
    """Return the differences without those at control that was rejected: they say nothing about the fit.

    NaN stands in the place of rejected coordinates; of the whole point where its axes are neither plan nor height.
    """
    out = found.rejected
    if not out.any():
        return found
    whole = np.repeat(out.any(axis=1, keepdims=True), 3, axis=1)
    mixed = np.array([frame.kind == "geocentric" for frame in result.frames])[result.inputs.control.frame, None]
    of_parts = np.where(mixed, whole, out)
    of_axes = of_parts if result.output.kind != "geocentric" else whole
    axes = np.where(result.output.user_from_internal(of_axes) > 0, np.nan, found.axes)
    return replace(found, axes=axes, parts=np.where(of_parts, np.nan, found.parts))


def _turned(found: Floats, frame: GroundFrame, place: Floats, axes: Floats) -> Floats:
    """Differences along the axes of a frame, along other axes; NaN where one of the three is missing."""
    turned: Floats = np.einsum("nai,nbi,nb->na", axes, frame.axes_at(place), found)
    return turned


def _held(result: Result) -> Flags:
    """Return which strip holds which given point, shape (s, c)."""
    numbers = located(result.inputs.control.ids, result.refined.observations.point_ids)
    held = [np.isin(numbers, strip.formed.point) for strip in result.strips]
    return np.array(held, bool).reshape(len(result.strips), len(numbers))


def _scale(result: Result, held: Flags) -> Floats:
    """Return the denominator of the photo scale at every given point, mean over its strips; NaN where it has none.

    In a bundle a point of no strip, seen on single photos, has that of all strips; without any, of all photos.
    """
    of_strips = np.array([strip.scale_number for strip in result.strips])
    scale = (held.T @ of_strips) / np.maximum(held.sum(axis=0), 1)
    if result.bundle is not None and result.precision is not None:
        of_singles = np.array([single.scale_number for single in result.bundle.singles])
        scale = np.where(held.any(axis=0), scale, np.mean(of_strips if len(of_strips) else of_singles))
    return np.where(scale > 0, scale, np.nan)


def _expected(result: Result, held: Flags) -> Floats:
    """Return the standard deviation of every difference, of the given coordinate and of the point together.

    That of the point is that of one model; of a bundle adjustment, its own. A control coordinate that took part in a
    bundle has drawn its point towards itself: what is left is its residual, whose standard deviation its redundancy
    number gives.
    """
    control, bundle = result.inputs.control, result.bundle
    of_bundle = None if bundle is None or result.precision is None else result.precision.points
    of_models = np.array([[s.precision.plan, s.precision.plan, s.precision.height] for s in result.strips]).reshape(
        -1, 3
    )
    variance = (held.T @ of_models**2) / np.maximum(held.sum(axis=0), 1)[:, None]
    for index, frame in enumerate(result.frames):
        rows = np.flatnonzero((control.frame == index) & (result.control_rows >= 0))
        at = result.control_rows[rows]
        if of_bundle is not None and len(rows):
            axes = frame.axes_at(result.points.cartesian[at])
            variance[rows] = np.einsum("nij,njk,nik->ni", axes, of_bundle[at], axes)
        elif frame.kind == "geocentric" and len(rows):
            level = frame.level_axes_at(result.points.cartesian[at])
            variance[rows] = np.einsum("nka,nk->na", level**2, variance[rows])
    sigma = np.sqrt(control.sigma**2 + variance)
    if bundle is not None and of_bundle is not None:
        for rows, group in _observed(bundle, control.ids):
            share = np.sqrt(np.clip(group.redundancy, LEAST_SHARE**2, 1.0))
            residual = group.sigma * share * bundle.unit
            sigma[rows] = np.where(np.isfinite(residual), residual, sigma[rows])
    return np.asarray(sigma, float)


def _observed(bundle: Bundle, ids: Sequence[str]) -> Iterator[tuple[Numbers, Group]]:
    """Give what a bundle knows of its control, where there is some, and the rows of its points among these ids."""
    problem = bundle.screened.problem
    rows = locate(map(problem.point_name, problem.control.point.tolist()), ids)
    yield from ((rows, each) for each in bundle.groups if each.kind == CONTROL)


def _redundancy(result: Result) -> Document:
    """Return columns of ``control``: how well each coordinate is checked in the bundle adjustment."""
    control = result.inputs.control
    if result.bundle is None:
        return {}
    redundancy = np.full(control.sigma.shape, np.nan)
    for rows, group in _observed(result.bundle, control.ids):
        redundancy[rows] = group.redundancy
    return {f"redundancy_{k}": column for k, column in enumerate(_in_list_order(result, redundancy).T, 1)}


def control_of(result: Result, found: Differences) -> Table:
    """Return the list ``control``: every given point with what is left there, in natural order of the ids."""
    control = result.inputs.control
    order = np.argsort(natural_rank(control.ids))
    columns = {
        "id": np.array(control.ids, object)[order],
        "role": np.where(control.check[order], "check", "control").astype(object),
        "use": np.array(("off", *COUNTED), object)[control.use[order] @ PLACES],
        "rejected": np.array(("", *COUNTED), object)[found.rejected[order] @ PLACES],
        "measured": result.control_rows[order] >= 0,
        **size_columns(found.axes[order], found.plan[order], found.height[order], found.scale[order]),
        **{f"sigma_{k + 1}": column for k, column in enumerate(_in_list_order(result, control.sigma)[order].T)},
        **{f"sigma_fit_{k + 1}": column for k, column in enumerate(_in_list_order(result, found.sigma)[order].T)},
        **{key: column[order] for key, column in _redundancy(result).items()},
        "normalised": found.normalised[order],
        "stands_out": _chosen(PARTS, found.stands_out[order]),
        "list": control.frame[order] + 1,
        "strips": _chosen([strip.strip.id for strip in result.strips], found.held.T[order]),
    }
    return Table.of("control", columns)


def _chosen(names: Sequence[str], chosen: Flags) -> list[list[str]]:
    """Return for each row the names that are chosen in it."""
    return [list(compress(names, row)) for row in chosen.tolist()]


def _in_list_order(result: Result, enu: Floats) -> Floats:
    """Return standard deviations in the order of the axes of each point's own list."""
    columns = enu.copy()
    for number, frame in enumerate(result.frames):
        rows = result.inputs.control.frame == number
        columns[rows] = frame.user_from_internal(enu[rows])
    return columns


def size_columns(axes: Floats, plan: Floats, height: Floats, scale: Floats) -> Document:
    """Return columns of differences: along the axes of the result, in plan and in height, and at photo scale."""
    return {
        **{f"d{axis}": axes[:, k] for k, axis in enumerate("xyz")},
        "plan": plan,
        "height": height,
        "plan_um": plan / scale * 1e6,
        "height_um": height / scale * 1e6,
    }


def misclosures_of(result: Result) -> Table:
    """Return the list ``misclosures``: strip minus control after the similarity, before any polynomial.

    Beside them, how far each coordinate is checked by all others, and its share in its own polynomial.
    """
    found = []
    for strip in result.strips:
        nothing = np.full(strip.control.use.shape, np.nan)
        screened, correction = strip.screened_control, strip.polynomial
        detectable = screened.detectable
        redundancy = np.where(np.isfinite(detectable), screened.redundancy, np.nan)
        leverage = [
            nothing[:, k] if correction is None or not correction.axes[k].terms else correction.axes[k].leverage
            for k in range(3)
        ]
        misclosures = np.where(strip.control.use, strip.absolute.misclosures, np.nan)
        columns = {
            "strip": strip.strip.id,
            "id": list(strip.control.ids),
            **dict(zip(GROUND_AXES, misclosures.T, strict=True)),
            **{f"redundancy_{axis}": column for axis, column in zip(GROUND_AXES, redundancy.T, strict=True)},
            **{f"detectable_{axis}": column for axis, column in zip(GROUND_AXES, detectable.T, strict=True)},
            **{f"leverage_{axis}": column for axis, column in zip("xyz", leverage, strict=True)},
        }
        found.append(Table.of("misclosures", columns)[np.argsort(natural_rank(strip.control.ids))])
    return Table.joined("misclosures", found)
