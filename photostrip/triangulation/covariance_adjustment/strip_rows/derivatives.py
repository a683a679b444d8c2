"""Sparse rows of derivatives by the image coordinates, and the error components through which most of them go.

Source: derived; see docs/precision.md, eq. 1-4.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Self

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import NamedTuple, dataclass, replace
from photostrip.geometry.similarity import similarity_derivatives
from photostrip.triangulation.relative_orientation.orientation import Orientation
from photostrip.triangulation.strip_formation.strip import FormedStrip

COMPONENTS = 6  # of the error of a model: five elements of its pair, logarithm of the scale that it hands on
ELEMENTS, SCALE = slice(0, 5), 5
# models between which error components share image coordinates: pairs share a photo, a scale transfer three
SHARING = 2
SPAN = SHARING + 1  # photos on which the image coordinates of an error component lie
# of the components of the models photo - 2, photo - 1 and photo, one after the other, those that an image point moves:
# of the first model nothing but its scale
MOVED = slice(SCALE, SPAN * COMPONENTS)


@dataclass(frozen=True, eq=False)
class ImagePoints:
    """Image points that take part, ordered by photo, and how the error components depend on them."""

    row: Numbers  # (n,): row in the table of image points
    photo: Numbers  # (n,): place of its photo in the strip, ascending
    stated: Floats  # (k, 2): standard deviations of all image points in that table, mm
    # (n, 2, 13): by x and y in their standard deviations: scale of the model photo - 2, components of the models
    # photo - 1 and photo (``MOVED``)
    components: Floats

    @property
    def sigma(self) -> Floats:
        """Stated standard deviations (n, 2) of x and y, mm."""
        return self.stated[self.row]

    def rows_of(self, rows: Numbers) -> Numbers:
        """Places here of rows in the table of image points."""
        places = np.full(len(self.stated), -1)  # a table of the size of all image points, not worth keeping
        places[self.row] = np.arange(len(self.row))
        return np.asarray(places[rows], np.intp)


@dataclass(frozen=True, eq=False)
class ErrorRows:
    """Errors of n points, photos or coordinates, of d numbers each, as sparse rows of derivatives.

    The error is ``by_similarity y(first) + sum_s by_component[s] u(first + s) + sum by_image v``   # eq. 3
    with y the similarity of model ``first``, u the error components of the models and v the errors of image coordinates
    in units of their standard deviations.
    """

    first: Numbers  # (n,): model whose similarity moves the whole
    by_similarity: Floats  # (n, d, 7)
    by_component: Floats  # (n, s, d, 6): by the components of the models from ``first`` on
    item: Numbers  # (e,): row to which each image point belongs that enters directly, ascending
    image: Numbers  # (e,): that image point, a row of ``ImagePoints``
    by_image: Floats  # (e, d, 2)

    @classmethod
    def without_images(cls, first: Numbers, by_similarity: Floats, by_component: Floats) -> Self:
        """Rows that no image point enters directly."""
        none = np.zeros(0, np.intp)
        return cls(
            first=first,
            by_similarity=by_similarity,
            by_component=by_component,
            item=none,
            image=none,
            by_image=np.zeros((0, by_similarity.shape[1], 2)),
        )

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Rows of several tables one after the other."""
        slots = max(part.by_component.shape[1] for part in parts)
        starts = np.cumsum([0, *(len(part.first) for part in parts)])
        size = parts[0].by_similarity.shape[1]
        by_component = np.zeros((int(starts[-1]), slots, size, COMPONENTS))
        for part, start in zip(parts, starts[:-1], strict=True):
            by_component[start : start + len(part.first), : part.by_component.shape[1]] = part.by_component
        return cls(
            first=np.concatenate([part.first for part in parts]),
            by_similarity=np.concatenate([part.by_similarity for part in parts]),
            by_component=by_component,
            item=np.concatenate([part.item + start for part, start in zip(parts, starts[:-1], strict=True)]),
            image=np.concatenate([part.image for part in parts]),
            by_image=np.concatenate([part.by_image for part in parts]),
        )

    def take(self, rows: Numbers) -> Self:
        item = self.item
        return self._selected(rows, *ranges(np.searchsorted(item, rows), np.searchsorted(item, rows, side="right")))

    def part(self, start: int, stop: int) -> Self:
        """Rows from start to stop, without copying."""
        low, high = np.searchsorted(self.item, [start, stop])
        return self._selected(slice(start, stop), self.item[low:high] - start, slice(low, high))

    def _selected(self, rows: Numbers | slice, item: Numbers, entry: Numbers | slice) -> Self:
        return replace(
            self,
            first=self.first[rows],
            by_similarity=self.by_similarity[rows],
            by_component=self.by_component[rows],
            item=item,
            image=self.image[entry],
            by_image=self.by_image[entry],
        )

    def along(self, direction: Floats) -> Self:
        """Errors along one direction (n, d) of each row: d = 1."""
        unit = direction[:, None]
        return replace(
            self,
            by_similarity=unit @ self.by_similarity,
            by_component=unit[:, None] @ self.by_component,
            by_image=unit[self.item] @ self.by_image,
        )


