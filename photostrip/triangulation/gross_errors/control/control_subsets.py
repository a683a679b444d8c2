"""Control that agrees: similarities of the fewest points that determine them, tried one after the other.

Weights that fall with the misclosure can end between good and wrong control when a third of it is wrong. Here two
points give the position, azimuth and scale of a strip that is nearly level, three heights its height and tilts; of all
such sets the one is taken whose similarity suits the better half of the control best. Up to nearly half of the control
may be wrong.

Source: least median of squares; derived, see docs/sources.md.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.similarity import similarity_derivatives
from photostrip.statistics import SIGMA_FROM_MEDIAN
from photostrip.triangulation import absolute_orientation

if TYPE_CHECKING:
    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.geometry.similarity import Similarity
    from photostrip.triangulation.absolute_orientation import Targets


PLAN_COLUMNS, HEIGHT_COLUMNS = [0, 1, 5, 6], [2, 3, 4]  # shifts X, Y, turn about Z, scale; shift Z, turns about X, Y
PLAN_POINTS, HEIGHT_POINTS = 2, 3  # of a set
SETS = 2000  # all sets of up to 63 points in plan and 23 heights
DETERMINED = 1e-4  # smallest determinant of a set, columns of unit length over all points
AGREE = 3.0  # standard deviations from the better half
FAR_SIGMAS = 12.0  # standard deviations; what is nearer is left to the tests of single coordinates
SUBSET_ROUNDS = 8


def far(strip: Floats, targets: Targets, weight: Floats, start: Similarity) -> tuple[Flags, Floats]:
    """Find coordinates far from a similarity that suits the better half of the control, in plan both of a point.

    Nothing is far that is within twelve standard deviations by its weight (n, 3), metres^-2. Also gives the misclosures
    of all after a similarity on those that agree, along the ground axes; a GeometryError when what agrees does not
    determine one.
    """
    use = targets.control.use
    expected = 1 / np.sqrt(np.where(weight > 0, weight, np.inf)).max(axis=0, initial=0.0)
    similarity, good = start, np.zeros(use.shape, bool)
    size = np.zeros(use.shape)
    for _ in range(SUBSET_ROUNDS):
        before = good
        good = _agreeing(similarity(strip), targets, expected)
        if (good == before).all():
            break
        result = absolute_orientation.orient(strip, targets, weight * good)
        similarity, size = result.similarity, _sizes(result.misclosures)
    scatter = [max(SIGMA_FROM_MEDIAN * float(np.median(size[good[:, k], k])), float(expected[k])) for k in (0, 1, 2)]
    scatter[0] = scatter[1] = max(scatter[:2])
    return np.asarray(use & (size > FAR_SIGMAS * np.array(scatter)), bool), result.misclosures


def _sizes(misclosures: Floats) -> Floats:
    """Distances in plan, twice, and in height; what is not given is 0."""
    known = np.nan_to_num(misclosures)
    plan = np.hypot(known[:, 0], known[:, 1])
    return np.column_stack([plan, plan, np.abs(known[:, 2])])


def _agreeing(xyz: Floats, targets: Targets, expected: Floats) -> Flags:
    """Coordinates that agree with the best set, to the first order about the present positions."""
    use = targets.control.use
    rows = targets.axes(xyz) @ similarity_derivatives(xyz, xyz.mean(axis=0))
    gap = np.nan_to_num(targets.misclosures(xyz))
    good = np.zeros(use.shape, bool)
    plan, height = np.flatnonzero(use[:, 0]), np.flatnonzero(use[:, 2])
    left = _best(rows[plan][:, :2][:, :, PLAN_COLUMNS], gap[plan, :2], PLAN_POINTS)
    good[plan, :2] = _near(left, PLAN_POINTS, float(expected[:2].max()))[:, None]
    left = _best(rows[height][:, 2:][:, :, HEIGHT_COLUMNS], gap[height, 2:], HEIGHT_POINTS)
    good[height, 2] = _near(left, HEIGHT_POINTS, float(expected[2]))
    return good


def _half(count: int, fewest: int) -> int:
    """Place of the misclosure that a set is rated by: half of the points beside those of the set."""
    return min((count + fewest + 1) // 2, count) - 1


def _near(left: Floats, fewest: int, expected: float) -> Flags:
    """Tell what agrees with the similarity that left these misclosures."""
    if len(left) <= fewest:
        return np.ones(len(left), bool)
    scatter = SIGMA_FROM_MEDIAN * float(np.sort(left)[_half(len(left), fewest)])
    return np.asarray(left <= AGREE * max(scatter, expected), bool)


def _best(design: Floats, gap: Floats, fewest: int) -> Floats:
    """Misclosures that the best set leaves, shape (n,); design (n, c, u), gap (n, c)."""
    n, _, unknowns = design.shape
    if n <= fewest:
        return np.zeros(n)
    design = design / np.maximum(np.linalg.norm(design.reshape(-1, unknowns), axis=0), 1e-300)
    sets = _sets(n, fewest)
    matrix, right = design[sets].reshape(len(sets), -1, unknowns), gap[sets].reshape(len(sets), -1)
    regular = np.abs(np.linalg.det(matrix)) > (DETERMINED / n) ** (unknowns / 2)
    if not regular.any():
        return np.asarray(np.linalg.norm(gap, axis=1), float)
    steps = np.linalg.solve(matrix[regular], -right[regular][:, :, None])[:, :, 0]
    left = np.linalg.norm(gap + np.einsum("ncu,su->snc", design, steps), axis=2)
    found: Floats = left[np.sort(left, axis=1)[:, _half(n, fewest)].argmin()]
    return found


def _sets(n: int, fewest: int) -> Numbers:
    """All sets of so many points, or as many as are tried, the same for the same number of points."""
    total = n * (n - 1) // 2 if fewest == PLAN_POINTS else n * (n - 1) * (n - 2) // 6
    if total <= SETS:
        return np.array(list(combinations(range(n), fewest)), np.intp)
    rng = np.random.default_rng(n)  # what is found does not change from run to run
    return np.argsort(rng.random((SETS, n)), axis=1)[:, :fewest].astype(np.intp)
