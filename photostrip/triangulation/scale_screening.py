"""Pass points that do not belong in a scale transfer, tested with the precision that their parallaxes give them.

The ratio of a point's distances from the common centre follows from its x parallaxes in the two models. An error of the
coordinate on the common photo changes both parallaxes, in opposite directions; errors of the two orientations
deform the models and change all ratios of a joint in a pattern. Both are propagated for each point.

Source: derived; see docs/sources.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.statistics import normal_quantile
from photostrip.triangulation import relative
from photostrip.triangulation.intersection import intersect
from photostrip.triangulation.robust import NORMAL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.triangulation.relative import Orientation

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

ALPHA = 0.001  # of rejecting a point of a joint without gross errors
FEWEST = 3  # with two ratios nobody can tell which is wrong
SMALLEST_SIGMA = 1e-3  # mm, of a y parallax, when the pairs' own residuals have to say it
DIFFERENCE = 1e-6  # rad, for derivatives by the elements
MEDIAN_SCATTER = 1.17  # sd of a standard deviation from the median of n residuals, times sqrt(n)
PROOF = 3.0  # of those, by which ratios must scatter more than propagated
ROUNDS = 10


def _distances(orientation: Orientation, elements: Floats) -> tuple[Floats, Floats]:
    """Logarithms of the distances from the left and from the right centre, of every row, base length 1."""
    left, right = relative.rays(elements, orientation.pairs)
    xyz = intersect(np.array([1.0, 0.0, 0.0]), left, right, orientation.pairs.focal).xyz
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.log(np.linalg.norm(xyz, axis=1)), np.log(np.linalg.norm(xyz - [1.0, 0.0, 0.0], axis=1))


def spreads(
    orientation: Orientation, vectors: Floats, rows: Sequence[Numbers], sigma: Floats | None = None
) -> tuple[Floats, Floats]:
    """Propagate image coordinates and orientations into scale ratios.

    Parameters
    ----------
    orientation : Orientation
        Oriented pairs.
    vectors : ndarray, shape (m, 3)
        Model points, base length 1.
    rows : sequence of ndarray of int, shape (t,)
        Joint, row before and row after of every pass point.
    sigma : ndarray, shape (p,), optional
        Standard deviation of a y parallax of weight one in each pair, mm.

    Returns
    -------
    single : ndarray, shape (t,)
        Relative standard deviation of each ratio by its own image coordinates.
    model : ndarray, shape (t,)
        The same by the deformation of the two models, against the mean of the joint.
    """
    joint, before, after = rows
    scatter = _scatter(orientation) if sigma is None else sigma
    base, _ = orientation.relative
    depth_before = np.linalg.norm(np.cross(vectors[before], base[joint]), axis=1)
    depth_after = np.linalg.norm(np.cross(vectors[after], base[joint + 1]), axis=1)
    quality = np.minimum(orientation.pairs.weight[before], orientation.pairs.weight[after])
    # an image coordinate has half the variance of a parallax; that of the common photo acts on both distances
    coordinate = (scatter[joint] ** 2 + scatter[joint + 1] ** 2) / 4 / quality
    factor = (depth_before + depth_after) ** 2 + depth_before**2 + depth_after**2
    single = np.sqrt(coordinate * factor) / orientation.pairs.focal
    variance = np.zeros(len(joint))
    if len(joint):
        cofactors, (from_left, from_right) = _cofactors(orientation), _slopes(orientation)
        for slope, model in ((from_right[before], joint), (from_left[after], joint + 1)):
            count = np.bincount(joint, minlength=joint.max() + 1)
            mean = np.column_stack([np.bincount(joint, slope[:, k]) for k in range(5)]) / np.maximum(count, 1)[:, None]
            own = slope - mean[joint]
            variance += np.einsum("ti,tij,tj->t", own, cofactors[model], own) * scatter[model] ** 2
    return single, np.sqrt(np.maximum(variance, 0.0))


def _scatter(orientation: Orientation) -> Floats:
    """Estimate the standard deviation of a y parallax from all pairs together."""
    known = orientation.sigma0[np.isfinite(orientation.sigma0)]
    value = np.sqrt(2.0) * float(np.median(known)) if len(known) else 0.0
    return np.full(orientation.pairs.size, max(value, SMALLEST_SIGMA))


def _slopes(orientation: Orientation) -> tuple[Floats, Floats]:
    """Differentiate the logarithms of the distances from both centres by the five elements, shapes (m, 5)."""
    columns = []
    for number in range(5):
        step = np.zeros(5)
        step[number] = DIFFERENCE
        up, down = (_distances(orientation, orientation.elements + sign * step) for sign in (1, -1))
        columns.append([(above - below) / (2 * DIFFERENCE) for above, below in zip(up, down, strict=True)])
    left, right = (np.nan_to_num(np.column_stack(side)) for side in zip(*columns, strict=True))
    return left, right


def _cofactors(orientation: Orientation) -> Floats:
    _, jacobian = relative.linearised(orientation.elements, orientation.pairs)
    return np.asarray(np.linalg.pinv(relative.normal_matrices(jacobian, orientation.pairs), hermitian=True), float)


def screen(
    ratio: Floats, weight: Floats, spread: tuple[Floats, Floats], joint: Numbers, joints: int
) -> tuple[Flags, Floats]:
    """Find the ratios that belong together.

    Parameters
    ----------
    ratio, weight : ndarray, shape (t,)
        Scale ratios and their weights in the mean.
    spread : tuple of ndarray, shape (t,)
        Relative standard deviations as :func:`spreads` gives them.
    joint : ndarray of int, shape (t,)
        Joint of each ratio, ascending.
    joints : int
        Number of joints.

    Returns
    -------
    used : ndarray of bool, shape (t,)
        Ratios that belong.
    limit : ndarray, shape (t,)
        Largest relative deviation of each that still belongs.
    """
    size = np.hypot(*spread)
    count = np.bincount(joint, minlength=joints)
    level = np.array([normal_quantile(1 - ALPHA / (2 * max(int(n), 1))) for n in count])
    value = np.log(ratio)
    center = _weighted_medians(value, weight, joint, joints)
    own = NORMAL * _weighted_medians(np.abs(value - center[joint]) / size, np.ones(len(value)), joint, joints)
    scale = np.maximum(1.0, own / (1 + PROOF * MEDIAN_SCATTER / np.sqrt(np.maximum(count, 1))))
    limit = (level * scale)[joint] * size
    few = (count < FEWEST)[joint]
    used = few | (np.abs(value - center[joint]) <= limit)
    for _ in range(ROUNDS):
        total = np.bincount(joint, weight * used, joints)
        center = np.bincount(joint, weight * used * value, joints) / total
        again = few | (np.abs(value - center[joint]) <= limit)
        again |= (np.bincount(joint, again, joints) < 1)[joint]
        if (again == used).all():
            break
        used = again
    return used, limit


def _weighted_medians(values: Floats, weight: Floats, joint: Numbers, joints: int) -> Floats:
    """Weighted median of each joint; 0 for a joint without values."""
    result = np.zeros(joints)
    order = np.lexsort((values, joint))
    total = np.cumsum(weight[order])
    ends = np.searchsorted(joint[order], np.arange(joints), side="right")
    starts = np.searchsorted(joint[order], np.arange(joints), side="left")
    before = np.concatenate([[0.0], total])
    for number in np.flatnonzero(ends > starts).tolist():
        half = (before[starts[number]] + before[ends[number]]) / 2
        place = starts[number] + int(np.searchsorted(total[starts[number] : ends[number]], half))
        result[number] = values[order[min(place, ends[number] - 1)]]
    return result
