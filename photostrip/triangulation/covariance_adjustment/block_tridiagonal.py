"""Symmetric block-tridiagonal systems that are not positive definite: solution, and the inverse on the diagonal.

Source: derived; block elimination from the first block on, and the backward recursion for the inverse.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import dataclass

# Rows from which on a block is inverted by parts, and symmetric products are made once: cut in three it takes 0.5 to
# 0.8 of the time for 120 to 2400 rows. 1000 photos with 30 points have 70; with 50 products take 1.6 times as long.
LARGE = 100


@dataclass(frozen=True, eq=False)
class Factors:
    """An eliminated system of n blocks of b rows."""

    inverses: Floats  # (n, b, b): P_i^-1, inverses of the pivot blocks P_i = D_i - B_(i-1)^T P_(i-1)^-1 B_(i-1)
    shares: Floats  # (n, b, b): P_i^-1 B_i, B_i the blocks beside the diagonal; the last is 0

    def solve(self, right: Floats) -> Floats:
        """Solve for right sides (n, b, k) by blocks."""
        reduced = right.copy()
        for number in range(1, len(right)):
            reduced[number] -= self.shares[number - 1].T @ reduced[number - 1]
        result: Floats = self.inverses @ reduced
        for number in range(len(right) - 2, -1, -1):
            result[number] -= self.shares[number] @ result[number + 1]
        return result

    def solve_near(self, number: int, right: Floats) -> Floats:
        """Solve for right sides (3, b, k) that are 0 but in a block and those before and after it: rows there.

        Beyond the first and the last block they are 0, too.
        """
        before, after = max(number - 1, 0), min(number + 1, len(self.shares) - 1)
        own = right[1] - self.shares[before].T @ right[0]
        last = self.diagonal_of_inverse[after] @ (right[2] - self.shares[number].T @ own)
        own = self.inverses[number] @ own - self.shares[number] @ last
        return np.stack([self.inverses[before] @ right[0] - self.shares[before] @ own, own, last])

    def entries_of_inverse(self, block: Numbers, position: Numbers) -> Floats:
        """Entries (n, q, q) of the inverse between the places of each row (n, q), in one or two consecutive blocks."""
        result = self.diagonal_of_inverse[block[:, :, None], position[:, :, None], position[:, None]]
        row, one, other = np.nonzero(block[:, None] == block[:, :, None] + 1)
        for number in np.unique(block[row, one]).tolist():
            some = np.flatnonzero(block[row, one] == number)
            at = row[some], one[some], other[some]
            above, of_above = np.unique(position[at[0], at[1]], return_inverse=True)
            below, of_below = np.unique(position[at[0], at[2]], return_inverse=True)
            beside = -self.shares[number][above] @ self.diagonal_of_inverse[number + 1][:, below]
            result[at] = result[at[0], at[2], at[1]] = beside[of_above, of_below]
        return result

    def part_of_inverse(self, block: Numbers, position: Numbers) -> Floats:
        """Entries (c, c) of the inverse between places: Z_ij = -P_i^-1 B_i Z_(i+1)j leads from a block to later ones.

        A solution for c columns takes eight times as long.
        """
        count, height = len(block), self.shares.shape[1]
        result, earlier, rows = np.empty((count, count)), np.zeros(0, np.intp), np.zeros((0, height))
        for number in range(int(block.min()), int(block.max()) + 1):
            own = np.flatnonzero(block == number)
            columns = self.diagonal_of_inverse[number][:, position[own]]
            result[np.ix_(own, own)] = columns[position[own]]
            beside = rows @ columns
            result[np.ix_(earlier, own)], result[np.ix_(own, earlier)] = beside, beside.T
            rows = -np.concatenate([rows @ self.shares[number], self.shares[number][position[own]]])
            earlier = np.append(earlier, own)
        return result

    @cached_property
    def diagonal_of_inverse(self) -> Floats:
        """Blocks (n, b, b) on the diagonal of the inverse: Z_i = P_i^-1 + P_i^-1 B_i Z_(i+1) (P_i^-1 B_i)^T."""
        result = self.inverses.copy()
        for number in range(len(result) - 2, -1, -1):
            share = self.shares[number].T
            result[number] += _symmetric(share, result[number + 1] @ share)
        return result


def eliminate(diagonal: Floats, beside: Floats, cuts: Sequence[Sequence[int]]) -> Factors:
    """Eliminate block after block; the factors take the place of the blocks.

    diagonal: (n, b, b), blocks D on the diagonal, symmetric.
    beside: (n, b, b), blocks B to the right of them; the last does not count.
    cuts: for each block, places where it may be cut: what stands before them can be eliminated first.
    Raises numpy.linalg.LinAlgError when a pivot block is singular.
    """
    beside[-1] = 0.0
    for number in range(len(diagonal)):
        diagonal[number] = _inverse(diagonal[number], cuts[number])
        if number + 1 < len(diagonal):
            share = diagonal[number] @ beside[number]
            diagonal[number + 1] -= _symmetric(beside[number], share)
            beside[number] = share
    return Factors(diagonal, beside)


def _inverse(matrix: Floats, cuts: Sequence[int]) -> Floats:
    """Invert a symmetric matrix whose part before a cut is regular: a large one by parts, as blocks are."""
    if len(matrix) < LARGE or not cuts:
        whole = np.linalg.inv(matrix)
        return np.asarray((whole + whole.T) / 2, float)
    middle = len(cuts) // 2
    cut = cuts[middle]
    first, beside = _inverse(matrix[:cut, :cut], cuts[:middle]), matrix[:cut, cut:]
    share = first @ beside
    rest = matrix[cut:, cut:] - _symmetric(beside, share)
    result = np.empty_like(matrix)
    result[cut:, cut:] = last = _inverse(rest, [each - cut for each in cuts[middle + 1 :]])
    result[cut:, :cut] = lower = -(share @ last).T
    result[:cut, cut:] = lower.T
    result[:cut, :cut] = first - _symmetric(share.T, lower)
    return result


def _symmetric(a: Floats, b: Floats) -> Floats:
    """Give a^T b where that is symmetric: of a large one what stands below four squares on the diagonal once only."""
    size = a.shape[1]
    if size < LARGE:
        return np.asarray(a.T @ b, float)
    result = np.empty((size, size))
    ends = [size * part // 4 for part in range(5)]
    for low, high in pairwise(ends):
        result[low:, low:high] = a[:, low:].T @ b[:, low:high]
        result[low:high, high:] = result[high:, low:high].T
    return result
