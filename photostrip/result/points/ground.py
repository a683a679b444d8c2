"""Ground coordinates of a result: its frame, its points, what is left at given points, ties between strips."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.result.numbers import natural_rank, rounded
from photostrip.result.points.precision import point_columns
from photostrip.result.quantities import coordinate_decimals, records

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline import Result
    from photostrip.result.numbers import Document

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

CONTROL = "control"  # kind of observations of a bundle adjustment
LEAST_SHARE = 0.1  # of its standard deviation that a control point shows of itself at least


@dataclass(frozen=True, eq=False)
class Differences:
    """Adjusted minus given at every given point, in the order of the inputs' control."""

    axes: Floats  # (c, 3): metres in the order of the result's axes; NaN where it does not count or is not known
    parts: Floats  # (c, 3): metres to the east, to the north and up at the point
    # (c, 3): standard deviation of each difference along the point's own axes in the fit, metres: of the given
    # coordinate and of a point of one model together
    sigma: Floats
    normalised: Floats  # (c,): the largest difference of a point in units of that standard deviation
    scale: Floats  # (c,): denominator of the photo scale at the point; NaN where it has no coordinates
    strips: tuple[tuple[str, ...], ...]
    rejected: Flags  # (c, 3): coordinates east, north, up of the control that were found wrong and not used

    @property
    def plan(self) -> Floats:
        """Lengths of the differences in plan, metres."""
        return np.hypot(self.parts[:, 0], self.parts[:, 1])

    @property
    def height(self) -> Floats:
        """Differences in height, metres."""
        return self.parts[:, 2]


def coordinates(frame: GroundFrame, enu: Floats) -> Document:
    """Return the columns x, y, z of coordinates in the internal order, with the decimals of their frame."""
    decimals = coordinate_decimals(frame.kind, frame.axes)
    return {axis: rounded(enu[:, k], count) for axis, k, count in zip("xyz", frame.order, decimals, strict=True)}


def frame_of(result: Result) -> Document:
    """Return the block ``frame``: what the coordinates of the result refer to."""
    frame = result.output
    return {
        "crs": frame.spec.crs,
        "axes": list(frame.axes),
        "kind": frame.kind,
        "plan_unit": frame.plan_unit,
        "height_unit": frame.height_unit,
        "plan_factor": frame.plan_factor,
        "height_factor": frame.height_factor,
        "ellipsoid": None if frame.ellipsoid is None else list(frame.ellipsoid),
        "heights": frame.spec.height,
        "description": frame.describe(),
    }


def points_of(result: Result, image_rms: Floats, rank: Numbers) -> list[Document]:
    """Return the list ``points``, in natural order of their ids.

    Parameters
    ----------
    image_rms : ndarray, shape (n,)
        Root mean square image residual of each point as numbered in the observations, mm.
    rank : ndarray of int, shape (n,)
        Place of each of them in natural order.
    """
    points, ids = result.points, result.refined.observations.point_ids
    models = np.zeros(len(ids), np.intp)
    for strip in result.strips:
        models[strip.formed.point] += strip.formed.model_count
    columns = {
        "id": [ids[number] for number in points.number],
        "role": list(result.roles),
        **coordinates(result.output, points.ground),
        **point_columns(result),
        "rays": points.rays,
        "models": models[points.number],
        "image_rms_um": image_rms[points.number] * 1000.0,
    }
    rows = records("points", columns)
    return [rows[row] for row in np.argsort(rank[points.number])]


# ------------------------------------------------------------------------------------------------ given points


def differences(result: Result) -> Differences:
    """Differences at control and check points, in the axes of the result and in plan and height.

    Returns
    -------
    Differences
        In the order of the inputs' control. A point that is given in geocentric coordinates and wanted in east, north
        and up, or the other way round, needs all three differences to be turned.
    """
    control = result.inputs.control
    axes, parts = np.full((len(control), 3), np.nan), np.full((len(control), 3), np.nan)
    for number, frame in enumerate(result.frames):
        rows = np.flatnonzero((control.frame == number) & (result.control_rows >= 0))
        if len(rows):
            place = result.points.cartesian[result.control_rows[rows]]
            found = result.control_differences[rows]
            level = frame.level_axes_at(place)
            parts[rows] = found if frame.kind != "geocentric" else _turned(found, frame, place, level)
            same = (frame.kind == "geocentric") == (result.output.kind == "geocentric")
            axes[rows] = found if same else _turned(found, frame, place, result.output.axes_at(place))
    sigma, scale, strips = _expected(result)
    with np.errstate(invalid="ignore"):
        ratio = np.abs(result.control_differences) / sigma
    normalised = np.where(np.isnan(ratio).all(axis=1), np.nan, np.nan_to_num(ratio).max(axis=1, initial=0.0))
    rejected = _rejected(result)
    return Differences(result.output.user_from_internal(axes), parts, sigma, normalised, scale, strips, rejected)


