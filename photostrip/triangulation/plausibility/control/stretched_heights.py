"""Another principal distance as the one error that all control shares: heights of the strip that are stretched.

A principal distance that is wrong by a share e stretches a strip of nearly vertical photos in height by e against its
plan. At the control that is one column more in the misclosures, the heights above their mean; it is tested by what the
sum of squares loses with it (``control_deletion``), against what it loses without any one point.

Source: derived.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.errors import PhotostripError
from photostrip.statistics import f_p_value
from photostrip.triangulation.gross_errors.control.control_deletion import HEIGHT, adjust

if TYPE_CHECKING:
    from photostrip.triangulation.gross_errors.control.strip_at_control import StripAtControl

FALSE_ALARM = 1e-5  # probability of a stretch where there is none


class StretchedHeights(NamedTuple):
    """How the heights of a strip are stretched against its plan."""

    share: float  # 0.01: heights one percent too large
    sigma: float
    probability: float  # of a larger test value by chance


def find_stretch(strip: StripAtControl) -> StretchedHeights | None:
    """Test whether the heights of a strip are stretched; None where nothing says so, or single points say more."""
    sections = strip.sections()
    if len(sections) > 1:  # the one with most relief says most
        _, strip = max(sections, key=lambda each: float(np.std(each[1].placed[:, HEIGHT])))
    place = strip.coordinates
    count = len(place.point)
    if count <= strip.design.shape[1] + 1:
        return None
    try:
        covariance = strip.covariance(np.arange(count))
        whole = adjust(strip, strip.misclosures(strip.control.use), covariance, bends=False)
    except PhotostripError:
        return None
    height = strip.placed[:, HEIGHT] - strip.placed[:, HEIGHT].mean()
    column = place.direction[:, HEIGHT] * height[place.point]
    scaled = column * whole.size[:count]
    normal = float(scaled @ whole.matrix[:count, :count] @ scaled)
    pull = float(scaled @ whole.pull[:count])
    rest = whole.freedom - 1
    if not normal > 0.0 or rest < 1:
        return None
    gain = pull**2 / normal
    spread = max(1.0, (whole.squares - gain) / rest)
    alone = max((each.gain for each in whole.deletions(whole.points) if np.isfinite(each.gain)), default=0.0)
    probability = f_p_value(gain / spread, 1, rest)
    if probability > FALSE_ALARM or gain < alone:
        return None
    return StretchedHeights(pull / normal, float(np.sqrt(spread / normal)), probability)
