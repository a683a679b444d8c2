"""Symmetric block-tridiagonal systems that are not positive definite: solution, and the inverse near the diagonal.

Source: derived; block elimination from the first block on, and the backward recursion for the inverse.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from photostrip.arrays import Floats
from photostrip.frozen import dataclass


@dataclass(frozen=True, eq=False)
class Factors:
    """An eliminated system of n blocks of b rows."""

    inverses: Floats  # (n, b, b): P_i^-1, inverses of the pivot blocks P_i = D_i - B_(i-1)^T P_(i-1)^-1 B_(i-1)
    shares: Floats  # (n, b, b): P_i^-1 B_i, B_i the blocks beside the diagonal; the last is 0

    def solve(self, right: Floats) -> Floats:
        """Solve for right sides (n, b, k) by blocks."""
        reduced = right.copy()
        for share, own, later in zip(self.shares[:-1], reduced[:-1], reduced[1:], strict=True):
            np.subtract(later, share.T @ own, out=later)
        result: Floats = self.inverses @ reduced
        for share, own, later in zip(self.shares[-2::-1], result[-2::-1], result[:0:-1], strict=True):
            np.subtract(own, share @ later, out=own)
        return result

    @cached_property
    def diagonal_of_inverse(self) -> Floats:
        """Blocks (n, b, b) on the diagonal of the inverse: Z_i = P_i^-1 + P_i^-1 B_i Z_(i+1) (P_i^-1 B_i)^T."""
        result = self.inverses.copy()
        for number in range(len(result) - 2, -1, -1):
            result[number] += self.shares[number] @ result[number + 1] @ self.shares[number].T
        return result

    def near_diagonal(self, number: int, own: slice, later: slice) -> Floats:
        """Part of the inverse that belongs to some rows of a block and of the next; of the last, to its own."""
        result = self.diagonal_of_inverse[number][own, own]
        if number + 1 == len(self.inverses):
            return result
        of_later, size = self.diagonal_of_inverse[number + 1][:, later], len(result)
        near = np.empty((size + of_later.shape[1],) * 2)
        near[:size, :size], near[size:, size:] = result, of_later[later]
        near[:size, size:] = beside = -self.shares[number][own] @ of_later
        near[size:, :size] = beside.T
        return near


def eliminate(diagonal: Floats, beside: Floats) -> Factors:
    """Eliminate block after block; the factors take the place of the blocks.

    diagonal: (n, b, b), blocks D on the diagonal, symmetric.
    beside: (n, b, b), blocks B to the right of them; the last does not count.
    Raises numpy.linalg.LinAlgError when a pivot block is singular.
    """
    beside[-1] = 0.0
    for number in range(len(diagonal)):
        inverse = np.linalg.inv(diagonal[number])
        diagonal[number] = inverse = (inverse + inverse.T) / 2
        if number + 1 < len(diagonal):
            share = inverse @ beside[number]
            diagonal[number + 1] -= beside[number].T @ share
            beside[number] = share
    return Factors(diagonal, beside)