@dataclass(frozen=True, eq=False)
class PointRows:
    """Errors of the n points of a strip as ``ErrorRows`` have them, d = 3.

    Their derivatives by the similarity, 170 bytes a point, follow from their places where they are needed.
    """

    xyz: Floats  # (n, 3): from the origin of the similarities, metres
    # first, by_component, image, by_image: as in ``ErrorRows``
    first: Numbers
    by_component: Floats
    starts: Numbers  # (n + 1,): where the image points of each begin that enter directly, and where the last end
    image: Numbers
    by_image: Floats

    def take(self, rows: Numbers) -> ErrorRows:
        item, entry = self.entries(rows)
        return ErrorRows(
            first=self.first[rows],
            by_similarity=self.by_similarity(rows),
            by_component=self.by_component[rows],
            item=item,
            image=self.image[entry],
            by_image=self.by_image[entry],
        )

    def entries(self, rows: Numbers) -> tuple[Numbers, Numbers]:
        """Find the image points that enter some points directly: number among these, and place in ``image``."""
        return ranges(self.starts[rows], self.starts[rows + 1])

    def by_similarity(self, rows: Numbers) -> Floats:
        """Displacements of some points by the similarity of their first model, (..., 3, 7)."""
        found = similarity_derivatives(self.xyz[rows.ravel()], np.zeros(3))
        return found.reshape(*rows.shape, *found.shape[1:])


@dataclass(frozen=True, eq=False)
class PlacedStrip:
    """A formed strip after its similarity, coordinates from the common origin, and what its rows are made of."""

    orientation: Orientation
    formed: FormedStrip
    xyz: Floats  # (q, 3)
    centers: Floats  # (p + 1, 3)
    rotations: Floats  # (p + 1, 3, 3)
    images: ImagePoints
    steps: Floats  # (p, 7, 6)


def ranges(start: Numbers, stop: Numbers) -> tuple[Numbers, Numbers]:
    """Write ranges out one after the other: number of the range, and every index from its start to its stop."""
    counts = stop - start
    number = np.repeat(np.arange(len(counts)), counts)
    return number, np.arange(len(number)) - np.repeat(np.cumsum(counts) - counts, counts) + start[number]


def add_rows(result: Floats, place: Numbers, values: Floats) -> None:
    """Add values (n, ...) to rows of the result, several to one perhaps; in a tenth of the time of ``np.add.at``."""
    if (place[1:] < place[:-1]).any():
        order = np.argsort(place, kind="stable")
        place, values = place[order], values[order]
    starts = np.flatnonzero(np.diff(place, prepend=-1))
    if len(starts):
        result[place[starts]] += np.add.reduceat(values, starts, axis=0)


def add_products(result: Floats, place: Numbers, first: Floats, second: Floats) -> None:
    """Add first^T second of rows (n, k, a) and (n, k, b) to matrices (a, b) of the result, several to one perhaps."""
    if (place[1:] < place[:-1]).any():
        order = np.argsort(place, kind="stable")
        place, first, second = place[order], first[order], second[order]
    starts = np.flatnonzero(np.diff(place, prepend=-1))
    ends = [*(starts * first.shape[1]).tolist(), first.shape[0] * first.shape[1]]
    first, second = first.reshape(-1, first.shape[2]), second.reshape(-1, second.shape[2])
    for at, (start, stop) in zip(place[starts].tolist(), pairwise(ends), strict=True):
        result[at] += first[start:stop].T @ second[start:stop]


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
