"""Columns of rows: their covariances with the conditions, and their coefficients of the unknowns, block by block.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Self

import numpy as np

from photostrip.arrays import Floats
from photostrip.frozen import NamedTuple, dataclass
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.covariance_adjustment import system
from photostrip.triangulation.error_propagation.covariances import NearImages
from photostrip.triangulation.error_propagation.derivatives import ErrorRows

AT_A_TIME = 32  # blocks whose columns are made together: 5 MB of points


class BlockColumns(NamedTuple):
    """Columns of the rows whose first model lies in one block."""

    number: int  # of the block
    rows: slice
    values: Floats  # (3, b, k): in the blocks before, own and after


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns b of rows that are ordered by their first models, block by block."""

    found: system.System
    rows: ErrorRows
    near: NearImages  # what enters them directly
    by_unknowns: Floats  # (n, d, 7): by the unknowns of the first model
    shared: system.SameImages  # image points in common with conditions, ordered by rows

    @classmethod
    def of(cls, found: system.System, rows: ErrorRows) -> Self:
        conditions, reach = found.conditions.rows, 2 * found.layout.width  # at most to the blocks beside
        near = rows.first[[0, -1]] + [-reach, reach] if len(rows.first) else [0, 0]
        begin, end = np.searchsorted(conditions.first, near).tolist()
        shared = system.same_images(rows, conditions.part(begin, end))
        return cls(
            found=found,
            rows=rows,
            near=NearImages.of(found.errors, rows),
            by_unknowns=rows.by_similarity @ found.conditions.local.to_common[rows.first],
            shared=system.SameImages(shared.first, shared.second + begin, shared.value[:, :, 0]),
        )

    @property
    def held(self) -> range:
        """Blocks from the first to the last with rows."""
        first, last = self.rows.first[[0, -1]].tolist() if len(self.rows.first) else (0, -1)
        return range(first // self.found.layout.width, last // self.found.layout.width + 1)

    @property
    def models(self) -> range:
        """Models of these blocks."""
        width, models = self.found.layout.width, len(self.found.layout.start)
        return range(self.held.start * width, min(self.held.stop * width, models))

    def blocks(self, numbers: range) -> Iterator[BlockColumns]:
        """Go through consecutive blocks; a few are made together."""
        for low in numbers[::AT_A_TIME]:
            yield from self._made(low, min(low + AT_A_TIME, numbers.stop))

    def _made(self, low: int, high: int) -> list[BlockColumns]:
        """Make the columns of blocks: covariances with conditions around, coefficients of unknowns, common images."""
        found, layout, size = self.found, self.found.layout, self.rows.by_similarity.shape[1]
        bounds = np.searchsorted(self.rows.first, np.arange(low, high + 1) * layout.width)
        begin, end = bounds[[0, -1]].tolist()
        part = self.rows.part(begin, end)
        own = part.first // layout.width - low
        rank = np.arange(begin, end) - bounds[own]
        place = rank[:, None] * size + np.arange(size)
        most, near = int(np.diff(bounds).max()) * size, self.near.with_components[begin:end]
        padded = system.PaddedRows.of(layout, part, near, place, range(low, high), most)
        columns = np.empty((3, high - low, layout.height, most))
        for beside in range(3):
            others = range(max(low + beside - 1, 0), min(high + beside - 1, layout.blocks))
            inside = slice(others.start - beside + 1 - low, others.stop - beside + 1 - low)
            system.products(found.padded, padded, others, 1 - beside, columns[beside, inside])
            columns[beside, : inside.start] = columns[beside, inside.stop :] = 0.0  # beyond the ends
        unknown = layout.unknown[part.first][:, None] + np.arange(SIMILARITY_PARAMETERS)
        columns[1, own[:, None, None], unknown[:, None], place[:, :, None]] = self.by_unknowns[begin:end]
        # products of image points that rows have in common with conditions
        inside = slice(*np.searchsorted(self.shared.first, [begin, end]).tolist())
        row, condition, value = self.shared.first[inside] - begin, self.shared.second[inside], self.shared.value[inside]
        beside = layout.block[condition] - own[row] - low + 1
        at = beside, own[row], layout.position[condition], rank[row] * size
        first = np.ravel_multi_index(at, columns.shape)
        np.add.at(
            columns.reshape(-1), first[:, None] + np.arange(size), value
        )  # flat: three indices take ten times as long
        return [
            BlockColumns(low + number, slice(start, stop), columns[:, number, :, : (stop - start) * size])
            for number, (start, stop) in enumerate(pairwise(bounds.tolist()))
        ]
