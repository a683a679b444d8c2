"""Symmetric block-tridiagonal systems that are not positive definite: solution, and the inverse near the diagonal.

Source: derived; block elimination from the first block on, and the backward recursion for the inverse.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Factors:
    """An eliminated system of n blocks of b rows."""

    inverses: Floats  # (n, b, b): inverses of the pivot blocks
    shares: Floats  # (n, b, b): those times the blocks beside the diagonal; the last is 0

    def solve(self, right: Floats) -> Floats:
        """Solve for right sides.

        Parameters
        ----------
        right : ndarray, shape (n, b, k)
            Right sides by blocks.

        Returns
        -------
        ndarray, shape (n, b, k)
            Solutions by blocks.
        """
        reduced = right.copy()
        for number in range(1, len(right)):
            reduced[number] -= self.shares[number - 1].T @ reduced[number - 1]
        result: Floats = self.inverses @ reduced
        for number in range(len(right) - 2, -1, -1):
            result[number] -= self.shares[number] @ result[number + 1]
        return result

    def inverse(self) -> Iterator[tuple[int, tuple[Floats, Floats, Floats]]]:
        """Give blocks of the inverse, from the last row of blocks to the first.

        Yields
        ------
        blocks : tuple of ndarray, shape (b, b)
            Of that row: on the diagonal, the next and the one after; 0 beyond the end.
        """
        zero = np.zeros_like(self.inverses[0])
        own, beside = zero, zero
        for number in range(len(self.inverses) - 1, -1, -1):
            share = self.shares[number]
            near, far = -(share @ own), -(share @ beside)
            own, beside = self.inverses[number] - near @ share.T, near
            yield number, (own, near, far)


def eliminate(diagonal: Floats, beside: Floats) -> Factors:
    """Eliminate block after block.

    Parameters
    ----------
    diagonal : ndarray, shape (n, b, b)
        Blocks on the diagonal, symmetric.
    beside : ndarray, shape (n, b, b)
        Blocks to the right of them; the last does not count.

    Raises
    ------
    numpy.linalg.LinAlgError
        When a pivot block is singular.
    """
    inverses, shares = np.empty_like(diagonal), np.zeros_like(beside)
    pivot = diagonal[0]
    for number in range(len(diagonal)):
        inverse = np.linalg.inv(pivot)
        inverses[number] = (inverse + inverse.T) / 2
        if number + 1 < len(diagonal):
            shares[number] = inverses[number] @ beside[number]
            pivot = diagonal[number + 1] - beside[number].T @ shares[number]
    return Factors(inverses, shares)