def of_used(result: Result, found: Differences) -> Differences:
    """Return the differences without those at control that was rejected: they say nothing about the fit.

    Returns
    -------
    Differences
        NaN in the place of rejected coordinates; the whole point where its axes are neither plan nor height.
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


def _rejected(result: Result) -> Flags:
    """Control coordinates that were given for use and that nothing used."""
    control = result.inputs.control
    row_of = {name: row for row, name in enumerate(control.ids)}
    held, used = np.zeros((len(control), 1), bool), np.zeros(control.use.shape, bool)
    if result.bundle is not None:
        problem, selection = result.bundle.screened.problem, result.bundle.screened.selection
        rows = [row_of[problem.point_name(int(point))] for point in problem.control.point]
        held[rows], used[rows] = True, selection.control
    for strip in result.photo_strips if result.bundle is None else ():
        rows = [row_of[name] for name in strip.control.ids]
        held[rows] = True
        used[rows] |= strip.control.use
    return np.asarray(control.use & held & ~used & ~control.check[:, None], bool)


def _turned(found: Floats, frame: GroundFrame, place: Floats, axes: Floats) -> Floats:
    """Differences along the axes of a frame, along other axes; NaN where one of the three is missing."""
    turned: Floats = np.einsum("nai,nbi,nb->na", axes, frame.axes_at(place), found)
    return turned


def _expected(result: Result) -> tuple[Floats, Floats, tuple[tuple[str, ...], ...]]:
    """Give standard deviation of the differences, photo scale and strips of every given point."""
    control, strips = result.inputs.control, result.strips
    number = {name: n for n, name in enumerate(result.refined.observations.point_ids)}
    numbers = np.array([number.get(name, -1) for name in control.ids], np.intp)
    held = np.array([np.isin(numbers, strip.formed.point) for strip in strips]).reshape(len(strips), len(control))
    count = np.maximum(held.sum(axis=0), 1)
    point = np.array([[s.precision[0], s.precision[0], s.precision[1]] for s in strips])
    variance = (held.T @ point**2) / count[:, None]
    if result.bundle is not None and result.precision is not None:
        return _expected_of_bundle(result, result.precision.points, variance, (held, count))
    for index, frame in enumerate(result.frames):
        rows = np.flatnonzero((control.frame == index) & (result.control_rows >= 0))
        if frame.kind == "geocentric" and len(rows):
            level = frame.level_axes_at(result.points.cartesian[result.control_rows[rows]])
            variance[rows] = np.einsum("nka,nk->na", level**2, variance[rows])
    scale = (held.T @ np.array([s.scale_number for s in strips])) / count
    names = tuple(tuple(s.strip.id for s, yes in zip(strips, column, strict=True) if yes) for column in held.T)
    return np.sqrt(control.sigma**2 + variance), np.where(scale > 0, scale, np.nan), names


def _expected_of_bundle(
    result: Result, covariances: Floats, variance: Floats, members: tuple[NDArray[np.bool_], Numbers]
) -> tuple[Floats, Floats, tuple[tuple[str, ...], ...]]:
    """Return the same for a bundle adjustment, which knows the precision of each point.

    A control coordinate that took part has drawn its point towards itself: what is left is its residual, whose standard
    deviation its redundancy number gives.
    """
    control, (held, count) = result.inputs.control, members
    for index, frame in enumerate(result.frames):
        rows = np.flatnonzero((control.frame == index) & (result.control_rows >= 0))
        if len(rows):
            at = result.control_rows[rows]
            axes = frame.axes_at(result.points.cartesian[at])
            variance[rows] = np.einsum("nij,njk,nik->ni", axes, covariances[at], axes)
    sigma = np.sqrt(control.sigma**2 + variance)
    if result.bundle is not None:
        problem, given = result.bundle.screened.problem, result.bundle.groups
        row_of = {name: row for row, name in enumerate(control.ids)}
        rows = np.array([row_of[problem.point_name(int(point))] for point in problem.control.point], np.intp)
        for group in (each for each in given if each.kind == CONTROL):
            share = np.sqrt(np.clip(group.redundancy, LEAST_SHARE**2, 1.0))
            residual = group.sigma * share * result.bundle.unit
            sigma[rows] = np.where(np.isfinite(residual), residual, sigma[rows])
    strips = result.photo_strips
    of_strips = np.array([s.scale_number for s in strips])
    scale = np.where(held.any(axis=0), (held.T @ of_strips) / count, np.mean(of_strips) if len(strips) else np.nan)
    names = tuple(tuple(s.strip.id for s, yes in zip(strips, column, strict=True) if yes) for column in held.T)
    return sigma, np.where(scale > 0, scale, np.nan), names


def control_of(result: Result, found: Differences) -> list[Document]:
    """Return the list ``control``: every given point with what is left there, in natural order of the ids."""
    control = result.inputs.control
    columns = {
        "id": list(control.ids),
        "role": ["check" if check else "control" for check in control.check.tolist()],
        "use": [_use(counts) for counts in control.use.tolist()],
        "rejected": [_use(out) if any(out) else "" for out in found.rejected.tolist()],
        "measured": result.control_rows >= 0,
        **_size_columns(found.axes, found.plan, found.height, found.scale),
        "sigma": _in_list_order(result, control.sigma),
        "sigma_fit": _in_list_order(result, found.sigma),
        "normalised": found.normalised,
        "list": control.frame + 1,
        "strips": [list(strips) for strips in found.strips],
    }
    rows = records("control", columns)
    return [rows[row] for row in np.argsort(natural_rank(control.ids))]


def _size_columns(axes: Floats, plan: Floats, height: Floats, scale: Floats) -> Document:
    """Return columns of differences: along the axes of the result, in plan and in height, and at photo scale."""
    return {
        **{f"d{axis}": axes[:, k] for k, axis in enumerate("xyz")},
        "plan": plan,
        "height": height,
        "plan_um": plan / scale * 1e6,
        "height_um": height / scale * 1e6,
    }


def _in_list_order(result: Result, enu: Floats) -> Floats:
    """Return standard deviations in the order of the axes of each point's own list."""
    columns = enu.copy()
    for number, frame in enumerate(result.frames):
        rows = result.inputs.control.frame == number
        columns[rows] = frame.user_from_internal(enu[rows])
    return columns


