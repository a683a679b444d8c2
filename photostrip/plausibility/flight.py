"""Perspective centres of a formed strip: heights, base lengths and base directions that do not go with the others.

All is measured against the strip itself, in units of its flying height and of its usual base, so that a wrong control
does not disturb it; and against the scatter of the flight, which is large where wind moves a small aircraft.

Given angles read in another unit or system: the reading that goes with the rotations found.

What the layout of the photos says about a strip: order, overlap, photos that stand twice, are mirrored or scaled.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise, product

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.rotation import SYSTEMS, about, from_angles
from photostrip.notes import MOST_NAMED, Finding, listed
from photostrip.plausibility import mosaic
from photostrip.plausibility.finding import found
from photostrip.plausibility.units import reading_of
from photostrip.points import PhotoPoints
from photostrip.statistics import SIGMA_FROM_MEDIAN, normal_quantile

MOST_HEIGHT_OFF = 0.2  # of the flying height, from the line of the neighbours
LONG_BASE, SHORT_BASE = 1.75, 0.5  # of the usual base
TURNED_DEG = 30.0  # of a base against its neighbours
BESIDE = 3  # bases on either side that say what is usual
BESIDES = np.array([step for step in range(-BESIDE, BESIDE + 1) if step])
LEAST_PHOTOS = 4
LEVEL = 1e-3  # of one false name among the heights, lengths or directions of a flight that scatters
SIGMA_FROM_LINE = 1.5**0.5  # of a height off the line of its neighbours, over that of a height


def find_odd_centers(
    centers: Floats, depth: Floats, up: Floats, photos: Sequence[str], strip: str, sigma: float = 0.0
) -> Iterator[Finding]:
    """Look for perspective centres that do not go with their neighbours.

    centers: (n, 3), perspective centres in order, any unit and frame.
    depth: (n,), height of each above the points it shows, in that unit.
    up: (3,), direction from the ground to the cameras.
    sigma: standard deviation of a coordinate of a centre, in that unit.
    """
    names = (strip,)
    below = np.flatnonzero(depth <= 0)
    if len(below):
        yield _below([photos[number] for number in below.tolist()], depth, below, names)
    if len(photos) < LEAST_PHOTOS:
        return
    flying = np.median(np.abs(depth))
    yield from _heights(centers @ up, flying, photos, names, SIGMA_FROM_LINE * sigma / flying)
    bases = np.diff(centers, axis=0)
    bases = bases - (bases @ up)[:, None] * up
    length = np.linalg.norm(bases, axis=1)
    of_base = np.sqrt(2.0) * sigma / max(np.median(length), 1e-12)
    yield from _lengths(length, photos, names, of_base)
    yield from _directions(bases, up, photos, names, np.degrees(of_base))


def _below(photos: Sequence[str], depth: Floats, below: Numbers, names: tuple[str, ...]) -> Finding:
    message = (
        f"the perspective centre of photo {photos[0]} lies below the points that it shows"
        if len(photos) == 1
        else f"the perspective centres of photos {listed(photos)} lie below the points that they show"
    )
    fix = "are x and y of the image coordinates or the axes of the control exchanged?"
    evidence = {"lowest_over_usual": float(depth[below].min() / np.median(np.abs(depth)))}
    return found("P204", message, fix, evidence, photos=photos, strips=names)


def _heights(
    height: Floats, flying: float, photos: Sequence[str], names: tuple[str, ...], known: float
) -> Iterator[Finding]:
    step, place = np.diff(height, 2) / flying, np.arange(len(height), dtype=float)
    level, slope = _robust_lines(place[:, None] + BESIDES, _beside(height))
    all_off = (height - level - slope * place) / flying
    at_end = (place == 0) | (place == place[-1])  # where a line is extended
    for number in np.flatnonzero(np.abs(all_off) > np.where(at_end, 2.0, 1.0) * MOST_HEIGHT_OFF).tolist():
        off = float(all_off[number])
        if abs(off) > _by_chance(step, range(number - 2, number + 1), known):
            message = (
                f"the perspective centre of photo {photos[number]} lies {100 * abs(off):.0f} % of the flying height "
                f"{'above' if off > 0 else 'below'} those of its neighbours"
            )
            fix = "does it have another principal distance, unit, or flight?"
            evidence = {"off_over_flying_height": off}
            yield found("P205", message, fix, evidence, photos=(photos[number],), strips=names)


def _by_chance(step: Floats, own: range, known: float) -> float:
    """How far chance brings one of a flight whose steps from one to the next, all but its own, scatter so much.

    known: standard deviation that it has at least.
    """
    others = np.delete(step, [row for row in own if 0 <= row < len(step)])
    sigma = SIGMA_FROM_MEDIAN * float(np.median(np.abs(others))) if len(others) else 0.0
    return normal_quantile(1.0 - LEVEL / (2.0 * (len(step) + 1))) * max(sigma, known)


def _beside(values: Floats) -> Floats:
    """Values (n, ...) of the neighbours of each of n photos or bases, (n, 6, ...); NaN beyond the ends."""
    beyond = np.full((BESIDE, *values.shape[1:]), np.nan)
    return np.concatenate([beyond, values, beyond])[np.arange(len(values))[:, None] + BESIDE + BESIDES]


def _robust_lines(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Lines (n,) through points (n, k) whose slopes are the medians of those of all pairs."""
    i, j = np.triu_indices(y.shape[1], 1)
    slope = np.nanmedian((y[:, j] - y[:, i]) / (x[:, j] - x[:, i]), axis=1)
    return np.nanmedian(y - slope[:, None] * x, axis=1), slope


