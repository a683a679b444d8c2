"""Perspective centres of a formed strip: heights, base lengths and base directions that do not go with the others.

All is measured against the strip itself, in units of its flying height and of its usual base, so that a wrong control
does not disturb it; and against the scatter of the flight, which is large where wind moves a small aircraft.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from photostrip.arrays import Floats, Numbers
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
