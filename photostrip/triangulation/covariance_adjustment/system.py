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
from photostrip.triangulation.error_propagation.covariances import NearImages
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, SHARING, ErrorRows, ranges
from photostrip.triangulation.error_propagation.strip_errors import StripErrors


@dataclass(frozen=True, eq=False)
class PaddedRows:
    """Rows with d = 1 of p consecutive models, model by model, r places for each model, empty places 0.

    The places come last, so that products of many models need no copies.
    """

    begin: int  # the first of the models
    by_component: Floats  # (p, s, 6, r)
    images: Floats  # (p, s + 4, 6, r): covariances of their image coordinates with components
    whole: Floats  # (p, s + 4, 6, r): covariances of the whole rows, without similarities, with components

    @classmethod
    def of(cls, errors: StripErrors, rows: ErrorRows, with_components: Floats, slots: int, models: range) -> Self:
        """Put rows that are ordered by their first models into places of these; one of d coordinates takes d places.

        with_components: covariances of their image points with components, as ``NearImages`` has them.
        slots: number of models over which any row reaches.
        """
        first, size, have = rows.first - models.start, rows.by_similarity.shape[1], rows.by_component.shape[1]
        rank = rank_in_model(first, len(models))
        places = max(int(rank.max(initial=0)) + 1, 1) * size
        by_component = np.zeros((len(models), slots, COMPONENTS, places))
        images = np.zeros((len(models), slots + 2 * SHARING, COMPONENTS, places))
        at = rank[:, None] * size + np.arange(size)
        by_component[first[:, None], :have, :, at] = rows.by_component.transpose(0, 2, 1, 3)
        images[first[:, None], : have + 2 * SHARING, :, at] = with_components
        whole = images + _with_components(errors.component_covariances, by_component, models)
        return cls(begin=models.start, by_component=by_component, images=images, whole=whole)


def _with_components(covariances: Floats, by_component: Floats, models: range) -> Floats:
    """Covariances of sums of components with the components from two models before to two after."""
    _, slots, _, places = by_component.shape
    result = np.zeros((len(models), slots + 2 * SHARING, COMPONENTS, places))
    for slot in range(slots):
        for apart in range(-SHARING, SHARING + 1):
            low = max(models.start, -apart - slot)
            high = max(min(models.stop, len(covariances) - slot - max(apart, 0)), low)
            mixed = covariances[low + slot + min(apart, 0) : high + slot + min(apart, 0), abs(apart)]
            mixed = mixed.transpose(0, 2, 1) if apart >= 0 else mixed
            row = slice(low - models.start, high - models.start)
            result[row, slot + apart + SHARING] += mixed @ by_component[row, slot]
    return result


