"""The banded system of a strip: conditions and unknowns model by model, their covariances, and its elimination.

Models are taken in blocks of as many as meet in one condition, so that only neighbouring blocks have anything in
common. Within a block the conditions of a model come before its unknowns: in this order every pivot is regular.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import NamedTuple, dataclass, replace
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.covariance_adjustment import block_tridiagonal
from photostrip.triangulation.covariance_adjustment.conditions import Conditions
from photostrip.triangulation.error_propagation.covariances import NearImages, around_models
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, SHARING, ErrorRows, ranges
from photostrip.triangulation.error_propagation.strip_errors import StripErrors

AT_A_TIME = 32  # blocks that are made together


@dataclass(frozen=True, eq=False)
class PaddedRows:
    """Rows with d = 1 of g consecutive blocks of w models, r places for each block, empty places 0."""

    width: int  # w
    begin: int  # the first of the blocks
    by_component: Floats  # (g, 6 t, r): by the components of t models from the first of the block on
    # (g, 6 (t + 4), r): covariances of their image coordinates, or of the whole rows without similarities, with
    # components of the models from two before the first of the block to two after the last of these
    covariances: Floats

    @classmethod
    def of(
        cls, layout: SystemLayout, rows: ErrorRows, images: Floats, place: Numbers, blocks: range, places: int
    ) -> Self:
        """Put rows into places of their blocks.

        images: covariances of their image points with components, as ``NearImages`` has them.
        place: (n, d), of each coordinate in its block.
        """
        have, slots, count = rows.by_component.shape[1], layout.slots + layout.width - 1, len(blocks)
        by_component = np.zeros((count, slots, COMPONENTS, places))
        covariances = np.zeros((count, slots + 2 * SHARING, COMPONENTS, places))
        block, shift = np.divmod(rows.first, layout.width)
        for number in range(layout.width):
            some = np.flatnonzero(shift == number)
            own, at = block[some, None] - blocks.start, place[some]
            by_component[own, number : number + have, :, at] = rows.by_component[some].transpose(0, 2, 1, 3)
            covariances[own, number : number + images.shape[2], :, at] = images[some]
        return cls(
            width=layout.width,
            begin=blocks.start,
            by_component=by_component.reshape(count, slots * COMPONENTS, places),
            covariances=covariances.reshape(count, (slots + 2 * SHARING) * COMPONENTS, places),
        )

    def whole(self, errors: StripErrors) -> Self:
        """Add covariances of the components, so that they are those of the whole rows."""
        blocks, slots = len(self.by_component), self.by_component.shape[1] // COMPONENTS
        first = (self.begin + np.arange(blocks)) * self.width
        around = around_models(errors.component_covariances, first, SHARING, slots + SHARING)
        result = np.zeros_like(self.covariances)
        for slot in range(slots):
            by_component = self.by_component[:, slot * COMPONENTS : (slot + 1) * COMPONENTS]
            for apart in range(-SHARING, SHARING + 1):
                mixed = around[:, slot + SHARING + min(apart, 0), abs(apart)]
                mixed = mixed.transpose(0, 2, 1) if apart >= 0 else mixed
                start = (slot + apart + SHARING) * COMPONENTS
                result[:, start : start + COMPONENTS] += mixed @ by_component
        result += self.covariances
        return replace(self, covariances=result)


def products(whole: PaddedRows, images: PaddedRows, blocks: range, apart: int, out: Floats) -> None:
    """Find covariances (m, r, r') of rows of blocks with rows of blocks apart.

    Products of image coordinates that both use directly are left out; ``same_images`` gives them.

    whole, images: the ones with covariances of whole rows, the others with those of image coordinates.
    """
    own = slice(blocks.start - whole.begin, blocks.stop - whole.begin)
    other = slice(blocks.start + apart - images.begin, blocks.stop + apart - images.begin)
    models = apart * whole.width
    np.matmul(*_over_same_models(whole.covariances[own], images.by_component[other], models + SHARING), out=out)
    out += np.matmul(*_over_same_models(whole.by_component[own], images.covariances[other], models - SHARING))


def _over_same_models(first: Floats, second: Floats, later: int) -> tuple[Floats, Floats]:
    """Cut (m, 6 t, r), transposed, and (m, 6 t', r'), whose models begin so much later, to the models of both."""
    skip_first, skip_second = COMPONENTS * max(later, 0), COMPONENTS * max(-later, 0)
    length = max(min(first.shape[1] - skip_first, second.shape[1] - skip_second), 0)
    left, right = first[:, skip_first : skip_first + length], second[:, skip_second : skip_second + length]
    return left.transpose(0, 2, 1), right


class SameImages(NamedTuple):
    """Products of image points that enter two tables of rows directly."""

    first: Numbers  # (k,): rows of the first table
    second: Numbers  # (k,): rows of the second table
    value: Floats  # (k, d, e)


def same_images(a: ErrorRows, b: ErrorRows) -> SameImages:
    """Find the image points that enter rows of both tables directly, of d and e coordinates."""
    order = np.argsort(b.image, kind="stable")
    image = b.image[order]
    of_a, place = ranges(np.searchsorted(image, a.image), np.searchsorted(image, a.image, side="right"))
    of_b = order[place]
    return SameImages(a.item[of_a], b.item[of_b], a.by_image[of_a] @ b.by_image[of_b].transpose(0, 2, 1))


@dataclass(frozen=True, eq=False)
class SystemLayout:
    """Where conditions and unknowns stand."""

    width: int  # models in a block
    slots: int  # models over which any row reaches
    heights: Numbers  # (g,): places that the conditions and unknowns of each block take
    # block, position: (n,): block of each condition, and its place there
    block: Numbers
    position: Numbers
    # start, unknown: (p,): place in its block of each model's first condition, and of its first unknown
    start: Numbers
    unknown: Numbers

    @classmethod
    def of(cls, first: Numbers, models: int, slots: int) -> Self:
        """Lay out conditions that are ordered by their first models."""
        width = min(slots, models)
        counts = np.bincount(first, minlength=models)
        begins = np.cumsum(counts + SIMILARITY_PARAMETERS) - counts - SIMILARITY_PARAMETERS
        numbers = np.arange(models)
        start = begins - begins[numbers // width * width]
        unknown = start + counts
        return cls(
            width=width,
            slots=slots,
            heights=np.append(unknown[width - 1 : -1 : width], unknown[-1]) + SIMILARITY_PARAMETERS,
            block=first // width,
            position=start[first] + np.arange(len(first)) - (np.cumsum(counts) - counts)[first],
            start=start,
            unknown=unknown,
        )

    @property
    def blocks(self) -> int:
        return len(self.heights)

    @property
    def height(self) -> int:
        """Places in a block: those that the largest takes."""
        return int(self.heights.max())

    @property
    def cuts(self) -> list[list[int]]:
        """Places in each block where its models begin, but for the first."""
        return [self.start[low + 1 : low + self.width].tolist() for low in range(0, len(self.start), self.width)]


@dataclass(frozen=True, eq=False)
class System:
    errors: StripErrors
    conditions: Conditions
    layout: SystemLayout
    padded: PaddedRows  # the conditions, with covariances of the whole rows
    factors: block_tridiagonal.Factors
    solution: Floats  # (g, b): correlates of the conditions, and unknowns

    @property
    def correlates(self) -> Floats:
        """Correlates lambda of the conditions, shape (n,)."""
        return np.asarray(self.solution[self.layout.block, self.layout.position], float)

    @property
    def cofactors(self) -> Floats:
        """Cofactors of the correlates, shape (n,)."""
        squares = np.concatenate([np.diagonal(block) for block in self.factors.diagonal_of_inverse])
        begin = np.cumsum(self.layout.heights) - self.layout.heights
        return np.asarray(squares[begin[self.layout.block] + self.layout.position], float)

    def columns_of_inverse(self, rows: Numbers) -> Floats:
        """Columns K^-1 e of conditions (c,), by blocks: shape (g, b, c)."""
        right = np.zeros((self.layout.blocks, self.layout.height, len(rows)))
        right[self.layout.block[rows], self.layout.position[rows], np.arange(len(rows))] = 1.0
        return self.factors.solve(right)

    def part_of_inverse(self, rows: Numbers) -> Floats:
        """Entries (c, c) of K^-1 between conditions."""
        return self.factors.part_of_inverse(self.layout.block[rows], self.layout.position[rows])

    @property
    def unknowns(self) -> Floats:
        """Small similarities y of the models, shape (p, 7)."""
        models = np.arange(len(self.layout.start))
        columns = self.layout.unknown[:, None] + np.arange(SIMILARITY_PARAMETERS)
        return np.asarray(self.solution[(models // self.layout.width)[:, None], columns], float)


def system(errors: StripErrors, wanted: Conditions, factor: float) -> System:
    """Build, eliminate and solve K = [Q A; A^T 0], Q = H H^T + noise / factor (eq. 7).

    ``factor`` is the variance factor of the image coordinates.
    """
    rows = wanted.rows
    slots = max(rows.by_component.shape[1], errors.points.by_component.shape[1], SHARING)
    layout = SystemLayout.of(rows.first, errors.models, slots)
    near = NearImages.of(errors, rows).with_components
    images = PaddedRows.of(layout, rows, near, layout.position[:, None], range(layout.blocks), layout.height)
    whole = images.whole(errors)
    diagonal, beside = _covariances(layout, rows, whole, images)
    _add_design(layout, wanted, diagonal, beside)
    diagonal[layout.block, layout.position, layout.position] += wanted.noise / factor
    block, empty = np.nonzero(np.arange(layout.height) >= layout.heights[:, None])
    diagonal[block, empty, empty] = 1.0
    factors = block_tridiagonal.eliminate(diagonal, beside, layout.cuts, layout.heights.tolist())
    return System(
        errors=errors,
        conditions=wanted,
        layout=layout,
        padded=whole,
        factors=factors,
        solution=_solution(layout, factors, wanted.value),
    )


def solved_for(found: System, wanted: Conditions) -> System:
    """Solve the eliminated system for other misclosures of the same conditions."""
    solution = _solution(found.layout, found.factors, wanted.value)
    return replace(found, conditions=wanted, solution=solution)


def _solution(layout: SystemLayout, factors: block_tridiagonal.Factors, value: Floats) -> Floats:
    right = np.zeros((layout.blocks, layout.height, 1))
    right[layout.block, layout.position, 0] = value
    return np.asarray(factors.solve(right)[:, :, 0], float)


def _covariances(layout: SystemLayout, rows: ErrorRows, whole: PaddedRows, images: PaddedRows) -> tuple[Floats, Floats]:
    """Make Q, the covariances of the conditions: blocks (g, b, b) on the diagonal and to the right of them."""
    diagonal, beside = np.zeros((2, layout.blocks, layout.height, layout.height))
    for low in range(0, layout.blocks, AT_A_TIME):
        for apart, blocks in enumerate((diagonal, beside)):
            some = range(low, min(low + AT_A_TIME, layout.blocks - apart))
            products(whole, images, some, apart, blocks[some.start : some.stop])
    for block, cuts in zip(diagonal, layout.cuts, strict=True):
        for cut in cuts:
            block[cut:, :cut] = block[:cut, cut:].T  # rounding makes it different
    shared = same_images(rows, rows)  # every pair in both orders
    block, position = ((each[shared.first], each[shared.second]) for each in (layout.block, layout.position))
    place = np.ravel_multi_index((block[0], *position), diagonal.shape)
    for apart, blocks in enumerate((diagonal, beside)):
        there = np.flatnonzero(block[1] == block[0] + apart)
        np.add.at(blocks.reshape(-1), place[there], shared.value[there, 0, 0])
    return diagonal, beside


def _add_design(layout: SystemLayout, wanted: Conditions, diagonal: Floats, beside: Floats) -> None:
    """Add A: the unknowns of each condition's own model, and of the next one."""
    rows = wanted.rows
    for model, values in ((rows.first, rows.by_similarity[:, 0]), (rows.first + 1, wanted.following)):
        known = np.flatnonzero(values.any(axis=1) & (model < len(layout.unknown)))  # none follows the last
        columns = layout.unknown[model[known]][:, None] + np.arange(SIMILARITY_PARAMETERS)
        apart = model[known] // layout.width > layout.block[known]
        block, position = layout.block[known, None], layout.position[known, None]
        beside[block[apart], position[apart], columns[apart]] = values[known][apart]
        own = block[~apart], position[~apart], columns[~apart]
        diagonal[own] = diagonal[own[0], own[2], own[1]] = values[known][~apart]
