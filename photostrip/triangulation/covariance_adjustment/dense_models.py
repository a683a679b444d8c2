"""Covariances of many points of few models: what they share is taken through the inverse once for each model.

The column of a row is b = B a + c. B belongs to its model: covariances of the conditions with the error components of
the models around, coefficients of the conditions by these components, and the unknowns of the model. a are the row's
own coefficients of these; c has only the conditions that share image points with the row. So no row needs a product of
its own with the inverse: b^T K^-1 b = a^T (B^T K^-1 B) a + 2 c^T (K^-1 B) a + c^T K^-1 c.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import NamedTuple
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.covariance_adjustment.columns import Columns
from photostrip.triangulation.covariance_adjustment.system import SameImages
from photostrip.triangulation.error_propagation.covariances import NearImages
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, ErrorRows


def are_dense(columns: Columns) -> bool:
    """Whether this takes fewer multiplications than five products with blocks of the inverse for each row.

    Here it is seven for each of the shared columns.
    """
    layout, size = columns.found.layout, columns.rows.by_similarity.shape[1]
    in_block = size * np.bincount(columns.rows.first // layout.width).max(initial=0)
    return bool(5 * in_block > 7 * layout.width * _coefficients(columns, slice(0, 1)).shape[2])


def explained(columns: Columns) -> Floats:
    """Give what the conditions explain of the covariances of rows, b^T K^-1 b, shape (n, d, d)."""
    found, rows, sparse = columns.found, columns.rows, _Sparse.of(columns)
    ends = [*np.searchsorted(rows.first, columns.models).tolist(), len(rows.first)]
    result = np.empty((*rows.by_similarity.shape[:2], rows.by_similarity.shape[1]))
    for number, some, values in _shared_columns(columns).blocks(columns.held):
        through = found.factors.solve_near(number, values)
        by_model = (np.split(each, some.stop - some.start, axis=2) for each in (values, through))
        for model, (shared, solved) in enumerate(zip(*by_model, strict=True), some.start):
            part = slice(ends[model], ends[model + 1])
            if part.start == part.stop:
                continue
            a, c = _coefficients(columns, part), sparse.value[part]
            block, position = sparse.block[part], sparse.position[part]
            of_a = np.tensordot(a, np.tensordot(shared, solved, ((0, 1), (0, 1))), 1)
            mixed = c.transpose(0, 2, 1) @ solved[block - number + 1, position] @ a.transpose(0, 2, 1)
            alone = c.transpose(0, 2, 1) @ found.factors.entries_of_inverse(block, position) @ c
            result[part] = of_a @ a.transpose(0, 2, 1) + mixed + mixed.transpose(0, 2, 1) + alone
    return result


def _coefficients(columns: Columns, part: slice) -> Floats:
    """Coefficients a of some rows, (n, d, r)."""
    by_component, with_components = columns.rows.by_component[part], columns.near.with_components[part]
    n, _, size, _ = by_component.shape
    parts = (
        by_component.transpose(0, 2, 1, 3).reshape(n, size, -1),
        with_components.reshape(n, size, -1),
        columns.by_unknowns[part],
    )
    return np.concatenate(parts, axis=2)


def _shared_columns(columns: Columns) -> Columns:
    """Make the columns B of models of blocks with rows: one row of r coordinates, in the order of ``_coefficients``."""
    models, slots = len(columns.models), columns.rows.by_component.shape[1]
    ends = np.cumsum([slots * COMPONENTS, np.prod(columns.near.with_components.shape[2:]), SIMILARITY_PARAMETERS])
    count = int(ends[-1])
    first, second, third = np.split(np.broadcast_to(np.eye(count), (models, count, count)), ends[:-1], axis=2)
    by_component = first.reshape(models, count, slots, COMPONENTS).transpose(0, 2, 1, 3)
    by_similarity, none = np.zeros((models, count, SIMILARITY_PARAMETERS)), np.zeros(0, np.intp)
    return Columns(
        found=columns.found,
        rows=ErrorRows.without_images(np.array(columns.models), by_similarity, by_component),
        near=NearImages(np.zeros((models, count, 0)), second.reshape(models, count, -1, COMPONENTS)),
        by_unknowns=third,
        shared=SameImages(none, none, np.zeros((0, count))),
    )


class _Sparse(NamedTuple):
    """Coefficients c of rows, side by side; rows with fewer than q of them have zeros."""

    block: Numbers  # (n, q): of the condition
    position: Numbers  # (n, q): there
    value: Floats  # (n, q, d)

    @classmethod
    def of(cls, columns: Columns) -> _Sparse:
        layout, shared = columns.found.layout, columns.shared
        n, size = columns.rows.by_similarity.shape[:2]
        counts = np.bincount(shared.first, minlength=n)
        place = np.arange(len(shared.first)) - np.repeat(np.cumsum(counts) - counts, counts)
        block = np.repeat(columns.rows.first[:, None] // layout.width, counts.max(initial=0), axis=1)
        position, value = np.zeros_like(block), np.zeros((*block.shape, size))
        block[shared.first, place] = layout.block[shared.second]
        position[shared.first, place] = layout.position[shared.second]
        value[shared.first, place] = shared.value
        return cls(block, position, value)
