"""Perspective centres of a formed strip: heights, base lengths and base directions that do not go with the others.

All is measured against the strip itself, in units of its flying height and of its usual base, so that a wrong control
does not disturb it; and against the scatter of the flight, which is large where wind moves a small aircraft.

Given angles read in another unit or system: the reading that goes with the rotations found.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.geometry.rotation import SYSTEMS, about, from_angles
from photostrip.notes import Finding, listed
from photostrip.plausibility.finding import found
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
    step = np.diff(np.log(np.maximum(length, 1e-12)))
    ratios = length / np.maximum(np.nanmedian(_beside(length), axis=1), 1e-12)
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