def _lengths(length: Floats, photos: Sequence[str], names: tuple[str, ...], known: float) -> Iterator[Finding]:
    length = np.maximum(length, 1e-12)  # photos at one place
    step, ratios = np.diff(np.log(length)), length / np.nanmedian(_beside(length), axis=1)
    for number, ratio in enumerate(ratios.tolist()):
        if SHORT_BASE < ratio < LONG_BASE:
            continue
        if min(abs(np.log(ratio)), abs(ratio - 1.0)) < _by_chance(step, range(number - 1, number + 1), known):
            continue
        pair = (photos[number], photos[number + 1])
        message = f"the base of photos {pair[0]} and {pair[1]} is {ratio:.2f} times as long as those beside it"
        fix = "is a photo missing between them?" if ratio > 1 else "is one of them from another flight?"
        yield found("P206", message, fix, {"base_over_usual": ratio}, photos=pair, strips=names)


def _directions(
    bases: Floats, up: Floats, photos: Sequence[str], names: tuple[str, ...], known: float
) -> Iterator[Finding]:
    unit = bases / np.maximum(np.linalg.norm(bases, axis=1, keepdims=True), 1e-12)
    step, turns = _turns(unit[:-1], unit[1:], up), _turns(np.nanmedian(_beside(unit), axis=1), bases, up)
    for number in np.flatnonzero(np.abs(turns) > TURNED_DEG).tolist():
        turn = float(turns[number])
        if abs(turn) <= _by_chance(step, range(number - 1, number + 1), known):
            continue
        pair = (photos[number], photos[number + 1])
        message = f"the base of photos {pair[0]} and {pair[1]} turns by {turn:+.0f} degrees against those beside it"
        fix = "does the strip bend there? else: is a photo listed in the wrong place or measured wrongly?"
        yield found("P207", message, fix, {"turn_deg": turn}, photos=pair, strips=names)


def _turns(one: Floats, other: Floats, up: Floats) -> Floats:
    """Give the turns about a direction from each of some bases to another, degrees."""
    return np.asarray(np.degrees(np.arctan2(np.cross(one, other) @ up, (one * other).sum(axis=-1))))


