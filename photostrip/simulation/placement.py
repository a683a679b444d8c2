"""Pass points: Gruber points at the nadir of each photo, further points at random in each model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.flight import CUT_SIGMAS, Photos, position_sigma, sees
from photostrip.simulation.ground import Surface, World
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
