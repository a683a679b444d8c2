"""Linearised rays of a batch, the points eliminated from them, and what that leaves for the photos.

The partials are taken along the axes of each photo: there they are functions of the image point and its depth alone.
A photo's six parameters are the shift of its perspective centre along its own axes, and its rotation about them, the
first of the three with the opposite sign (that saves a pass over all rays; ``SIGNS``).

With A the partials of a ray by its point and B by its photo and the common parameters, both in units of sigma, and
L L' the normal matrix of a point, the photos get B'B - T T' with T = B' A L^-T: a product of matrices for each group of
points that are seen by the same photos.

Source: [Granshaw 1980] for the elimination; the partials are derived.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.bundle.observations.ray_batches import Batch

    Floats = NDArray[np.float64]

PHOTO = 6  # parameters of a photo
SMALL_GROUP = 24  # points: up to here it pays to bring the numbers of a group together before they are multiplied
SIGNS = np.array([1.0, 1.0, 1.0, -1.0, 1.0, 1.0])  # of a photo's parameters, see above


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays of a batch at one state."""

    turn: Floats  # (3, 3, k, S): photo axes as rows of object components: the transposed rotation of each ray
    ratio: Floats  # (2, k, S): computed image coordinates divided by the principal distance
    depth: Floats  # (k, S): reciprocal of the third photo coordinate, 1/m; negative in front of the camera
    pull: Floats  # (2, k, S): principal distance divided by sigma
    misfit: Floats  # (2, k, S): measured minus computed image coordinates in units of sigma


def view(batch: Batch, xyz: Floats, photos: Floats) -> Rays:
    """Project the points of a batch.

    Parameters
    ----------
    xyz : ndarray, shape (3, S)
        Points of the slots.
    photos : ndarray, shape (13, m)
        Of each photo: nine elements of the transposed rotation by rows, perspective centre, principal distance.
    """
    k, slots = batch.photo.shape
    of_ray = photos.take(batch.photo, axis=1, mode="clip")
    turn, center, focal = of_ray[:9].reshape(3, 3, k, slots), of_ray[9:12], of_ray[12]
    arm = xyz[:, None, :] - center
    along = turn[:, 0] * arm[0]
    part = turn[:, 1] * arm[1]
    along += part
    np.multiply(turn[:, 2], arm[2], out=part)
    along += part
    depth = 1.0 / along[2]
    ratio = along[:2]
    ratio *= -depth
    pull = batch.weight * focal
    misfit = batch.xy * batch.weight
    misfit -= ratio * pull
    return Rays(turn, ratio, depth, pull, misfit)


def by_point(rays: Rays) -> Floats:
    """Give partials of the computed image coordinates by the points.

    Returns
    -------
    ndarray, shape (3, 2, k, S)
        In units of sigma per metre; object axes first.
    """
    partials: Floats = rays.turn[2][:, None] * rays.ratio
    partials += rays.turn[:2].transpose(1, 0, 2, 3)
    partials *= rays.pull * -rays.depth
    return partials


def by_photo(rays: Rays, more: int) -> Floats:
    """Give partials of the computed image coordinates by the photo's parameters, the misfit as last row.

    Parameters
    ----------
    more : int
        Rows for common parameters, left to be filled, between the photo's and the misfit.

    Returns
    -------
    ndarray, shape (6 + more + 1, 2, k, S)
        In units of sigma per metre and radian.
    """
    partials = np.empty((PHOTO + more + 1, *rays.ratio.shape))
    ratio, pull = rays.ratio, rays.pull
    lean = ratio * pull
    np.multiply(pull[0], rays.depth, out=partials[0, 0])
    np.multiply(pull[1], rays.depth, out=partials[1, 1])
    partials[0, 1] = partials[1, 0] = 0.0
    np.multiply(lean, rays.depth, out=partials[2])
    np.multiply(lean, ratio[1], out=partials[3])
    partials[3, 1] += pull[1]
    np.multiply(lean, ratio[0], out=partials[4])
    partials[4, 0] += pull[0]
    np.multiply(pull[0], ratio[1], out=partials[5, 0])
    np.multiply(pull[1], ratio[0], out=partials[5, 1])
    np.negative(partials[5, 1], out=partials[5, 1])
    partials[-1] = rays.misfit
    return partials


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Points of a batch, eliminated."""

    # (S,): reciprocal diagonal of the Cholesky factor L of the normal matrix of each point (three), then its elements
    # below the diagonal, 21, 31, 32
    root: tuple[Floats, ...]
    # (6 k + more + 1, 3, S): T: for each ray six rows, then the common parameters; last L^-1 times the right-hand side
    # of the point
    rows: Floats
    # (S,): least information on a direction as part of all on the point: about the square of the sine of the angle
    # between rays. NaN where the matrix is not positive definite
    strength: Floats


def eliminate(batch: Batch, xyz: Floats, rays: Rays, common: Floats | None, damping: float = 0.0) -> Eliminated:
    """Eliminate the points of a batch.

    Parameters
    ----------
    batch : Batch
        The rays and the control of these points.
    xyz : ndarray, shape (3, S)
        Points of the slots.
    rays : Rays
        The rays, linearised there.
    common : ndarray, shape (more, 2, k, S), or None
        Partials by common parameters, in units of sigma.
    damping : float
        Part of its diagonal by which each normal matrix is made larger.
    """
    white = by_point(rays)
    normal, right = point_normals(batch, xyz, white, rays.misfit)
    root, strength = cholesky(normal, damping)
    with np.errstate(invalid="ignore", over="ignore"):
        forward(root, right)
        forward(root, white)
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


def point_normals(batch: Batch, xyz: Floats, partials: Floats, misfit: Floats) -> tuple[list[Floats], Floats]:
    """Sum normal matrices of points.

    Parameters
    ----------
    batch : Batch
        The rays and the control of these points.
    xyz : ndarray, shape (3, S)
        Points of the slots.
    partials : ndarray, shape (3, 2, k, S)
        Partials by the points, in units of sigma.
    misfit : ndarray, shape (2, k, S)
        Measured minus computed, in units of sigma.

    Returns
    -------
    normal : list of ndarray, shape (S,)
        Elements 11, 22, 33, 21, 31, 32.
    right : ndarray, shape (3, S)
        Right-hand sides.
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


