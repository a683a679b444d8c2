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
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, REACH, ErrorRows, ranges
from photostrip.triangulation.error_propagation.strip_errors import StripErrors


@dataclass(frozen=True, eq=False)
class PaddedRows:
    """Rows with d = 1 of p consecutive models, model by model, r places for each model, empty places 0."""

    begin: int  # the first of the models
    by_component: Floats  # (p, r, s, 6)
    images: Floats  # (p, r, s + 4, 6): covariances of their image coordinates with components
    whole: Floats  # (p, r, s + 4, 6): covariances of the whole rows, without similarities, with components

    @classmethod
    def of(cls, errors: StripErrors, rows: ErrorRows, slots: int, models: range) -> Self:
        """Put rows that are ordered by their first models into places of these; one of d coordinates takes d places.

        ``slots`` is the number of models over which any row reaches.
        """
        first, size, have = rows.first - models.start, rows.by_similarity.shape[1], rows.by_component.shape[1]
        rank = rank_in_model(first, len(models))
        places = max(int(rank.max(initial=0)) + 1, 1) * size
        by_component = np.zeros((len(models), places, slots, COMPONENTS))
        images = np.zeros((len(models), places, slots + 2 * REACH, COMPONENTS))
        at = rank[:, None] * size + np.arange(size)
        with_components = NearImages.of(errors, rows).with_components
        by_component[first[:, None], at, :have] = rows.by_component.transpose(0, 2, 1, 3)
        images[first[:, None], at, : have + 2 * REACH] = with_components
        whole = images + _with_components(errors.component_covariances, by_component, models)
        return cls(begin=models.start, by_component=by_component, images=images, whole=whole)


def _with_components(covariances: Floats, by_component: Floats, models: range) -> Floats:
    """Covariances of sums of components with the components from two models before to two after."""
    _, places, slots, _ = by_component.shape
    result = np.zeros((len(models), places, slots + 2 * REACH, COMPONENTS))
    for slot in range(slots):
        for apart in range(-REACH, REACH + 1):
            low = max(models.start, -apart - slot)
            model = np.arange(low, max(min(models.stop, len(covariances) - slot - max(apart, 0)), low))
            if len(model):
                mixed = covariances[model + slot + min(apart, 0), abs(apart)]
                mixed = mixed if apart >= 0 else mixed.transpose(0, 2, 1)
                row = slice(low - models.start, low - models.start + len(model))
                result[row, :, slot + apart + REACH] += by_component[row, :, slot] @ mixed
    return result


def products(a: PaddedRows, b: PaddedRows, models: Numbers, apart: int) -> Floats:
    """Covariances (m, r_a, r_b) of rows of models with rows of models apart.

    Products of image coordinates that both use directly are left out; ``same_images`` gives them.
    """
    other, count = models + apart - b.begin, len(models)
    models = models - a.begin
    total = np.zeros((count, a.by_component.shape[1], b.by_component.shape[1]))
    for first, second, low in (
        (a.whole[models], b.by_component[other], apart + REACH),
        (a.by_component[models], b.images[other], apart - REACH),
    ):
        skip_first, skip_second = max(low, 0), max(-low, 0)
        length = min(first.shape[2] - skip_first, second.shape[2] - skip_second)
        if length > 0:
            left = first[:, :, skip_first : skip_first + length].reshape(count, total.shape[1], -1)
            right = second[:, :, skip_second : skip_second + length].reshape(count, total.shape[2], -1)
            total += left @ right.transpose(0, 2, 1)
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

    # diagonal, beside: (g, b, b): blocks on the diagonal and to the right of them
    diagonal: Floats
    beside: Floats

    def add(self, row: tuple[Numbers, Numbers], column: tuple[Numbers, Numbers], values: Floats, *, both: bool) -> None:
        """Add values (k,) at rows and columns given by block and position.

        With ``both`` each value stands at its mirrored place too; otherwise the mirrored values are given themselves.
        """
        height = self.diagonal.shape[1]
        inside = row[1] * height + column[1]
        mirrored = column[1] * height + row[1]
        same, right, left = (np.flatnonzero(column[0] == row[0] + apart) for apart in (0, 1, -1))
        block = row[0] * height**2
        # flat places: three indices take ten times as long
        np.add.at(self.diagonal.reshape(-1), (block + inside)[same], values[same])
        np.add.at(self.beside.reshape(-1), (block + inside)[right], values[right])
        if both:
            np.add.at(self.diagonal.reshape(-1), (block + mirrored)[same], values[same])
            np.add.at(self.beside.reshape(-1), (column[0] * height**2 + mirrored)[left], values[left])


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


def system(errors: StripErrors, wanted: Conditions, factor: float) -> System:
    """Build, eliminate and solve K = [Q A; A^T 0], Q = H H^T + noise / factor (eq. 7).

    ``factor`` is the variance factor of the image coordinates.
    """
    rows = wanted.rows
    slots = max(rows.by_component.shape[1], errors.points.by_component.shape[1], REACH)
    layout = SystemLayout.of(rows.first, errors.models, min(slots, errors.models))
    padded = PaddedRows.of(errors, rows, slots, range(errors.models))
    shape = (layout.blocks, layout.height, layout.height)
    matrix = BlockMatrix(np.zeros(shape), np.zeros(shape))
    _add_covariances(matrix, layout, padded, rows)
    _add_design(matrix, layout, wanted)
    matrix.diagonal[layout.block, layout.position, layout.position] += wanted.noise / factor
    blocks, places = layout.empty()
    matrix.diagonal[blocks, places, places] = 1.0
    factors = block_tridiagonal.eliminate(matrix.diagonal, matrix.beside)
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


def _add_covariances(matrix: BlockMatrix, layout: SystemLayout, padded: PaddedRows, rows: ErrorRows) -> None:
    """Add Q, the covariances of the conditions."""
    models = len(layout.start)
    number = np.full((models, padded.by_component.shape[1]), -1)
    number[rows.first, layout.rank] = np.arange(len(layout.rank))

    def places(conditions: Numbers) -> tuple[Numbers, Numbers]:
        return layout.block[conditions], layout.position[conditions]

    for apart in range(min(layout.width, models - 1) + 1):
        model = np.arange(models - apart)
        values = products(padded, padded, model, apart)
        first, second = number[model], number[model + apart]
        m, i, j = np.nonzero((first[:, :, None] >= 0) & (second[:, None, :] >= 0))
        matrix.add(places(first[m, i]), places(second[m, j]), values[m, i, j], both=apart > 0)
    shared = same_images(rows, rows)  # every pair in both orders
    matrix.add(places(shared.first), places(shared.second), shared.value[:, 0, 0], both=False)


def _add_design(matrix: BlockMatrix, layout: SystemLayout, wanted: Conditions) -> None:
    """Add A: the unknowns of each condition's own model, and of the next one."""
    first = wanted.rows.first
    linked = np.flatnonzero(np.abs(wanted.following).sum(axis=1) > 0)
    for condition, model, values in (
        (np.arange(len(first)), first, wanted.rows.by_similarity[:, 0]),
        (linked, first[linked] + 1, wanted.following[linked]),
    ):
        for column in range(SIMILARITY_PARAMETERS):
            row = layout.block[condition], layout.position[condition]
            target = model // layout.width, layout.unknown[model] + column
            matrix.add(row, target, values[:, column], both=True)
