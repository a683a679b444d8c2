"""The strip adjusted with its own covariance: misclosures go to every point by least-squares prediction.

No polynomial is chosen. The similarities of all models are unknowns; the steps between them, the control and the
distances of the pass points from the common centres are conditions, whose covariances are exact products of their rows
by the image coordinates. Written model by model the system is banded and its cost grows with the length of the strip.

Source: derived; see docs/precision.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation import block_tridiagonal
from photostrip.triangulation.precision import local_covariances, own_with_units
from photostrip.triangulation.strip_conditions import CONTROL, Conditions, Local
from photostrip.triangulation.strip_errors import PARAMETERS, REACH, SPAN, UNITS, Rows, StripErrors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

MODELS = 64  # models whose points are worked on at a time


@dataclass(frozen=True, eq=False)
class Predicted:
    """Errors of things, as the adjustment finds them.

    Parameters
    ----------
    error : ndarray, shape (n, d)
        To be subtracted.
    covariance : ndarray, shape (n, d, d)
        Of what is left, for a variance factor of 1.
    """

    error: Floats
    covariance: Floats


@dataclass(frozen=True, eq=False)
class Tested:
    """What the adjustment says about itself, in the order of the control coordinates.

    Parameters
    ----------
    squares : float
        Weighted sum of squares of all misclosures.
    redundancy : int
        Its expectation.
    normalised : ndarray, shape (w,)
        Test value of each control coordinate, standard normal when it is right; NaN where nothing checks it.
    size : ndarray, shape (w,)
        Error that would explain it, metres.
    distances : int
        Distances of pass points that took part.
    """

    squares: float
    redundancy: int
    normalised: Floats
    size: Floats
    distances: int


@dataclass(frozen=True, eq=False)
class _Padded:
    """Rows with d = 1 model by model, empty places 0.

    Parameters
    ----------
    core : ndarray, shape (p, r, s, 6)
        Coefficients of units.
    own : ndarray, shape (p, r, s + 4, 6)
        Covariances of their own image coordinates with units.
    whole : ndarray, shape (p, r, s + 4, 6)
        Covariances of the whole rows, without similarities, with units.
    """

    core: Floats
    own: Floats
    whole: Floats


@dataclass(frozen=True, eq=False)
class System:
    """The banded system: where everything stands, and its factors.

    Parameters
    ----------
    width : int
        Models in a block.
    block, position : ndarray of int, shape (n,)
        Block of each condition, and its place in it.
    start : ndarray of int, shape (p,)
        Place of the first condition of each model in its block.
    unknown : ndarray of int, shape (p,)
        Place of the first unknown of each model in its block.
    factors : Factors
        The eliminated system.
    solution : ndarray, shape (g, b)
        Correlates of the conditions and unknowns.
    padded : _Padded
        The conditions model by model.
    """

    width: int
    block: Numbers
    position: Numbers
    start: Numbers
    unknown: Numbers
    factors: block_tridiagonal.Factors
    solution: Floats
    padded: _Padded


def _pad(errors: StripErrors, rows: Rows, rank: Numbers, slots: int, places: int) -> _Padded:
    """Put rows (d = 1) into their models; more slots where others reach farther."""
    models = errors.models
    core = np.zeros((models, places, slots, UNITS))
    own = np.zeros((models, places, slots + 2 * REACH, UNITS))
    have = rows.core.shape[1]
    core[rows.first, rank, :have] = rows.core[:, :, 0]
    own[rows.first, rank, : have + 2 * REACH] = own_with_units(errors, rows)[:, :, 0]
    return _Padded(core, own, own + _with_units(errors.covariances, core))


def _with_units(covariances: Floats, core: Floats) -> Floats:
    """Covariances of sums of units with the units from two models before to two after."""
    models, places, slots, _ = core.shape
    result = np.zeros((models, places, slots + 2 * REACH, UNITS))
    for slot in range(slots):
        for apart in range(-REACH, REACH + 1):
            low = max(0, -apart - slot)
            mine = np.arange(low, models - max(slot + max(apart, 0), 0))
            if not len(mine):
                continue
            at = mine + slot + min(apart, 0)
            mixed = covariances[at, abs(apart)]
            mixed = mixed if apart >= 0 else mixed.transpose(0, 2, 1)
            result[mine, :, slot + apart + REACH] += core[mine, :, slot] @ mixed
    return result


def _products(a: _Padded, b: _Padded, models: Numbers, apart: int) -> Floats:
    """Covariances of rows of models with rows of models apart, but for image coordinates both use by themselves."""
    other = models + apart
    slots_a, slots_b = a.core.shape[2], b.core.shape[2]
    total = np.zeros((len(models), a.core.shape[1], b.core.shape[1]))
    for first, second, low in (
        (a.whole[models], b.core[other], apart + REACH),
        (a.core[models], b.own[other], apart - REACH),
    ):
        here, there = max(low, 0), max(-low, 0)
        length = min(first.shape[2] - here, second.shape[2] - there)
        if length > 0:
            left = first[:, :, here : here + length].reshape(len(models), slots_a and first.shape[1], -1)
            right = second[:, :, there : there + length].reshape(len(models), slots_b and second.shape[1], -1)
            total += left @ right.transpose(0, 2, 1)
    return total


def system(errors: StripErrors, wanted: Conditions, local: Local, factor: float) -> System:
    """Build and eliminate the system of all conditions and unknowns.

    Parameters
    ----------
    errors : StripErrors
        The formed strip.
    wanted : Conditions
        Conditions, model by model.
    local : Local
        Unknowns of the models.
    factor : float
        Variance factor of the image coordinates.

    Returns
    -------
    System
        The solution.
    """
    del local
    models, rows = errors.models, wanted.rows
    slots = max(rows.core.shape[1], errors.points.core.shape[1])
    width = min(max(REACH, slots), models)
    counts = np.bincount(rows.first, minlength=models)
    before = np.concatenate([[0], np.cumsum(counts)])
    rank = np.arange(len(rows.first)) - before[rows.first]
    block_of = np.arange(models) // width
    sizes = counts + PARAMETERS
    ends = np.cumsum(sizes) - sizes
    start = ends - ends[np.arange(models) // width * width]
    unknown = start + counts
    height = int((unknown + PARAMETERS).max())
    padded = _pad(errors, rows, rank, slots, max(int(counts.max()), 1))
    block, position = block_of[rows.first], start[rows.first] + rank
    number = np.full((models, padded.core.shape[1]), -1)
    number[rows.first, rank] = np.arange(len(rank))
    blocks = int(block_of[-1]) + 1
    diagonal, beside = np.zeros((blocks, height, height)), np.zeros((blocks, height, height))
    fill = _Filler(diagonal, beside)
    for apart in range(min(width, models - 1) + 1):
        mine = np.arange(models - apart)
        values = _products(padded, padded, mine, apart)
        m, i, j = np.nonzero((number[mine][:, :, None] >= 0) & (number[mine + apart][:, None, :] >= 0))
        first, second = number[mine][m, i], number[mine + apart][m, j]
        fill.add(block[first], position[first], block[second], position[second], values[m, i, j], once=apart == 0)
    for first, second, value in _same_images(rows, rows):
        keep = (rows.first[first] < rows.first[second]) | (rows.first[first] == rows.first[second])
        first, second, value = first[keep], second[keep], value[keep, 0, 0]
        same = rows.first[first] == rows.first[second]
        for part, once in ((same, True), (~same, False)):
            a, b = first[part], second[part]
            fill.add(block[a], position[a], block[b], position[b], value[part], once=once)
    diagonal[block, position, position] += wanted.noise / factor
    everyone = np.arange(len(block))
    for column in range(PARAMETERS):
        at = unknown[rows.first] + column
        fill.add(block, position, block, at, rows.frame[:, 0, column], once=False)
        linked = everyone[np.abs(wanted.following).sum(axis=1) > 0]
        target = rows.first[linked] + 1
        there = unknown[target] + column
        fill.add(block[linked], position[linked], block_of[target], there, wanted.following[linked, column], once=False)
    used = np.zeros((blocks, height), bool)
    used[block, position] = True
    used[np.repeat(block_of, PARAMETERS), (unknown[:, None] + np.arange(PARAMETERS)).ravel()] = True
    empty = np.nonzero(~used)
    diagonal[empty[0], empty[1], empty[1]] = 1.0
    right = np.zeros((blocks, height))
    right[block, position] = wanted.value
    factors = block_tridiagonal.eliminate(diagonal, beside)
    return System(width, block, position, start, unknown, factors, factors.solve(right), padded)


@dataclass(frozen=True, eq=False)
class _Filler:
    """Puts values into the blocks of a symmetric matrix."""

    diagonal: Floats
    beside: Floats

    def add(
        self, block_a: Numbers, a: Numbers, block_b: Numbers, b: Numbers, values: Floats, *, once: bool
    ) -> None:
        """Add values at (a, b), and at (b, a) unless both orders are given."""
        same = block_a == block_b
        np.add.at(self.diagonal, (block_a[same], a[same], b[same]), values[same])
        if not once:
            np.add.at(self.diagonal, (block_a[same], b[same], a[same]), values[same])
        upper = block_b == block_a + 1
        np.add.at(self.beside, (block_a[upper], a[upper], b[upper]), values[upper])
        lower = block_b == block_a - 1
        np.add.at(self.beside, (block_b[lower], b[lower], a[lower]), values[lower])


def _same_images(a: Rows, b: Rows) -> Sequence[tuple[Numbers, Numbers, Floats]]:
    """Products of image points that two sets of rows use by themselves: rows of both and values (n, d_a, d_b)."""
    order = np.argsort(b.image, kind="stable")
    image = b.image[order]
    low, high = np.searchsorted(image, a.image), np.searchsorted(image, a.image, side="right")
    counts = high - low
    mine = np.repeat(np.arange(len(a.image)), counts)
    theirs = order[np.arange(len(mine)) - np.repeat(np.cumsum(counts) - counts, counts) + low[mine]]
    return [(a.item[mine], b.item[theirs], a.own[mine] @ b.own[theirs].transpose(0, 2, 1))]


# ----------------------------------------------------------------------------------------------------- prediction


def predict(
    errors: StripErrors, wanted: Conditions, local: Local, found: System, things: Sequence[Rows]
) -> tuple[list[Predicted], Floats]:
    """Predict the errors of things, and say how well they are known.

    Parameters
    ----------
    errors : StripErrors
        The formed strip.
    wanted : Conditions
        The conditions.
    local : Local
        Unknowns of the models.
    found : System
        The solved system.
    things : sequence of Rows
        Points, photos.

    Returns
    -------
    predicted : list of Predicted
        For each of the things.
    cofactors : ndarray, shape (n,)
        Of the correlates of the conditions.
    """
    jobs = [_Job.of(errors, wanted, local, found, rows) for rows in things]
    cofactors = np.zeros(len(found.block))
    order = np.argsort(found.block, kind="stable")
    ends = np.searchsorted(found.block[order], np.arange(len(found.solution) + 1))
    window: list[tuple[Floats, Floats, Floats]] = []
    height = found.solution.shape[1]
    zero = np.zeros((height, height))
    for number, blocks in found.factors.inverse():
        rows = order[ends[number] : ends[number + 1]]
        cofactors[rows] = blocks[0][found.position[rows], found.position[rows]]
        window = [blocks, *window[:2]]
        if number + 1 < len(found.solution):
            _visit(jobs, number + 1, window, zero)
    _visit(jobs, 0, [(zero, zero, zero), *window[:2]], zero)
    return [job.predicted(errors) for job in jobs], cofactors


def _visit(jobs: Sequence[_Job], number: int, window: Sequence[tuple[Floats, Floats, Floats]], zero: Floats) -> None:
    """Finish the things whose first model lies in a block, with the inverse around it."""
    rows = [*window, (zero, zero, zero)][:3]
    (before, before_own, before_after), (own, own_after, _), (after, _, _) = rows
    around = np.block(
        [
            [before, before_own, before_after],
            [before_own.T, own, own_after],
            [before_after.T, own_after.T, after],
        ]
    )
    for job in jobs:
        job.visit(number, around)


@dataclass(eq=False)
class _Job:
    """Things to be predicted, block by block."""

    rows: Rows
    found: System
    wanted: Conditions
    padded: _Padded
    frame: Floats  # (n, d, 7), by the unknowns of the first model
    rank: Numbers
    images: tuple[Numbers, Numbers, Floats]
    order: Numbers
    error: Floats
    quadratic: Floats

    @classmethod
    def of(cls, errors: StripErrors, wanted: Conditions, local: Local, found: System, rows: Rows) -> _Job:
        """Prepare things."""
        n, size = rows.frame.shape[:2]
        flat = Rows(
            np.repeat(rows.first, size),
            rows.frame.reshape(n * size, 1, PARAMETERS),
            rows.core.transpose(0, 2, 1, 3).reshape(n * size, rows.core.shape[1], 1, UNITS),
            np.zeros(0, np.intp),
            np.zeros(0, np.intp),
            np.zeros((0, 1, 2)),
        )
        order = np.argsort(rows.first, kind="stable")
        counts = np.bincount(rows.first, minlength=errors.models)
        rank = np.empty(n, np.intp)
        rank[order] = np.arange(n) - (np.cumsum(counts) - counts)[rows.first[order]]
        slots = found.padded.core.shape[2]
        models, places = errors.models, int(counts.max()) * size
        core = np.zeros((models, places, slots, UNITS))
        own = np.zeros((models, places, slots + 2 * REACH, UNITS))
        at = (rank[:, None] * size + np.arange(size)).ravel()
        core[flat.first, at, : rows.core.shape[1]] = flat.core[:, :, 0]
        with_units = own_with_units(errors, rows)
        with_units = with_units.transpose(0, 2, 1, 3).reshape(n * size, with_units.shape[1], UNITS)
        own[flat.first, at, : with_units.shape[1]] = with_units
        padded = _Padded(core, own, own + _with_units(errors.covariances, core))
        (images,) = _same_images(rows, wanted.rows)
        by_block = np.argsort(rows.first[images[0]] // found.width, kind="stable")
        images = (images[0][by_block], images[1][by_block], images[2][by_block])
        frame = rows.frame @ local.to_common[rows.first]
        return cls(
            rows,
            found,
            wanted,
            padded,
            frame,
            rank,
            images,
            order,
            np.zeros((n, size)),
            np.zeros((n, size, size)),
        )

    def visit(self, number: int, around: Floats) -> None:
        """Finish the things of one block, given the inverse of it and its neighbours."""
        found, size = self.found, self.rows.frame.shape[1]
        height = found.solution.shape[1]
        first = self.rows.first[self.order]
        models = len(found.start)
        low, high = np.searchsorted(first, [number * found.width, (number + 1) * found.width])
        mine = self.order[low:high]
        if not len(mine):
            return
        mixed = np.zeros((3 * height, len(mine) * size))
        column = low
        for model in range(number * found.width, min((number + 1) * found.width, models)):
            count = int(np.searchsorted(first, model + 1)) - column
            columns = slice((column - low) * size, (column - low + count) * size)
            here = np.array([model])
            for apart in range(-found.width, found.width + 1):
                other = model + apart
                if not count or not 0 <= other < models:
                    continue
                values = _products(self.padded, found.padded, here, apart)[0]
                rows = int(found.unknown[other] - found.start[other])
                top = (other // found.width - number + 1) * height + found.start[other]
                mixed[top : top + rows, columns] = values[: count * size, :rows].T
            top = height + found.unknown[model]
            mixed[top : top + PARAMETERS, columns] = self.frame[self.order[column : column + count]].reshape(
                -1, PARAMETERS
            ).T
            column += count
        place = np.full(len(self.rows.first), -1)
        place[mine] = np.arange(len(mine))
        thing, condition, value = self.images
        from_, to = np.searchsorted(self.rows.first[thing] // found.width, [number, number + 1])
        thing, condition, value = thing[from_:to], condition[from_:to], value[from_:to]
        top = (found.block[condition] - number + 1) * height + found.position[condition]
        for axis in range(size):
            np.add.at(mixed, (top, place[thing] * size + axis), value[:, axis, 0])
        padded = np.concatenate([np.zeros((1, height)), found.solution, np.zeros((1, height))])
        self.error[mine] = (padded[number : number + 3].ravel() @ mixed).reshape(-1, size)
        half = (around @ mixed).reshape(3 * height, len(mine), size)
        self.quadratic[mine] = np.einsum("knd,kne->nde", mixed.reshape(3 * height, len(mine), size), half)

    def predicted(self, errors: StripErrors) -> Predicted:
        """Give what was found."""
        return Predicted(self.error, local_covariances(errors, self.rows, own_with_units(errors, self.rows)) - self.quadratic)


def tested(wanted: Conditions, found: System, cofactors: Floats, count: int) -> Tested:
    """Test the adjustment as a whole and every control coordinate.

    Parameters
    ----------
    wanted : Conditions
        The conditions.
    found : System
        The solved system.
    cofactors : ndarray, shape (n,)
        Of the correlates.
    count : int
        Number of control coordinates.

    Returns
    -------
    Tested
        Test values.
    """
    correlates = found.solution[found.block, found.position]
    rows = np.flatnonzero(wanted.kind == CONTROL)
    normalised, size = np.full(count, np.nan), np.full(count, np.nan)
    checked = rows[cofactors[rows] * (wanted.noise[rows] + 1e-12) > 1e-6]  # noqa: PLR2004
    normalised[wanted.source[checked]] = correlates[checked] / np.sqrt(cofactors[checked])
    size[wanted.source[checked]] = correlates[checked] / cofactors[checked]
    distances = int((wanted.kind == 2).sum())  # noqa: PLR2004
    redundancy = count - PARAMETERS + distances
    return Tested(float(wanted.value @ correlates), redundancy, normalised, size, distances)


__all__ = ["SPAN", "Predicted", "System", "Tested", "predict", "system", "tested"]
