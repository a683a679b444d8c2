"""Points of windows: what the rays of a point demand of their photos, the point itself eliminated.

Points with equally many rays stand together in arrays. What their rays demand does not change from adjustment to
adjustment and is computed once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from photostrip.triangulation.gross_errors.rays.windows import FEWEST, PHOTO_PARAMETERS

if TYPE_CHECKING:
    from photostrip.arrays import Flags, Floats, Numbers
    from photostrip.triangulation.gross_errors.rays.windows import WindowRays


CONCORDANT = 1e-9  # smallest share of a condition that the others do not hold already
KEPT = (
    "basis",
    "design",
    "closing",
    "gram",
    "independent",
)  # of a group, what is not computed again for some of its points


@dataclass(frozen=True, eq=False)
class Group:
    """Points with equally many rays in their window."""

    window: Numbers  # (k,): window of each point, counted within the batch
    ray: Numbers  # (k, r): rays of the point, in flight order
    column: Numbers  # (k, r): place of their photos in the window
    by_point: Floats  # (k, 2r, 3): derivatives of all coordinates by the point
    by_photo: Floats  # (k, 2r, 6r): derivatives by the photos of the point, one after the other
    misfit: Floats  # (k, 2r): measured minus computed

    def take(self, rows: Flags) -> Group:
        """Give some of the points."""
        part = Group(
            self.window[rows],
            self.ray[rows],
            self.column[rows],
            self.by_point[rows],
            self.by_photo[rows],
            self.misfit[rows],
        )
        part.__dict__.update({name: self.__dict__[name][rows] for name in KEPT if name in self.__dict__})
        return part

    @property
    def parameters(self) -> Numbers:
        """Place of the parameters of its photos among those of the window, shape (k, 6r)."""
        found: Numbers = (PHOTO_PARAMETERS * self.column[:, :, None] + np.arange(PHOTO_PARAMETERS)).reshape(
            len(self.window), -1
        )
        return found

    @cached_property
    def basis(self) -> Floats:
        """Conditions that do not feel the point, out of its coordinates; see ``coplanarities``."""
        return coplanarities(self)

    @cached_property
    def design(self) -> Floats:
        """Derivatives of those conditions by the photos of the point, shape (k, 2r - 3, 6r)."""
        return np.asarray(self.basis @ self.by_photo, float)

    @cached_property
    def closing(self) -> Floats:
        """Their misclosures, shape (k, 2r - 3)."""
        return np.asarray((self.basis @ self.misfit[:, :, None])[:, :, 0], float)

    @cached_property
    def gram(self) -> Floats:
        """Their cofactors, shape (k, 2r - 3, 2r - 3)."""
        return np.asarray(self.basis @ self.basis.transpose(0, 2, 1), float)

    @cached_property
    def independent(self) -> Floats:
        """The same as precise as coordinates and uncorrelated: derivatives, then misclosures, (k, 2r - 3, 6r + 1)."""
        root = np.linalg.cholesky(self.gram + CONCORDANT * np.eye(self.gram.shape[1]))
        joined = np.concatenate([self.design, self.closing[:, :, None]], axis=2)
        return np.asarray(np.linalg.solve(root, joined), float)


def groups(rays: WindowRays, first: Numbers, length: int) -> list[Group]:
    """Sort the rays of some windows by point, and the points by their number of rays: two, three and so on.

    ``rays`` are ordered by point and photo; points with one ray in a window are left out.
    """
    inside = (rays.photo >= first[:, None]) & (rays.photo < first[:, None] + length)
    window, ray = np.nonzero(inside)
    key = window * (int(rays.point.max(initial=0)) + 1) + rays.point[ray]
    begin = np.flatnonzero(np.diff(key, prepend=-1))
    count = np.diff(np.append(begin, len(key)))
    found = []
    for r in np.unique(count[count > 1]).tolist():
        place = begin[count == r, None] + np.arange(r)
        of_point, of_window = ray[place], window[begin[count == r]]
        k = len(of_window)
        design = np.zeros((k, r, 2, r, PHOTO_PARAMETERS))
        design[:, range(r), :, range(r), :] = rays.by_photo[of_point].transpose(1, 0, 2, 3)
        found.append(
            Group(
                of_window,
                of_point,
                rays.photo[of_point] - first[of_window, None],
                rays.by_point[of_point].reshape(k, 2 * r, 3),
                design.reshape(k, 2 * r, PHOTO_PARAMETERS * r),
                rays.misfit[of_point].reshape(k, 2 * r),
            )
        )
    return found


def projectors(group: Group, weight: Floats) -> Floats:
    """Projections P (k, 2r, 2r) that take the point out of its weighted rays: P A = 0, A the derivatives by the point.

    ``weight`` is 1 for a ray that counts, 0 for one that does not; zero for a point with fewer than two rays.
    """
    root = np.repeat(weight, 2, axis=1)[:, :, None]
    design = group.by_point * root
    normal = design.transpose(0, 2, 1) @ design
    enough = weight.sum(axis=1) >= FEWEST
    normal[~enough] = np.eye(3)
    inside = design @ np.linalg.solve(normal, design.transpose(0, 2, 1))
    matrix = np.eye(design.shape[1]) * root - inside
    matrix[~enough] = 0.0
    return np.asarray(matrix, float)


def coplanarities(group: Group) -> Floats:
    """Conditions of rays of neighbouring photos, then what more the rays of a point demand: unit rows (k, 2r - 3, 2r).

    An error along the base leaves the first r - 1 alone, which are y parallaxes; the r - 2 others are at right angles
    to them and to each other.
    """
    k, coordinates = group.misfit.shape
    r = coordinates // 2
    result = np.zeros((k, 2 * r - 3, 2 * r))
    for number in range(r - 1):
        row = _across(group.by_point[:, 2 * number : 2 * number + 4])
        result[:, number, 2 * number : 2 * number + 4] = row / np.maximum(
            np.linalg.norm(row, axis=1, keepdims=True), 1e-300
        )
    if r > FEWEST:
        pairs = result[:, : r - 1]
        gram = pairs @ pairs.transpose(0, 2, 1) + CONCORDANT * np.eye(r - 1)
        rest = projectors(group, np.ones((k, r))) - pairs.transpose(0, 2, 1) @ np.linalg.solve(gram, pairs)
        for number in range(r - 1, 2 * r - 3):
            result[:, number] = row = _longest(rest)
            rest = rest - row[:, :, None] * row[:, None, :]
    return result


def _across(slopes: Floats) -> Floats:
    """Row at right angles to three columns of length four, by minors; shape (k, 4) of (k, 4, 3)."""
    a, b, c, d = slopes.transpose(1, 2, 0)
    first, last = _cross(a, b), _cross(c, d)
    minors = [(b * last).sum(axis=0), -(a * last).sum(axis=0), (d * first).sum(axis=0), -(c * first).sum(axis=0)]
    return np.stack(minors, axis=1)


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross products of columns, shape (3, k)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _longest(projection: Floats) -> Floats:
    """Return a unit vector inside the range of each projection, its longest column; shape (k, c) of (k, c, c)."""
    place = np.diagonal(projection, axis1=1, axis2=2).argmax(axis=1)
    column = projection[np.arange(len(projection)), :, place]
    return np.asarray(column / np.maximum(np.linalg.norm(column, axis=1, keepdims=True), 1e-300), float)
