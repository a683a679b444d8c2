"""Cholesky factor of normal equations in a band, solutions with it, and the elements of the inverse within the band.

The band is stored as scipy wants it: column by column, the diagonal first. Element (i, j) of the matrix then stands at
place ``i + j * width`` of the flat array (width: elements below the diagonal), so that any block within the band can be
looked at as a plain matrix without copying; what such a view shows beyond the band is another column's.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import as_strided
from scipy.linalg import cho_solve_banded, cholesky_banded, solve_triangular

from photostrip.arrays import Flags, Floats, Numbers

COLUMNS_AT_A_TIME = 48  # columns of the inverse that are found at a time


class Band:
    """A symmetric positive definite matrix with ``width`` elements below the diagonal, and its Cholesky factor.

    ``block`` rows and columns belong to each photo or model.
    """

    def __init__(self, size: int, width: int, block: int) -> None:
        self.block = block
        self.size, self.width = size, min(width, size - 1)
        # The last few rows of views reach beyond the end.
        self.flat = np.zeros((size + self.width + COLUMNS_AT_A_TIME) * (self.width + 1))

    @property
    def columns(self) -> Floats:
        """The storage as LAPACK sees it, shape (width + 1, size), by columns."""
        return self.flat[: self.size * (self.width + 1)].reshape(self.size, self.width + 1).T

    def place(self, row: Numbers, column: Numbers) -> Numbers:
        """Places of elements (row >= column) in the flat storage."""
        return row + column * self.width

    def holds(self, row: Numbers, column: Numbers) -> Flags:
        """Whether the blocks of pairs of photos lie within the band."""
        return np.asarray(np.abs(row - column) <= self.width // self.block)

    def blocks(self, row: Numbers, column: Numbers) -> Floats:
        """Give blocks within the band, shape (..., u, u)."""
        table, middle = self._table, self.width // self.block
        return table.reshape(-1, self.block, self.block)[row * table.shape[1] + column - row + middle]

    @cached_property
    def _table(self) -> Floats:
        """All blocks, of both halves: in row i those of photo i with the photos from i - w to i + w."""
        u = self.block
        photos, width, stride = self.size // u, self.width // u, self.flat.itemsize
        strides = (u * (1 + self.width) * stride, u * stride, stride, self.width * stride)
        lower = as_strided(self.flat, (photos, width + 1, u, u), strides)  # by column, from the diagonal down
        table = np.empty((photos, 2 * width + 1, u, u))
        table[:, width] = np.tril(lower[:, 0]) + np.tril(lower[:, 0], -1).swapaxes(1, 2)
        for lag in range(1, width + 1):
            table[lag:, width - lag] = lower[:-lag, lag]
            table[:-lag, width + lag] = lower[:-lag, lag].swapaxes(1, 2)
        return table

    def look(self, row: int, column: int, rows: int, columns: int) -> Floats:
        """Look at a block; only what lies in the band's lower half belongs to the matrix."""
        stride = self.flat.itemsize
        return as_strided(self.flat[row + column * self.width :], (rows, columns), (stride, stride * self.width))

    def factor(self) -> bool:
        """Replace the matrix by its factor; False when it is not positive definite."""
        try:
            self.columns[...] = cholesky_banded(self.columns, overwrite_ab=True, lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            return False
        return True

    def solve(self, right: Floats) -> Floats:
        """Solve for columns (size, c) with the factor."""
        return np.asarray(cho_solve_banded((self.columns, True), right, check_finite=False))

    def inverse(self) -> Band:
        """Find the elements of the inverse within the band, lower half; what stands outside the band is not defined.

        With columns i and the rows J below them, and L the factor: Z_Ji = -Z_JJ L_Ji L_ii^-1 and
        Z_ii = (L_ii L_ii')^-1 - (L_Ji L_ii^-1)' Z_Ji, from the last columns to the first. Source: [Takahashi 1973].
        """
        inverse = Band(self.size, self.width, self.block)
        window = np.zeros((self.width, self.width))
        for first in range((self.size - 1) // COLUMNS_AT_A_TIME * COLUMNS_AT_A_TIME, -1, -COLUMNS_AT_A_TIME):
            count = min(COLUMNS_AT_A_TIME, self.size - first)
            below = min(self.width, self.size - first - count)
            own = np.tril(np.triu(self.look(first, first, count, count), -self.width))
            diagonal = solve_triangular(own, np.eye(count), lower=True, check_finite=False)
            # Below the diagonal blocks, what is within the band: first + count + row - (first + column) <= width.
            coupling = np.triu(self.look(first + count, first, below, count), count - self.width) @ diagonal
            under = -window[:below, :below] @ coupling
            whole = np.zeros((count + self.width, count + self.width))
            whole[:count, :count] = diagonal.T @ diagonal - coupling.T @ under
            whole[count : count + below, :count], whole[:count, count : count + below] = under, under.T
            whole[count:, count:] = window[: self.width, : self.width]
            row, column = whole.strides
            sheared = as_strided(whole, (count, self.width + 1), (row + column, row))
            inverse.columns.T[first : first + count] = sheared
            window = whole[: self.width, : self.width]
        return inverse
