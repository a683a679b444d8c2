"""The banded system of a strip: conditions and unknowns model by model, their covariances, and its elimination.

Models are taken in blocks of as many as meet in one condition, so that only neighbouring blocks have anything in
common. Within a block the conditions of a model come before its unknowns: in this order every pivot is regular.

Source: derived; see docs/precision.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.covariance_adjustment import block_tridiagonal
from photostrip.triangulation.error_propagation.covariances import images_with_components
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, REACH, ErrorRows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.covariance_adjustment.conditions import Conditions
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Padded:
    """ErrorRows with d = 1 model by model, empty places 0."""

    core: Floats  # (p, r, s, 6): coefficients of units
    own: Floats  # (p, r, s + 4, 6): covariances of their own image coordinates with units
    whole: Floats  # (p, r, s + 4, 6): covariances of the whole rows, without similarities, with units


def pad(errors: StripErrors, rows: ErrorRows, rank: Numbers, slots: int) -> Padded:
    """Put rows into places of their first models; a row of d coordinates takes d places.

    Parameters
    ----------
    rank : ndarray of int, shape (n,)
        Place of each among the things of its model.
    slots : int
        Models over which anything reaches.
    """
    models, size, have = errors.models, rows.by_similarity.shape[1], rows.by_component.shape[1]
    places = max(int(rank.max(initial=0)) + 1, 1) * size
    core = np.zeros((models, places, slots, COMPONENTS))
    own = np.zeros((models, places, slots + 2 * REACH, COMPONENTS))
    at = rank[:, None] * size + np.arange(size)
    core[rows.first[:, None], at, :have] = rows.by_component.transpose(0, 2, 1, 3)
    own[rows.first[:, None], at, : have + 2 * REACH] = images_with_components(errors, rows).transpose(0, 2, 1, 3)
    return Padded(core, own, own + _with_units(errors.component_covariances, core))


def _with_units(covariances: Floats, core: Floats) -> Floats:
    """Covariances of sums of units with the units from two models before to two after."""
    models, places, slots, _ = core.shape
    result = np.zeros((models, places, slots + 2 * REACH, COMPONENTS))
    for slot in range(slots):
        for apart in range(-REACH, REACH + 1):
            mine = np.arange(max(0, -apart - slot), max(models - slot - max(apart, 0), 0))
            if len(mine):
                mixed = covariances[mine + slot + min(apart, 0), abs(apart)]
                mixed = mixed if apart >= 0 else mixed.transpose(0, 2, 1)
                result[mine, :, slot + apart + REACH] += core[mine, :, slot] @ mixed
    return result


def products(a: Padded, b: Padded, models: Numbers, apart: int) -> Floats:
    """Covariances of rows of models with rows of models apart, but for image coordinates both use by themselves.

    Parameters
    ----------
    models : ndarray of int, shape (m,)
        Models of the first.
    apart : int
        Models from there to those of the second.

    Returns
    -------
    ndarray, shape (m, r_a, r_b)
        Covariances.
    """
    other, count = models + apart, len(models)
    total = np.zeros((count, a.core.shape[1], b.core.shape[1]))
    for first, second, low in (
        (a.whole[models], b.core[other], apart + REACH),
        (a.core[models], b.own[other], apart - REACH),
    ):
        here, there = max(low, 0), max(-low, 0)
        length = min(first.shape[2] - here, second.shape[2] - there)
        if length > 0:
            left = first[:, :, here : here + length].reshape(count, total.shape[1], -1)
            right = second[:, :, there : there + length].reshape(count, total.shape[2], -1)
            total += left @ right.transpose(0, 2, 1)
    return total


def same_images(a: ErrorRows, b: ErrorRows) -> tuple[Numbers, Numbers, Floats]:
    """Products of image points that two sets of rows use by themselves.

    Parameters
    ----------
    a, b : ErrorRows
        ErrorRows with d and e coordinates.

    Returns
    -------
    things : ndarray of int, shape (k,)
        Things of the first.
    others : ndarray of int, shape (k,)
        Things of the second.
    values : ndarray, shape (k, d, e)
        Their products.
    """
    order = np.argsort(b.image, kind="stable")
    image = b.image[order]
    low, high = np.searchsorted(image, a.image), np.searchsorted(image, a.image, side="right")
    counts = high - low
    mine = np.repeat(np.arange(len(a.image)), counts)
    theirs = order[np.arange(len(mine)) - np.repeat(np.cumsum(counts) - counts, counts) + low[mine]]
    return a.item[mine], b.item[theirs], a.by_image[mine] @ b.by_image[theirs].transpose(0, 2, 1)


# --------------------------------------------------------------------------------------------------------- layout


@dataclass(frozen=True, eq=False)
class Layout:
    """Where conditions and unknowns stand."""

    width: int
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
    def of(cls, first: Numbers, models: int, width: int) -> Layout:
        """Lay out conditions that are ordered by their first models."""
        counts = np.bincount(first, minlength=models)
        rank = np.arange(len(first)) - (np.cumsum(counts) - counts)[first]
        begins = np.cumsum(counts + SIMILARITY_PARAMETERS) - counts - SIMILARITY_PARAMETERS
        numbers = np.arange(models)
        start = begins - begins[numbers // width * width]
        unknown = start + counts
        height = int(unknown.max()) + SIMILARITY_PARAMETERS
        blocks = (models - 1) // width + 1
        return cls(width, blocks, height, rank, first // width, start[first] + rank, start, unknown)

    def empty(self) -> tuple[Numbers, Numbers]:
        """Places that nothing takes."""
        used = np.zeros((self.blocks, self.height), bool)
        used[self.block, self.position] = True
        models = np.arange(len(self.start))
        used[(models // self.width)[:, None], self.unknown[:, None] + np.arange(SIMILARITY_PARAMETERS)] = True
        blocks, places = np.nonzero(~used)
        return blocks, places


@dataclass(frozen=True, eq=False)
class Matrix:
    """A symmetric matrix of blocks on and beside the diagonal."""

    # diagonal, beside: (g, b, b): blocks on the diagonal and to the right of them
    diagonal: Floats
    beside: Floats

    @classmethod
    def zero(cls, layout: Layout) -> Matrix:
        """Return an empty one."""
        shape = (layout.blocks, layout.height, layout.height)
        return cls(np.zeros(shape), np.zeros(shape))

    def add(self, row: tuple[Numbers, Numbers], column: tuple[Numbers, Numbers], values: Floats, *, both: bool) -> None:
        """Add values at places given by block and position.

        Parameters
        ----------
        row, column : tuple of ndarray of int
            Block and position of each value.
        values : ndarray, shape (k,)
            Values.
        both : bool
            Whether each value stands at its mirrored place too; otherwise the mirrored values are given themselves.
        """
        same = row[0] == column[0]
        block, i, j = row[0][same], row[1][same], column[1][same]
        np.add.at(self.diagonal, (block, i, j), values[same])
        if both:
            np.add.at(self.diagonal, (block, j, i), values[same])
        right, left = column[0] == row[0] + 1, column[0] == row[0] - 1
        np.add.at(self.beside, (row[0][right], row[1][right], column[1][right]), values[right])
        if both:
            np.add.at(self.beside, (column[0][left], column[1][left], row[1][left]), values[left])


@dataclass(frozen=True, eq=False)
class System:
    """The solved system."""

    layout: Layout  # where everything stands
    padded: Padded
    factors: block_tridiagonal.Factors
    solution: Floats  # (g, b): correlates of the conditions, and unknowns

    def solved_for(self, value: Floats) -> Floats:
        """Solve for other misclosures.

        Parameters
        ----------
        value : ndarray, shape (n,)
            Misclosures of all conditions, metres.

        Returns
        -------
        ndarray, shape (g, b)
            As ``solution``.
        """
        layout = self.layout
        right = np.zeros((layout.blocks, layout.height, 1))
        right[layout.block, layout.position, 0] = value
        return np.asarray(self.factors.solve(right)[:, :, 0], float)


def system(errors: StripErrors, wanted: Conditions, factor: float) -> System:
    """Build, eliminate and solve the system of all conditions and unknowns.

    Parameters
    ----------
    wanted : Conditions
        Conditions, model by model.
    factor : float
        Variance factor of the image coordinates.

    Notes
    -----
    K = [Q A; A^T 0] with Q = H H^T + noise / factor.
    """
    rows = wanted.rows
    slots = max(rows.by_component.shape[1], errors.points.by_component.shape[1], REACH)
    layout = Layout.of(rows.first, errors.models, min(slots, errors.models))
    padded = pad(errors, rows, layout.rank, slots)
    matrix = Matrix.zero(layout)
    _add_covariances(matrix, layout, padded, rows)
    _add_design(matrix, layout, wanted)
    matrix.diagonal[layout.block, layout.position, layout.position] += wanted.noise / factor
    blocks, places = layout.empty()
    matrix.diagonal[blocks, places, places] = 1.0
    factors = block_tridiagonal.eliminate(matrix.diagonal, matrix.beside)
    eliminated = System(layout, padded, factors, np.zeros((layout.blocks, layout.height)))
    return replace(eliminated, solution=eliminated.solved_for(wanted.value))


def _add_covariances(matrix: Matrix, layout: Layout, padded: Padded, rows: ErrorRows) -> None:
    """Add covariances of the conditions."""
    models = len(layout.start)
    number = np.full((models, padded.core.shape[1]), -1)
    number[rows.first, layout.rank] = np.arange(len(layout.rank))
    for apart in range(min(layout.width, models - 1) + 1):
        mine = np.arange(models - apart)
        values = products(padded, padded, mine, apart)
        here, there = number[mine], number[mine + apart]
        m, i, j = np.nonzero((here[:, :, None] >= 0) & (there[:, None, :] >= 0))
        first, second = here[m, i], there[m, j]
        places = [(layout.block[k], layout.position[k]) for k in (first, second)]
        matrix.add(places[0], places[1], values[m, i, j], both=apart > 0)
    first, second, shared = same_images(rows, rows)  # every pair in both orders
    places = [(layout.block[k], layout.position[k]) for k in (first, second)]
    matrix.add(places[0], places[1], shared[:, 0, 0], both=False)


def _add_design(matrix: Matrix, layout: Layout, wanted: Conditions) -> None:
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
