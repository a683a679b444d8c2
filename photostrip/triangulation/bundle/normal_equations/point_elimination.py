"""Points eliminated from the rays of a batch, and what that leaves for the photos.

With A the partials of a ray by its point and B by its photo and the common parameters, both in units of sigma, and
L L' the normal matrix of a point, the photos get B'B - T T' with T = B' A L^-T: a product of matrices for each group of
points on the same photos.

Source: [Granshaw 1980] for the elimination.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from photostrip.arrays import Floats
from photostrip.frozen import NamedTuple, dataclass
from photostrip.triangulation.bundle.observations.collinearity import PHOTO, Rays, by_point
from photostrip.triangulation.bundle.observations.ray_batches import RayBatch
from photostrip.triangulation.bundle.structure import triangle

SMALL_GROUP = 24  # points: up to here it pays to bring the numbers of a group together before they are multiplied


@dataclass(frozen=True, eq=False)
class Eliminated:
    root: PointFactors
    # (6 k + more + 1, 3, S): T: for each ray six rows, then the common parameters; last L^-1 times the right-hand side
    # of the point
    rows: Floats
    # (S,): least information on a direction as part of all on the point: about the square of the sine of the angle
    # between rays. NaN where the matrix is not positive definite
    strength: Floats


def eliminate(batch: RayBatch, xyz: Floats, rays: Rays, common: Floats | None, damping: float = 0.0) -> Eliminated:
    """Eliminate the points (3, S) of a batch.

    ``common`` (more, 2, k, S): partials by common parameters, in units of sigma; ``damping``: part of its diagonal by
    which each normal matrix is made larger.
    """
    white = by_point(rays)
    normal, right = point_normals(batch, xyz, white, rays.misfit)
    root, strength = PointFactors.of(normal, damping)
    with np.errstate(invalid="ignore", over="ignore"):
        root.forward(right)
        root.forward(white)
    k, slots = rays.depth.shape
    more = 0 if common is None else len(common)
    rows = np.empty((PHOTO * k + more + 1, 3, slots))
    rows[-1] = right
    if common is not None:
        np.einsum("pakr,cakr->pcr", common, white, out=rows[PHOTO * k : -1])
    white *= rays.pull
    out = rows[: PHOTO * k].reshape(k, PHOTO, 3, slots).transpose(1, 2, 0, 3)
    by_x, by_y = white[:, 0], white[:, 1]
    lean = rays.ratio[0] * by_x
    lean += rays.ratio[1] * by_y
    np.multiply(by_x, rays.depth, out=out[0])
    np.multiply(by_y, rays.depth, out=out[1])
    np.multiply(lean, rays.depth, out=out[2])
    part = rays.ratio[1] * lean
    np.add(part, by_y, out=out[3])
    np.multiply(rays.ratio[0], lean, out=part)
    np.add(part, by_x, out=out[4])
    by_x *= rays.ratio[1]
    by_y *= rays.ratio[0]
    np.subtract(by_x, by_y, out=out[5])
    return Eliminated(root, rows, strength)


def point_normals(batch: RayBatch, xyz: Floats, partials: Floats, misfit: Floats) -> tuple[list[Floats], Floats]:
    """Sum A'A over the rays of each point, and its control: elements 11, 22, 33, 21, 31, 32, and A'l, (3, S).

    Partials (3, 2, k, S) and misfits (2, k, S) are in units of sigma.
    """
    pairs = ((0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1))
    rows = partials.reshape(3, -1, partials.shape[-1])
    normal = [np.einsum("rs,rs->s", rows[i], rows[j]) for i, j in pairs]
    right = np.einsum("crs,rs->cs", rows, misfit.reshape(rows.shape[1:]))
    if len(batch.control):
        at = batch.control
        for element, (i, j) in zip(normal, pairs, strict=True):
            element[at] += batch.control_normal[i, j]
        right[:, at] += batch.control_right - np.einsum("ijs,js->is", batch.control_normal, xyz[:, at])
    for element in normal[:3]:
        element[batch.dummy] = 1.0
    return normal, right


class PointFactors(NamedTuple):
    """Cholesky factors L of the 3 x 3 normal matrices of points, element by element (S,); NaN where not positive."""

    # r1, r2, r3: reciprocals of the diagonal; l21, l31, l32: elements below it
    r1: Floats
    r2: Floats
    r3: Floats
    l21: Floats
    l31: Floats
    l32: Floats

    @classmethod
    def of(cls, normal: list[Floats], damping: float = 0.0) -> tuple[Self, Floats]:
        """Factor matrices, given by their elements 11, 22, 33, 21, 31, 32, the diagonal enlarged.

        Also returns the smallest square of the diagonal of each factor as part of the trace of the matrix, (S,).
        """
        n11, n22, n33 = (element * (1.0 + damping) for element in normal[:3]) if damping else normal[:3]
        n21, n31, n32 = normal[3:]
        with np.errstate(invalid="ignore", divide="ignore"):
            r1 = 1.0 / np.sqrt(n11)
            l21, l31 = n21 * r1, n31 * r1
            r2 = 1.0 / np.sqrt(n22 - l21 * l21)
            l32 = (n32 - l21 * l31) * r2
            r3 = 1.0 / np.sqrt(n33 - l31 * l31 - l32 * l32)
            strength = 1.0 / (np.maximum(np.maximum(r1, r2), r3) ** 2 * (n11 + n22 + n33))
        return cls(r1=r1, r2=r2, r3=r3, l21=l21, l31=l31, l32=l32), strength

    def forward(self, columns: Floats) -> None:
        """Multiply columns (3, ..., S) with L^-1, in place."""
        first, second, third = columns
        first *= self.r1
        second -= first * self.l21
        second *= self.r2
        third -= first * self.l31
        third -= second * self.l32
        third *= self.r3

    def backward(self, columns: Floats) -> None:
        """Multiply columns (3, ..., S) with the transpose of L^-1, in place."""
        first, second, third = columns
        third *= self.r3
        second -= third * self.l32
        second *= self.r2
        first -= second * self.l21
        first -= third * self.l31
        first *= self.r1


class GroupSquares(NamedTuple):
    """Products of the rows of each group of points, with C = 6 k + more + 1 and c = 6 + more + 1 columns.

    The last element, the square of the misfits, stands summed over the batch in the first ray and group.
    """

    added: Floats  # (k, groups, c, c): B'B of each ray, summed over the points
    subtracted: Floats  # (groups, C, C): T T', summed over the points


def squares(batch: RayBatch, partials: Floats, rows: Floats) -> GroupSquares:
    """Multiply the rows of each group: what is added and what is subtracted at its photos.

    ``partials`` as of ``by_photo``, ``rows`` as of ``eliminate``.
    """
    p, q, k, groups = len(partials), len(rows), partials.shape[2], len(batch.sets)
    added, subtracted = np.empty((k, groups, p, p)), np.empty((groups, q, q))
    done = 0
    for first, last, count, size in batch.runs:
        run = (partials[..., first:last], rows[..., first:last])
        to = (added[:, done : done + count, :, :-1], subtracted[done : done + count, :, :-1])
        (_small_squares if size <= SMALL_GROUP else _large_squares)(run, to, count, size)
        done += count
    added[..., :-1, -1], subtracted[:, :-1, -1] = added[..., -1, :-1], subtracted[:, -1, :-1]
    added[..., -1, -1] = subtracted[:, -1, -1] = 0.0
    added[0, 0, -1, -1] = np.einsum("akr,akr->", partials[-1], partials[-1])
    subtracted[0, -1, -1] = np.einsum("cr,cr->", rows[-1], rows[-1])
    return GroupSquares(added, subtracted)


# Both leave out the last column: numpy would take a whole square to BLAS as symmetric, which is slower when small.


def _small_squares(run: tuple[Floats, Floats], to: tuple[Floats, Floats], count: int, size: int) -> None:
    """Bring the numbers of each group together, and multiply."""
    singles = np.ascontiguousarray(run[0].transpose(2, 3, 1, 0)).reshape(-1, count, 2 * size, len(run[0]))
    np.matmul(singles.swapaxes(-1, -2), singles[..., :-1], out=to[0])
    rows = np.ascontiguousarray(run[1].transpose(2, 1, 0)).reshape(count, 3 * size, len(run[1]))
    np.matmul(rows.swapaxes(-1, -2), rows[..., :-1], out=to[1])


def _large_squares(run: tuple[Floats, Floats], to: tuple[Floats, Floats], count: int, size: int) -> None:
    p, _, k, _ = run[0].shape
    singles = run[0].reshape(p, 2, k, count, size).transpose(1, 2, 3, 0, 4)
    both = singles @ singles[..., :-1, :].swapaxes(-1, -2)
    np.add(both[0], both[1], out=to[0])
    rows = run[1].reshape(-1, 3, count, size).transpose(1, 2, 0, 3)
    three = rows @ rows[..., :-1, :].swapaxes(-1, -2)
    three[0] += three[1]
    np.add(three[0], three[2], out=to[1])


class BatchBlocks(NamedTuple):
    """What a batch contributes to the normal equations."""

    pairs: Floats  # (k (k + 1) / 2 * groups, 6, 6): pairs of photos
    border: Floats  # (k * groups, 6, more + 1): photos with common parameters and right-hand side
    corner: Floats  # (more + 1, more + 1): common parameters and right-hand side among themselves


def blocks_of(products: GroupSquares, rays: int) -> BatchBlocks:
    """Cut the products of a batch into what goes to pairs, to the border of photos and to the corner: B'B - T T'."""
    added, subtracted = products
    n = PHOTO * rays
    groups = len(subtracted)
    row, column = triangle(rays)
    squares = subtracted[:, :n, :n].reshape(groups, rays, PHOTO, rays, PHOTO)
    pairs = squares.transpose(1, 3, 0, 2, 4)[row, column]
    np.negative(pairs, out=pairs)
    pairs[row == column] += added[:, :, :PHOTO, :PHOTO]
    border = added[:, :, :PHOTO, PHOTO:] - subtracted[:, :n, n:].reshape(groups, rays, PHOTO, -1).transpose(1, 0, 2, 3)
    corner = added[:, :, PHOTO:, PHOTO:].sum(axis=(0, 1)) - subtracted[:, n:, n:].sum(axis=0)
    return BatchBlocks(pairs.reshape(-1, PHOTO, PHOTO), border.reshape(rays * groups, PHOTO, -1), corner)