LEAST_TURNED = 3  # photos
HARMLESS_DEG = 0.3  # rms difference: start values need not be better
BETTER_SHARE = 0.25  # of the rms difference that another reading may leave
Reading = tuple[Floats, str, str]  # rotations, how they are read in words, code
DEGREES, GONS = 180.0 / np.pi, 200.0 / np.pi
UNITS = (
    (DEGREES / GONS, "gons read as degrees"),
    (GONS / DEGREES, "degrees read as gons"),
    (DEGREES, "radians read as degrees"),
    (GONS, "radians read as gons"),
    (1 / DEGREES, "degrees read as radians"),
    (1 / GONS, "gons read as radians"),
)


def find_wrong_angles(
    angles: Floats, system: str, rotations: Floats, photos: Sequence[str], convergence: float = 0.0
) -> Iterator[Finding]:
    """Compare given angles with the rotations that the photos turned out to have.

    angles: (n, 3), given angles as they were read, radians, of the stated `system` (``geometry.rotation.SYSTEMS``).
    rotations: (n, 3, 3), rotations found, image axes to east, north, up.
    convergence: azimuth of grid north there, radians.
    Yields P601 or P602, at most one.
    """
    stated = from_angles(angles, system)
    readings = [*_readings(angles, system), _transposed(stated)]
    if system == "yaw-pitch-roll":
        readings += _mounted(stated)
    yield from _misread(stated, readings, rotations, photos, convergence)


def find_wrong_rotations(
    stated: Floats, rotations: Floats, photos: Sequence[str], convergence: float = 0.0
) -> Iterator[Finding]:
    """Compare given rotations (n, 3, 3) that are no angles with those found, as ``find_wrong_angles`` does."""
    other_y = stated * np.array([1.0, -1.0, -1.0]), "with image axes of which y has the other direction", "P602"
    yield from _misread(stated, [_transposed(stated), other_y, *_mounted(stated)], rotations, photos, convergence)


def _misread(
    as_stated: Floats, readings: Sequence[Reading], rotations: Floats, photos: Sequence[str], convergence: float
) -> Iterator[Finding]:
    if len(photos) < LEAST_TURNED:
        return
    stated = _rms(as_stated, rotations)
    best, text, code = stated, "", ""
    for other, what, kind in (*readings, _turned(as_stated, rotations, convergence)):
        left = _rms(other, rotations)
        if left < best:
            best, text, code = left, what, kind
    nothing = _rms(np.broadcast_to(np.eye(3), rotations.shape), rotations)
    # angles that are only scattered fit the better the smaller a unit makes them, and best as no angles at all
    expected = min(stated, nothing) if code == "P601" else stated
    if stated < HARMLESS_DEG or best > BETTER_SHARE * expected:
        return
    message = (
        f"the given angles of {len(photos)} photos differ from those found by {stated:.2f} degrees (rms); {text} they "
        f"differ by {best:.2f} degrees"
    )
    fix = "correct `orientations.angles`: unit, system, and the north that they count from"
    evidence = {"rms_as_stated_deg": stated, "rms_as_read_otherwise_deg": best, "photos": len(photos)}
    yield found(code, message, fix, evidence, photos=photos, key="orientations.angles")


def _rms(one: Floats, other: Floats) -> float:
    """Rms angle between rotations, degrees."""
    cosine = (np.einsum("nij,nij->n", one, other) - 1.0) / 2.0
    return float(np.degrees(np.sqrt(np.mean(np.arccos(np.clip(cosine, -1.0, 1.0)) ** 2))))


def _transposed(stated: Floats) -> Reading:
    return stated.transpose(0, 2, 1), "as rotations from object to image", "P602"


def _mounted(stated: Floats) -> Iterator[Reading]:
    """Give the rotations of a camera that is mounted otherwise."""
    for turn, where in ((np.pi / 2.0, "ahead"), (-np.pi / 2.0, "down")):
        yield stated @ about(0, turn), f"of a camera that looks {where} where pitch and roll are zero", "P602"


