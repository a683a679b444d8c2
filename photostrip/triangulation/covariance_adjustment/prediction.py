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

from photostrip.distributions import gamma_cdf
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.statistics import normal_quantile
from photostrip.triangulation.covariance_adjustment.conditions import CONTROL, DISTANCE, Conditions, Local
from photostrip.triangulation.covariance_adjustment.system import Padded, System, pad, products, same_images
from photostrip.triangulation.error_propagation.covariances import images_with_components, local_covariances

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.triangulation.error_propagation.derivatives import ErrorRows
    from photostrip.triangulation.error_propagation.strip_errors import StripErrors

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

LEVEL = 0.03  # probability that any control coordinate of a sound strip is called doubtful
CHECKED = 1e-6  # part of a control coordinate's variance that the others must check


@dataclass(frozen=True, eq=False)
class Predicted:
    """Errors of things, as the adjustment finds them."""

    error: Floats  # (n, d): to be subtracted
    covariance: Floats  # (n, d, d): of what is left, for a variance factor of 1


@dataclass(frozen=True, eq=False)
class Tested:
    """What the adjustment says about itself, in the order of the control coordinates."""

    squares: float  # weighted sum of squares of all misclosures
    redundancy: int
    # (w,): test value of each control coordinate, standard normal when it is right; NaN where nothing checks it
    normalised: Floats
    size: Floats  # (w,): error of the given coordinate, given minus true, that would explain it, metres
    distances: int  # distances of pass points that took part

    @property
    def probability(self) -> float:
        """Probability of a larger sum of squares by chance; NaN without redundancy."""
        return 1 - gamma_cdf(self.squares / 2, self.redundancy / 2) if self.redundancy > 0 else float("nan")

    @property
    def limit(self) -> float:
        """Test value that the largest of all control coordinates exceeds by chance in 3 % of strips."""
        return normal_quantile(1 - LEVEL / (2 * max(len(self.normalised), 1)))

    @property
    def doubtful(self) -> Numbers:
        """Control coordinates beyond the limit, the worst first."""
        beyond = np.flatnonzero(np.abs(np.nan_to_num(self.normalised)) > self.limit)
        return beyond[np.argsort(-np.abs(self.normalised[beyond]), kind="stable")]


# ----------------------------------------------------------------------------------------------------- prediction


def predict(
    errors: StripErrors, wanted: Conditions, local: Local, found: System, things: Sequence[ErrorRows]
) -> tuple[list[Predicted], Floats]:
    """Predict the errors of things, and say how well they are known.

    Parameters
    ----------
    things : sequence of ErrorRows
        Points, photos.

    Returns
    -------
    cofactors : ndarray, shape (n,)
        Of the correlates of the conditions.
    """
    orders = [np.argsort(rows.first, kind="stable") for rows in things]
    jobs = [_Job.of(errors, wanted, local, found, rows.take(order)) for rows, order in zip(things, orders, strict=True)]
    layout = found.layout
    cofactors = np.zeros(len(layout.block))
    ends = np.searchsorted(layout.block, np.arange(layout.blocks + 1))
    zero = np.zeros((layout.height, layout.height))
    window = [(zero, zero, zero)] * 3
    for number, blocks in found.factors.inverse():
        position = layout.position[ends[number] : ends[number + 1]]
        cofactors[ends[number] : ends[number + 1]] = blocks[0][position, position]
        window = [blocks, *window[:2]]
        if number + 1 < layout.blocks:
            _visit(jobs, number + 1, window, found)
    _visit(jobs, 0, [(zero, zero, zero), *window[:2]], found)
    return [_predicted(errors, job, order) for job, order in zip(jobs, orders, strict=True)], cofactors


def _predicted(errors: StripErrors, job: _Job, order: Numbers) -> Predicted:
    """Return what was found, in the order in which the things were given."""
    covariance = local_covariances(errors, job.rows, images_with_components(errors, job.rows)) - job.quadratic
    back = np.argsort(order, kind="stable")
    return Predicted(job.error[back], covariance[back])


