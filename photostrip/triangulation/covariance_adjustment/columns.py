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
        layout, size = self.found.layout, self.rows.by_similarity.shape[1]
        models = len(layout.start)
        some = range(low * layout.width, min(high * layout.width, models))
        ends = np.searchsorted(self.rows.first, [*some, some.stop])
        bounds = ends[np.minimum(np.arange(high - low + 1) * layout.width, len(some))]
        counts = np.diff(bounds)
        offsets = np.concatenate([[0], np.cumsum(3 * layout.height * counts * size)])
        whole = np.zeros(offsets[-1])
        columns = [
            whole[start:stop].reshape(3, layout.height, count * size)
            for (start, stop), count in zip(pairwise(offsets.tolist()), counts.tolist(), strict=True)
        ]
        begin, end = ends[[0, -1]].tolist()
        part, near = self.rows.part(begin, end), self.near.with_components[begin:end]
        slots = self.found.padded.by_component.shape[1]
        padded = system.PaddedRows.of(self.found.errors, part, near, slots, some)
        starts, unknowns, reached = layout.start.tolist(), layout.unknown.tolist(), ends.tolist()
        # the place of each model's rows: its block, and its columns there
        places = {
            place: (place // layout.width, slice((start - first) * size, (stop - first) * size))
            for place, (start, stop) in enumerate(pairwise(reached))
            for first in [int(bounds[place // layout.width])]
            if stop > start
        }
        for apart in range(-layout.width, layout.width + 1):
            others = range(max(some.start + apart, 0), min(some.stop + apart, models))
            if not others:
                continue
            values = system.products(self.found.padded, padded, others, -apart)
            for number, (block, across) in places.items():
                other = some.start + number + apart
                if other not in others:
                    continue
                beside = other // layout.width - (low + block) + 1
                top, height = starts[other], unknowns[other]
                value = values[other - others.start]
                columns[block][beside, top:height, across] = value[: height - top, : across.stop - across.start]
        for number, (block, across) in places.items():
            unknown = unknowns[number + some.start]
            by_unknowns = self.by_unknowns[reached[number] : reached[number + 1]].reshape(-1, SIMILARITY_PARAMETERS)
            columns[block][1, unknown : unknown + SIMILARITY_PARAMETERS, across] = by_unknowns.T
        # products of image points that rows have in common with conditions
        inside = slice(*np.searchsorted(self.shared.first, [begin, end]).tolist())
        row, condition, value = self.shared.first[inside], self.shared.second[inside], self.shared.value[inside]
        own = self.rows.first[row] // layout.width - low
        place = (layout.block[condition] - (low + own) + 1) * layout.height + layout.position[condition]
        first = offsets[own] + (place * counts[own] + row - bounds[own]) * size
        np.add.at(whole, first[:, None] + np.arange(size), value)  # flat: three indices take ten times as long
        return [
            BlockColumns(number, slice(start, stop), values)
            for number, (start, stop), values in zip(range(low, high), pairwise(bounds.tolist()), columns, strict=True)
        ]
