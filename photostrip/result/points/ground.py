"""Ground coordinates of a result: its frame, its points, what is left at given points, ties between strips."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.result.numbers import GEOGRAPHIC, GROUND, Document, Plain, natural_rank, rounded
from photostrip.result.points.precision import point_columns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.pipeline import Result, StripResult

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


def coordinates(frame: GroundFrame, enu: Floats) -> Plain:
    """Ground coordinates as they are written.

    Parameters
    ----------
    enu : ndarray, shape (n, 3)
        Coordinates in the internal order.

    Returns
    -------
    list of list of float
        In the order of the frame's axes; 4 decimals, angles 10.
    """
    height = rounded(enu[:, 2], GROUND)
    plan = rounded(enu[:, :2], GEOGRAPHIC if frame.kind == "geographic" else GROUND)
    first, second, third = frame.order
    rows = ((*pair, z) for pair, z in zip(plan, height, strict=True))
    return [(row[first], row[second], row[third]) for row in rows]


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
    names = [ids[number] for number in points.number]
    models = np.zeros(len(ids), np.intp)
    for strip in result.strips:
        models[strip.formed.point] += strip.formed.model_count
    columns = zip(
        names,
        result.roles,
        coordinates(result.output, points.ground),
        points.rays.tolist(),
        models[points.number].tolist(),
        rounded(image_rms[points.number] * 1000, 2),
        point_columns(result),
        strict=True,
    )
    rows = [
        {
            "id": name, "role": role, "x": x, "y": y, "z": z, **sigmas,
            "rays": rays, "models": count, "image_rms_um": image,
        }
        for name, role, (x, y, z), rays, count, image, sigmas in columns
    ]  # fmt: skip
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
    order = np.argsort(natural_rank(control.ids))
    moved = rounded(found.axes, GROUND)
    size = rounded(np.column_stack([found.plan, found.height]), GROUND)
    in_photo = rounded(np.column_stack([found.plan, found.height]) / found.scale[:, None] * 1e6, 1)
    given = _own_order(result, control.sigma)
    expected = _own_order(result, found.sigma)
    normalised = rounded(found.normalised, 2)
    return [
        {
            "id": control.ids[row],
            "role": "check" if control.check[row] else "control",
            "use": _use(control.use[row].tolist()),
            "rejected": _use(found.rejected[row].tolist()) if found.rejected[row].any() else "",
            "measured": bool(result.control_rows[row] >= 0),
            "dx": moved[row][0], "dy": moved[row][1], "dz": moved[row][2],
            "plan": size[row][0], "height": size[row][1],
            "plan_um": in_photo[row][0], "height_um": in_photo[row][1],
            "sigma": given[row],
            "sigma_fit": expected[row],
            "normalised": normalised[row],
            "list": int(control.frame[row]) + 1,
            "strips": list(found.strips[row]),
        }
        for row in order.tolist()
    ]  # fmt: skip


def _own_order(result: Result, enu: Floats) -> Plain:
    """Give standard deviations in the order of the axes of each point's own list."""
    columns = enu.copy()
    for number, frame in enumerate(result.frames):
        rows = result.inputs.control.frame == number
        columns[rows] = frame.user_from_internal(enu[rows])
    return rounded(columns, GROUND)


def _use(counts: list[bool]) -> str:
    """Return the word of the project file for which coordinates count."""
    east, north, up = counts
    return f"{'x' if east else ''}{'y' if north else ''}{'z' if up else ''}" or "off"


def ties_of(result: Result, rank: Numbers) -> list[Document]:
    """Return the list ``ties``: points of two strips with their differences, second minus first."""
    ties, ids = result.ties, result.refined.observations.point_ids
    if not len(ties.number):
        return []
    scale = np.array([s.scale_number for s in result.strips])[ties.strips].mean(axis=1)
    moved = rounded(result.output.user_from_internal(ties.difference), GROUND)
    level = _level_ties(result)
    size = np.column_stack([np.hypot(level[:, 0], level[:, 1]), level[:, 2]])
    metres, in_photo = rounded(size, GROUND), rounded(size / scale[:, None] * 1e6, 1)
    names = [s.strip.id for s in result.strips]
    order = np.lexsort((ties.strips[:, 1], ties.strips[:, 0], rank[ties.number])).tolist()
    return [
        {
            "id": ids[ties.number[row]],
            "strips": [names[number] for number in ties.strips[row]],
            "dx": moved[row][0], "dy": moved[row][1], "dz": moved[row][2],
            "plan": metres[row][0], "height": metres[row][1],
            "plan_um": in_photo[row][0], "height_um": in_photo[row][1],
        }
        for row in order
    ]  # fmt: skip


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
    rows = []
    for strip in result.strips:
        values = rounded(np.where(strip.control.use, strip.absolute.misclosures, np.nan), GROUND)
        redundancy, detectable = _checked(strip)
        leverage = _leverage(strip)
        for row in np.argsort(natural_rank(strip.control.ids)):
            parts = dict(zip(GROUND_AXES, values[row], strict=True))
            rows.append(
                {
                    "strip": strip.strip.id,
                    "id": strip.control.ids[row],
                    **parts,
                    "redundancy": dict(zip(GROUND_AXES, redundancy[row], strict=True)),
                    "detectable": dict(zip(GROUND_AXES, detectable[row], strict=True)),
                    "leverage": dict(zip("xyz", leverage[row], strict=True)),
                }
            )
    return rows


def _checked(strip: StripResult) -> tuple[Plain, Plain]:
    """Redundancy numbers of the control, and the smallest errors that would be found, metres."""
    found, nothing = strip.judged_control, np.full(strip.control.use.shape, np.nan)
    if found is None:
        return rounded(nothing, 3), rounded(nothing, 3)
    known = np.isfinite(found.detectable)
    return rounded(np.where(known, found.redundancy, np.nan), 3), rounded(found.detectable, 3)


def _leverage(strip: StripResult) -> Plain:
    """Share of each control point in the polynomials of X, Y, Z at its own place, 0 to 1."""
    nothing = np.full(strip.control.use.shape, np.nan)
    if strip.polynomial is None:
        return rounded(nothing, 3)
    columns = [axis.leverage if axis.terms else nothing[:, k] for k, axis in enumerate(strip.polynomial.axes)]
    return rounded(np.column_stack(columns), 3)