def _readings(angles: Floats, system: str) -> Iterator[Reading]:
    """Give rotations under other readings, in words, with the code: other units first, then systems, senses, turns."""
    for factor, text in UNITS:
        yield from_angles(angles * factor, system), f"as {text.split(' read as ')[0]}", "P601"
    for other in SYSTEMS:
        if other != system:
            yield from_angles(angles, other), f"as {other}", "P602"
    for signs in product((1.0, -1.0), repeat=3):
        if signs != (1.0, 1.0, 1.0):
            names = [name for name, sign in zip(system.split("-"), signs, strict=True) if sign < 0]
            yield from_angles(angles * signs, system), f"with {' and '.join(names)} of the other sign", "P602"
    about_view = "yaw" if system.startswith("yaw") else "kappa"
    for turn in (90.0, 180.0, 270.0):
        changed = angles + np.radians([turn if name == about_view else 0.0 for name in system.split("-")])
        yield from_angles(changed, system), f"with {about_view} larger by {turn:.0f} degrees", "P602"


def _turned(stated: Floats, rotations: Floats, convergence: float) -> Reading:
    """Turn all photos about the vertical by the angle that goes best with the rotations found."""
    together = np.einsum("nij,nkj->ik", rotations, stated)
    turn = float(np.arctan2(together[1, 0] - together[0, 1], together[0, 0] + together[1, 1]))
    text = f"turned about the vertical by {np.degrees(turn):+.2f} degrees"
    if convergence:
        text += f" (grid north lies {np.degrees(convergence):+.2f} degrees from true north there)"
    return about(2, turn) @ stated, text, "P602"


Toward = Callable[[int, int], complex | None]
Against = Callable[[Sequence[int]], list[int]]
Closer = Callable[[str, str], tuple[complex, complex] | None]

TURNED_BACK = 0.3  # cosine between the directions to both neighbours; -1 in a straight flight
SURE_COUNT = 3  # common points of a link that may speak against the list
SURE_POINTS = 6  # common points of two photos that tell whether they show the same points
SURE_SHARE = 0.25  # of their spread, below which they do
SURE_MISFIT = 0.35  # of its base
SAME_PLACE_SHARE = 0.03  # of the median base between photos that share points: two photos from one place
SAME_PHOTO_SIGMAS = 5.0  # standard deviations of an image coordinate left by a link: a base that tilts hide leaves more
MOST_LOOKED_AT = 24  # photos that are looked at closer; a list that is wrong at more places needs no closer look
LEAST_ORDERED = 3  # photos that have an order
OTHER_SCALE = 1.25  # ratio to both neighbours that tilts and relief do not make


@dataclass(frozen=True)
class PhotoOrder:
    """A strip as its photos lie, for the evidence that needs them in order."""

    photos: tuple[str, ...]  # photos in the order in which they lie, each place once
    # centre of the next photo on each of them, in the unit of its coordinates; NaN where it has no link
    steps: tuple[complex, ...]
    mirrored: frozenset[str]  # photos that are mirror images of the others
    size: dict[str, float]  # photos whose coordinates are larger than those of the others, and how many times


def find_wrong_order(
    observations: PhotoPoints, strip: str, photos: Sequence[str], closer: Closer = lambda _one, _other: None
) -> tuple[list[Finding], PhotoOrder]:
    """Compare the list of a strip's photos with what their common points say.

    observations: image points of the project, in any unit.
    closer: gives of two photos the direction of each from the other, tilts taken into account, or None; asked where the
        layout contradicts the list.
    Returns P102, P104, P201, P202, P203, P303.
    Returns the strip as its photos lie.
    """
    links = mosaic.link(observations, photos)
    odd = _unlike(links, len(photos))
    findings: list[Finding] = []
    mirrored: frozenset[str] = frozenset()
    size: dict[str, float] = {}
    if not links.alike:
        plane = mosaic.lay_out(links, len(photos))
        plane.size[odd] = 1.0  # nothing is known of their scale
        findings += [*_scaled(plane, strip, photos), *_mirrored(plane, strip, photos)]
        mirrored = frozenset(photos[number] for number in np.flatnonzero(plane.mirrored).tolist())
        size = {photos[number]: float(plane.size[number]) for number in _other_size(plane)}
    findings += _of_other_points(observations, odd, links, strip, photos)
    twice = _twice(links, observations.sigma)
    findings += [_twin(links, pair, strip, photos) for pair in twice]
    left = [number for number in range(len(photos)) if number not in {other for _, other in twice}]
    against = partial(turned_back, links, closer=_by_number(closer, photos))
    order = _order(links, left, against, len(photos))
    moved = _moved(order, left)
    if moved:
        findings.append(_out_of_order(links, order, moved, strip, photos, against))
    findings += _gaps(links, order, strip, photos)
    return findings, PhotoOrder(
        photos=tuple(photos[number] for number in order), steps=_steps(links, order), mirrored=mirrored, size=size
    )


