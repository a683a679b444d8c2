"""Rows after the conditions of their points were eliminated: products with the inverse of the whole system.

The column b of a row has its covariances with the conditions of its own point, and its window. With the own covariances
D = L L^T of these conditions and their windows Z, b^T K^-1 b' = s^T s' + z^T S^-1 z' where s = L^-1 of the covariances,
z = window - s^T L^-1 Z, and S is what is left of K. A condition itself is a row of which b is a unit vector.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from photostrip.arrays import Floats, Numbers, distinct, runs_of
from photostrip.frozen import NamedTuple, dataclass
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import ErrorRows, ranges, same_images
from photostrip.triangulation.covariance_adjustment.strip_rows.sums import NearImages
from photostrip.triangulation.covariance_adjustment.system import System
from photostrip.triangulation.covariance_adjustment.windows import ANCHOR, MODEL, MODELS, windows


@dataclass(frozen=True, eq=False)
class Reduced:
    """Rows of d coordinates, ordered by the first models of their points."""

    base: Numbers  # (n,): first model
    window: Floats  # (n, d, 7 + 24 w): z
    condition: Numbers  # (n,): first condition of their points; -1 of points without any
    own: Floats  # (n, k, d): s, of the conditions from there on

    @property
    def by_coordinate(self) -> Reduced:
        """Each coordinate as a row of its own."""
        size = self.own.shape[2]
        return Reduced(
            base=np.repeat(self.base, size),
            window=self.window.reshape(len(self.base) * size, 1, -1),
            condition=np.repeat(self.condition, size),
            own=self.own.transpose(0, 2, 1).reshape(len(self.base) * size, -1, 1),
        )


class Solved(NamedTuple):
    """Rows of one coordinate, and S^-1 z of them."""

    rows: Reduced
    columns: Floats  # (g, b, c)


def of_rows(found: System, rows: ErrorRows, near: NearImages, of_images: Numbers) -> Reduced:
    """Reduce rows that are ordered by the first models of their points.

    of_images: (k,), conditions of all image points, as the system finds them.
    """
    conditions, count, size = found.conditions, *rows.by_similarity.shape[:2]
    result = Reduced(
        base=rows.first,
        window=windows(found.blocks, conditions.similarities, rows, near.with_components, rows.first),
        condition=np.full(count, -1),
        own=np.zeros((count, found.roots.root.shape[1], size)),
    )
    start = of_images[rows.image]
    entry = np.flatnonzero(start >= 0)
    result.condition[rows.item[entry]] = start[entry]
    chosen = found.roots.of_points(distinct(start[entry]))
    shared = same_images(rows, conditions.rows.take(chosen))
    second = chosen[shared.second]
    np.add.at(result.own, (shared.first, second - found.roots.start[second]), shared.value[:, :, 0])
    _reduce(found, result)
    return result


def of_conditions(found: System, chosen: Numbers) -> Reduced:
    """Reduce the unit vectors of some conditions, which are in the order of all."""
    count, start = len(chosen), found.roots.start[chosen]
    result = Reduced(
        base=found.conditions.base[chosen],
        window=np.zeros((count, 1, SIMILARITY_PARAMETERS + 2 * found.blocks.width * MODEL)),
        condition=start,
        own=np.zeros((count, found.roots.root.shape[1], 1)),
    )
    result.own[np.arange(count), chosen - start] = 1.0
    _reduce(found, result)
    return result


def _reduce(found: System, result: Reduced) -> None:
    """Multiply s of rows by L^-1, and subtract s^T L^-1 Z from their windows."""
    rows = np.flatnonzero(result.condition >= 0)
    chosen = found.roots.of_points(distinct(result.condition[rows]))
    roots, whitened = found.roots.take(chosen), found.windows(chosen)
    first, plain = np.searchsorted(chosen, result.condition[rows]), result.own[rows]
    for place in range(roots.root.shape[1]):
        row = np.minimum(first + place, len(chosen) - 1)
        here = np.flatnonzero((row == first + place) & (roots.start[row] == first))
        own = (roots.root[row[here], None] @ plain[here])[:, 0]
        result.own[rows[here], place] = own
        result.window[rows[here]] -= own[:, :, None] * whitened[row[here], None]


def solved(found: System, rows: Reduced) -> Solved:
    """Solve for the windows of rows of one coordinate."""
    right, own = np.zeros((*found.solution.shape, len(rows.base))), found.blocks.height - ANCHOR.start
    number, block = np.arange(len(rows.base)), rows.base // found.blocks.width
    right[block, ANCHOR.start :, number] = rows.window[:, 0, :own]
    inside = np.flatnonzero(block + 1 < len(right))
    right[block[inside] + 1, MODELS:, number[inside]] = rows.window[inside, 0, own:]
    return Solved(rows, found.factors.solve(right))


def products(found: System, rows: Reduced, others: Solved) -> Floats:
    """Give b^T K^-1 b' of rows with others, shape (n, d, c)."""
    result = _own_products(rows, others.rows)
    for block, some in runs_of(rows.base // found.blocks.width):
        near = [others.columns[block, ANCHOR.start :], *others.columns[block + 1 : block + 2, MODELS:]]
        columns = np.concatenate(near)
        result[some] += rows.window[some, :, : len(columns)] @ columns
    return result


def squares(found: System, rows: Reduced) -> Floats:
    """Give b^T K^-1 b of each row, shape (n, d, d)."""
    count, size, length = rows.window.shape
    window, own, later = rows.window.reshape(count * size, length), slice(ANCHOR.start, None), slice(MODELS, None)
    through = np.zeros_like(window)
    for block, some in runs_of(rows.base // found.blocks.width):
        near, part = found.factors.near_diagonal(block, own, later), slice(some.start * size, some.stop * size)
        np.matmul(window[part, : len(near)], near, out=through[part, : len(near)])  # behind the last are zeros
    result = rows.own.transpose(0, 2, 1) @ rows.own
    result += rows.window @ through.reshape(rows.window.shape).transpose(0, 2, 1)
    return np.asarray(result, float)


def squares_and_products(found: System, rows: Reduced) -> Floats:
    """Give b^T K^-1 b' of rows of one coordinate with each other, shape (n, n).

    With S eliminated from the first block on, a window becomes r in its two blocks and all later ones, and z^T S^-1 z'
    = sum r^T P^-1 r'. What blocks behind both windows add to it is said by the inverse on the diagonal.
    """
    factors, count, height = found.factors, len(rows.base), found.blocks.height
    result, columns = _own_products(rows, rows)[:, 0], np.zeros((count, 2, height))
    columns[:, 0, ANCHOR.start :] = rows.window[:, 0, : height - ANCHOR.start]
    columns[:, 1, MODELS:] = rows.window[:, 0, height - ANCHOR.start :]
    ends = np.searchsorted(rows.base // found.blocks.width, np.arange(found.blocks.count + 1))
    reduced = np.zeros((height, 0))
    for number, (start, stop) in enumerate(pairwise(ends.tolist())):
        before = int(ends[max(number - 1, 0)])
        right = np.zeros((height, stop))
        right[:, before:start] = columns[before:start, 1].T
        right[:, start:] = columns[start:stop, 0].T
        if number:
            right[:, :start] -= factors.shares[number - 1].T @ reduced
        reduced = right
        for weight, some in (
            (factors.diagonal_of_inverse[number], slice(before, start)),
            (factors.inverses[number], slice(start, stop)),
        ):
            result[: some.stop, some] += reduced[:, : some.stop].T @ (weight @ reduced[:, some])
    upper = np.triu(result)
    return np.asarray(upper + np.triu(upper, 1).T, float)


def _own_products(rows: Reduced, others: Reduced) -> Floats:
    """Give s^T s' of rows with others of one coordinate, shape (n, d, c): of the same points."""
    result = np.zeros((len(rows.base), rows.own.shape[2], len(others.base)))
    some, order = np.flatnonzero(rows.condition >= 0), np.argsort(others.condition, kind="stable")
    condition = others.condition[order]
    wanted = rows.condition[some]
    first, place = ranges(np.searchsorted(condition, wanted), np.searchsorted(condition, wanted, side="right"))
    row, other = some[first], order[place]
    result[row, :, other] = (rows.own[row].transpose(0, 2, 1) @ others.own[other])[:, :, 0]
    return result
