"""Points, photos and tests read from the solved system by least-squares prediction.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import dataclass
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.statistics import gamma_cdf, normal_quantile
from photostrip.triangulation.covariance_adjustment import dense_models, relinearisation, system
from photostrip.triangulation.covariance_adjustment.columns import AT_A_TIME, Columns
from photostrip.triangulation.covariance_adjustment.conditions import CONTROL, DISTANCE
from photostrip.triangulation.error_propagation import joint_covariances
from photostrip.triangulation.error_propagation.covariances import along_strip, local_covariances
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, ErrorRows, PointRows

CHECKED = 1e-6  # part of a control coordinate's variance that the others must check


@dataclass(frozen=True, eq=False)
class AdjustmentTest:
    """What the adjustment says about itself, in the order of the control coordinates."""

    squares: float  # weighted sum of squares of all misclosures
    redundancy: int
    # (w,): test value of each control coordinate, standard normal when it is right; NaN where nothing checks it
    normalised: Floats
    size: Floats  # (w,): error of the given coordinate, given minus true, that would explain it, metres
    distances: int  # distances of pass points that took part
    level: float  # probability that any control coordinate of a sound strip is called doubtful

    @property
    def probability(self) -> float:
        """Probability of a larger sum of squares by chance; NaN without redundancy."""
        return 1 - gamma_cdf(self.squares / 2, self.redundancy / 2) if self.redundancy > 0 else float("nan")

    @property
    def limit(self) -> float:
        """Test value that the largest of all control coordinates exceeds by chance with that probability."""
        return normal_quantile(1 - self.level / (2 * max(len(self.normalised), 1)))

    @property
    def doubtful(self) -> Numbers:
        """Control coordinates beyond the limit, the worst first."""
        beyond = np.flatnonzero(np.abs(np.nan_to_num(self.normalised)) > self.limit)
        return beyond[np.argsort(-np.abs(self.normalised[beyond]), kind="stable")]


def errors(found: system.System, rows: ErrorRows, images: Floats) -> Floats:
    """Predict the errors (n, d) of points and photos, to be subtracted.

    e = b^T [lambda; y], with b as in ``covariances``: what the errors of the image coordinates displace, and the
    similarity of the first model.

    images: (k, 2), errors of the image coordinates of which the rows are not free yet, in their standard deviations.
    """
    by_images = relinearisation.displacements(found.errors, rows, images)
    by_unknowns = rows.by_similarity @ found.conditions.local.to_common[rows.first]
    return np.asarray(by_images + (by_unknowns @ found.unknowns[rows.first, :, None])[:, :, 0], float)


def covariances(found: system.System, rows: ErrorRows | PointRows) -> Floats:
    """Covariances (n, d, d) of what is left of the errors of points and photos, for a variance factor of 1.

    With b the column of a row: its covariances with the conditions and its coefficients of the unknowns,
    Cov = C - b^T K^-1 b. A row has to do with its own block and the two beside it. With K eliminated from the first
    block on, b becomes r in these, and b^T K^-1 b = r1^T P1^-1 r1 + r2^T P2^-1 r2 + r3^T Z3 r3: the block of the
    inverse on the diagonal says what all later ones add.
    """
    order = np.argsort(rows.first, kind="stable")
    section = rows.first[order] // (found.layout.width * AT_A_TIME)
    size = rows.by_component.shape[2]
    result = np.empty((len(order), size, size))
    for some in np.split(order, np.flatnonzero(np.diff(section)) + 1):
        columns = Columns.of(found, rows.take(some))
        explained = dense_models.explained if dense_models.are_dense(columns) else _explained
        result[some] = local_covariances(found.errors, columns.rows, columns.near) - explained(columns)
    return result


def photo_covariances(found: system.System) -> Floats:
    """Covariances (m, 6, 6) of photos, as ``covariances`` gives them: all but the last move with their model alone.

    Their columns lie in their own block: the block of the inverse on the diagonal says all.
    """
    rows, layout, models = photo_rows(found), found.layout, np.arange(found.errors.models)
    by_unknowns = rows.by_similarity[:-1] @ found.conditions.local.to_common
    inverse, count = found.factors.diagonal_of_inverse, SIMILARITY_PARAMETERS
    places = zip((models // layout.width).tolist(), layout.unknown.tolist(), strict=True)
    cofactors = np.stack([inverse[block][first : first + count, first : first + count] for block, first in places])
    of_models = -by_unknowns @ cofactors @ by_unknowns.transpose(0, 2, 1)
    return np.concatenate([of_models, covariances(found, rows.take(models[-1:] + 1))])


def _explained(of_rows: Columns) -> Floats:
    """Give what the conditions explain of the covariances of rows (n, d, d), b^T K^-1 b."""
    factors, (n, size) = of_rows.found.factors, of_rows.rows.by_similarity.shape[:2]
    known = np.zeros((n, size, size))
    for number, rows, columns in of_rows.blocks(of_rows.held):
        reduced, last = factors.reduced_near(number, columns), number + 1
        weighted = [
            (factors.diagonal_of_inverse[each] if each == last else factors.inverse(each)) @ own
            for each, own in zip(factors.near(number), reduced, strict=True)
        ]
        left, right = (np.concatenate(each) for each in (reduced, weighted))
        left, right = (each.reshape(len(left), -1, size) for each in (left, right))
        known[rows] = left.transpose(1, 2, 0) @ right.transpose(1, 0, 2)
    return known


def photo_rows(found: system.System) -> ErrorRows:
    """Rows of the photos of a strip: centre and small rotation, d = 6.

    Each photo moves with the model on its right, the last with its own and the step behind it.
    """
    models = found.errors.models
    by_similarity = np.zeros((models + 1, 6, SIMILARITY_PARAMETERS))
    by_similarity[:, :3] = similarity_derivatives(found.conditions.local.centers, np.zeros(3))
    by_similarity[:, 3:, 3:6] = np.eye(3)
    by_component = np.zeros((models + 1, 1, 6, COMPONENTS))
    by_component[-1, 0] = by_similarity[-1] @ found.errors.steps[-1]
    return ErrorRows.without_images(np.append(np.arange(models), models - 1), by_similarity, by_component)


def influence(found: system.System, rows: ErrorRows, chosen: Numbers) -> Floats:
    """Differentiate predicted errors by the misclosures of conditions: b^T K^-1 e, shape (n, d, c).

    The system is solved for the columns of the n rows or for the unit vectors of the c conditions, whichever are fewer.
    """
    layout, size = found.layout, rows.by_similarity.shape[1]
    if len(rows.first) * size >= len(chosen):
        return with_columns(found, rows, found.columns_of_inverse(chosen))
    order = np.argsort(rows.first, kind="stable")
    right = np.zeros((layout.blocks + 2, layout.height, len(order), size))
    for number, at, values in Columns.of(found, rows.take(order)).blocks(range(layout.blocks)):
        right[number : number + 3, :, order[at]] = values.reshape(*values.shape[:2], -1, size)
    solved = found.factors.solve(right[1:-1].reshape(layout.blocks, layout.height, -1))
    return np.asarray(solved[layout.block[chosen], layout.position[chosen]].T.reshape(len(order), size, -1), float)


def with_columns(found: system.System, rows: ErrorRows, columns: Floats) -> Floats:
    """Multiply columns of rows with others by blocks (g, b, c): b^T times those, shape (n, d, c)."""
    order, (blocks, height, count) = np.argsort(rows.first, kind="stable"), columns.shape
    around = np.zeros((blocks + 2, height, count))
    around[1:-1] = columns
    result = np.zeros((len(order), rows.by_similarity.shape[1], count))
    for number, at, values in Columns.of(found, rows.take(order)).blocks(range(blocks)):
        near = around[number : number + 3].reshape(-1, count)
        result[order[at]] = (values.reshape(len(near), -1).T @ near).reshape(-1, *result.shape[1:])
    return result


def joint_covariance(found: system.System, rows: ErrorRows) -> Floats:
    """Covariances (n, n) of what is left of the errors of rows with d = 1: C - b^T K^-1 b, as ``covariances`` has them.

    With K eliminated as in ``covariances``: what later blocks add to two rows is said by the inverse on the diagonal
    where both have all of their columns behind them.
    """
    order = np.argsort(rows.first, kind="stable")
    rows = rows.take(order)
    columns, layout, factors = Columns.of(found, rows), found.layout, found.factors
    own = rows.without_similarity()  # the similarities of the models are unknowns, not errors
    covariance = joint_covariances.joint_covariance(found.errors, own, along_strip(found.errors))
    blocks = list(columns.blocks(range(layout.blocks)))
    reduced = np.zeros((0, 0))
    for number, height in enumerate(factors.heights):
        around = [blocks[each] for each in factors.near(number)]
        near = [each for each in around if each.rows.start < each.rows.stop]
        right = np.zeros((height, around[-1].rows.stop))  # later columns begin in later blocks
        for block, at, values in near:
            right[:, at] = values[1 + number - block, :height]
        if number:
            right[:, : reduced.shape[1]] -= factors.share(number - 1).T @ reduced
        reduced = right
        for block, at, _ in near:
            weight = factors.diagonal_of_inverse[number] if block < number else factors.inverse(number)
            covariance[: at.stop, at] -= reduced[:, : at.stop].T @ (weight @ reduced[:, at])
    upper = np.triu(covariance)
    result = np.empty_like(covariance)
    result[np.ix_(order, order)] = upper + np.triu(upper, 1).T
    return result


def tested(found: system.System, count: int, level: float) -> AdjustmentTest:
    """Test the adjustment as a whole, w^T lambda, and each control coordinate, lambda / sqrt(q).

    count: number of control coordinates.
    level: probability of calling any of them doubtful in a sound strip.
    """
    wanted, correlates, cofactors = found.conditions, found.correlates, found.cofactors
    rows = np.flatnonzero(wanted.kind == CONTROL)
    normalised, size = np.full(count, np.nan), np.full(count, np.nan)
    checked = rows[cofactors[rows] * (wanted.noise[rows] + 1e-12) > CHECKED]
    normalised[wanted.source[checked]] = correlates[checked] / np.sqrt(cofactors[checked])
    size[wanted.source[checked]] = -correlates[checked] / cofactors[checked]  # given minus true
    distances = int((wanted.kind == DISTANCE).sum())
    return AdjustmentTest(
        squares=float(wanted.value @ correlates),
        redundancy=count - SIMILARITY_PARAMETERS + distances,
        normalised=normalised,
        size=size,
        distances=distances,
        level=level,
    )