def find_other_scale(observations: PhotoPoints, strip: str, photos: Sequence[str]) -> Iterator[Finding]:
    """Look for photos at another scale than both their neighbours by the images alone, where a strip is not formed."""
    links = mosaic.link(observations, photos)
    for number in range(1, len(photos) - 1):
        rows = [links.index.get((number - 1, number)), links.index.get((number, number + 1))]
        if rows[0] is None or rows[1] is None:
            continue
        before, after = abs(links.turn[rows[0]]), abs(links.turn[rows[1]])
        ratio = np.array([before, 1.0 / max(after, mosaic.TINY)])  # of this photo to both
        if (ratio > OTHER_SCALE).all() or (ratio < 1 / OTHER_SCALE).all():
            size = float(np.sqrt(ratio.prod()))
            message = f"the scale of photo {photos[number]} is {size:.2f} times that of both its neighbours"
            fix = "does it have another principal distance, unit, or flight?"
            evidence = {"scale_over_neighbours": size}
            yield found("P205", message, fix, evidence, photos=(photos[number],), strips=(strip,))


def _steps(links: mosaic.PhotoLinks, order: Sequence[int]) -> tuple[complex, ...]:
    """Way to the next photo on each photo: slope of the line through the centres of all photos linked with it.

    A tilt moves single centres by as much as a base; those of photos farther on say more of it.
    """
    rank = np.full(max((*order, int(links.photo.max(initial=0)))) + 1, -1)
    rank[list(order)] = np.arange(len(order))
    photo, other = (np.concatenate([links.photo[:, k], links.photo[:, 1 - k]]) for k in (0, 1))
    way, count = np.concatenate(links.bases), np.tile(links.count, 2)
    lag = rank[other] - rank[photo]
    near = np.abs(lag) == 1  # a link of two points serves where there is no better one
    use = (rank[photo] >= 0) & (rank[other] >= 0) & np.isfinite(way) & (near | (count >= SURE_COUNT))
    at, lag, way = rank[photo[use]], lag[use], way[use]
    size = len(order)
    number = np.bincount(at, minlength=size) + 1.0  # with its own centre
    first, second = np.bincount(at, lag, size), np.bincount(at, lag.astype(float) ** 2, size)
    total = np.bincount(at, way.real, size) + 1j * np.bincount(at, way.imag, size)
    mixed = np.bincount(at, lag * way.real, size) + 1j * np.bincount(at, lag * way.imag, size)
    below = number * second - first**2
    slope = np.where(below > 0, (number * mixed - first * total) / np.where(below > 0, below, 1.0), np.nan)
    return tuple(slope.tolist())


def _other_size(plane: mosaic.Mosaic) -> list[int]:
    return [int(number) for number in np.flatnonzero(np.abs(np.log(plane.size)) > np.log(mosaic.SCALE_JUMP))]


def _scaled(plane: mosaic.Mosaic, strip: str, photos: Sequence[str]) -> Iterator[Finding]:
    for number in _other_size(plane):
        size = float(plane.size[number])
        reading = reading_of(size, (0.5, 2.0))
        message = f"the coordinates on photo {photos[number]} are {size:.4g} times as large as on its neighbours"
        if reading.name:
            message += f": {reading.name}"
        fix = "bring its rows into the unit of the others"
        yield found("P102", message, fix, {"times": size}, photos=(photos[number],), strips=(strip,))