def cholesky(normal: list[Floats], damping: float = 0.0) -> tuple[tuple[Floats, ...], Floats]:
    """Cholesky factors of 3 x 3 matrices.

    Parameters
    ----------
    normal : list of ndarray, shape (S,)
        Elements 11, 22, 33, 21, 31, 32.
    damping : float
        Part of the diagonal that is added to it.

    Returns
    -------
    root : tuple of ndarray, shape (S,)
        Reciprocals of 11, 22, 33 of the factor; its elements 21, 31, 32. NaN where a matrix is not positive.
    strength : ndarray, shape (S,)
        Smallest square of the diagonal of the factor as part of the trace of the matrix.
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
    return (r1, r2, r3, l21, l31, l32), strength


def forward(root: tuple[Floats, ...], columns: Floats) -> None:
    """Multiply with L^-1, in place.

    Parameters
    ----------
    root : tuple of ndarray, shape (S,)
        As of ``cholesky``.
    columns : ndarray, shape (3, ..., S)
        Columns, one for each slot and each leading index.
    """
    r1, r2, r3, l21, l31, l32 = root
    first, second, third = columns
    first *= r1
    second -= first * l21
    second *= r2
    third -= first * l31
    third -= second * l32
    third *= r3


def backward(root: tuple[Floats, ...], columns: Floats) -> None:
    """Multiply with the transpose of L^-1, in place; see ``forward``."""
    r1, r2, r3, l21, l31, l32 = root
    first, second, third = columns
    third *= r3
    second -= third * l32
    second *= r2
    first -= second * l21
    first -= third * l31
    first *= r1


def squares(batch: Batch, partials: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Products of the rows of each group: what is added and what is subtracted at its photos.

    Parameters
    ----------
    partials : ndarray, shape (6 + more + 1, 2, k, S)
        Of ``by_photo``.
    rows : ndarray, shape (6 k + more + 1, 3, S)
        Of ``eliminate``.

    Returns
    -------
    added : ndarray, shape (k, groups, 6 + more + 1, 6 + more + 1)
        B'B of each ray of each group, summed over its points. The last element of all, the square of the misfits,
        stands summed over the batch in the first.
    taken : ndarray, shape (groups, 6 k + more + 1, 6 k + more + 1)
        T T', summed over the points; the last element likewise.
    """
    p, q, k, groups = len(partials), len(rows), partials.shape[2], len(batch.sets)
    added, taken = np.empty((k, groups, p, p)), np.empty((groups, q, q))
    done = 0
    for first, last, count, size in batch.runs:
        run = (partials[..., first:last], rows[..., first:last])
        to = (added[:, done : done + count, :, :-1], taken[done : done + count, :, :-1])
        (_small_squares if size <= SMALL_GROUP else _large_squares)(run, to, count, size)
        done += count
    added[..., :-1, -1], taken[:, :-1, -1] = added[..., -1, :-1], taken[:, -1, :-1]
    added[..., -1, -1] = taken[:, -1, -1] = 0.0
    added[0, 0, -1, -1] = np.einsum("akr,akr->", partials[-1], partials[-1])
    taken[0, -1, -1] = np.einsum("cr,cr->", rows[-1], rows[-1])
    return added, taken


# Both leave out the last column: numpy would take a whole square to BLAS as symmetric, which is slower when small.


def _small_squares(run: tuple[Floats, Floats], to: tuple[Floats, Floats], count: int, size: int) -> None:
    """Bring the numbers of each group together, and multiply."""
    own = np.ascontiguousarray(run[0].transpose(2, 3, 1, 0)).reshape(-1, count, 2 * size, len(run[0]))
    np.matmul(own.swapaxes(-1, -2), own[..., :-1], out=to[0])
    joint = np.ascontiguousarray(run[1].transpose(2, 1, 0)).reshape(count, 3 * size, len(run[1]))
    np.matmul(joint.swapaxes(-1, -2), joint[..., :-1], out=to[1])


def _large_squares(run: tuple[Floats, Floats], to: tuple[Floats, Floats], count: int, size: int) -> None:
    """Multiply where the numbers are."""
    p, _, k, _ = run[0].shape
    own = run[0].reshape(p, 2, k, count, size).transpose(1, 2, 3, 0, 4)
    both = own @ own[..., :-1, :].swapaxes(-1, -2)
    np.add(both[0], both[1], out=to[0])
    joint = run[1].reshape(-1, 3, count, size).transpose(1, 2, 0, 3)
    three = joint @ joint[..., :-1, :].swapaxes(-1, -2)
    three[0] += three[1]
    np.add(three[0], three[2], out=to[1])
