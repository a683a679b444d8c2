"""The banded system of a strip: what models and points say of its unknowns, block by block, and its elimination.

Conditions of a point share its image points and nothing else with other conditions but error components and unknowns.
So they are eliminated first, point by point, whatever their number; what is left are the unknowns of the models and of
an anchor for each block, with the correlates of what defines them. A block takes as many models as a point reaches
over, so that only neighbouring blocks have anything in common.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Self

import numpy as np

from photostrip.arrays import Floats, Numbers, distinct, pieces, runs_of
from photostrip.frozen import dataclass, replace
from photostrip.geometry.similarity import SIMILARITY_PARAMETERS
from photostrip.triangulation.covariance_adjustment import block_tridiagonal
from photostrip.triangulation.covariance_adjustment.conditions import Conditions
from photostrip.triangulation.covariance_adjustment.similarities import PhotoSimilarities
from photostrip.triangulation.covariance_adjustment.strip_rows.derivatives import (
    COMPONENTS,
    SHARING,
    SPAN,
    ErrorRows,
    ranges,
    same_images,
)
from photostrip.triangulation.covariance_adjustment.strip_rows.strip_errors import StripErrors
from photostrip.triangulation.covariance_adjustment.strip_rows.sums import NearImages
from photostrip.triangulation.covariance_adjustment.windows import (
    ANCHOR,
    COMPONENT,
    CORRELATE,
    LINK,
    MODEL,
    MODELS,
    Blocks,
    windows,
)

AT_A_TIME = 1024  # rows whose windows are made together


@dataclass(frozen=True, eq=False)
class PointRoots:
    """Own covariances D = E E^T + noise of the conditions of each point, as L^-1 with D = L L^T."""

    start: Numbers  # (n,): first condition of the point of each condition
    root: Floats  # (n, k): each row of L^-1, from that condition on

    @classmethod
    def of(cls, rows: ErrorRows, point: Numbers, noise: Floats) -> Self:
        """Factorise them, conditions of a point one after the other.

        Raises numpy.linalg.LinAlgError where two of a point's conditions are the same.
        """
        start = np.flatnonzero(np.diff(point, prepend=-1))
        counts = np.diff(np.append(start, len(point)))
        result = cls(np.repeat(start, counts), np.zeros((len(point), int(counts.max(initial=0)))))
        for size in distinct(counts).tolist():
            of_size = start[counts == size]
            for piece in pieces(len(of_size), max(AT_A_TIME // size, 1)):
                some = of_size[piece, None] + np.arange(size)
                own = np.zeros((len(some), size, size))
                chosen = rows.take(some.ravel())
                shared = same_images(chosen, chosen)  # every pair in both orders
                of_point, place = np.divmod(shared.first, size)
                np.add.at(own, (of_point, place, shared.second % size), shared.value[:, 0, 0])
                own[:, np.arange(size), np.arange(size)] += noise[some]
                result.root[some, :size] = np.linalg.inv(np.linalg.cholesky(own))
        return result

    def pieces(self) -> Iterator[slice]:
        """Cut the conditions into pieces of bounded memory, points left whole."""
        ends = np.append(np.flatnonzero(np.diff(self.start, prepend=-1)), len(self.start))
        while len(ends) > 1:
            last = max(int(np.searchsorted(ends, ends[0] + AT_A_TIME, side="right")) - 1, 1)
            yield slice(int(ends[0]), int(ends[last]))
            ends = ends[last:]

    def of_points(self, starts: Numbers) -> Numbers:
        """All conditions of points, given by the first of each."""
        return ranges(starts, np.searchsorted(self.start, starts, side="right"))[1]

    def take(self, some: slice | Numbers) -> PointRoots:
        """Those of some conditions, of whole points."""
        place = (np.arange(len(self.start)) - self.start)[some]
        return PointRoots(np.arange(len(place)) - place, self.root[some])

    def whitened(self, values: Floats) -> Floats:
        """Multiply values (n, ...) of the conditions by L^-1."""
        return self._multiplied(values, transposed=False)

    def weighted(self, values: Floats) -> Floats:
        """Multiply whitened values (n, ...) by L^-T."""
        return self._multiplied(values, transposed=True)

    def _multiplied(self, values: Floats, *, transposed: bool) -> Floats:
        """Multiply by the diagonal, and by what stands before it in rows of points with several conditions."""
        every, tail = np.arange(len(self.start)), [1] * (values.ndim - 1)
        place = every - self.start
        result: Floats = values * self.root[every, place].reshape(-1, *tail)
        for row in range(1, self.root.shape[1]):
            here = np.flatnonzero(place == row)
            for column in range(row):
                there, factor = self.start[here] + column, self.root[here, column].reshape(-1, *tail)
                if transposed:
                    result[there] += factor * values[here]
                else:
                    result[here] += factor * values[there]
        return result


@dataclass(frozen=True, eq=False)
class System:
    """An eliminated and solved system."""

    errors: StripErrors
    conditions: Conditions
    components: Floats  # (p, 6): what the error components are known to be already
    roots: PointRoots
    blocks: Blocks
    factors: block_tridiagonal.Factors
    solution: Floats  # (g, b): correlates and unknowns

    @cached_property
    def correlates(self) -> Floats:
        """Correlates lambda of the conditions, shape (n,)."""
        base, result = self.conditions.base, np.empty(len(self.conditions.value))
        following = np.concatenate([self.solution[1:, MODELS:], np.zeros((1, self.blocks.height - MODELS))])
        of_windows = np.concatenate([self.solution[:, ANCHOR.start :], following], axis=1)
        for piece in self.roots.pieces():
            said = np.einsum("nc,nc->n", self.windows(piece), of_windows[base[piece] // self.blocks.width])
            roots = self.roots.take(piece)
            result[piece] = roots.weighted(roots.whitened(self.conditions.value[piece]) - said)
        return result

    def of_images(self) -> Numbers:
        """Find the first condition of the point of each image point, shape (k,); -1 where it enters none directly."""
        rows, result = self.conditions.rows, np.full(len(self.errors.images.row), -1)
        result[rows.image] = self.roots.start[rows.item]
        return result

    @property
    def component_changes(self) -> Floats:
        """What the error components (p, 6) are beside what they were known to be."""
        return self._of_models[:, COMPONENT] * self.conditions.similarities.size

    @property
    def component_correlates(self) -> Floats:
        """Correlates (p, 6) of the error components."""
        return self._of_models[:, CORRELATE] / self.conditions.similarities.size

    @cached_property
    def unknowns(self) -> Floats:
        """Small similarities (p + 1, 7) of the photos about the common origin: of anchors, and the steps behind."""
        similarities, (blocks, width) = self.conditions.similarities, (len(self.solution), self.blocks.width)
        moved = np.zeros((blocks * width, SIMILARITY_PARAMETERS))
        models = slice(SHARING, SHARING + self.errors.models)
        moved[models] = (similarities.steps @ self._of_models[:, COMPONENT, None])[:, :, 0]
        before = np.cumsum(moved.reshape(blocks, width, -1), axis=1)[:, :-1]
        anchors = similarities.to_common[self.blocks.anchors] @ self.solution[:, ANCHOR, None]
        result = np.repeat(anchors[:, None, :, 0], width, axis=1)
        result[:, 1:] += before
        return result.reshape(blocks * width, -1)[SHARING : SHARING + self.errors.models + 1]

    @property
    def squares(self) -> float:
        """Weighted sum of squares of all misclosures, w^T lambda."""
        known = float((self.components * self.component_correlates).sum())
        return float(self.conditions.value @ self.correlates) - known

    @property
    def _of_models(self) -> Floats:
        """The solution (p, 12) model by model."""
        every = self.solution[:, MODELS:].reshape(-1, MODEL)
        return every[SHARING : SHARING + self.errors.models]

    def windows(self, some: slice | Numbers) -> Floats:
        """Whitened windows (n, 7 + 24 w) of some conditions, of whole points."""
        return _windows(self.errors, self.conditions, self.roots, self.blocks, some)


def system(errors: StripErrors, wanted: Conditions, factor: float, components: Floats | None = None) -> System:
    """Build, eliminate and solve K = [Q A; A^T 0], Q = H H^T + noise / factor (eq. 7).

    ``factor`` is the variance factor of the image coordinates, ``components`` (p, 6) what the error components are
    known to be already.
    """
    reach = max(errors.points.by_component.shape[1], SHARING)
    blocks = Blocks.of(errors.models, reach)
    roots = PointRoots.of(wanted.rows, wanted.point, wanted.noise / factor)
    diagonal, beside = np.zeros((2, blocks.count, blocks.height, blocks.height))
    right = np.zeros((blocks.count, blocks.height))
    _add_models(errors, wanted.similarities, blocks, diagonal, beside)
    _add_links(wanted.similarities, blocks, diagonal, beside)
    for block, of_block, values in _by_block(errors, wanted, roots, blocks):
        _subtract_squares(of_block.T @ of_block, block, diagonal, beside)
        _subtract(of_block.T @ values, block, right)
    known = np.zeros((errors.models, COMPONENTS)) if components is None else components
    factors = block_tridiagonal.eliminate(diagonal, beside)
    return System(
        errors=errors,
        conditions=wanted,
        components=known,
        roots=roots,
        blocks=blocks,
        factors=factors,
        solution=_solution(factors, wanted.similarities, right, known),
    )


def solved_for(found: System, value: Floats, components: Floats | None = None) -> System:
    """Solve the eliminated system for other misclosures (n,) of the same conditions."""
    conditions, right = replace(found.conditions, value=value), np.zeros_like(found.solution)
    for block, of_block, values in _by_block(found.errors, conditions, found.roots, found.blocks):
        _subtract(of_block.T @ values, block, right)
    known = np.zeros_like(found.components) if components is None else components
    solution = _solution(found.factors, conditions.similarities, right, known)
    return replace(found, conditions=conditions, components=known, solution=solution)


def _by_block(
    errors: StripErrors, wanted: Conditions, roots: PointRoots, blocks: Blocks
) -> Iterator[tuple[int, Floats, Floats]]:
    """Go through the blocks in which conditions begin: whitened windows (n, 7 + 24 w) of some, and misclosures (n,)."""
    for piece in roots.pieces():
        found, values = _windows(errors, wanted, roots, blocks, piece), roots.take(piece).whitened(wanted.value[piece])
        for block, some in runs_of(wanted.base[piece] // blocks.width):
            yield block, found[some], values[some]


def _windows(
    errors: StripErrors, wanted: Conditions, roots: PointRoots, blocks: Blocks, some: slice | Numbers
) -> Floats:
    """Whitened windows (n, 7 + 24 w) of some conditions, of whole points."""
    rows = wanted.rows.part(some.start, some.stop) if isinstance(some, slice) else wanted.rows.take(some)
    images = NearImages.of(errors, rows).with_components
    plain = windows(blocks, wanted.similarities, rows, images, wanted.base[some])
    return roots.take(some).whitened(plain[:, 0])


def _solution(
    factors: block_tridiagonal.Factors, similarities: PhotoSimilarities, right: Floats, components: Floats
) -> Floats:
    of_models = right[:, MODELS:].reshape(-1, MODEL)
    of_models[SHARING : SHARING + len(components), CORRELATE] -= components / similarities.size
    right[:, MODELS:] = of_models.reshape(len(right), -1)
    return factors.solve(right[:, :, None])[:, :, 0]


def _add_models(
    errors: StripErrors, similarities: PhotoSimilarities, blocks: Blocks, diagonal: Floats, beside: Floats
) -> None:
    """Add covariances of the error components, which unknowns they are, and a unit matrix where no model is."""
    shape = blocks.count, blocks.width, MODEL, blocks.width, MODEL
    on, next_to = np.zeros((2, *shape))
    models = np.arange(errors.models)
    for apart in range(min(SPAN, len(models))):
        some = models[: len(models) - apart]
        (block, place), (other_block, other) = blocks.places(some), blocks.places(some + apart)
        size = similarities.size[some, :, None] * similarities.size[some + apart, None]
        values = errors.component_covariances[some, apart] / size
        for where, there in ((on, other_block == block), (next_to, other_block > block)):
            where[block[there], place[there], CORRELATE, other[there], CORRELATE] = values[there]
        same = other_block == block
        on[block[same], other[same], CORRELATE, place[same], CORRELATE] = values[same].transpose(0, 2, 1)
    block, place = blocks.places(models)
    unit = np.eye(COMPONENTS)
    on[block, place, COMPONENT, place, CORRELATE] = on[block, place, CORRELATE, place, COMPONENT] = unit
    is_model = np.zeros(blocks.count * blocks.width, bool)
    is_model[SHARING + models] = True
    block, place = np.divmod(np.flatnonzero(~is_model), blocks.width)
    on[block, place, :, place] = np.eye(MODEL)
    diagonal[:, MODELS:, MODELS:] = on.reshape(blocks.count, blocks.height - MODELS, -1)
    beside[:, MODELS:, MODELS:] = next_to.reshape(blocks.count, blocks.height - MODELS, -1)


def _add_links(similarities: PhotoSimilarities, blocks: Blocks, diagonal: Floats, beside: Floats) -> None:
    """Join each anchor to the next by the steps between: 0 = y(b + 1) - y(b) carried over - sum of steps."""
    anchors, unit = blocks.anchors, np.eye(SIMILARITY_PARAMETERS)
    from_common = similarities.from_common[anchors[1:]]
    beside[:-1, LINK, ANCHOR] = unit
    carried = np.zeros((blocks.count - 1, SIMILARITY_PARAMETERS, blocks.height - LINK.stop))
    carried[:, :, :SIMILARITY_PARAMETERS] = -from_common @ similarities.to_common[anchors[:-1]]
    of_models = carried[:, :, SIMILARITY_PARAMETERS:].reshape(len(carried), SIMILARITY_PARAMETERS, blocks.width, MODEL)
    for place in range(blocks.width):
        model = np.arange(len(carried)) * blocks.width + place - SHARING
        steps = similarities.steps[np.maximum(model, 0)] * (model >= 0)[:, None, None]
        of_models[:, :, place, COMPONENT] = -from_common @ steps
    diagonal[:-1, LINK, ANCHOR.start :] = carried
    diagonal[:-1, ANCHOR.start :, LINK] = carried.transpose(0, 2, 1)
    diagonal[-1, LINK, LINK] = unit  # none follows the last


def _subtract_squares(squares: Floats, block: int, diagonal: Floats, beside: Floats) -> None:
    """Subtract Z^T D^-1 Z of conditions whose windows begin in a block."""
    own = diagonal.shape[1] - ANCHOR.start
    diagonal[block, ANCHOR.start :, ANCHOR.start :] -= squares[:own, :own]
    if block + 1 < len(diagonal):  # behind the last there are zeros
        beside[block, ANCHOR.start :, MODELS:] -= squares[:own, own:]
        diagonal[block + 1, MODELS:, MODELS:] -= squares[own:, own:]


def _subtract(values: Floats, block: int, right: Floats) -> None:
    """Subtract what stands in a window that begins in a block from a right side (g, b)."""
    own = right.shape[1] - ANCHOR.start
    right[block, ANCHOR.start :] -= values[:own]
    if block + 1 < len(right):
        right[block + 1, MODELS:] -= values[own:]