def _mirrored(plane: mosaic.Mosaic, strip: str, photos: Sequence[str]) -> Iterator[Finding]:
    for number in np.flatnonzero(plane.mirrored).tolist():
        message = (
            f"photo {photos[number]} fits its neighbours only as a mirror image: a negative read as a positive, its x "
            "and y exchanged, or its y counted the other way"
        )
        fix = "turn the photo over in its rows, or measure it from the right side"
        yield found("P104", message, fix, {}, photos=(photos[number],), strips=(strip,))


def _of_other_points(
    observations: PhotoPoints, odd: Sequence[int], links: mosaic.PhotoLinks, strip: str, photos: Sequence[str]
) -> Iterator[Finding]:
    """Photos `odd` whose points lie on no other photo as they lie on them: their ids belong to other points."""
    names = [photos[number] for number in odd]
    if not names:
        return
    shown = "photo" if len(names) == 1 else "photos"
    message = f"strip {strip}: the points of {shown} {listed(names)} lie on no neighbour as they lie there"
    fix = "were their ids written in another row, or points numbered anew on each photo?"
    if len(names) == 1:
        moved = {rows: mosaic.link(_moved_by(observations, names[0], rows), photos) for rows in (1, -1)}
        left = {rows: _left(links, len(photos))[0][odd[0]] for rows, links in moved.items()}
        rows = min(left, key=lambda each: float(left[each]))
        if left[rows] < SURE_SHARE:
            message += f"; with its ids moved {'down' if rows > 0 else 'up'} by one row they do"
            fix = "put the ids into the rows of their points"
    evidence = {"photos": len(names), "misfit_over_spread": float(_left(links, len(photos))[0][odd].min())}
    yield found("P303", message, fix, evidence, photos=names, strips=(strip,), key="observations")


def _unlike(links: mosaic.PhotoLinks, photos: int) -> list[int]:
    """Photos that share enough points with others, and go with none of them."""
    mean, least = _left(links, photos)
    return [int(number) for number in np.flatnonzero((mean > mosaic.MOST_SHARE) & (least > SURE_SHARE))]


def _left(links: mosaic.PhotoLinks, photos: int) -> tuple[Floats, Floats]:
    """Give the mean and the least of what links of enough points leave on each photo, over the spread of the points."""
    sure = links.count >= SURE_POINTS
    photo, weight = links.photo[sure].ravel(), np.repeat(links.count[sure], 2).astype(float)
    share = np.repeat(links.share[sure], 2)
    least = np.full(photos, np.inf)
    np.minimum.at(least, photo, share)
    total = np.bincount(photo, weight, photos)
    return np.bincount(photo, weight * share, photos) / np.maximum(total, 1.0), least


def _moved_by(observations: PhotoPoints, photo: str, rows: int) -> PhotoPoints:
    """Image points whose ids on one photo are moved along its rows."""
    inside = observations.photo == observations.photo_ids.index(photo)
    point = observations.point.copy()
    point[inside] = np.roll(point[inside], rows)
    return replace(observations, point=point)


def _twice(links: mosaic.PhotoLinks, sigma: Floats) -> list[tuple[int, int]]:
    """Photos taken from one place: the same photo under two names."""
    base = np.abs(links.bases[1])
    if not len(base):  # as in each of the single photos of a block: the median of a million takes its time
        return []
    usual = np.median(base)
    like = np.abs(np.log(np.maximum(np.abs(links.turn), mosaic.TINY))) < np.log(mosaic.SCALE_JUMP)
    same = (
        like
        & (base < SAME_PLACE_SHARE * usual)
        & (links.misfit < SAME_PHOTO_SIGMAS * float(np.median(sigma)))
        & (links.count >= SURE_COUNT)
    )
    return [(int(a), int(b)) for a, b in links.photo[same]]


