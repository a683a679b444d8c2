"""Errors that all control shares, or that of one list, tested before points are tested one by one.

A principal distance that is wrong by a share e stretches a strip of nearly vertical photos in height by e against its
plan; a control list in another frame, or with heights of another kind, lies beside the others by one shift. At the
control these are few columns more in the misclosures: the heights above their mean, or ones at the coordinates of a
list. They are tested by what the sum of squares loses with them (``control_search``), against what it loses without
any one point.

Source: derived.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import PhotostripError
from photostrip.geodesy.local_frame import EARTH_RADIUS
from photostrip.statistics import f_p_value
from photostrip.strip.control_search import HEIGHT, JointAdjustment, adjust

if TYPE_CHECKING:
    from photostrip.strip.control_search import StripAtControl


MORE_THAN_ALONE = 1.0 + 1e-6  # of what one point explains: a list may have one point only
FALSE_ALARM = 1e-5  # probability of an error of all where there is none


class StretchedHeights(NamedTuple):
    """How the heights of a strip are stretched against its plan."""

    share: float  # 0.01: heights one percent too large
    sigma: float
    gain: float  # of the sum of squares, over the variance factor of what is left


class ShiftedList(NamedTuple):
    """How the control of one list lies beside that of the others."""

    number: int  # of the list
    # shift, sigma: (3,): given minus what the others predict, along the ground axes, metres; NaN where nothing is given
    shift: Floats
    sigma: Floats
    gain: float


def find_shared(strip: StripAtControl) -> StretchedHeights | ShiftedList | None:
    """Find what all control of a strip, or of a list, shares; None where nothing says so, or single points say more."""
    # the section with most relief says most
    _, strip = max(strip.sections, key=lambda each: float(np.std(each[1].placed[:, HEIGHT])))
    count = len(strip.coordinates.point)
    if count <= strip.design.shape[1] + 1:
        return None
    try:
        laid = strip.laid
        whole = adjust(laid, laid.misclosures(), strip.joint_covariance, bends=False)
    except PhotostripError:
        return None
    alone = max((each.gain for each in whole.deletions(whole.points) if np.isfinite(each.gain)), default=0.0)
    found = [_stretch(strip, whole, alone), *_shifts(strip, whole, alone)]
    return max((each for each in found if each is not None), key=lambda each: each.gain, default=None)


def _stretch(strip: StripAtControl, whole: JointAdjustment, alone: float) -> StretchedHeights | None:
    place = strip.coordinates
    of_strip = strip.placed[:, HEIGHT] - strip.placed[:, HEIGHT].mean()
    # a strip that bends has heights where the ground has none, and wrong heights are none of the strip
    tested, also = (
        _tested(whole, (place.direction[:, HEIGHT] * height[place.point])[:, None], alone)
        for height in (_relief(strip, whole.w), of_strip)
    )
    if tested is None or also is None or tested.value[0] <= -1.0:  # level ground: heights turned over are its errors
        return None
    return StretchedHeights(float(tested.value[0]), float(tested.sigma[0]), tested.gain)


def _relief(strip: StripAtControl, w: Floats) -> Floats:
    """Heights of the ground at the control (n,), against their mean, metres.

    They are those given, without what the curvature of the Earth takes from a plane: the photos follow it.
    """
    height, place = strip.placed[:, HEIGHT].copy(), strip.coordinates
    rows = np.flatnonzero(place.axis == HEIGHT)
    height[place.point[rows]] -= w[rows]
    if strip.targets.frames[0].kind != "local":
        d = strip.placed[:, :HEIGHT] - strip.placed[:, :HEIGHT].mean(axis=0)
        height += (d**2).sum(axis=1) / (2.0 * EARTH_RADIUS)
    return np.asarray(height - height.mean(), float)


def _shifts(strip: StripAtControl, whole: JointAdjustment, alone: float) -> list[ShiftedList]:
    """Shifts of all lists but the largest."""
    place, lists = strip.coordinates, strip.control.frame[strip.coordinates.point]
    numbers, sizes = np.unique(lists, return_counts=True)
    found = []
    for number in numbers[np.argsort(sizes, kind="stable")][:-1].tolist():
        inside = lists == number
        axes = np.unique(place.axis[inside])
        tested = _tested(whole, (inside[:, None] & (place.axis[:, None] == axes)).astype(float), alone)
        if tested is not None:
            shift, sigma = np.full((2, 3), np.nan)
            shift[axes], sigma[axes] = -tested.value, tested.sigma
            found.append(ShiftedList(number=number, shift=shift, sigma=sigma, gain=tested.gain))
    return found


class Shared(NamedTuple):
    """Columns that are significant: their values, standard deviations, and what the sum of squares loses with them."""

    value: Floats
    sigma: Floats
    gain: float


def _tested(whole: JointAdjustment, columns: Floats, alone: float) -> Shared | None:
    """Test columns (w, k) of the misclosures; None where chance, or a single point, explains as much."""
    count, unknowns = columns.shape
    scaled = columns * whole.size[:count, None]
    normal, pull = scaled.T @ whole.matrix[:count, :count] @ scaled, scaled.T @ whole.pull[:count]
    return significant(normal, pull, whole.squares, whole.freedom - unknowns, alone)


def significant(normal: Floats, pull: Floats, squares: float, rest: int, alone: float) -> Shared | None:
    """Test what normal equations (k, k) find of differences; None where chance, or a single point, explains as much.

    squares, rest: their sum of squares, and the redundancy that is left with the columns.
    """
    unknowns = len(pull)
    if rest < 1 or np.linalg.matrix_rank(normal, hermitian=True) < unknowns:
        return None
    inverse = np.linalg.inv(normal)
    gain = float(pull @ inverse @ pull)
    spread = max(1.0, (squares - gain) / rest)
    if gain <= MORE_THAN_ALONE * alone or f_p_value(gain / unknowns / spread, unknowns, rest) > FALSE_ALARM:
        return None
    return Shared(inverse @ pull, np.sqrt(np.diag(inverse) * spread), gain / spread)
