"""Pass points that do not belong in a scale transfer, tested with the precision that their parallaxes give them.

The ratio of a point's distances from the common centre follows from its x parallaxes in the two models. An error of the
coordinate on the common photo changes both parallaxes, in opposite directions; errors of the two orientations
deform the models and change all ratios of a junction in a pattern. Both are propagated for each point.

Source: derived; see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.statistics import SIGMA_FROM_MEDIAN, normal_quantile
from photostrip.triangulation.relative_orientation.solution import (
    base_rays,
    linearised_parallaxes,
    normal_matrices,
)

if TYPE_CHECKING:
    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.triangulation.relative_orientation.orientation import Orientation


ALPHA = 0.001  # of rejecting a point of a junction without gross errors
FEWEST = 3  # with two ratios nobody can tell which is wrong
SMALLEST_SIGMA = 1e-3  # mm, of a y parallax, when the pairs' own residuals have to say it
MEDIAN_SCATTER = 1.17  # sd of a standard deviation from the median of n residuals, times sqrt(n)
PROOF = 3.0  # of those, by which ratios must scatter more than propagated
ROUNDS = 10


class PassPoints(NamedTuple):
    """Points that two neighbouring models have in common; junction i lies between models i and i+1, at photo i+1."""

    junction: Numbers  # (t,): junction of each row, ascending
    # before, after: (t,): rows of the point in the pairs' table, in the model before and after the junction
    before: Numbers
    after: Numbers


def spreads(
    orientation: Orientation, vectors: Floats, joined: PassPoints, sigma: Floats | None = None
) -> tuple[Floats, Floats]:
    """Propagate image coordinates and orientations into scale ratios.

    vectors: (m, 3), model points, base length 1.
    sigma: (p,), optional, standard deviation of a y parallax of weight one in each pair, mm.
    Returns single: (t,), relative standard deviation of each ratio by its own image coordinates.
    Returns model: (t,), the same by the deformation of the two models, against the mean of the junction.
    """
    junction, before, after = joined
    scatter = _scatter(orientation) if sigma is None else sigma
    base, _ = orientation.relative
    depth_before, depth_after = depths(vectors[before], base[junction]), depths(vectors[after], base[junction + 1])
    quality = np.minimum(orientation.pairs.weight[before], orientation.pairs.weight[after])
    # an image coordinate has half the variance of a parallax; that of the common photo acts on both distances
    coordinate = (scatter[junction] ** 2 + scatter[junction + 1] ** 2) / 4 / quality
    factor = (depth_before + depth_after) ** 2 + depth_before**2 + depth_after**2
    single = np.sqrt(coordinate * factor) / orientation.pairs.focal
    variance = np.zeros(len(junction))
    if len(junction):
        count = np.maximum(np.bincount(junction), 1)[:, None]
        weight = _turns(orientation)
        for side, (row, model) in enumerate(((after, junction + 1), (before, junction))):
            slope = _slopes(orientation, row, side)
            mean = np.column_stack([np.bincount(junction, each) for each in slope.T]) / count
            deviation = slope - mean[junction]
            spread = (deviation[:, None, :] @ weight[model])[:, 0]
            variance += (spread * deviation).sum(axis=1) * scatter[model] ** 2
    return single, np.sqrt(np.maximum(variance, 0.0))


def depths(vectors: Floats, base: Floats) -> Floats:
    """Distances of points from the base line, from vectors to them and unit vectors of the base (t, 3)."""
    (x, y, z), (u, v, w) = vectors.T, base.T
    return np.asarray(np.sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2), float)


def _scatter(orientation: Orientation) -> Floats:
    """Estimate the standard deviation of a y parallax from all pairs together."""
    known = orientation.sigma0[np.isfinite(orientation.sigma0)]
    value = np.sqrt(2.0) * float(np.median(known)) if len(known) else 0.0
    return np.full(orientation.pairs.size, max(value, SMALLEST_SIGMA))


def _turns(orientation: Orientation) -> Floats:
    """Cofactors of small turns of both photos about the axes of the base frame, shape (p, 6, 6).

    The angle alpha turns a photo about -Y, kappa about the third column of its rotation, omega about (cos alpha, 0,
    sin alpha).
    """
    al1, ka1, al2, om2, ka2 = orientation.elements.T
    axes = np.zeros((len(al1), 6, 5))
    axes[:, 1, 0] = axes[:, 4, 2] = -1.0
    axes[:, :3, 1] = from_alpha_omega_kappa(al1, 0.0, ka1)[:, :, 2]
    axes[:, 3, 3], axes[:, 5, 3] = np.cos(al2), np.sin(al2)
    axes[:, 3:, 4] = from_alpha_omega_kappa(al2, om2, ka2)[:, :, 2]
    return np.asarray(axes @ _cofactors(orientation) @ axes.transpose(0, 2, 1), float)


def _slopes(orientation: Orientation, rows: Numbers, side: int) -> Floats:
    """Differentiate the logarithm of the distance from the left (0) or right (1) centre by turns, shape (k, 6).

    With image coordinates x1, y1, x2, y2 turned into the base frame, the parallax p = x1 - x2 and y = (y1 + y2) / 2,
    the distances are sqrt(x1^2 + y^2 + f^2) / p and sqrt(x2^2 + y^2 + f^2) / p. A turn of a photo about X, Y, Z moves
    its x by xy/f, -f - x^2/f, -y and its y by f + y^2/f, -xy/f, x.
    """
    whole = orientation.pairs
    pairs = replace(whole, pair=whole.pair[rows], left=whole.left[rows], right=whole.right[rows])
    f = pairs.focal
    slope = np.empty((len(rows), 6))
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = [-f * ray[:2] / ray[2] for ray in base_rays(orientation.elements, pairs)]
        inverse, middle = 1 / (sides[0][0] - sides[1][0]), (sides[0][1] + sides[1][1]) / 2
        squares = 1 / (sides[side][0] ** 2 + middle**2 + f**2)
        by_y = middle * squares / 2
        for number, (x, y) in enumerate(sides):
            by_x = (inverse if number else -inverse) + (x * squares if number == side else 0.0)
            across = x * y / f
            slope[:, 3 * number] = by_x * across + by_y * (f + y**2 / f)
            slope[:, 3 * number + 1] = -by_x * (f + x**2 / f) - by_y * across
            slope[:, 3 * number + 2] = by_y * x - by_x * y
    return np.nan_to_num(slope, posinf=0.0, neginf=0.0)


def _cofactors(orientation: Orientation) -> Floats:
    """Cofactors of the elements; of degenerate pairs as far as the points determine them."""
    weak = np.flatnonzero(np.isnan(orientation.cofactors[:, 0, 0]))
    if not len(weak):
        return orientation.cofactors
    part = orientation.take(weak)
    _, jacobian = linearised_parallaxes(part.elements, part.pairs)
    cofactors = orientation.cofactors.copy()
    cofactors[weak] = np.linalg.pinv(normal_matrices(jacobian, part.pairs), hermitian=True)
    return cofactors


def screen(
    ratio: Floats, weight: Floats, spread: tuple[Floats, Floats], junction: Numbers, junctions: int
) -> tuple[Flags, Floats]:
    """Find the ratios that belong together, and the largest relative deviation of each that still belongs.

    spread: (t,), relative standard deviations as ``spreads`` gives them.
    junction: (t,), junction of each ratio, ascending.
    """
    size = np.hypot(*spread)
    count = np.bincount(junction, minlength=junctions)
    levels = [normal_quantile(1 - ALPHA / (2 * max(n, 1))) for n in range(int(count.max(initial=0)) + 1)]
    value = np.log(ratio)
    center = _weighted_medians(value, weight, junction, junctions)
    off = np.abs(value - center[junction]) / size
    scatter = SIGMA_FROM_MEDIAN * _weighted_medians(off, np.ones(len(value)), junction, junctions)
    scale = np.maximum(1.0, scatter / (1 + PROOF * MEDIAN_SCATTER / np.sqrt(np.maximum(count, 1))))
    limit = (np.array(levels)[count] * scale)[junction] * size
    few = (count < FEWEST)[junction]
    used = few | (np.abs(value - center[junction]) <= limit)
    for _ in range(ROUNDS):
        total = np.bincount(junction, weight * used, junctions)
        center = np.bincount(junction, weight * used * value, junctions) / total
        again = few | (np.abs(value - center[junction]) <= limit)
        again |= (np.bincount(junction, again, junctions) < 1)[junction]
        if (again == used).all():
            break
        used = again
    return used, limit


def _weighted_medians(values: Floats, weight: Floats, junction: Numbers, junctions: int) -> Floats:
    """Weighted median of each junction; 0 for a junction without values."""
    if not len(values):
        return np.zeros(junctions)
    count = np.bincount(junction, minlength=junctions)
    place = np.arange(len(values)) - (np.cumsum(count) - count)[junction]
    table, weights = np.full((2, junctions, int(count.max())), np.inf)
    table[junction, place], weights[junction, place] = values, weight
    order = np.argsort(table, axis=1)
    total = np.cumsum(np.take_along_axis(np.where(np.isfinite(table), weights, 0.0), order, axis=1), axis=1)
    middle = (total < total[:, -1:] / 2).sum(axis=1, keepdims=True)
    found = np.take_along_axis(np.take_along_axis(table, order, axis=1), middle, axis=1)[:, 0]
    return np.where(count > 0, found, 0.0)
