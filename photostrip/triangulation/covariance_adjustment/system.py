"""The banded system of a strip: the unknowns of all photos, what models and points say of them, and its elimination.

Conditions of a point share its image points and nothing else with other conditions but error components and unknowns.
So they are eliminated first, point by point, whatever their number; what is left are 14 rows for each photo. Photos are
taken in blocks of as many as a point reaches over, so that only neighbouring blocks have anything in common.

Source: derived; see docs/precision.md, eq. 7.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np

from photostrip.arrays import Floats, Numbers, distinct
from photostrip.frozen import NamedTuple, dataclass, replace
from photostrip.triangulation.covariance_adjustment import block_tridiagonal
from photostrip.triangulation.covariance_adjustment.conditions import Conditions
from photostrip.triangulation.covariance_adjustment.similarities import PhotoSimilarities
from photostrip.triangulation.covariance_adjustment.windows import PLACES, STEP, UNKNOWN, windows
from photostrip.triangulation.error_propagation.covariances import NearImages
from photostrip.triangulation.error_propagation.derivatives import COMPONENTS, SHARING, SPAN, ErrorRows, ranges
from photostrip.triangulation.error_propagation.strip_errors import StripErrors

AT_A_TIME = 2048  # rows whose windows are made together, in whole models


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


def sections(base: Numbers, size: int = 1) -> Iterator[slice]:
    """Cut rows of so many coordinates, ordered by their models, into parts of bounded memory, models left whole."""
    ends = np.append(np.flatnonzero(np.diff(base, prepend=-1)), len(base))
    while len(ends) > 1:
        last = max(int(np.searchsorted(ends, ends[0] + AT_A_TIME // size, side="right")) - 1, 1)
        yield slice(int(ends[0]), int(ends[last]))
        ends = ends[last:]


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
        place = np.arange(len(point)) - result.start
        for size in distinct(counts).tolist():
            some = start[counts == size][:, None] + np.arange(size)
            number = np.full(len(point), -1)
            number[some] = np.arange(len(some))[:, None]
            own = np.zeros((len(some), size, size))
            chosen = rows.take(some.ravel())
            shared = same_images(chosen, chosen)  # every pair in both orders
            first, second = (some.ravel()[each] for each in (shared.first, shared.second))
            np.add.at(own, (number[first], place[first], place[second]), shared.value[:, 0, 0])
            own[:, np.arange(size), np.arange(size)] += noise[some]
            result.root[some, :size] = np.linalg.inv(np.linalg.cholesky(own))
        return result

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
    """An eliminated and solved system; its photos begin with two that have no part in it."""

    errors: StripErrors
    conditions: Conditions
    components: Floats  # (p, 6): what the error components are known to be already
    roots: PointRoots
    width: int  # photos of a block
    factors: block_tridiagonal.Factors
    solution: Floats  # (g, b): correlates of the components, and unknowns

    @property
    def similarities(self) -> PhotoSimilarities:
        return self.conditions.similarities

    @cached_property
    def by_photo(self) -> Floats:
        """The solution (p + 1, 14) photo by photo."""
        every = self.solution.reshape(-1, PLACES)
        return every[SHARING : SHARING + self.errors.models + 1]

    @property
    def unknowns(self) -> Floats:
        """Small similarities y of the photos, shape (p + 1, 7)."""
        return self.by_photo[:, UNKNOWN]

    @cached_property
    def correlates(self) -> Floats:
        """Correlates lambda of the conditions, shape (n,)."""
        found, result = self.solution.reshape(-1, PLACES), np.empty(len(self.conditions.value))
        around = np.arange(self.width + 1)
        for part in sections(self.conditions.base):
            photos = np.minimum(self.conditions.base[part, None] + around, len(found) - 1)  # beyond it windows are 0
            said = np.einsum("nwc,nwc->n", self.windows(part), found[photos])
            roots = self.roots.take(part)
            result[part] = roots.weighted(roots.whitened(self.conditions.value[part]) - said)
        return result

    @property
    def squares(self) -> float:
        """Weighted sum of squares of all misclosures, w^T lambda."""
        of_components = self.by_photo[:-1, :COMPONENTS] / self.similarities.size
        known = float((self.components * of_components).sum())
        return float(self.conditions.value @ self.correlates) - known

    def windows(self, some: slice | Numbers) -> Floats:
        """Whitened windows (n, w, 14) of some conditions, of whole points."""
        return _windows(self.errors, self.conditions, self.roots, some, self.width + 1)


def system(errors: StripErrors, wanted: Conditions, factor: float, components: Floats | None = None) -> System:
    """Build, eliminate and solve K = [Q A; A^T 0], Q = H H^T + noise / factor (eq. 7).

    ``factor`` is the variance factor of the image coordinates, ``components`` (p, 6) what the error components are
    known to be already.
    """
    reach = max(wanted.rows.by_component.shape[1], errors.points.by_component.shape[1], SHARING)
    width, photos = reach + SHARING, SHARING + errors.models + 1
    blocks = -(-photos // width)
    roots = PointRoots.of(wanted.rows, wanted.point, wanted.noise / factor)
    diagonal, beside = np.zeros((2, blocks, width * PLACES, width * PLACES))
    _add_models(errors, wanted.similarities, diagonal, beside)
    right = np.zeros((blocks * width + reach + 1, PLACES))
    for part in sections(wanted.base):
        found = _windows(errors, wanted, roots, part, width + 1)
        _subtract_points(wanted.base[part], found.reshape(len(found), -1), diagonal, beside)
        whitened = roots.take(part).whitened(wanted.value[part])
        _subtract_right(wanted.base[part], found, whitened, right)
    known = np.zeros((errors.models, COMPONENTS)) if components is None else components
    factors = block_tridiagonal.eliminate(diagonal, beside)
    return System(
        errors=errors,
        conditions=wanted,
        components=known,
        roots=roots,
        width=width,
        factors=factors,
        solution=_solution(factors, wanted.similarities, right, known),
    )


def solved_for(found: System, value: Floats, components: Floats | None = None) -> System:
    """Solve the eliminated system for other misclosures (n,) of the same conditions."""
    conditions = replace(found.conditions, value=value)
    right = np.zeros((len(found.solution) * found.width + found.width, PLACES))
    for part in sections(conditions.base):
        whitened = found.roots.take(part).whitened(value[part])
        _subtract_right(conditions.base[part], found.windows(part), whitened, right)
    known = np.zeros_like(found.components) if components is None else components
    solution = _solution(found.factors, found.similarities, right, known)
    return replace(found, conditions=conditions, components=known, solution=solution)


def _windows(errors: StripErrors, wanted: Conditions, roots: PointRoots, some: slice | Numbers, photos: int) -> Floats:
    """Whitened windows (n, w, 14) of some conditions, of whole points."""
    rows = wanted.rows.part(some.start, some.stop) if isinstance(some, slice) else wanted.rows.take(some)
    images = NearImages.of(errors, rows).with_components
    plain = windows(wanted.similarities, rows, images, wanted.base[some], photos)
    return roots.take(some).whitened(plain[:, 0])


def _solution(
    factors: block_tridiagonal.Factors, similarities: PhotoSimilarities, right: Floats, components: Floats
) -> Floats:
    count, height = factors.inverses.shape[:2]
    models = slice(SHARING, SHARING + len(components))
    right[models, :COMPONENTS] -= components / similarities.size
    return factors.solve(right[: count * height // PLACES].reshape(count, height, 1))[:, :, 0]


def _add_models(errors: StripErrors, similarities: PhotoSimilarities, diagonal: Floats, beside: Floats) -> None:
    """Add covariances of the components, and what they are by the unknowns; a unit matrix where no photo is."""
    blocks, height, _ = diagonal.shape
    width, models = height // PLACES, errors.models
    shape = blocks, width, PLACES, width, PLACES
    diagonal, beside = diagonal.reshape(shape), beside.reshape(shape)

    def put(first: Numbers, apart: int, rows: slice, columns: slice, values: Floats) -> None:
        block, place = np.divmod(first, width)
        next_block, other = np.divmod(first + apart, width)
        for blocks_, some in ((diagonal, next_block == block), (beside, next_block > block)):
            blocks_[block[some], place[some], rows, other[some], columns] = values[some]
        own = np.flatnonzero(next_block == block)
        diagonal[block[own], other[own], columns, place[own], rows] = values[own].transpose(0, 2, 1)

    photos = SHARING + np.arange(models)
    components = slice(0, COMPONENTS)
    for apart in range(min(SPAN, models)):
        size = similarities.size[: models - apart, :, None] * similarities.size[apart:, None]
        values = errors.component_covariances[: models - apart, apart] / size
        put(photos[: models - apart], apart, components, components, values)
    put(photos, 0, STEP, UNKNOWN, similarities.own)
    put(photos, 1, STEP, UNKNOWN, similarities.following)
    last = photos[-1:] + 1
    none = np.append(np.arange(SHARING), np.arange(int(last[0]) + 1, blocks * width))
    for empty, places in ((none, slice(0, PLACES)), (last, STEP)):
        unit = np.eye(places.stop - places.start)
        put(empty, 0, places, places, np.broadcast_to(unit, (len(empty), *unit.shape)))


def _subtract_points(base: Numbers, found: Floats, diagonal: Floats, beside: Floats) -> None:
    """Subtract Z^T D^-1 Z of conditions with whitened windows (n, w 14)."""
    blocks, height, _ = diagonal.shape
    width = height // PLACES
    starts = np.flatnonzero(np.diff(base, prepend=-1))
    for start, stop in pairwise([*starts.tolist(), len(base)]):
        block, place = divmod(int(base[start]), width)
        squares = found[start:stop].T @ found[start:stop]
        first = place * PLACES
        inside = height - first  # places of the window in its first block; the others are in the next
        diagonal[block, first:, first:] -= squares[:inside, :inside]
        if block + 1 < blocks:
            rest = len(squares) - inside
            beside[block, first:, :rest] -= squares[:inside, inside:]
            diagonal[block + 1, :rest, :rest] -= squares[inside:, inside:]


def _subtract_right(base: Numbers, found: Floats, whitened: Floats, right: Floats) -> None:
    """Subtract Z^T D^-1 w of conditions with whitened windows (n, w, 14) from the right side, photo by photo."""
    starts = np.flatnonzero(np.diff(base, prepend=-1))
    if not len(starts):
        return
    sums = np.add.reduceat(found * whitened[:, None, None], starts, axis=0)
    for photo in range(found.shape[1]):
        right[base[starts] + photo] -= sums[:, photo]