def _visit(jobs: Sequence[_Job], number: int, window: Sequence[tuple[Floats, Floats, Floats]], found: System) -> None:
    """Finish the things whose first model lies in a block, with the inverse around it."""
    (before, before_own, before_after), (own, own_after, _), (after, _, _) = window
    around = np.block(
        [
            [before, before_own, before_after],
            [before_own.T, own, own_after],
            [before_after.T, own_after.T, after],
        ]
    )
    for job in jobs:
        job.visit(number, around, found)


@dataclass(frozen=True, eq=False)
class _Job:
    """Things to be predicted, block by block; results are filled in."""

    rows: ErrorRows  # the things, ordered by their first models
    padded: Padded
    frame: Floats  # (n, d, 7): by the unknowns of the first model
    # things and conditions that use the same image points, and their products; ordered by things
    shared: tuple[Numbers, Numbers, Floats]
    # error, quadratic: (n, d) and (n, d, d): what is found
    error: Floats
    quadratic: Floats

    @classmethod
    def of(cls, errors: StripErrors, wanted: Conditions, local: Local, found: System, rows: ErrorRows) -> _Job:
        """Prepare things that are ordered by their first models."""
        n, size = rows.by_similarity.shape[:2]
        counts = np.bincount(rows.first, minlength=errors.models)
        rank = np.arange(n) - (np.cumsum(counts) - counts)[rows.first]
        padded = pad(errors, rows, rank, found.padded.core.shape[2])
        thing, condition, value = same_images(rows, wanted.rows)
        order = np.argsort(thing, kind="stable")
        return cls(
            rows,
            padded,
            rows.by_similarity @ local.to_common[rows.first],
            (thing[order], condition[order], value[order, :, 0]),
            np.zeros((n, size)),
            np.zeros((n, size, size)),
        )

    def columns(self, number: int, found: System) -> tuple[int, int, Floats]:
        """Covariances of the things of one block with the conditions around, and coefficients of their unknowns.

        Returns the first thing of the block, the first after it, and an array of three blocks of rows.
        """
        layout, size = found.layout, self.rows.by_similarity.shape[1]
        low, high = np.searchsorted(self.rows.first, [number * layout.width, (number + 1) * layout.width]).tolist()
        mixed = np.zeros((3, layout.height, (high - low) * size))
        if low < high:
            self._with_conditions(mixed, number, low, found)
            begin, end = np.searchsorted(self.shared[0], [low, high])
            thing, condition, value = (column[begin:end] for column in self.shared)
            block, position = layout.block[condition] - number + 1, layout.position[condition]
            columns = (thing - low)[:, None] * size + np.arange(size)
            np.add.at(mixed, (block[:, None], position[:, None], columns), value)
        return low, high, mixed

    def visit(self, number: int, around: Floats, found: System) -> None:
        """Finish the things of one block, given the inverse of it and its neighbours."""
        layout, size = found.layout, self.rows.by_similarity.shape[1]
        low, high, mixed = self.columns(number, found)
        if low == high:
            return
        inside = slice(max(number - 1, 0), number + 2)
        window = np.zeros((3, layout.height))
        window[inside.start - number + 1 :][: len(found.solution[inside])] = found.solution[inside]
        flat = mixed.reshape(3 * layout.height, -1)
        self.error[low:high] = (window.ravel() @ flat).reshape(-1, size)
        split = flat.reshape(len(flat), high - low, size).transpose(1, 2, 0)
        self.quadratic[low:high] = split @ (around @ flat).reshape(len(flat), high - low, size).transpose(1, 0, 2)

    def _with_conditions(self, mixed: Floats, number: int, low: int, found: System) -> None:
        """Fill in the covariances with conditions around, and the coefficients of the unknowns."""
        layout, size, models = found.layout, self.rows.by_similarity.shape[1], len(found.layout.start)
        mine = np.arange(number * layout.width, min((number + 1) * layout.width, models))
        ends = np.searchsorted(self.rows.first, [*mine, mine[-1] + 1])
        for apart in range(-layout.width, layout.width + 1):
            inside = (mine + apart >= 0) & (mine + apart < models)
            if not inside.any():
                continue
            values = products(self.padded, found.padded, mine[inside], apart)
            for place, value in zip(np.flatnonzero(inside).tolist(), values, strict=True):
                other, count = mine[place] + apart, (ends[place + 1] - ends[place]) * size
                top, rows = layout.start[other], layout.unknown[other] - layout.start[other]
                left = (ends[place] - low) * size
                mixed[other // layout.width - number + 1, top : top + rows, left : left + count] = value[
                    :count, :rows
                ].T
        for place, model in enumerate(mine.tolist()):
            top, left, right = layout.unknown[model], (ends[place] - low) * size, (ends[place + 1] - low) * size
            frame = self.frame[ends[place] : ends[place + 1]].reshape(-1, SIMILARITY_PARAMETERS)
            mixed[1, top : top + SIMILARITY_PARAMETERS, left:right] = frame.T


