"""The same as ``band`` where the band would be too wide: a sparse factor, and the inverse at pairs of photos.

Rings and stars of strips have no order in which they are a narrow band. SuperLU finds an order with little fill
of its own. The inverse is found column by column, some hundred at a time, and only the blocks of pairs of photos that
share points are kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.triangulation.bundle.observations.collinearity import PHOTO

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

TOGETHER = 64  # photos whose columns of the inverse are found at a time


class Sparse:
    """A symmetric positive definite matrix of blocks, and its factor.

    ``blocks`` (b, 6, 6) are those of the pairs of photos ``rows`` >= ``columns``, sorted by row, then column.
    """

    def __init__(self, photos: int, rows: Numbers, columns: Numbers, blocks: Floats) -> None:
        self.photos, self.size = photos, PHOTO * photos
        self.rows, self.columns, self.stored = rows, columns, blocks
        self.factored: SuperLU | None = None

    def factor(self) -> bool:
        """Factor the matrix; False when it is not positive definite."""
        from scipy.sparse import coo_array
        from scipy.sparse.linalg import splu

        element = np.arange(PHOTO)
        row = np.broadcast_to((PHOTO * self.rows)[:, None, None] + element[:, None], self.stored.shape)
        column = np.broadcast_to((PHOTO * self.columns)[:, None, None] + element, self.stored.shape)
        below = self.rows != self.columns
        place = (
            np.concatenate([row.ravel(), column[below].ravel()]),
            np.concatenate([column.ravel(), row[below].ravel()]),
        )
        values = np.concatenate([self.stored.ravel(), self.stored[below].ravel()])
        matrix = coo_array((values, place), shape=(self.size, self.size)).tocsc()
        try:
            self.factored = splu(
                matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
            )
        except RuntimeError:  # exactly singular
            return False
        return bool((self.factored.U.diagonal() > 0.0).all())

    def solve(self, right: Floats) -> Floats:
        """Solve for columns (size, c) with the factor."""
        if self.factored is None:
            raise ValueError("not factored")
        return np.asarray(self.factored.solve(np.ascontiguousarray(right, float)))

    def inverse(self) -> Sparse:
        """Return the elements of the inverse at the pairs."""
        found = np.empty_like(self.stored)
        order = np.argsort(self.columns, kind="stable")
        edges = np.searchsorted(self.columns[order], np.arange(0, self.photos + TOGETHER, TOGETHER))
        for chunk, first in enumerate(range(0, self.photos, TOGETHER)):
            count = min(TOGETHER, self.photos - first)
            unit = np.zeros((self.size, PHOTO * count))
            unit[PHOTO * first : PHOTO * (first + count)] = np.eye(PHOTO * count)
            solved = self.solve(unit).reshape(self.photos, PHOTO, count, PHOTO)
            pairs = order[edges[chunk] : edges[chunk + 1]]
            found[pairs] = solved[self.rows[pairs], :, self.columns[pairs] - first]
        return Sparse(self.photos, self.rows, self.columns, found)

    def _pair(self, row: Numbers, column: Numbers) -> tuple[Numbers, Flags]:
        """Return the number of the pair of photos, and whether there is one."""
        keys = self.rows * self.photos + self.columns
        wanted = np.maximum(row, column) * self.photos + np.minimum(row, column)
        pair = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return pair, keys[pair] == wanted

    def holds(self, row: Numbers, column: Numbers) -> Flags:
        """Whether the blocks of pairs of photos are stored."""
        return self._pair(row, column)[1]

    def blocks(self, row: Numbers, column: Numbers) -> Floats:
        """Give stored blocks, shape (..., 6, 6)."""
        found = self.stored[self._pair(row, column)[0]]
        return np.where((row < column)[..., None, None], found.swapaxes(-1, -2), found)
