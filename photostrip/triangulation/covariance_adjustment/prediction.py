"""Points, photos and tests read from the solved system by least-squares prediction.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from photostrip.distributions import gamma_cdf
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS, similarity_derivatives
from photostrip.statistics import normal_quantile
from photostrip.triangulation.covariance_adjustment import system
from photostrip.triangulation.covariance_adjustment.block_tridiagonal import InverseRow
from photostrip.triangulation.covariance_adjustment.conditions import CONTROL, DISTANCE, centers_of
from photostrip.triangulation.error_propagation import joint_covariances
from photostrip.triangulation.error_propagation.covariances import (
    along_strip,
    images_with_components,
    local_covariances,
)
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, ELEMENTS, ErrorRows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Floats, Numbers
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors

CHECKED = 1e-6  # part of a control coordinate's variance that the others must check


@dataclass(frozen=True, eq=False)
class Predicted:
    """Errors of points or photos, as the adjustment finds them."""

    error: Floats  # (n, d): to be subtracted
    covariance: Floats  # (n, d, d): of what is left, for a variance factor of 1

    @classmethod
    def empty(cls, rows: ErrorRows) -> Self:
        """Room for the errors of rows."""
        n, size = rows.by_similarity.shape[:2]
        return cls(np.zeros((n, size)), np.zeros((n, size, size)))


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


def predict(found: system.System, tables: Sequence[ErrorRows]) -> tuple[list[Predicted], Floats]:
    """Predict the errors of points and photos, and say how well they are known.

    With b the column of a row: its covariances with the conditions and its coefficients of the unknowns, e = b^T
    [lambda; y] and Cov = C - b^T K^-1 b. A row has to do with its own block and the two beside it, so that only the
    inverse near the diagonal is needed.

    Returns cofactors: (n,), of the correlates of the conditions.
    """
    orders = [np.argsort(rows.first, kind="stable") for rows in tables]
    columns = [_Columns.of(found, rows.take(order)) for rows, order in zip(tables, orders, strict=True)]
    predicted = [Predicted.empty(rows) for rows in tables]
    layout = found.layout
    cofactors = np.zeros(len(layout.block))
    ends = np.searchsorted(layout.block, np.arange(layout.blocks + 1))
    zero = np.zeros((layout.height, layout.height))
    none = InverseRow(zero, zero, zero)

    def visit(number: int, before: InverseRow, middle: InverseRow, after: InverseRow) -> None:
        around = np.block(
            [
                [before.diagonal, before.following, before.after],
                [before.following.T, middle.diagonal, middle.following],
                [before.after.T, middle.following.T, after.diagonal],
            ]
        )
        for each, result in zip(columns, predicted, strict=True):
            each.predict(number, around, result)

    middle = after = none
    for number, before in found.factors.inverse():
        position = layout.position[ends[number] : ends[number + 1]]
        cofactors[ends[number] : ends[number + 1]] = before.diagonal[position, position]
        if number + 1 < layout.blocks:
            visit(number + 1, before, middle, after)
        middle, after = before, middle
    visit(0, none, middle, after)
    for each, result, order in zip(columns, predicted, orders, strict=True):
        formed = local_covariances(found.errors, each.rows, images_with_components(found.errors, each.rows))
        back = np.argsort(order, kind="stable")
        result.covariance[:] = (formed - result.covariance)[back]
        result.error[:] = result.error[back]
    return predicted, cofactors


def photo_rows(errors: StripErrors) -> ErrorRows:
    """Rows of the photos of a strip: centre and small rotation, d = 6.

    Each photo moves with the model on its right, the last with its own.
    """
    models = errors.models
    by_similarity = np.zeros((models + 1, 6, SIMILARITY_PARAMETERS))
    by_similarity[:, :3] = similarity_derivatives(centers_of(errors), np.zeros(3))
    by_similarity[:, 3:, 3:6] = np.eye(3)
    by_component = np.zeros((models + 1, 1, 6, COMPONENTS))
    by_component[-1, 0, :3, ELEMENTS] = errors.pairs.base_by_elements[-1]
    by_component[-1, 0, 3:, ELEMENTS] = errors.pairs.rotation_by_elements[-1]
    return ErrorRows.without_images(np.append(np.arange(models), models - 1), by_similarity, by_component)


@dataclass(frozen=True, eq=False)
class _Columns:
    """Columns b of rows that are ordered by their first models, block by block."""

    found: system.System
    rows: ErrorRows
    padded: system.PaddedRows
    by_unknowns: Floats  # (n, d, 7): by the unknowns of the first model
    shared: system.SameImages  # image points in common with conditions, ordered by rows

    @classmethod
    def of(cls, found: system.System, rows: ErrorRows) -> Self:
        rank = system.rank_in_model(rows.first, found.errors.models)
        shared = system.same_images(rows, found.conditions.rows)
        order = np.argsort(shared.first, kind="stable")
        return cls(
            found=found,
            rows=rows,
            padded=system.PaddedRows.of(found.errors, rows, rank, found.padded.by_component.shape[2]),
            by_unknowns=rows.by_similarity @ found.conditions.local.to_common[rows.first],
            shared=system.SameImages(shared.first[order], shared.second[order], shared.value[order, :, 0]),
        )

    def of_block(self, number: int) -> tuple[slice, Floats]:
        """Rows whose first model lies in a block, and their columns (3, b, k) in the blocks before, own and after."""
        layout, size = self.found.layout, self.rows.by_similarity.shape[1]
        low, high = np.searchsorted(self.rows.first, [number * layout.width, (number + 1) * layout.width]).tolist()
        columns = np.zeros((3, layout.height, (high - low) * size))
        if low < high:
            self._fill(columns, number, low)
            begin, end = np.searchsorted(self.shared.first, [low, high])
            row, condition, value = (column[begin:end] for column in self.shared)
            block, position = layout.block[condition] - number + 1, layout.position[condition]
            place = (row - low)[:, None] * size + np.arange(size)
            np.add.at(columns, (block[:, None], position[:, None], place), value)
        return slice(low, high), columns

    def predict(self, number: int, around: Floats, result: Predicted) -> None:
        """Fill in error b^T [lambda; y] and b^T K^-1 b of one block, given the inverse of it and its neighbours."""
        layout, size = self.found.layout, self.rows.by_similarity.shape[1]
        rows, columns = self.of_block(number)
        count = rows.stop - rows.start
        if not count:
            return
        solution = np.zeros((3, layout.height))
        inside = slice(max(number - 1, 0), number + 2)
        solution[inside.start - number + 1 :][: len(self.found.solution[inside])] = self.found.solution[inside]
        flat = columns.reshape(3 * layout.height, -1)
        result.error[rows] = (solution.ravel() @ flat).reshape(-1, size)
        split = flat.reshape(len(flat), count, size).transpose(1, 2, 0)
        result.covariance[rows] = split @ (around @ flat).reshape(len(flat), count, size).transpose(1, 0, 2)

    def _fill(self, columns: Floats, number: int, low: int) -> None:
        """Fill in the covariances with conditions around, and the coefficients of the unknowns."""
        layout, size = self.found.layout, self.rows.by_similarity.shape[1]
        models = len(layout.start)
        model = np.arange(number * layout.width, min((number + 1) * layout.width, models))
        ends = np.searchsorted(self.rows.first, [*model, model[-1] + 1])
        for apart in range(-layout.width, layout.width + 1):
            inside = (model + apart >= 0) & (model + apart < models)
            if not inside.any():
                continue
            values = system.products(self.padded, self.found.padded, model[inside], apart)
            for place, value in zip(np.flatnonzero(inside).tolist(), values, strict=True):
                other, count = model[place] + apart, (ends[place + 1] - ends[place]) * size
                block, top, height = other // layout.width - number + 1, layout.start[other], layout.unknown[other]
                left = (ends[place] - low) * size
                columns[block, top:height, left : left + count] = value[:count, : height - top].T
        for place, unknown in enumerate(layout.unknown[model].tolist()):
            left, right = (ends[place] - low) * size, (ends[place + 1] - low) * size
            by_unknowns = self.by_unknowns[ends[place] : ends[place + 1]].reshape(-1, SIMILARITY_PARAMETERS)
            columns[1, unknown : unknown + SIMILARITY_PARAMETERS, left:right] = by_unknowns.T


def influence(found: system.System, rows: ErrorRows, chosen: Numbers) -> Floats:
    """Differentiate predicted errors by the misclosures of conditions: b^T K^-1 e, shape (n, d, c).

    The system is solved for the columns of the n rows or for the unit vectors of the c conditions, whichever are fewer.
    """
    layout, size = found.layout, rows.by_similarity.shape[1]
    order = np.argsort(rows.first, kind="stable")
    columns = _Columns.of(found, rows.take(order))
    block, position = layout.block[chosen], layout.position[chosen]
    result = np.zeros((len(order), size, len(chosen)))
    if len(order) * size < len(chosen):
        right = np.zeros((layout.blocks + 2, layout.height, len(order), size))
        for number in range(layout.blocks):
            at, values = columns.of_block(number)
            right[number : number + 3, :, order[at]] = values.reshape(*values.shape[:2], -1, size)
        solved = found.factors.solve(right[1:-1].reshape(layout.blocks, layout.height, -1))
        result[:] = solved[block, position].T.reshape(result.shape)
        return result
    right = np.zeros((layout.blocks, layout.height, len(chosen)))
    right[block, position, np.arange(len(chosen))] = 1.0
    solved = np.zeros((layout.blocks + 2, layout.height, len(chosen)))
    solved[1:-1] = found.factors.solve(right)
    for number in range(layout.blocks):
        at, values = columns.of_block(number)
        near = solved[number : number + 3].reshape(3 * layout.height, -1)
        result[order[at]] = (values.reshape(len(near), -1).T @ near).reshape(-1, size, len(chosen))
    return result


def joint_covariance(found: system.System, rows: ErrorRows) -> Floats:
    """Covariances (n, n) of what is left of the errors of rows with d = 1: C - b^T K^-1 b, as ``predict`` has them.

    With K eliminated from the first block on, b^T K^-1 b = sum r^T P^-1 r with the reduced columns r of each block.
    """
    order = np.argsort(rows.first, kind="stable")
    rows = rows.take(order)
    columns, layout, factors = _Columns.of(found, rows), found.layout, found.factors
    own = rows.without_similarity()  # the similarities of the models are unknowns, not errors
    covariance = joint_covariances.joint_covariance(found.errors, own, along_strip(found.errors))
    blocks = [columns.of_block(number) for number in range(layout.blocks)]
    reduced = np.zeros((layout.height, 0))
    for number in range(layout.blocks):
        near = blocks[max(number - 1, 0) : number + 2]
        reached, shift = near[-1][0].stop, min(number, 1)  # later columns begin in later blocks
        right = np.zeros((layout.height, reached))
        for place, (at, values) in enumerate(near):
            right[:, at] = values[1 + shift - place]
        if number:
            right[:, : reduced.shape[1]] -= factors.shares[number - 1].T @ reduced
        reduced = right
        covariance[:reached, :reached] -= reduced.T @ (factors.inverses[number] @ reduced)
    result = np.empty_like(covariance)
    result[np.ix_(order, order)] = covariance
    return result


def tested(found: system.System, cofactors: Floats, count: int, level: float) -> AdjustmentTest:
    """Test the adjustment as a whole, w^T lambda, and each control coordinate, lambda / sqrt(q).

    cofactors: (n,), of the correlates.
    count: number of control coordinates.
    level: probability of calling any of them doubtful in a sound strip.
    """
    wanted, correlates = found.conditions, found.correlates
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
