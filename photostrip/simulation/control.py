"""Control and check points: which of the pass points are given on the ground, and with what errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.notes import counted
from photostrip.points import ControlPoints, PointTable
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.placement import Placed
from photostrip.simulation.spec import Spec

CHECK_POINTS = 10  # when the specification does not say how many


@dataclass(frozen=True, eq=False)
class Roles:
    """Numbers of the points that are given."""

    control: Numbers  # (c,): control points, by strip, along it, then from left to right
    use: Flags  # (c, 3): which of their coordinates are given: east, north, up (X, Y, Z)
    check: Numbers  # (k,): check points, by number


def roles(spec: Spec, placed: Placed, rays: Numbers) -> Roles:
    """Choose control and check points; `rays` says on how many photos of its own strip each point lies.

    Draws (`Purpose.ROLES`): an order of all points for the layout ``random``; an order of the control points for the
    shares of ``use``; an order of all points for the check points.

    Raises InputError when there are not enough points on two photos.
    """
    draws = Draws(spec.seed, Purpose.ROLES)
    order = draws.order(len(rays))
    pick = _random if spec.control.layout == "random" else _designed
    control = pick(spec, placed, rays, order)
    use = _shares(spec.control.use, draws.order(len(control)))
    order = draws.order(len(rays))
    free = order[(rays[order] >= 2) & ~np.isin(order, control)]
    check = min(CHECK_POINTS, len(free) // 2) if spec.control.check is None else spec.control.check
    if len(free) < check:
        asked, left = counted(check, "check point is", "check points are"), counted(len(free), "point is", "points are")
        message = f"{asked} asked for, but only {left} left for them"
        raise InputError(Fault(message, code="simulation-points", key="control.check", fix="add extra_per_model"))
    return Roles(control, use, np.sort(free[:check]))


def band_photos(spec: Spec) -> list[int]:
    """Photos of a strip, counted from 0, at whose nadir a band of control points lies.

    The first and the last are always among them, except that a single band lies in the middle.
    """
    last, bands, every = spec.flight.photos - 1, spec.control.bands, spec.control.every
    if every is not None:
        return [*range(0, last, every), last]
    if bands == 1:
        return [last // 2]
    return [(2 * k * last + bands - 1) // (2 * (bands - 1)) for k in range(bands)]


def _designed(spec: Spec, placed: Placed, rays: Numbers, order: Numbers) -> Numbers:  # noqa: ARG001 (one form with _random)
    """Gruber points at the places of the layout, in every strip."""
    n, rows = spec.flight.photos, spec.points.rows
    if spec.control.layout == "bands":
        k = spec.control.per_band
        chosen_rows = [rows // 2] if k == 1 else [(2 * i * (rows - 1) + k - 1) // (2 * (k - 1)) for i in range(k)]
        wanted = [(photo, row) for photo in band_photos(spec) for row in chosen_rows]
    else:
        wanted = [(photo, row) for photo in (0, n - 1) for row in (0, rows - 1)]
        if spec.control.layout == "corners+centre":
            wanted.insert(2, (n // 2, rows // 2))
    first = np.full((len(rays) and int(placed.home.max()) + 1, rows), -1)
    gruber = np.flatnonzero(placed.row >= 0)
    first[placed.home[gruber], placed.row[gruber]] = gruber
    control = np.array([first[j * n + photo, row] for j in range(spec.flight.strips) for photo, row in wanted])
    not_shown = [placed.ids[i] for i in control[rays[control] < 2].tolist()]
    if not_shown:
        message = f"control points {', '.join(not_shown)} lie on fewer than two photos"
        raise InputError(Fault(message, code="simulation-overlap", key="flight", fix="less attitude scatter or relief"))
    return control


def _random(spec: Spec, placed: Placed, rays: Numbers, order: Numbers) -> Numbers:
    """Points anywhere, in every strip."""
    chosen = []
    for j in range(spec.flight.strips):
        of_strip = order[(placed.home[order] // spec.flight.photos == j) & (rays[order] >= 2)]
        if len(of_strip) < spec.control.count:
            asked = counted(spec.control.count, "control point is", "control points are")
            message = f"{asked} asked for, but a strip has only {counted(len(of_strip), 'point')}"
            raise InputError(Fault(message, code="simulation-points", key="control.count"))
        chosen.append(np.sort(of_strip[: spec.control.count]))
    return np.concatenate(chosen)


def _shares(use: dict[str, float], order: Numbers) -> Flags:
    """Deal the shares of given coordinates out to the points, the largest remainders rounded up."""
    count, total = len(order), sum(use.values())
    exact = np.array([share / total * count for share in use.values()])
    number = np.floor(exact + 1e-9).astype(int)
    number[np.argsort(number - exact, kind="stable")[: count - number.sum()]] += 1
    kinds = np.array([["x" in name, "y" in name, "z" in name] for name in use])
    given = np.empty((count, 3), dtype=bool)
    given[order] = np.repeat(kinds, number, axis=0)
    return given


def given_coordinates(
    spec: Spec, chosen: Roles, points: PointTable, offset: Floats, frames: list[GroundFrame]
) -> ControlPoints:
    """Make the control list: true coordinates with errors, each in its frame.

    Control points, then check points; coordinates that are not given are NaN. Draws (`Purpose.CONTROL`): for each
    control point, then for each check point east, north, up.

    offset: (c, 3), gross errors of the control points east, north, up (X, Y, Z), metres.
    frames: the frame of the first list and, if there is one, of the second.
    """
    rows = np.concatenate([chosen.control, chosen.check])
    n, given = len(rows), len(chosen.control)
    true = points.xyz[rows]
    noise = spec.control.sigma if spec.control.noise is None else spec.control.noise
    error = Draws(spec.seed, Purpose.CONTROL).normal(n, 3) * noise
    error[:given] += offset
    moved = true + np.einsum("ni,nij->nj", error, frames[0].axes_at(true))
    number = _frame_numbers(spec, true, frames)
    enu = np.empty((n, 3))
    for k, frame in enumerate(frames):
        enu[number == k] = frame.ground_from_cartesian(moved[number == k])
    use = np.concatenate([chosen.use, np.ones((n - given, 3), dtype=bool)])
    return ControlPoints(
        ids=tuple(points.ids[i] for i in rows.tolist()),
        enu=np.where(use, enu, np.nan),
        use=use,
        check=np.arange(n) >= given,
        sigma=np.broadcast_to(np.asarray(spec.control.sigma), (n, 3)),
        frame=number,
    )


def _frame_numbers(spec: Spec, xyz: Floats, frames: list[GroundFrame]) -> Numbers:
    """Which of the frames each point is given in: the second east of the boundary."""
    if len(frames) == 1:
        return np.zeros(len(xyz), dtype=np.intp)
    boundary = spec.control.boundary_longitude_deg
    if boundary is None:
        boundary = spec.ground.center_deg[0]
    east = np.degrees(frames[0].geodetic(xyz)[:, 0]) - boundary
    number = (((east + 180.0) % 360.0) >= 180.0).astype(np.intp)  # noqa: PLR2004  half a turn: the short way round
    if number.min() == number.max():
        where = "east" if number.any() else "west"
        message = f"all given points lie {where} of the boundary at {boundary:g} degrees"
        key = "control.boundary_longitude_deg"
        raise InputError(Fault(message, code="simulation-boundary", key=key, fix="put it between them"))
    return number