def _use(counts: list[bool]) -> str:
    """Return the word of the project file for which coordinates count."""
    east, north, up = counts
    return f"{'x' if east else ''}{'y' if north else ''}{'z' if up else ''}" or "off"


def ties_of(result: Result, rank: Numbers) -> list[Document]:
    """Return the list ``ties``: points of two strips with their differences, second minus first."""
    ties, ids = result.ties, result.refined.observations.point_ids
    if not len(ties.number):
        return []
    names = [strip.strip.id for strip in result.strips]
    scale = np.array([strip.scale_number for strip in result.strips])[ties.strips].mean(axis=1)
    level, axes = _level_ties(result), result.output.user_from_internal(ties.difference)
    columns = {
        "id": [ids[number] for number in ties.number],
        "strips": [[names[first], names[second]] for first, second in ties.strips],
        **_size_columns(axes, np.hypot(level[:, 0], level[:, 1]), level[:, 2], scale),
    }
    rows = records("ties", columns)
    return [rows[row] for row in np.lexsort((ties.strips[:, 1], ties.strips[:, 0], rank[ties.number]))]


def _level_ties(result: Result) -> Floats:
    """Differences of ties to the east, to the north and up."""
    if result.output.kind != "geocentric":
        return result.ties.difference
    place = result.points.cartesian[np.searchsorted(result.points.number, result.ties.number)]
    level: Floats = np.einsum("nij,nj->ni", result.output.level_axes_at(place), result.ties.difference)
    return level


def not_determined_of(result: Result) -> list[Document]:
    """Return the list ``not_determined``: measured points without coordinates, and why."""
    names = list(result.not_determined)
    return [{"id": names[row], "reason": result.not_determined[names[row]]} for row in np.argsort(natural_rank(names))]


def misclosures_of(result: Result) -> list[Document]:
    """Return the list ``misclosures``: strip minus control after the similarity, before any polynomial.

    Beside them, how far each coordinate is checked by all others, and its share in its own polynomial.
    """
    found = []
    for strip in result.strips:
        nothing = np.full(strip.control.use.shape, np.nan)
        tested, correction = strip.judged_control, strip.polynomial
        detectable = nothing if tested is None else tested.detectable
        redundancy = nothing if tested is None else np.where(np.isfinite(detectable), tested.redundancy, np.nan)
        leverage = [
            nothing[:, k] if correction is None or not correction.axes[k].terms else correction.axes[k].leverage
            for k in range(3)
        ]
        misclosures = np.where(strip.control.use, strip.absolute.misclosures, np.nan)
        columns = {
            "strip": strip.strip.id,
            "id": list(strip.control.ids),
            **dict(zip(GROUND_AXES, misclosures.T, strict=True)),
            "redundancy": dict(zip(GROUND_AXES, redundancy.T, strict=True)),
            "detectable": dict(zip(GROUND_AXES, detectable.T, strict=True)),
            "leverage": dict(zip("xyz", leverage, strict=True)),
        }
        rows = records("misclosures", columns)
        found += [rows[row] for row in np.argsort(natural_rank(strip.control.ids))]
    return found
