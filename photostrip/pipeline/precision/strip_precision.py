"""How precise points and photos of one strip are, and of all strips together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.pipeline.results import Adjusted, Precision, StripResult
from photostrip.strip.error_propagation.check_errors import CheckErrors

AT_A_TIME = 100  # control coordinates that two strips share, looked at together


@dataclass(frozen=True, eq=False)
class StripPrecision:
    """Covariances of one strip in the axes of the Cartesian frame."""

    points: Floats  # (q, 3, 3): of the points of the strip, metres^2
    photos: Floats  # (m, 6, 6): of centre and small rotation of its photos; NaN where a photo could not be oriented
    # takes rows of points (n,) and of control coordinates (c,), gives what errors of these coordinates subtract from
    # these points, (n, 3, c), in the same axes
    by_control: Callable[[Numbers, Numbers], Floats]
    # (w, 2): the control coordinates that count: the control point's number among the image points' ids, and its ground
    # axis
    control: Numbers
    variance: Floats  # (w,): their variances, metres^2
    sigma: float  # standard deviation of an image coordinate of weight one, mm
    basis: str  # where that comes from
    check: CheckErrors | None  # errors at the strip's check points, with their covariance


def joined(strips: Sequence[StripPrecision], results: Sequence[StripResult], points: Adjusted) -> Precision:
    """Precision of all strips together."""
    return Precision(
        points=_means(strips, results, points.number),
        photos=tuple(strip.photos for strip in strips),
        sigma=tuple(strip.sigma for strip in strips),
        basis=tuple(strip.basis for strip in strips),
        checks=tuple(strip.check for strip in strips),
    )


def _means(strips: Sequence[StripPrecision], results: Sequence[StripResult], number: Numbers) -> Floats:
    """Covariances (n, 3, 3) of the points of all strips; a point of several strips is their mean.

    Strips have no image coordinate in common; what their points share are the errors of common control.
    """
    if len(strips) == 1:
        return strips[0].points
    rows = [np.searchsorted(number, result.formed.point) for result in results]
    count = np.bincount(np.concatenate(rows), minlength=len(number))
    total = np.zeros((len(number), 3, 3))
    for row, strip in zip(rows, strips, strict=True):
        total[row] += strip.points
    for (row_a, a), (row_b, b) in combinations(zip(rows, strips, strict=True), 2):
        shared, in_a, in_b = np.intersect1d(row_a, row_b, return_indices=True)
        _, of_a, of_b = np.intersect1d(_keys(a), _keys(b), return_indices=True)
        if not len(shared):
            continue
        for start in range(0, len(of_a), AT_A_TIME):
            part = slice(start, start + AT_A_TIME)
            by_a, by_b = a.by_control(in_a, of_a[part]), b.by_control(in_b, of_b[part])
            mixed = (by_a * a.variance[of_a[part]]) @ by_b.transpose(0, 2, 1)
            total[shared] += mixed + mixed.transpose(0, 2, 1)
    total /= (count**2)[:, None, None]
    return total


def _keys(strip: StripPrecision) -> Numbers:
    """One number for each control coordinate."""
    return np.asarray(strip.control[:, 0] * 3 + strip.control[:, 1], np.intp)