def _twin(links: mosaic.PhotoLinks, pair: tuple[int, int], strip: str, photos: Sequence[str]) -> Finding:
    row = links.index[pair]
    one, other = photos[pair[0]], photos[pair[1]]
    usual = np.median(np.abs(links.bases[1]))
    message = (
        f"photos {one} and {other} show their {links.count[row]} common points at the same places, within "
        f"{100 * float(links.misfit[row]) / usual:.2g} % of a base: the same photo twice"
    )
    fix = f"take {other} out of the strip, or give the rows of the photo that was meant"
    evidence = {
        "common_points": int(links.count[row]),
        "base_mm": float(np.abs(links.bases[1][row])),
        "usual_base_mm": usual,
        "misfit_mm": float(links.misfit[row]),
    }
    return found("P203", message, fix, evidence, photos=(one, other), strips=(strip,))


def _by_number(closer: Closer, photos: Sequence[str]) -> Toward:
    """Return the direction of one photo on another, both by number, as the closer look has it."""

    def toward(of: int, other: int) -> complex | None:
        directions = closer(photos[min(of, other)], photos[max(of, other)])
        return None if directions is None else directions[0 if of < other else 1]

    return toward


def turned_back(links: mosaic.PhotoLinks, order: Sequence[int], closer: Toward = lambda _of, _other: None) -> list[int]:
    """Find photos, listed in an order, whose two neighbours lie on the same side.

    None is named where a link is missing or doubtful, or where `closer`, which takes tilts into account, contradicts.
    """
    sure = (links.count >= SURE_COUNT) & (links.misfit < SURE_MISFIT * np.abs(links.bases[1]))
    certain, ways = sure.tolist(), [each.tolist() for each in links.bases]

    def toward(of: int, other: int) -> complex | None:
        row = links.index.get((min(of, other), max(of, other)))
        return ways[0 if of < other else 1][row] if row is not None and certain[row] else None

    found: list[int] = []
    looked_at = 0
    for before, photo, after in zip(order, order[1:], order[2:], strict=False):
        one, two = toward(photo, before), toward(photo, after)
        if one is None or two is None or not _same_side(one, two):
            continue
        looked_at += 1
        near = [closer(photo, other) for other in (before, after)] if looked_at <= MOST_LOOKED_AT else [None, None]
        if near[0] is None or near[1] is None or _same_side(near[0], near[1]):
            found.append(photo)
    return found


def _same_side(one: complex, two: complex) -> bool:
    return (one * two.conjugate()).real > TURNED_BACK * abs(one) * abs(two)


def _unlinked(links: mosaic.PhotoLinks, order: Sequence[int]) -> int:
    return sum((min(pair), max(pair)) not in links.index for pair in pairwise(order))


def _order(links: mosaic.PhotoLinks, listed: list[int], contradictions: Against, photos: int) -> list[int]:
    """Photos as they lie, where the list is contradicted; else as listed."""
    against = len(contradictions(listed)) + _unlinked(links, listed)
    if not against or len(listed) < LEAST_ORDERED:
        return listed
    plane = mosaic.lay_out(links, photos)
    order: list[int] = []
    for part in dict.fromkeys(plane.part[listed].tolist()):  # as they are listed
        order += _along(plane, [number for number in listed if plane.part[number] == part])
    left = len(contradictions(order)) + _unlinked(links, order)
    return order if left < against else listed


def _along(plane: mosaic.Mosaic, inside: list[int]) -> list[int]:
    """Photos of one part along its longest direction, in the sense in which fewer are out of the list's order."""
    if len(inside) < LEAST_ORDERED:
        return inside
    center = plane.offset[inside]
    d = center - center.mean()
    axis = np.sqrt((d**2).sum())  # direction of the largest extent
    along = (d * np.conj(axis)).real
    order = [inside[k] for k in np.argsort(along, kind="stable")]
    return min((order, order[::-1]), key=lambda each: len(_moved(each, inside)))


