"""Pass points: Gruber points at the nadir of each photo, further points at random in each model.

Control and check points: which of the pass points are given on the ground, and with what errors.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.notes import counted
from photostrip.points import ControlPoints, PointTable
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.flight import CUT_SIGMAS, Photos, Surface, World, position_sigma, sees
from photostrip.simulation.spec import Spec

# Where a point is tried when its photos do not all show it at first: shift along, in half widths of the zone on three
# photos, and part of the distance from the flight line.
GRUBER_TRIES = tuple(
    (shift, part) for part in (1.0, 0.9, 0.8, 0.65, 0.5, 0.35) for shift in (0.0, 0.5, -0.5, 1.0, -1.0)
)
EXTRA_TRIES = tuple((shift, part) for part in (1.0, 0.85, 0.7, 0.5, 0.3) for shift in (1.0, 0.5, 0.0))
FLATTEST_RAY = np.radians(75.0)  # a ray flatter than this is not looked for


@dataclass(frozen=True, eq=False)
class Placed:
    """Points on the terrain."""

    # point ids: the photo and a number. The Gruber points of a photo have the numbers from 1 on, from left to right;
    # further points of the model that begins with it have the next numbers
    ids: tuple[str, ...]
    home: Numbers  # (n,): number of that photo
    row: Numbers  # (n,): number of the row of a Gruber point, -1 for other points
    # along, across, height: (n,): places from the middle of the strips and heights above the ellipsoid, metres
    along: Floats
    across: Floats
    height: Floats
    xyz: Floats  # (n, 3): points in the Cartesian frame, metres


@dataclass(frozen=True, eq=False)
class _Slots:
    """Points to be placed, all in the same manner: where they may lie and which photos must show them."""

    photos: Numbers  # (n, m), -1 where there is none
    along: Floats  # (n,) middle
    across: Floats  # (n,) flight line
    drawn: Floats  # (n, 2) scatter, metres, left out where a point is tried again
    shift: Floats  # (n,) metres along for a shift of 1
    aside: Floats  # (n,) metres from the flight line


def place(spec: Spec, space: World, terrain: Surface, photos: Photos) -> Placed:
    """Place all pass points, by photo, the Gruber points of a photo before the further ones of its model.

    Every point is moved towards the middle until the photos it is meant for show it. Draws (`Purpose.POINTS`): for each
    photo and row along, across; then for each model and further point along, across.
    """
    rows, extra, n = spec.points.rows, spec.points.extra_per_model, spec.flight.photos
    draws = Draws(spec.seed, Purpose.POINTS)
    everyone = np.arange(len(photos.ids))
    gruber = np.repeat(everyone, rows)
    further = np.repeat(everyone[everyone % n < n - 1], extra)
    slots = [
        (_gruber_slots(spec, photos, gruber, draws.between(len(gruber), 2)), GRUBER_TRIES),
        (_extra_slots(spec, photos, further, draws.between(len(further), 2)), EXTRA_TRIES),
    ]
    found = [_moved_inwards(spec, space, terrain, photos, each, tries) for each, tries in slots]
    home = np.concatenate([gruber, further])
    number = np.concatenate([np.arange(len(gruber)) % rows, rows + np.arange(len(further)) % max(extra, 1)])
    along, across = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((number, home))
    home, number, along, across = home[order], number[order], along[order], across[order]
    height = terrain(along, across)
    return Placed(
        ids=tuple(f"{photos.ids[k]}-{i + 1}" for k, i in zip(home.tolist(), number.tolist(), strict=True)),
        home=home,
        row=np.where(number < rows, number, -1),
        along=along,
        across=across,
        height=height,
        xyz=space.cartesian(along, across, height),
    )


def _gruber_slots(spec: Spec, photos: Photos, home: Numbers, drawn: Floats) -> _Slots:
    n, rows = spec.flight.photos, spec.points.rows
    length, width = spec.footprint
    zone = min(max(length / 2.0 - spec.base, 0.0), spec.base / 2.0)  # half the width of what lies on three photos
    inside = home % n
    side = 1.0 - 2.0 * (np.arange(len(home)) % rows) / (rows - 1)  # 1 on the left, -1 on the right
    return _Slots(
        photos=np.stack([np.where(inside > 0, home - 1, -1), home, np.where(inside < n - 1, home + 1, -1)], axis=1),
        along=photos.along[home],
        across=photos.across[home],
        drawn=drawn * (spec.points.scatter_percent / 100.0 * zone),
        shift=np.full(len(home), zone),
        aside=_leftwards(photos, n)[home] * side * (spec.points.reach_percent / 200.0 * width),
    )


def _extra_slots(spec: Spec, photos: Photos, home: Numbers, drawn: Floats) -> _Slots:
    half = np.stack([photos.along[home + 1] - photos.along[home], photos.across[home + 1] - photos.across[home]]) / 2.0
    return _Slots(
        photos=np.stack([home, home + 1], axis=1),
        along=photos.along[home] + half[0],
        across=photos.across[home] + half[1],
        drawn=np.zeros((len(home), 2)),
        shift=drawn[:, 0] * half[0],
        aside=drawn[:, 1] * (spec.points.reach_percent / 200.0 * spec.footprint[1]),
    )


def _leftwards(photos: Photos, n: int) -> Floats:
    """1 for photos of strips flown forwards, -1 for those flown back: the sign of the left-hand side."""
    ends = photos.along.reshape(-1, n)
    return np.repeat(np.where(ends[:, -1] < ends[:, 0], -1.0, 1.0), n)


def _moved_inwards(
    spec: Spec, space: World, terrain: Surface, photos: Photos, slots: _Slots, tries: Iterable[tuple[float, float]]
) -> tuple[Floats, Floats]:
    """Try places until the photos meant for a point show it; keep the first try where they never do."""
    along, across = np.empty_like(slots.along), np.empty_like(slots.across)
    open_ = np.arange(len(along))
    for number, (shift, part) in enumerate(tries):
        drawn = slots.drawn[open_] if number == 0 else np.zeros((len(open_), 2))
        s = slots.along[open_] + shift * slots.shift[open_] + drawn[:, 0]
        t = slots.across[open_] + part * slots.aside[open_] + drawn[:, 1]
        xyz = space.cartesian(s, t, terrain(s, t))
        wanted = slots.photos[open_]
        good = np.ones(len(open_), dtype=bool)
        for column in wanted.T:
            good &= (column < 0) | sees(spec, photos, np.maximum(column, 0), xyz)
        found = good if number else np.ones_like(good)
        if number:  # a point of another row may have been moved to the same place
            settled = np.setdiff1d(np.arange(len(along)), open_)
            found &= ~np.isin(np.round(s + 1j * t, 3), np.round(along[settled] + 1j * across[settled], 3))
        along[open_[found]], across[open_[found]] = s[found], t[found]
        open_ = open_[~good]
        if not len(open_):
            break
    return along, across


def shown(spec: Spec, photos: Photos, placed: Placed) -> tuple[Numbers, Numbers]:
    """All image points: which photo shows which point.

    Points are sought only around the place of each photo in its strip, so that the time grows with the photos, not with
    their square.

    Returns photo, point: (n,), numbers of photo and point of each image point, by photo, then by point.
    """
    n = spec.flight.photos
    reach = _reach(spec, placed)
    found_photo, found_point = [], []
    for j in range(spec.flight.strips):
        rows = np.arange(j * n, (j + 1) * n)
        backward = n > 1 and photos.along[rows[-1]] < photos.along[rows[0]]
        sign = -1.0 if backward else 1.0
        place = sign * placed.along / spec.base + (n - 1) / 2  # number in the strip, with a fraction
        first = np.maximum(np.ceil(place - reach / spec.base), 0).astype(np.intp)
        last = np.minimum(np.floor(place + reach / spec.base), n - 1).astype(np.intp)
        near = np.abs(placed.across - photos.across[rows].mean()) <= reach
        count = np.where(near, np.maximum(last - first + 1, 0), 0)
        point = np.repeat(np.arange(len(placed.along)), count)
        photo = rows[0] + np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
        good = sees(spec, photos, photo, placed.xyz[point])
        found_photo.append(photo[good])
        found_point.append(point[good])
    photo, point = np.concatenate(found_photo), np.concatenate(found_point)
    order = np.lexsort((point, photo))
    return photo[order], point[order]


def _reach(spec: Spec, placed: Placed) -> float:
    """Largest distance on the ground, metres, from a photo's planned place to what it can show."""
    tilt = CUT_SIGMAS * np.radians(np.hypot(*spec.flight.attitude_sigma_deg[:2]))
    view = np.arctan(np.hypot(*spec.format) / 2.0 / spec.camera.principal_distance)
    moved = CUT_SIGMAS * np.asarray(position_sigma(spec))
    depth = spec.flying_height + spec.terrain.height - placed.height.min() + moved[2]
    return float(depth * np.tan(min(view + tilt, FLATTEST_RAY)) + np.hypot(moved[0], moved[1]))


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
