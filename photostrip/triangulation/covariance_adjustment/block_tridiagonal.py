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
    """An eliminated system of n blocks with places for b rows, of which each takes its own number."""

    inverses: Floats  # (n, b, b): P_i^-1, inverses of the pivot blocks P_i = D_i - B_(i-1)^T P_(i-1)^-1 B_(i-1)
    shares: Floats  # (n, b, b): P_i^-1 B_i, B_i the blocks beside the diagonal; the last is 0
    heights: Sequence[int]  # rows of each block; what stands in the places beyond them has to do with nothing else

    def inverse(self, number: int) -> Floats:
        """Inverse (b_i, b_i) of the pivot block of the rows of a block."""
        return self.inverses[number, : self.heights[number], : self.heights[number]]

    def share(self, number: int) -> Floats:
        """Give P_i^-1 B_i of the rows of a block and those of the next, (b_i, b_(i+1)); of the last without columns."""
        following = self.heights[number + 1] if number + 1 < len(self.heights) else 0
        return self.shares[number, : self.heights[number], :following]

    def solve(self, right: Floats) -> Floats:
        """Solve for right sides (n, b, k) by blocks."""
        reduced = right.copy()
        for share, own, later in zip(self.shares[:-1], reduced[:-1], reduced[1:], strict=True):
            np.subtract(later, share.T @ own, out=later)
        result: Floats = self.inverses @ reduced
        for share, own, later in zip(self.shares[-2::-1], result[-2::-1], result[:0:-1], strict=True):
            np.subtract(own, share @ later, out=own)
        return result

    def near(self, number: int) -> range:
        """Give a block with those before and after it."""
        return range(max(number - 1, 0), min(number + 2, len(self.heights)))

    def reduced_near(self, number: int, right: Floats) -> list[Floats]:
        """Eliminate from right sides (3, b, k) that are 0 but in a block and those before and after it: rows of each.

        Beyond the first and the last block there are none.
        """
        result: list[Floats] = []
        for each in self.near(number):
            own = right[each - number + 1, : self.heights[each]]
            result.append(own - self.share(each - 1).T @ result[-1] if result else own)
        return result

    def solve_near(self, number: int, right: Floats) -> Floats:
        """Solve for such right sides: rows there; beyond the first and the last block they are 0."""
        near, reduced, result = self.near(number), self.reduced_near(number, right), np.zeros_like(right)
        later = self.diagonal_of_inverse[near[-1]] @ reduced[-1]
        result[near[-1] - number + 1, : len(later)] = later
        for each, own in zip(near[-2::-1], reduced[-2::-1], strict=True):
            later = self.inverse(each) @ own - self.share(each) @ later
            result[each - number + 1, : len(later)] = later
        return result

    def entries_of_inverse(self, block: Numbers, position: Numbers) -> Floats:
        """Entries (n, q, q) of the inverse between the places of each row (n, q), in one or two consecutive blocks."""
        result = np.empty((*block.shape, block.shape[1]))
        for number in np.unique(block).tolist():
            row, one, other = np.nonzero((block[:, :, None] == number) & (block[:, None] == number))
            result[row, one, other] = self.diagonal_of_inverse[number][position[row, one], position[row, other]]
            row, one, other = np.nonzero((block[:, :, None] == number) & (block[:, None] == number + 1))
            if not len(row):
                continue
            above, of_above = np.unique(position[row, one], return_inverse=True)
            below, of_below = np.unique(position[row, other], return_inverse=True)
            beside = -self.share(number)[above] @ self.diagonal_of_inverse[number + 1][:, below]
            result[row, one, other] = result[row, other, one] = beside[of_above, of_below]
        return result

    def part_of_inverse(self, block: Numbers, position: Numbers) -> Floats:
        """Entries (c, c) of the inverse between places: Z_ij = -P_i^-1 B_i Z_(i+1)j leads from a block to later ones.

        A solution for c columns takes eight times as long.
        """
        count, first = len(block), int(block.min())
        result, earlier = np.empty((count, count)), np.zeros(0, np.intp)
        rows = np.zeros((0, self.heights[first]))
        for number in range(first, int(block.max()) + 1):
            own = np.flatnonzero(block == number)
            columns = self.diagonal_of_inverse[number][:, position[own]]
            result[np.ix_(own, own)] = columns[position[own]]
            beside = rows @ columns
            result[np.ix_(earlier, own)], result[np.ix_(own, earlier)] = beside, beside.T
            rows = -np.concatenate([rows @ self.share(number), self.share(number)[position[own]]])
            earlier = np.append(earlier, own)
        return result

    @cached_property
    def diagonal_of_inverse(self) -> Sequence[Floats]:
        """Blocks (b_i, b_i) on the diagonal of the inverse: Z_i = P_i^-1 + P_i^-1 B_i Z_(i+1) (P_i^-1 B_i)^T."""
        last = len(self.heights) - 1
        result = [self.inverse(last)]
        for number in range(last - 1, -1, -1):
            share = self.share(number).T
            result.append(self.inverse(number) + _symmetric(share, result[-1] @ share))
        return result[::-1]


def eliminate(diagonal: Floats, beside: Floats, cuts: Sequence[Sequence[int]], heights: Sequence[int]) -> Factors:
    """Eliminate block after block; the factors take the place of the blocks.

    diagonal: (n, b, b), blocks D on the diagonal, symmetric.
    beside: (n, b, b), blocks B to the right of them; the last does not count.
    cuts: for each block, places where it may be cut: what stands before them can be eliminated first.
    heights: rows of each block; in the places beyond them stands a unit matrix.
    Raises numpy.linalg.LinAlgError when a pivot block is singular.
    """
    beside[-1] = 0.0
    for number in range(len(diagonal)):
        diagonal[number] = inverse = _inverse(diagonal[number], cuts[number])
        if number + 1 < len(diagonal):
            share = inverse @ beside[number]
            diagonal[number + 1] -= _symmetric(beside[number], share)
            beside[number] = share
    return Factors(diagonal, beside, heights)


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
