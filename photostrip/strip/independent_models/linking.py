"""Links of neighbouring models: a similarity in space over their common points and their common perspective centre.

Every model has a system of its own. A link takes the coordinates of the second model into the system of the first. Both
were measured, so a difference has the variance of both; plan and height of a model have different ones, in the axes of
its own system. The estimate starts from the closed form, which needs no approximation whatever the rotation. All links
of a strip are solved together, in one batch.

Source: [001] eq. 145-149 for the similarity; weights and iteration derived, see docs/independent-models.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.geometry.rotation import from_vector
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives

LEAST_COMMON = 3
ITERATIONS, CONVERGED = 20, 1e-12
THIN = 1e-3  # second over first extent of common points below which they stand on one line
HELD = 1e-6  # redundancy of a direction below which nothing checks it
LARGEST_STEP = 2.0  # of an iteration, in rotation (radians) and logarithm of the scale


@dataclass(frozen=True, eq=False)
class StripModels:
    """Models of one strip, in flight order."""

    count: int
    points: int  # nodes below this number are points, the others perspective centres
    row: Numbers  # (n,): rows of the project's ``points.ModelPoints``
    # model, node: (n,): place of the model in the strip, and point or centre, of each row
    model: Numbers
    node: Numbers
    # xyz, sigma: (n, 3): model coordinates and their standard deviations, mm
    xyz: Floats
    sigma: Floats


@dataclass(frozen=True, eq=False)
class CommonPoints:
    """Points and centres that neighbouring models have in common; link i takes model i + 1 into model i."""

    link: Numbers  # (t,): link of each row, ascending
    # before, after: (t,): rows of ``StripModels`` in the model before and in the one after
    before: Numbers
    after: Numbers
    count: int

    def sums(self, values: Floats) -> Floats:
        """Add up values of rows, shape (t, ...), for each link."""
        total = np.zeros((self.count, *values.shape[1:]))
        np.add.at(total, self.link, values)
        return total


@dataclass(frozen=True, eq=False)
class Similarities:
    """One similarity ``target = scale rotation source + shift`` for each link."""

    scale: Floats  # (j,): scales
    rotation: Floats  # (j, 3, 3): rotations
    shift: Floats  # (j, 3): shifts

    def of(self, number: Numbers, xyz: Floats) -> Floats:
        """Transform points, each by the similarity of its number."""
        moved: Floats = (
            self.scale[number, None] * np.einsum("nij,nj->ni", self.rotation[number], xyz) + self.shift[number]
        )
        return moved


@dataclass(frozen=True, eq=False)
class SolvedLinks:
    """Links after least squares."""

    similarities: Similarities  # from the model after each link into the model before it
    # (t, 3): coordinates in the model before minus those taken over from the model after, mm, also of rows not used
    residual: Floats
    weight: Floats  # (t, 3, 3): inverse covariances of the residuals' observations, mm^-2
    # (t, 3, 7): derivatives of the point taken over by shift, rotation and logarithm of the scale about the link's
    # centroid
    design: Floats
    cofactors: Floats  # (j, 7, 7): of these parameters
    centroid: Floats  # (j, 3): centroids in the model before, mm
    squares: Floats  # (j,): weighted squares of the rows used
    redundancy: Numbers  # (j,): three for every row used, minus seven


def common(models: StripModels) -> CommonPoints:
    """Find what neighbouring models have in common; a point of models i and i + 2 alone links nothing."""
    order = np.lexsort((models.model, models.node))
    model, node = models.model[order], models.node[order]
    both = np.flatnonzero((node[1:] == node[:-1]) & (model[1:] == model[:-1] + 1))
    before, after = order[both], order[both + 1]
    link = models.model[before]
    by_link = np.argsort(link, kind="stable")
    return CommonPoints(
        link=link[by_link], before=before[by_link], after=after[by_link], count=max(models.count - 1, 0)
    )


def closed_form(shared: CommonPoints, models: StripModels, share: Floats) -> tuple[Similarities, Floats]:
    """Similarities by singular values, from the model after into the model before, with weights ``share`` of the rows.

    Also the sums of squares (j, 2) that the best similarity leaves, and the best one of the other hand, mm^2.
    Source: [001] eq. 145-149; the determinant factor keeps reflections out, its opposite asks for one.
    """
    a, b = models.xyz[shared.before], models.xyz[shared.after]
    total = np.maximum(shared.sums(share), 1e-300)[:, None]
    mean_a, mean_b = (shared.sums(share[:, None] * each) / total for each in (a, b))
    da, db = a - mean_a[shared.link], b - mean_b[shared.link]
    cross = shared.sums(share[:, None, None] * da[:, :, None] * db[:, None, :])
    u, values, vt = np.linalg.svd(cross)
    sign = np.ones((shared.count, 3))
    sign[:, 2] = np.sign(np.linalg.det(u @ vt))
    size_a, size_b = (shared.sums(share * (each**2).sum(axis=1)) for each in (da, db))
    rotation = (u * sign[:, None, :]) @ vt
    along = np.column_stack([(values * sign).sum(axis=1), (values * sign * [1, 1, -1]).sum(axis=1)])
    scale = along[:, 0] / np.maximum(size_b, 1e-300)
    shift = mean_a - scale[:, None] * np.einsum("jik,jk->ji", rotation, mean_b)
    squares = size_a[:, None] - along**2 / np.maximum(size_b, 1e-300)[:, None]
    return Similarities(scale, rotation, shift), np.maximum(squares, 0.0)


def either_hand(source: Floats, target: Floats) -> tuple[float, float]:
    """Find the sums of squares that the best similarity of two sets of points leaves, and the best reflected one."""
    a, b = target - target.mean(axis=0), source - source.mean(axis=0)
    u, values, vt = np.linalg.svd(a.T @ b)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    along = np.array([(values * sign).sum(), (values * sign * [1, 1, -1]).sum()])
    left = np.maximum((a**2).sum() - along**2 / (b**2).sum(), 0.0)
    return float(left[0]), float(left[1])


def extents(shared: CommonPoints, models: StripModels, used: Flags) -> Floats:
    """How far the common points of each link are from a line: second over first extent in the model before, (j,)."""
    a, share = models.xyz[shared.before], used.astype(float)
    mean = shared.sums(share[:, None] * a) / np.maximum(shared.sums(share), 1.0)[:, None]
    da = (a - mean[shared.link]) * share[:, None]
    values = np.linalg.svd(shared.sums(da[:, :, None] * da[:, None, :]), compute_uv=False)
    return np.asarray(np.sqrt(values[:, 1] / np.maximum(values[:, 0], 1e-300)), float)


def solve(shared: CommonPoints, models: StripModels, used: Flags) -> SolvedLinks:
    """Least squares of all links together; every link has at least three rows in use that are not on one line.

    Minimises v^T (C_a + s^2 R C_b R^T)^-1 v with v = a - (s R b + t): the coordinates of both models carry errors.
    """
    share = used.astype(float)
    found, _ = closed_form(shared, models, share)
    a, b = models.xyz[shared.before], models.xyz[shared.after]
    variance_a, variance_b = models.sigma[shared.before] ** 2, models.sigma[shared.after] ** 2
    count = np.maximum(shared.sums(share), 1.0)[:, None]
    centroid = shared.sums(share[:, None] * a) / count
    arm = a - centroid[shared.link]
    size = np.sqrt(np.maximum(shared.sums(share * (arm**2).sum(axis=1)) / count[:, 0], 1e-300))
    unit = np.ones((shared.count, SIMILARITY_PARAMETERS))
    unit[:, 3:] = 1 / size[:, None]  # rotation and scale move the points by as much as a shift
    for _ in range(ITERATIONS):
        turn = found.scale[shared.link, None, None] * found.rotation[shared.link]
        covariance = (turn * variance_b[:, None, :]) @ turn.transpose(0, 2, 1)
        covariance[:, range(3), range(3)] += variance_a
        weight = np.asarray(np.linalg.inv(covariance), float)
        moved = found.of(shared.link, b)
        residual, design = a - moved, similarity_derivatives(moved - centroid[shared.link], np.zeros(3))
        scaled = design * unit[shared.link][:, None, :]
        weighted = scaled.transpose(0, 2, 1) @ weight * share[:, None, None]
        normal, right = shared.sums(weighted @ scaled), shared.sums(np.einsum("tij,tj->ti", weighted, residual))
        inverse = np.linalg.inv(normal)
        step = np.einsum("jik,jk->ji", inverse, right) * unit
        found = _corrected(found, step, centroid)
        if np.abs(step / unit).max(initial=0.0) < CONVERGED * size.max(initial=1.0):
            break
    residual = a - found.of(shared.link, b)
    return SolvedLinks(
        similarities=found,
        residual=residual,
        weight=weight,
        design=design,
        cofactors=inverse * unit[:, :, None] * unit[:, None, :],
        centroid=centroid,
        squares=shared.sums(share * np.einsum("ti,tij,tj->t", residual, weight, residual)),
        redundancy=3 * shared.sums(share).astype(np.intp) - SIMILARITY_PARAMETERS,
    )


def _corrected(found: Similarities, step: Floats, centroid: Floats) -> Similarities:
    """Compose the similarities with small ones about the centroids."""
    turn = from_vector(np.clip(step[:, 3:6], -LARGEST_STEP, LARGEST_STEP))
    growth = np.exp(np.clip(step[:, 6], -LARGEST_STEP, LARGEST_STEP))
    arm = found.shift - centroid
    shift = centroid + step[:, :3] + growth[:, None] * np.einsum("jik,jk->ji", turn, arm)
    u, _, vt = np.linalg.svd(turn @ found.rotation)
    return Similarities(found.scale * growth, u @ vt, shift)


class PointTests(NamedTuple):
    """Tests of common points; P the weights, Q_v the cofactors of the residuals v."""

    value: Floats  # (t,): v^T P (P Q_v P)^-1 P v, chi-square with ``freedom`` degrees; NaN for rows not used
    # (t, 3): estimated gross error (P Q_v P)^-1 P v, mm in the model before; of rows not used their residual
    error: Floats
    freedom: Numbers  # (t,): directions in which the others check the point: 3, fewer where they hardly fix the link


def studentised(shared: CommonPoints, solved: SolvedLinks, used: Flags) -> PointTests:
    """Test every common point as a whole: how much of the squares goes when it is left out.

    Source: [Baarda 1968], the three coordinates of a point together.
    """
    values, axes = np.linalg.eigh(solved.weight)
    root = (axes * np.sqrt(values)[:, None, :]) @ axes.transpose(0, 2, 1)  # symmetric, root @ root = weight
    scaled = root @ solved.design
    reduced = np.eye(3) - scaled @ solved.cofactors[shared.link] @ scaled.transpose(0, 2, 1)
    left, directions = np.linalg.eigh(reduced)
    checked = left > HELD
    inverse = np.where(checked, 1 / np.where(checked, left, 1.0), 0.0)
    white = np.einsum("tij,tj->ti", root, solved.residual)
    parts = np.einsum("tji,tj->ti", directions, white) * inverse
    estimate = np.einsum("tij,tj->ti", directions, parts)
    value = (white * estimate).sum(axis=1)
    error = np.linalg.solve(root, estimate[:, :, None])[:, :, 0]
    return PointTests(
        value=np.where(used, value, np.nan),
        error=np.where(used[:, None], error, solved.residual),
        freedom=np.where(used, checked.sum(axis=1), 0).astype(np.intp),
    )