def influence(errors: StripErrors, wanted: Conditions, local: Local, found: System, rows: ErrorRows) -> Floats:
    """Predicted errors of a few things by the misclosures of all conditions.

    Parameters
    ----------
    rows : ErrorRows
        The things, d = 1, in any order.

    Returns
    -------
    ndarray, shape (n, c)
        One row for each thing.
    """
    order = np.argsort(rows.first, kind="stable")
    job = _Job.of(errors, wanted, local, found, rows.take(order))
    layout = found.layout
    right = np.zeros((layout.blocks + 2, layout.height, len(order)))
    for number in range(layout.blocks):
        low, high, mixed = job.columns(number, found)
        right[number : number + 3, :, order[low:high]] = mixed
    solved = found.factors.solve(right[1:-1])
    return np.asarray(solved[layout.block, layout.position].T, float)


def by_conditions(
    errors: StripErrors, wanted: Conditions, local: Local, found: System, rows: ErrorRows, chosen: Numbers
) -> Floats:
    """Predicted errors of many things by the misclosures of some conditions.

    Parameters
    ----------
    rows : ErrorRows
        n things of d coordinates, in any order.
    chosen : ndarray of int, shape (c,)
        The conditions that are asked about.

    Returns
    -------
    ndarray, shape (n, d, c)
        What is subtracted from each thing, by each misclosure.
    """
    layout, size = found.layout, rows.by_similarity.shape[1]
    right = np.zeros((layout.blocks, layout.height, len(chosen)))
    right[layout.block[chosen], layout.position[chosen], np.arange(len(chosen))] = 1.0
    solved = np.zeros((layout.blocks + 2, layout.height, len(chosen)))
    solved[1:-1] = found.factors.solve(right)
    order = np.argsort(rows.first, kind="stable")
    job = _Job.of(errors, wanted, local, found, rows.take(order))
    result = np.zeros((len(order), size, len(chosen)))
    for number in range(layout.blocks):
        low, high, mixed = job.columns(number, found)
        if low < high:
            window = solved[number : number + 3].reshape(3 * layout.height, -1)
            result[order[low:high]] = (mixed.reshape(len(window), -1).T @ window).reshape(high - low, size, -1)
    return result


def tested(wanted: Conditions, found: System, cofactors: Floats, count: int) -> Tested:
    """Test the adjustment as a whole and every control coordinate.

    Parameters
    ----------
    cofactors : ndarray, shape (n,)
        Of the correlates.
    """
    correlates = found.solution[found.layout.block, found.layout.position]
    rows = np.flatnonzero(wanted.kind == CONTROL)
    normalised, size = np.full(count, np.nan), np.full(count, np.nan)
    checked = rows[cofactors[rows] * (wanted.noise[rows] + 1e-12) > CHECKED]
    normalised[wanted.source[checked]] = correlates[checked] / np.sqrt(cofactors[checked])
    size[wanted.source[checked]] = -correlates[checked] / cofactors[checked]  # given minus true
    distances = int((wanted.kind == DISTANCE).sum())
    redundancy = count - SIMILARITY_PARAMETERS + distances
    return Tested(float(wanted.value @ correlates), redundancy, normalised, size, distances)