def _moved(order: Sequence[int], listed: Sequence[int]) -> list[int]:
    """Fewest photos that must be moved in the list: those outside its longest part in order."""
    if list(order) == list(listed):
        return []
    rank = {number: place for place, number in enumerate(order)}
    ends: list[int] = []
    chain: list[int] = []
    before: dict[int, int | None] = {}
    for number in listed:
        place = bisect_left([rank[each] for each in ends], rank[number])
        before[number] = ends[place - 1] if place else None
        ends[place : place + 1] = [number]
    last: int | None = ends[-1]
    while last is not None:
        chain.append(last)
        last = before[last]
    return [number for number in listed if number not in set(chain)]


def _out_of_order(
    links: mosaic.PhotoLinks,
    order: Sequence[int],
    moved: Sequence[int],
    strip: str,
    photos: Sequence[str],
    contradictions: Against,
) -> Finding:
    names = [photos[number] for number in order]
    wrong = [photos[number] for number in moved]
    exchanged = _exchanged(order, moved, photos)
    if exchanged:
        wrong = list(exchanged)
        message = f"strip {strip}: photos {wrong[0]} and {wrong[1]} are listed in the wrong order"
    elif len(moved) == 1:
        place = order.index(moved[0])
        near = [photos[number] for number in (*order[max(place - 1, 0) : place], *order[place + 1 : place + 2])]
        where = f"between {near[0]} and {near[1]}" if len(near) > 1 else f"beside {near[0]}"
        message = f"strip {strip}: photo {wrong[0]} is not where it is listed; its points put it {where}"
    else:
        message = f"strip {strip}: photos {listed(wrong)} are not where they are listed"
    concerned = _window(names, wrong)
    message += f"; the photos lie in the order {', '.join(concerned)}"
    given = [number for number in range(len(photos)) if number in set(order)]
    evidence = {
        "photos_moved": len(moved),
        "turned_back_as_listed": len(contradictions(given)),
        "turned_back_as_found": len(contradictions(order)),
        "neighbours_without_link_as_listed": _unlinked(links, given),
    }
    fix = "list the photos in flight order, or correct the photo ids in the table"
    return found("P201", message, fix, evidence, photos=tuple(wrong), strips=(strip,))


def _exchanged(order: Sequence[int], moved: Sequence[int], photos: Sequence[str]) -> tuple[str, str] | None:
    """Return the two neighbours whose exchange is all that is wrong."""
    if len(moved) != 1:
        return None
    place = order.index(moved[0])
    rest = sorted(order)
    for other in (*order[max(place - 1, 0) : place], *order[place + 1 : place + 2]):
        one, two = rest.index(moved[0]), rest.index(other)
        swapped = list(rest)
        swapped[one], swapped[two] = swapped[two], swapped[one]
        if swapped in (list(order), list(order)[::-1]):
            one, two = sorted((moved[0], other))
            return photos[one], photos[two]
    return None


def _window(names: Sequence[str], wrong: Sequence[str]) -> list[str]:
    """Return the part of the order that shows where wrong photos belong."""
    places = [names.index(each) for each in wrong]
    low, high = max(min(places) - 2, 0), min(max(places) + 3, len(names))
    return list(names[low:high]) if high - low <= 2 * MOST_NAMED else [*names[low : low + 2 * MOST_NAMED], "..."]


def _gaps(links: mosaic.PhotoLinks, order: Sequence[int], strip: str, photos: Sequence[str]) -> Iterator[Finding]:
    """Neighbours, in the order in which the photos lie, without two common points."""
    for a, b in pairwise(order):
        if (min(a, b), max(a, b)) in links.index:
            continue
        message = f"photos {photos[a]} and {photos[b]} follow each other and have no two points in common"
        fix = "is a photo between them missing, or does one of them belong to another strip?"
        evidence = {"common_points_at_most": 1}
        yield found("P202", message, fix, evidence, photos=(photos[a], photos[b]), strips=(strip,))
