"""Stereopairs of a strip: the points that neighbouring photos have in common.

The measurements of all pairs stand in flat columns ordered by pair; sums over a pair are segment sums, so that a
thousand pairs cost little more than one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.notes import counted
from photostrip.points import PhotoPoints, frozen_alike, take_rows

MINIMUM_POINTS = 5  # as many as elements
BY_ROW = ("pair", "left", "right", "weight", "point", "rows")


@dataclass(frozen=True, eq=False)
class Pairs:
    """What is measured in stereopairs: flat columns, ordered by pair."""

    starts: Numbers  # (p,): first row of each pair
    pair: Numbers  # (m,): pair of each row
    # left, right: (m, 2): image coordinates in mm, reduced to the principal point
    left: Floats
    right: Floats
    weight: Floats  # (m,): weight of the y parallax; 0 takes a point out
    focal: float  # principal distance in mm
    point: Numbers  # (m,): point of each row
    rows: Numbers  # (m, 2): rows of the measurements on the left and right photo in the table of image points

    @property
    def size(self) -> int:
        return len(self.starts)

    def rows_of(self, numbers: Numbers) -> Numbers:
        """Rows of some pairs, ascending."""
        wanted = np.zeros(self.size, bool)
        wanted[numbers] = True
        return np.flatnonzero(wanted[self.pair])

    def take(self, numbers: Numbers) -> Pairs:
        """Take some of the pairs, given by ascending numbers; they are renumbered from 0."""
        part = take_rows(self, self.rows_of(numbers), BY_ROW)
        pair = np.searchsorted(numbers, part.pair)
        return replace(part, pair=pair, starts=np.searchsorted(pair, np.arange(len(numbers))))

    def without(self, gone: Flags) -> Pairs:
        """Leave out rows; each pair must keep one."""
        if not gone.any():
            return self
        left = take_rows(self, ~gone, BY_ROW)
        return replace(left, starts=np.searchsorted(left.pair, np.arange(self.size)))

    def some_points(self, most: int) -> Numbers:
        """Draw points of which each pair has as many as that, or all it has."""
        points = int(self.point.max(initial=-1)) + 1
        order = np.random.default_rng(0).permutation(points)[self.point]  # the same in all its pairs
        rows = np.lexsort((order, self.pair))
        rank = np.arange(len(rows)) - self.starts[self.pair]
        return np.unique(self.point[rows[rank < most]])

    def sums(self, values: Floats) -> Floats:
        """Sum columns over each pair: values by row, shape (..., m), become sums by pair, shape (..., p)."""
        return np.add.reduceat(values, self.starts, axis=-1)


def collect_pairs(observations: PhotoPoints, photos: Sequence[str], focal: float) -> Pairs:
    """Points measured on neighbouring photos of a strip, as pairs.

    photos: photos of the strip in flight order; pair i is made of photos i and i+1.
    Returns measurements; weights are 1 where the standard deviations across the base are the strip's median.
    Raises GeometryError when a pair has fewer than five common points.
    """
    place = {photo: number for number, photo in enumerate(photos)}
    order_of = np.array([place.get(photo, -1) for photo in observations.photo_ids], np.intp)
    position = order_of[observations.photo]
    inside = np.flatnonzero(position >= 0)
    order = inside[np.lexsort((position[inside], observations.point[inside]))]
    point, position = observations.point[order], position[order]
    both = np.flatnonzero((point[1:] == point[:-1]) & (position[1:] == position[:-1] + 1))
    both = both[np.argsort(position[both], kind="stable")]
    rows = np.column_stack([order[both], order[both + 1]])
    pair = position[both]
    counts = np.bincount(pair, minlength=len(photos) - 1)
    _require_points(counts, photos)
    left, right = observations.xy[rows[:, 0]], observations.xy[rows[:, 1]]
    variance = observations.sigma**2
    x, y = (np.bincount(pair, shift, len(counts)).astype(float) for shift in (left - right).T)
    across = _across(x, y)[pair]
    of_parallax = (variance[rows, 1] + (variance[rows, 0] - variance[rows, 1]) * across[:, None]).sum(axis=1)
    return Pairs(
        starts=np.concatenate([[0], np.cumsum(counts)[:-1]]),
        pair=pair,
        left=left,
        right=right,
        weight=frozen_alike(2 * np.median(observations.sigma[inside]) ** 2 / of_parallax, float, (len(rows),)),
        focal=focal,
        point=observations.point[rows[:, 0]],
        rows=rows,
    )


def _across(x: Floats, y: Floats) -> Floats:
    """Shares (p,) of x in a variance across the base, along which common points shift by x, y (p,) between photos."""
    squares = x**2 + y**2
    return np.divide(y**2, squares, out=np.zeros(len(x)), where=squares > 0.0)


def _require_points(counts: Numbers, photos: Sequence[str]) -> None:
    for number in np.flatnonzero(counts < MINIMUM_POINTS).tolist():
        names = photos[number : number + 2]
        msg = (
            f"relative orientation of photos {names[0]} and {names[1]}: "
            f"{counted(int(counts[number]), 'common point')}, at least {MINIMUM_POINTS} are necessary (12 are "
            "recommended); measure more points or correct the order of the photos"
        )
        raise GeometryError(msg, photos=names, code="too-few-common-points")