def products(a: PaddedRows, b: PaddedRows, models: range, apart: int) -> Floats:
    """Covariances (m, r_a, r_b) of rows of models with rows of models apart.

    Products of image coordinates that both use directly are left out; ``same_images`` gives them.
    """
    of_a = slice(models.start - a.begin, models.stop - a.begin)
    of_b = slice(models.start + apart - b.begin, models.stop + apart - b.begin)
    total = np.zeros((len(models), a.by_component.shape[3], b.by_component.shape[3]))
    for first, second, low in (
        (a.whole[of_a], b.by_component[of_b], apart + SHARING),
        (a.by_component[of_a], b.images[of_b], apart - SHARING),
    ):
        skip_first, skip_second = max(low, 0), max(-low, 0)
        length = min(first.shape[1] - skip_first, second.shape[1] - skip_second)
        if length > 0:
            left = first[:, skip_first : skip_first + length].reshape(len(total), -1, total.shape[1])
            right = second[:, skip_second : skip_second + length].reshape(len(total), -1, total.shape[2])
            total += left.transpose(0, 2, 1) @ right
    return total


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
    # blocks, height: number of blocks, and rows of each
    blocks: int
    height: int
    rank: Numbers  # (n,): place of each condition among those of its model
    # block, position: (n,): block of each condition, and its place there
    block: Numbers
    position: Numbers
    # start, unknown: (p,): place in its block of each model's first condition, and of its first unknown
    start: Numbers
    unknown: Numbers

    @classmethod
    def of(cls, first: Numbers, models: int, width: int) -> Self:
        """Lay out conditions that are ordered by their first models."""
        counts = np.bincount(first, minlength=models)
        rank = rank_in_model(first, models)
        begins = np.cumsum(counts + SIMILARITY_PARAMETERS) - counts - SIMILARITY_PARAMETERS
        numbers = np.arange(models)
        start = begins - begins[numbers // width * width]
        unknown = start + counts
        return cls(
            width=width,
            blocks=(models - 1) // width + 1,
            height=int(unknown.max()) + SIMILARITY_PARAMETERS,
            rank=rank,
            block=first // width,
            position=start[first] + rank,
            start=start,
            unknown=unknown,
        )

    def empty(self) -> tuple[Numbers, Numbers]:
        """Places that nothing takes."""
        used = np.zeros((self.blocks, self.height), bool)
        used[self.block, self.position] = True
        models = np.arange(len(self.start))
        used[(models // self.width)[:, None], self.unknown[:, None] + np.arange(SIMILARITY_PARAMETERS)] = True
        blocks, places = np.nonzero(~used)
        return blocks, places


def rank_in_model(first: Numbers, models: int) -> Numbers:
    """Place of each row among those of its model, for rows that are ordered by their models."""
    counts = np.bincount(first, minlength=models)
    return np.asarray(np.arange(len(first)) - (np.cumsum(counts) - counts)[first], np.intp)


@dataclass(frozen=True, eq=False)
class BlockMatrix:
    """A symmetric matrix of blocks on and beside the diagonal."""

    layout: SystemLayout
    # diagonal, beside: (g, b, b): blocks on the diagonal and to the right of them
    diagonal: Floats
    beside: Floats

    def put(self, model: int, rows: slice, other: int, columns: slice, values: Floats) -> None:
        """Put values at rows of a model's block, columns of that of the same or a later model, and mirrored."""
        block = model // self.layout.width
        if other // self.layout.width > block:
            self.beside[block, rows, columns] = values
        else:
            self.diagonal[block, rows, columns] = values
            if other != model:  # or the values have both sides
                self.diagonal[block, columns, rows] = values.T


@dataclass(frozen=True, eq=False)
class System:
    errors: StripErrors
    conditions: Conditions
    layout: SystemLayout
    padded: PaddedRows  # the conditions
    factors: block_tridiagonal.Factors
    solution: Floats  # (g, b): correlates of the conditions, and unknowns

    @property
    def correlates(self) -> Floats:
        """Correlates lambda of the conditions, shape (n,)."""
        return np.asarray(self.solution[self.layout.block, self.layout.position], float)

    @property
    def cofactors(self) -> Floats:
        """Cofactors of the correlates, shape (n,)."""
        place = self.layout.position
        return np.asarray(self.factors.diagonal_of_inverse[self.layout.block, place, place], float)

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
    layout = SystemLayout.of(rows.first, errors.models, min(slots, errors.models))
    padded = PaddedRows.of(errors, rows, NearImages.of(errors, rows).with_components, slots, range(errors.models))
    shape = (layout.blocks, layout.height, layout.height)
    matrix = BlockMatrix(layout, np.zeros(shape), np.zeros(shape))
    _put_covariances(matrix, padded, rows)
    _add_design(matrix, wanted)
    matrix.diagonal[layout.block, layout.position, layout.position] += wanted.noise / factor
    blocks, places = layout.empty()
    matrix.diagonal[blocks, places, places] = 1.0
    cuts = [layout.start[low + 1 : low + layout.width].tolist() for low in range(0, errors.models, layout.width)]
    factors = block_tridiagonal.eliminate(matrix.diagonal, matrix.beside, cuts)
    return System(
        errors=errors,
        conditions=wanted,
        layout=layout,
        padded=padded,
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


def _put_covariances(matrix: BlockMatrix, padded: PaddedRows, rows: ErrorRows) -> None:
    """Put Q, the covariances of the conditions, into an empty matrix."""
    layout = matrix.layout
    inside = [slice(*bounds) for bounds in zip(layout.start.tolist(), layout.unknown.tolist(), strict=True)]
    for apart in range(min(layout.width, len(inside) - 1) + 1):
        values = products(padded, padded, range(len(inside) - apart), apart)
        for model, (one, other, value) in enumerate(zip(inside, inside[apart:], values, strict=False)):
            part = value[: one.stop - one.start, : other.stop - other.start]
            matrix.put(model, one, model + apart, other, part)
    shared = same_images(rows, rows)  # every pair in both orders
    block, position = ((each[shared.first], each[shared.second]) for each in (layout.block, layout.position))
    place = (block[0] * layout.height + position[0]) * layout.height + position[1]
    for apart, blocks in enumerate((matrix.diagonal, matrix.beside)):
        there = np.flatnonzero(block[1] == block[0] + apart)
        np.add.at(blocks.reshape(-1), place[there], shared.value[there, 0, 0])


def _add_design(matrix: BlockMatrix, wanted: Conditions) -> None:
    """Add A: the unknowns of each condition's own model, and of the next one."""
    layout, rows = matrix.layout, wanted.rows
    for model, values in ((rows.first, rows.by_similarity[:, 0]), (rows.first + 1, wanted.following)):
        known = model < len(layout.unknown)  # none follows the last
        columns = layout.unknown[model[known]][:, None] + np.arange(SIMILARITY_PARAMETERS)
        apart = model[known] // layout.width > layout.block[known]
        block, position = layout.block[known, None], layout.position[known, None]
        matrix.beside[block[apart], position[apart], columns[apart]] = values[known][apart]
        own = block[~apart], position[~apart], columns[~apart]
        matrix.diagonal[own] = matrix.diagonal[own[0], own[2], own[1]] = values[known][~apart]
