"""How much worse the points of a pair are than those of a good pair of the same base and height.

A good pair has six standard points: two rows of three, one base apart each way, about the middle of the pair's own
points. Its elements, in the place of those found, give the same points a covariance to compare with; errors of the
points' own image coordinates are in both.

Source: [001] for the six points; the comparison is derived.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from photostrip.arrays import Floats
from photostrip.points import take_rows
from photostrip.strip.error_propagation.strip_errors import differentiate_pairs
from photostrip.strip.relative_orientation.orientation import BY_ROW, Orientation
from photostrip.strip.relative_orientation.pairs import Pairs
from photostrip.strip.relative_orientation.solution import (
    in_front_of_cameras,
    linearised_parallaxes,
    normal_matrices,
    turns,
)

WEAK_PAIR = 3.0  # times a good pair: six points in a band a third as wide as the base is long
MOST_POINTS = 60  # of a pair that are looked at
STANDARD = np.array([[x, y] for y in (0.0, 1.0, -1.0) for x in (-0.5, 0.5)])  # from the middle, in bases


def times_a_good_pair(oriented: Orientation) -> Floats:
    """Find the standard deviation of the points of each pair, rms, over that in a good pair, shape (p,).

    Sums over the points of tr(A A') / 2 + tr(B Q B') with their derivatives A by the image coordinates, B by the
    elements; Q their cofactors, as found or of the good pair. The left photo is held, the base is one.
    """
    oriented = _some_points(oriented)
    pairs = oriented.pairs
    level = np.tile(np.eye(3), (pairs.size, 1, 1))
    with np.errstate(all="ignore"):
        errors = differentiate_pairs(oriented, level, np.ones(pairs.size))
        used = in_front_of_cameras(oriented.elements, pairs)
        own = pairs.sums(np.where(used, (errors.point_by_image**2).sum(axis=(1, 2)) / 2.0, 0.0))
        by = np.where(used[:, None, None], errors.point_by_elements, 0.0)
        squares = pairs.sums(np.einsum("mci,mcj->ijm", by, by))
        standard = _standard_points(oriented)
        good = np.linalg.inv(normal_matrices(linearised_parallaxes(oriented.elements, standard).jacobian, standard))
        found, wanted = (own + np.einsum("pij,ijp->p", each, squares) for each in (oriented.cofactors, good))
        return np.asarray(np.sqrt(found / wanted), float)


def _some_points(oriented: Orientation) -> Orientation:
    """Take the points that were used, of dense pairs some: the others would say the same."""
    used = oriented.used
    wanted = np.isin(oriented.point, oriented.pairs.without(~used).some_points(MOST_POINTS)) & used
    return replace(take_rows(oriented, wanted, BY_ROW), pairs=oriented.pairs.without(~wanted))


def _standard_points(oriented: Orientation) -> Pairs:
    """Measure the six points of a good pair in every pair: level in the base frame, then by the photos as they are."""
    pairs = oriented.pairs
    (lx, ly, lz), (rx, _, rz) = oriented.rays
    count = pairs.sums(np.ones(len(pairs.pair)))
    x1, y1, x2 = (pairs.sums(-pairs.focal * across / depth) / count for across, depth in ((lx, lz), (ly, lz), (rx, rz)))
    base = x1 - x2
    number = np.repeat(np.arange(pairs.size), len(STANDARD))
    xy = np.tile(STANDARD, (pairs.size, 1)) * base[number, None]
    photos = []
    for x, rotation in zip((x1, x2), turns(oriented.elements), strict=True):
        level = np.column_stack([x[number] + xy[:, 0], y1[number] + xy[:, 1], np.full(len(xy), -pairs.focal)])
        seen = np.einsum("mi,mij->mj", level, rotation[number])
        photos.append(-pairs.focal * seen[:, :2] / seen[:, 2:])
    none = np.zeros(len(number), np.intp)
    return replace(
        pairs,
        starts=np.arange(pairs.size) * len(STANDARD),
        pair=number,
        left=photos[0],
        right=photos[1],
        weight=np.ones(len(number)),
        point=none,
        rows=np.column_stack([none, none]),
    )
