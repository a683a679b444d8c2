"""A strip formed anew with other principal distances, to see whether its control asks for one of them.

A wrong principal distance stretches the heights of a strip and, where the photos are tilted, leaves y parallaxes. Where
the heights of the control show a stretch, the strip is formed again with the principal distance that they ask for; when
it then fits much better, and the pairs no worse, that is told.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.pipeline.plausibility import evidence
from photostrip.triangulation.plausibility import found
from photostrip.triangulation.plausibility.control import control_heights

if TYPE_CHECKING:
    from collections.abc import Callable

    from photostrip.notes import Finding
    from photostrip.pipeline.inputs import Settings, Strip
    from photostrip.pipeline.plausibility.evidence import Formed
    from photostrip.points import PhotoPoints
    from photostrip.triangulation.plausibility.control.control_heights import Stretched

    Read = Callable[[Formed], Stretched | None]

MISFIT = 2.5  # times what makes sense: heights that fit better need no other principal distance
BETTER = 0.4  # of that misfit, left with another principal distance that is told
NO_WORSE = 1.1  # times the sigma0 of the pairs
MUCH_BETTER = 0.7  # times that sigma0: pairs that ask for the other distance themselves
SHOWN = 3.0  # times what makes sense: stretch of the relief that no bend explains
TRIALS = 3  # of forming a strip anew
GIVEN_UP = 60.0  # misfit after two of them
LONGEST = 40  # photos: a longer strip would take too long
TRIED = (0.2, 5.0)  # of the principal distance given
FIRST = (1.4, 0.7, 2.0, 0.5)  # tried when the pairs cannot be oriented at all


def examine(formed: Formed, observations: PhotoPoints, settings: Settings, read: Read) -> list[Finding]:
    """Try other principal distances on a strip that does not fit the heights of its control.

    Parameters
    ----------
    observations : PhotoPoints
        Image points in the system of the photo, mm.
    read : callable
        Compares a formed strip with the heights of its control.

    Returns
    -------
    list of Finding
        P105, at most one.
    """
    # of a badly wrong distance, most control may have been dropped
    first = read(formed) or read(formed.whole) if len(formed.strip.photos) <= LONGEST else None
    if first is None or first.misfit < MISFIT or abs(first.ratio - 1.0) < control_heights.SCALE_LEAST:
        return []
    for start in (first.ratio, *FIRST):
        ratio, last, pairs = _settled(formed.strip, observations, settings, read, start)
        if last is None or last.misfit > BETTER * first.misfit or pairs > NO_WORSE * _pairs(formed):
            continue
        if abs(ratio - 1.0) * first.relief > SHOWN or pairs < MUCH_BETTER * _pairs(formed):
            break  # else a bend of the strip explains it
    else:
        return []
    numbers: dict[str, float | int | str] = {
        "heights_given_over_strip": first.ratio, "misfit_as_given": first.misfit, "misfit_then": last.misfit,
        "pairs_sigma0_mm": _pairs(formed), "pairs_sigma0_then_mm": pairs,
    }  # fmt: skip
    times = first.misfit / last.misfit
    return _told(formed.strip, ratio, f"fits the heights of its control {times:.0f} times better", numbers)


def without_pairs(strip: Strip, observations: PhotoPoints, settings: Settings, read: Read) -> list[Finding]:
    """Try other principal distances on a strip whose pairs cannot be oriented.

    Returns
    -------
    list of Finding
        P105, at most one.
    """
    for start in FIRST if len(strip.photos) <= LONGEST else ():
        ratio, last, pairs = _settled(strip, observations, settings, read, start)
        if last is not None and last.misfit < MISFIT:
            numbers: dict[str, float | int | str] = {"misfit_then": last.misfit, "pairs_sigma0_then_mm": pairs}
            return _told(strip, ratio, "can be formed and fits the heights of its control only", numbers)
    return []


def _changed(strip: Strip, factor: float) -> Strip:
    camera = replace(strip.camera, principal_distance=strip.camera.principal_distance * factor)
    return replace(strip, camera=camera)


def _pairs(formed: Formed) -> float:
    """Middle sigma0 of the pairs, mm."""
    sigma0 = formed.orientation.sigma0
    known = sigma0[np.isfinite(sigma0)]
    return float(np.median(known)) if len(known) else 0.0


def _settled(
    strip: Strip, observations: PhotoPoints, settings: Settings, read: Read, ratio: float
) -> tuple[float, Stretched | None, float]:
    """Follow the stretch of the heights until it is gone: factor of the principal distance, fit, sigma0 of pairs."""
    last, pairs = None, 0.0
    for trial in range(TRIALS):
        if last is not None:
            ratio *= last.ratio
        if not TRIED[0] < ratio < TRIED[1]:
            return ratio, None, 0.0
        again = evidence.form(_changed(strip, ratio), observations, settings)
        last = read(again) if again is not None else None
        if again is None or last is None:
            return ratio, None, 0.0
        pairs = _pairs(again)
        if trial and last.misfit > GIVEN_UP:
            break
    return ratio, last, pairs


def _told(strip: Strip, ratio: float, how: str, numbers: dict[str, float | int | str]) -> list[Finding]:
    if abs(ratio - 1.0) < control_heights.SCALE_LEAST:
        return []
    given = strip.camera.principal_distance
    message = f"strip {strip.id} {how} with a principal distance of {given * ratio:.1f} mm; {given:g} mm are given"
    evidence_ = numbers | {"principal_distance_mm": given, "would_fit_mm": given * ratio}
    key = f"cameras.{strip.camera.name}.principal_distance"
    return [found("P105", message, "take it from the certificate", evidence_, strips=(strip.id,), key=key)]
