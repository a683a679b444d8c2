"""A strip formed anew with other principal distances, to see whether its control asks for one of them.

A wrong principal distance stretches the heights of a strip and, where the photos are tilted, leaves y parallaxes. Where
the heights of the control show a stretch, the strip is formed again with the principal distance that they ask for; when
it then fits much better, and the pairs no worse, that is reported.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from photostrip.camera import Camera
from photostrip.errors import GeometryError
from photostrip.notes import Finding
from photostrip.pipeline.inputs import Settings, Strip
from photostrip.pipeline.plausibility import evidence
from photostrip.pipeline.plausibility.evidence import EvidenceStrip
from photostrip.plausibility import found
from photostrip.plausibility.control import wrong_heights
from photostrip.plausibility.control.wrong_heights import HeightStretch
from photostrip.plausibility.finding import Evidence
from photostrip.points import PhotoPoints, locate, take_rows
from photostrip.strip.relative_orientation.pairs import Pairs, collect_pairs

Compare = Callable[[EvidenceStrip], HeightStretch | None]

# sigma0 of the pairs over what is stated, from which they ask for it: in strips with the distance of another lens whose
# control shows no stretch it is 3 and more, in sound ones below 1.8
ASKING_SIGMA0 = 2.0
LEAST_MISFIT = 2.5  # times what makes sense: heights that fit better need no other principal distance
LEFT_SHARE = 0.4  # of that misfit, left with another principal distance that is reported
MOST_SIGMA0_RATIO = 1.1  # times the sigma0 of the pairs
BETTER_SIGMA0_RATIO = 0.7  # times that sigma0: pairs that ask for the other distance themselves
BEND_POWER = 1.5  # of the number of photos: so does the bend of a strip grow, which is a small part of that
TRIALS = 3  # of forming a strip anew
GIVEN_UP_MISFIT = 60.0  # misfit after two of them
MOST_PHOTOS = 40  # photos: a longer strip would take too long
ENOUGH_POINTS = 100  # of a pair of a strip formed for trials, where it has more
MOST_POINTS = 10_000  # image points of all strips formed for trials: of 20 photos with 100 points one start is followed
FACTOR_RANGE = (0.05, 5.0)  # of the principal distance given
FIX = "take it from the certificate"
UNIT_FACTOR = 5.0  # a principal distance off by more may be right, and the decimal point of the image coordinates wrong
FIRST_FACTORS = (1.4, 0.7, 2.0, 0.5, 0.1)  # tried when the pairs cannot be oriented at all


class DistanceTrial(NamedTuple):
    """A strip formed with another principal distance."""

    factor: float  # of the principal distance given
    # misfit, in_relief: of the heights, in units of what makes sense; without and with a bend of the strip
    misfit: float
    in_relief: float
    sigma0: float  # of the pairs, mm


def find_wrong_distance(
    formed: EvidenceStrip,
    as_given: HeightStretch | None,
    observations: PhotoPoints,
    given: Sequence[str],
    settings: Settings,
    compare: Compare,
    *,
    stretched: bool,
) -> list[Finding]:
    """Try other principal distances on a strip that does not fit the heights of its control (P105, P107, at most one).

    It is tried where something asks for it: all control together, a misfit larger than a strip bends, or the pairs.

    as_given: how the strip fits those heights as it was formed, where that is known.
    given: ids of given points.
    `compare` compares a formed strip with them.
    stretched: whether all control of the strip together shows that its heights are stretched, or the run doubts some.
    """
    if len(formed.strip.photos) > MOST_PHOTOS:
        return []
    # of a badly wrong distance, most control may have been dropped
    first = as_given or compare(formed) or compare(formed.whole)
    least = 0.0 if stretched else wrong_heights.LEAST_SCALE_ERROR
    if first is None or first.misfit < LEAST_MISFIT or abs(first.ratio - 1.0) < least:
        return []
    sigma0 = _middle_sigma0(formed)
    no_bend = first.misfit > len(formed.strip.photos) ** BEND_POWER
    if not (stretched or no_bend or pairs_ask(formed, observations)):
        return []
    some = _some_points(formed.orientation.pairs, observations, given)
    for start in (first.ratio, *FIRST_FACTORS)[: _most_starts(some)]:
        trial = _followed(formed.strip, some, settings, compare, start)
        if trial is None or trial.misfit > LEFT_SHARE * first.misfit or trial.sigma0 > MOST_SIGMA0_RATIO * sigma0:
            continue
        in_relief = no_bend or trial.in_relief < LEFT_SHARE * first.in_relief
        if in_relief or trial.sigma0 < BETTER_SIGMA0_RATIO * sigma0:
            break  # else a bend of the strip explains it
    else:
        return []
    if abs(trial.factor - 1.0) < least:
        return []
    numbers: Evidence = {
        "heights_given_over_strip": first.ratio, "misfit_as_given": first.misfit, "misfit_then": trial.misfit,
        "pairs_sigma0_mm": sigma0, "pairs_sigma0_then_mm": trial.sigma0,
    }  # fmt: skip
    times = first.misfit / trial.misfit
    return _finding(formed.strip, trial.factor, f"fits the heights of its control {times:.0f} times better", numbers)


def find_distance_without_pairs(
    strip: Strip,
    observations: PhotoPoints,
    given: Sequence[str],
    settings: Settings,
    compare: Compare,
) -> list[Finding]:
    """Try other principal distances on a strip whose pairs cannot be oriented (P105, at most one)."""
    if len(strip.photos) > MOST_PHOTOS:
        return []
    try:
        pairs = collect_pairs(observations, strip.photos, strip.camera.principal_distance)
    except GeometryError:
        return []  # whatever the principal distance
    some = _some_points(pairs, observations, given)
    for start in FIRST_FACTORS[: _most_starts(some)]:
        trial = _followed(strip, some, settings, compare, start)
        if trial is not None and trial.misfit < LEAST_MISFIT:
            numbers: Evidence = {"misfit_then": trial.misfit, "pairs_sigma0_then_mm": trial.sigma0}
            return _finding(strip, trial.factor, "can be formed and fits the heights of its control only", numbers)
    return []


def _some_points(pairs: Pairs, observations: PhotoPoints, given: Sequence[str]) -> PhotoPoints:
    """Leave out what trials of a strip can do without, where its pairs have many points; given points stay."""
    some = pairs.some_points(ENOUGH_POINTS)
    if len(some) == len(np.unique(pairs.point)):
        return observations
    chosen = np.zeros(len(observations.point_ids) + 1, bool)  # the last: given points that nobody measured
    chosen[some] = chosen[locate(given, observations.point_ids)] = True
    return take_rows(observations, chosen[observations.point], ("photo", "point", "xy", "sigma"))


def _most_starts(observations: PhotoPoints) -> int:
    """Count the starts that a project with so many points allows each of its strips."""
    return max(MOST_POINTS // (TRIALS * max(len(observations.point), 1)), 1)


def pairs_ask(formed: EvidenceStrip, observations: PhotoPoints) -> bool:
    """Whether the pairs of a strip fit so badly that another principal distance may be the reason."""
    return _middle_sigma0(formed) > ASKING_SIGMA0 * formed.strip.median_sigma(observations)


def _middle_sigma0(formed: EvidenceStrip) -> float:
    """Middle sigma0 of the pairs, mm."""
    sigma0 = formed.orientation.sigma0
    known = sigma0[np.isfinite(sigma0)]
    return np.median(known) if len(known) else 0.0


def _followed(
    strip: Strip, observations: PhotoPoints, settings: Settings, compare: Compare, ratio: float
) -> DistanceTrial | None:
    """Follow the stretch of the heights until it is gone; None where no strip can be formed and compared."""
    last, pairs = None, 0.0
    for trial in range(TRIALS):
        if last is not None:
            ratio *= last.ratio
        if not FACTOR_RANGE[0] < ratio < FACTOR_RANGE[1]:
            return None
        camera = replace(strip.camera, principal_distance=strip.camera.principal_distance * ratio)
        again = evidence.form(replace(strip, camera=camera), observations, settings)
        last = compare(again) if again is not None else None
        if again is None or last is None:
            return None
        pairs = _middle_sigma0(again)
        if trial and last.misfit > GIVEN_UP_MISFIT:
            break
    return (
        None
        if last is None
        else DistanceTrial(factor=ratio, misfit=last.misfit, in_relief=last.in_relief, sigma0=pairs)
    )


def other_distance(
    camera: Camera, would_fit: float, message: str, fix: str, numbers: Evidence, strips: Sequence[str]
) -> Finding:
    """Name the principal distance that would fit: a small difference (P107) or a wrong one (P105)."""
    given = camera.principal_distance
    code = "P107" if abs(would_fit / given - 1.0) < wrong_heights.LEAST_SCALE_ERROR else "P105"
    evidence_ = numbers | {"principal_distance_mm": given, "would_fit_mm": would_fit}
    return found(code, message, fix, evidence_, strips=strips, key=f"cameras.{camera.name}.principal_distance")


def _finding(strip: Strip, ratio: float, how: str, numbers: Evidence) -> list[Finding]:
    given = strip.camera.principal_distance
    message = f"strip {strip.id} {how} with a principal distance of {given * ratio:.1f} mm; {given:g} mm is given"
    fix = FIX if 1.0 / UNIT_FACTOR < ratio < UNIT_FACTOR else f"{FIX}, or correct `observations.unit`"
    return [other_distance(strip.camera, given * ratio, message, fix, numbers, (strip.id,))]
