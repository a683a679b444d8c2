"""Cholesky factor of normal equations in a band, solutions with it, and the elements of the inverse within the band.

The band is stored as scipy wants it: column by column, the diagonal first. Element (i, j) of the matrix then stands at
place ``i + j * width`` of the flat array (width: elements below the diagonal), so that any block within the band can be
looked at as a plain matrix without copying; what such a view shows beyond the band is another column's.

Normal equations of a bundle at one state: points eliminated, photos in a band, common parameters as its border.

With A, B, C the derivatives of the rays by their photo, point and the common parameters, all in units of sigma, and
L L' the normal matrix of a point (its control included), the photos get A'A - T T' with T = A'B L^-T, the border is
A'C - T R with R = L^-1 B'C, and the corner C'C - R'R. Source: [Granshaw 1980] for the elimination.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import as_strided
from scipy.linalg import cho_solve_banded, cholesky_banded, solve_triangular
from scipy.sparse import bsr_array, csr_array

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.network.observations import LinearisedOrientations, Rays, attitudes_at, positions_at, view
from photostrip.network.problem import ImageObservations, Parameters, PreparedProblem

COLUMNS_AT_A_TIME = 48  # columns of the inverse that are found at a time


class Band:
    """A symmetric positive definite matrix with ``width`` elements below the diagonal, and its Cholesky factor.

    ``block`` rows and columns belong to each photo or model.
    """

    def __init__(self, size: int, width: int, block: int) -> None:
        self.block = block
        self.size, self.width = size, min(width, size - 1)
        # The last few rows of views reach beyond the end.
        self.flat = np.zeros((size + self.width + COLUMNS_AT_A_TIME) * (self.width + 1))

    @property
    def columns(self) -> Floats:
        """The storage as LAPACK sees it, shape (width + 1, size), by columns."""
        return self.flat[: self.size * (self.width + 1)].reshape(self.size, self.width + 1).T

    def place(self, row: Numbers, column: Numbers) -> Numbers:
        """Places of elements (row >= column) in the flat storage."""
        return row + column * self.width

    def holds(self, row: Numbers, column: Numbers) -> Flags:
        """Whether the blocks of pairs of photos lie within the band."""
        return np.asarray(np.abs(row - column) <= self.width // self.block)

    def blocks(self, row: Numbers, column: Numbers) -> Floats:
        """Give blocks within the band, shape (..., u, u)."""
        table, middle = self._table, self.width // self.block
        return table.reshape(-1, self.block, self.block)[row * table.shape[1] + column - row + middle]

    @cached_property
    def _table(self) -> Floats:
        """All blocks, of both halves: in row i those of photo i with the photos from i - w to i + w."""
        u = self.block
        photos, width, stride = self.size // u, self.width // u, self.flat.itemsize
        strides = (u * (1 + self.width) * stride, u * stride, stride, self.width * stride)
        lower = as_strided(self.flat, (photos, width + 1, u, u), strides)  # by column, from the diagonal down
        table = np.empty((photos, 2 * width + 1, u, u))
        table[:, width] = np.tril(lower[:, 0]) + np.tril(lower[:, 0], -1).swapaxes(1, 2)
        for lag in range(1, width + 1):
            table[lag:, width - lag] = lower[:-lag, lag]
            table[:-lag, width + lag] = lower[:-lag, lag].swapaxes(1, 2)
        return table

    def look(self, row: int, column: int, rows: int, columns: int) -> Floats:
        """Look at a block; only what lies in the band's lower half belongs to the matrix."""
        stride = self.flat.itemsize
        return as_strided(self.flat[row + column * self.width :], (rows, columns), (stride, stride * self.width))

    def factor(self) -> bool:
        """Replace the matrix by its factor; False when it is not positive definite."""
        try:
            self.columns[...] = cholesky_banded(self.columns, overwrite_ab=True, lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            return False
        return True

    def solve(self, right: Floats) -> Floats:
        """Solve for columns (size, c) with the factor."""
        return np.asarray(cho_solve_banded((self.columns, True), right, check_finite=False))

    def inverse(self) -> Band:
        """Find the elements of the inverse within the band, lower half; what stands outside the band is not defined.

        With columns i and the rows J below them, and L the factor: Z_Ji = -Z_JJ L_Ji L_ii^-1 and
        Z_ii = (L_ii L_ii')^-1 - (L_Ji L_ii^-1)' Z_Ji, from the last columns to the first. Source: [Takahashi 1973].
        """
        inverse = Band(self.size, self.width, self.block)
        window = np.zeros((self.width, self.width))
        for first in range((self.size - 1) // COLUMNS_AT_A_TIME * COLUMNS_AT_A_TIME, -1, -COLUMNS_AT_A_TIME):
            count = min(COLUMNS_AT_A_TIME, self.size - first)
            below = min(self.width, self.size - first - count)
            own = np.tril(np.triu(self.look(first, first, count, count), -self.width))
            diagonal = solve_triangular(own, np.eye(count), lower=True, check_finite=False)
            # Below the diagonal blocks, what is within the band: first + count + row - (first + column) <= width.
            coupling = np.triu(self.look(first + count, first, below, count), count - self.width) @ diagonal
            under = -window[:below, :below] @ coupling
            whole = np.zeros((count + self.width, count + self.width))
            whole[:count, :count] = diagonal.T @ diagonal - coupling.T @ under
            whole[count : count + below, :count], whole[:count, count : count + below] = under, under.T
            whole[count:, count:] = window[: self.width, : self.width]
            row, column = whole.strides
            sheared = as_strided(whole, (count, self.width + 1), (row + column, row))
            inverse.columns.T[first : first + count] = sheared
            window = whole[: self.width, : self.width]
        return inverse


@dataclass(frozen=True, eq=False)
class Linearised:
    """All observations at one state."""

    rays: Rays
    # (c, 3), (c, 3, 3): given minus computed coordinates of control in units of sigma, 0 where nothing is given; their
    # derivatives by the point
    control: Floats
    by_controlled: Floats
    positions: LinearisedOrientations
    attitudes: LinearisedOrientations
    chi_square: float  # weighted sum of squares of all misfits, a-priori values of common parameters among them


def linearise(prepared: PreparedProblem, state: Parameters) -> Linearised:
    problem, calibrated = prepared.problem, prepared.calibrated
    rays = view(problem, state)
    control = problem.control
    counts = (1.0 / control.sigma) * prepared.measured[control.point][:, None]
    by_controlled = control.axes * counts[:, :, None]
    misfit = np.einsum("nij,nj->ni", by_controlled, control.xyz - state.points[control.point])
    positions = positions_at(problem.positions, state.centers, state.rotations, state.common, calibrated)
    attitudes = attitudes_at(problem.attitudes, state.rotations, len(state.common))
    parts = [rays.misfit, misfit, state.common / prepared.prior]
    parts += [each.residual * each.weight for each in (positions, attitudes)]
    return Linearised(
        rays=rays,
        control=misfit,
        by_controlled=by_controlled,
        positions=positions,
        attitudes=attitudes,
        chi_square=sum(float(np.vdot(each, each)) for each in parts),
    )


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations of photos (m), points (q) and common parameters (p) at one state."""

    prepared: PreparedProblem
    linearised: Linearised
    root: Floats  # (q, 3, 3): L^-1 of the points
    # (q,): least information on a direction as part of all on the point: about the square of the sine of the angle
    # between rays. NaN where the matrix is not positive definite
    strength: Floats
    carried: bsr_array  # (u m, 3 q): T
    unreduced: Floats  # (m, u, u): A'A of each photo, with what positions and attitudes add
    blocks: Floats  # (b, u, u): A'A - T T' for each pair of photos, with what positions and attitudes add
    border: Floats  # (u m, p): A'C - T R
    common_points: csr_array  # (3 q, p): R
    corner: Floats  # (p, p): C'C - R'R, with the a-priori weights
    # right-hand sides: of photos and common parameters with the points eliminated, and L^-1 times those of the points
    right_photos: Floats  # (u m,)
    right_points: Floats  # (3 q,)
    right_common: Floats  # (p,)

    @property
    def own(self) -> Floats:
        """Blocks of each photo with itself, (m, u, u)."""
        return self.blocks[self.prepared.own]

    @property
    def roots(self) -> bsr_array:
        """The inverses of the points' factors as one matrix, (3 q, 3 q)."""
        return _blocks(self.root, np.arange(len(self.root)), len(self.root))

    @property
    def chi_square(self) -> float:
        return self.linearised.chi_square if np.isfinite(self.strength).all() else np.inf


def equations_at(prepared: PreparedProblem, state: Parameters, damping: float = 0.0) -> NormalEquations:
    """Linearise everything at a state and eliminate the points.

    ``damping`` is the part of its diagonal by which the normal matrix of each point is made larger.
    """
    problem, at = prepared.problem, linearise(prepared, state)
    control, rays, m, q, p = problem.control, at.rays, problem.photos, problem.points, len(state.common)
    u = problem.unknowns
    A = _blocks(rays.by_photo, problem.images.photo, m)
    B = _blocks(rays.by_point, problem.images.point, q)
    by_photo, by_point, misfit = A.T, B.T, rays.misfit.ravel()

    normal, right = _own_blocks(by_point @ B, q), (by_point @ misfit).reshape(q, 3)
    np.add.at(normal, control.point, at.by_controlled.swapaxes(1, 2) @ at.by_controlled)
    np.add.at(right, control.point, np.einsum("nip,ni->np", at.by_controlled, at.control))
    normal[~prepared.measured] = np.eye(3)
    normal[:, range(3), range(3)] *= 1.0 + damping
    root, strength = _roots(normal)
    roots = _blocks(root, np.arange(q), q)
    pull = rays.by_photo.swapaxes(1, 2) @ (rays.by_point @ root.swapaxes(1, 2)[problem.images.point])
    carried = _by_photo(pull, problem.images, m, q)
    right_points = roots @ right.ravel()

    own, right_photos = _own_blocks(by_photo @ A, m), (by_photo @ misfit).reshape(m, u)
    border, corner, right_common = np.zeros((u * m, p)), np.diag(prepared.prior**-2.0), np.zeros(p)
    for given in (each for each in (at.positions, at.attitudes) if len(each.photo)):  # of photos only
        by_given, by_common, off = given.scaled()
        np.add.at(own, given.photo, by_given.swapaxes(1, 2) @ by_given)
        np.add.at(right_photos, given.photo, np.einsum("nip,ni->np", by_given, off))
        np.add.at(border.reshape(m, u, p), given.photo, by_given.swapaxes(1, 2) @ by_common)
        corner += np.einsum("nia,nib->ab", by_common, by_common)
        right_common += np.einsum("nia,ni->a", by_common, off)
    right_common -= prepared.prior**-2.0 * state.common
    C = csr_array((rays.by_common.data, rays.by_common.indices, rays.by_common.indptr), shape=(rays.misfit.size, p))
    common_points = csr_array((3 * q, p))
    if prepared.calibrated:
        common_points = csr_array(roots @ (by_point @ C))
        border += (by_photo @ C - carried @ common_points).toarray()
        corner += (C.T @ C - common_points.T @ common_points).toarray()
        right_common += C.T @ misfit - common_points.T @ right_points
    blocks = -_squares(prepared, pull)
    blocks[prepared.own] += own
    return NormalEquations(
        prepared=prepared,
        linearised=at,
        root=root,
        strength=strength,
        carried=carried,
        unreduced=own,
        blocks=blocks,
        border=border,
        common_points=common_points,
        corner=corner,
        right_photos=right_photos.ravel() - carried @ right_points,
        right_points=right_points,
        right_common=right_common,
    )


def _blocks(blocks: Floats, column: Numbers, columns: int) -> bsr_array:
    """Sparse matrix of one block in each row of blocks, (n a, columns b), from blocks (n, a, b) and their columns."""
    n, a, b = blocks.shape
    return bsr_array((blocks, column, np.arange(n + 1)), shape=(n * a, columns * b))


def _by_photo(blocks: Floats, images: ImageObservations, photos: int, points: int) -> bsr_array:
    """Sparse matrix (u m, 3 q) of blocks (n, u, 3), one for each ray."""
    order = np.argsort(images.photo, kind="stable")
    edges = np.searchsorted(images.photo[order], np.arange(photos + 1))
    return bsr_array((blocks[order], images.point[order], edges), shape=(blocks.shape[1] * photos, 3 * points))


def _squares(prepared: PreparedProblem, pull: Floats) -> Floats:
    """T T' at the pairs of photos, (b, u, u), from the blocks (n, u, 3) of T: dense products of near points."""
    u = prepared.problem.unknowns
    found = np.zeros((len(prepared.row), u, u))
    for near in prepared.near:
        photos = len(near.photos)
        rows = np.zeros((photos, u, len(near.points), 3))
        rows[near.photo, :, near.point] = pull[near.ray]
        flat = rows.reshape(u * photos, -1)
        product = (flat @ flat.T).reshape(photos, u, photos, u).swapaxes(1, 2)
        pair = prepared.pair(near.photos[:, None], near.photos)
        found[pair[pair >= 0]] += product[pair >= 0]
    return found


def _own_blocks(matrix: bsr_array, size: int) -> Floats:
    """Diagonal blocks of a matrix of that many, zero where it has none."""
    row = np.repeat(np.arange(size), np.diff(matrix.indptr))
    own = row == matrix.indices
    found = np.zeros((size, *matrix.blocksize))
    found[row[own]] = matrix.data[own]
    return found


def _roots(normal: Floats) -> tuple[Floats, Floats]:
    """Inverses of the Cholesky factors of matrices (q, 3, 3), and their strength, (q,); NaN where not definite.

    Element by element: numpy factors 3 x 3 matrices one by one, ten times slower, and refuses all for one.
    """
    root = np.zeros_like(normal)
    with np.errstate(invalid="ignore", divide="ignore"):
        a = 1.0 / np.sqrt(normal[:, 0, 0])
        l21, l31 = normal[:, 1, 0] * a, normal[:, 2, 0] * a
        b = 1.0 / np.sqrt(normal[:, 1, 1] - l21**2)
        l32 = (normal[:, 2, 1] - l21 * l31) * b
        c = 1.0 / np.sqrt(normal[:, 2, 2] - l31**2 - l32**2)
        root[:, 0, 0], root[:, 1, 1], root[:, 2, 2] = a, b, c
        root[:, 1, 0], root[:, 2, 1] = -l21 * a * b, -l32 * b * c
        root[:, 2, 0] = (l21 * l32 * b - l31) * a * c
        strength = 1.0 / (np.maximum(np.maximum(a, b), c) ** 2 * np.einsum("nii->n", normal))
    return root, strength


class Columns(NamedTuple):
    """What each of k causes of size one puts into the observations, in units of their standard deviations."""

    among: Flags  # (n,): rays that they touch
    rays: Floats  # (r, c, k): of these rays
    control: Floats  # (c, 3, k): along its axes
    positions: Floats  # (g, 3, k): along theirs


class Explained(NamedTuple):
    """Normal equations of causes beside all unknowns: with H their columns, w the misfits, M = I - A Q A'."""

    pull: Floats  # (k,): H' M w
    normal: Floats  # (k, k): H' M H
    squares: Floats  # (k,): H' H of each column


class Solved(NamedTuple):
    """N^-1 times right-hand sides of k columns."""

    photos: Floats  # (u m, k)
    points: Floats  # (3 q, k)
    common: Floats  # (p, k)


@dataclass(frozen=True, eq=False)
class FactoredEquations:
    """Normal equations with the photos' part in factors."""

    equations: NormalEquations
    band: Band  # the factor, photos in the order of ``rank``
    damping: float = 0.0  # part by which the diagonal of what is left for the common parameters is made larger

    @cached_property
    def places(self) -> Numbers:
        """Row within the band of each parameter of the photos, (u m,)."""
        u = self.band.block
        return (u * self.equations.prepared.rank[:, None] + np.arange(u)).ravel()

    @cached_property
    def inverse(self) -> Band:
        """Elements within the band of the inverse of the photos' part alone, in the order of ``rank``."""
        return self.band.inverse()

    @cached_property
    def cross(self) -> Floats:
        """Photos' part of the inverse times the border, (u m, p)."""
        return self.by_photos(self.equations.border)

    @cached_property
    def left(self) -> Floats:
        """Normal matrix of the common parameters with everything else unknown, (p, p)."""
        return np.asarray(self.equations.corner - self.equations.border.T @ self.cross)

    @cached_property
    def common(self) -> Floats:
        """Cofactors of the common parameters, (p, p)."""
        damped = self.left + self.damping * np.diag(np.diag(self.left))
        inverse = np.linalg.inv(damped)
        return np.asarray(0.5 * (inverse + inverse.T))

    def by_photos(self, right: Floats) -> Floats:
        """Solve for right-hand sides (u m, k) of the photos alone."""
        ordered = np.empty_like(right)
        ordered[self.places] = right
        return self.band.solve(ordered)[self.places] if right.size else right

    def solved(self, photos: Floats, points: Floats, common: Floats) -> Solved:
        """Solve for right-hand sides of photos (u m, k) and common parameters (p, k), points (3 q, k) eliminated.

        Those of the points are multiplied with L^-1 already, and subtracted from the others as in ``equations_at``.
        """
        equations = self.equations
        by_photos, by_common = self.shared(photos, common)
        rest = points - equations.carried.T @ by_photos - equations.common_points @ by_common
        return Solved(by_photos, equations.roots.T @ rest, by_common)

    def shared(self, photos: Floats, common: Floats) -> tuple[Floats, Floats]:
        """Solve for right-hand sides of photos (u m, k) and common parameters (p, k) with the points eliminated."""
        alone = self.by_photos(photos)
        by_common = self.common @ (common - self.equations.border.T @ alone)
        return alone - self.cross @ by_common, by_common

    def explained(self, columns: Columns) -> Explained:
        """Say what the misfits would lose by causes that nothing has been asked about."""
        equations, at = self.equations, self.equations.linearised
        problem, k, p = equations.prepared.problem, columns.rays.shape[2], len(equations.right_common)
        m, q, (rays,) = problem.photos, problem.points, np.nonzero(columns.among)
        of_rays = columns.rays.reshape(columns.rays.shape[0] * columns.rays.shape[1], k)  # k may be 0
        photos = _blocks(at.rays.by_photo[rays], problem.images.photo[rays], m).T @ of_rays
        points = _blocks(at.rays.by_point[rays], problem.images.point[rays], q).T @ of_rays
        np.add.at(points.reshape(q, 3, k), problem.control.point, at.by_controlled.swapaxes(1, 2) @ columns.control)
        by_calibration = at.rays.by_common
        common = np.zeros((p, k))
        common[: by_calibration.shape[1]] = by_calibration[np.repeat(columns.among, columns.rays.shape[1])].T @ of_rays
        squares = of_rays.T @ of_rays + np.einsum("nik,nil->kl", columns.control, columns.control)
        pull = of_rays.T @ at.rays.misfit[rays].ravel() + np.einsum("nik,ni->k", columns.control, at.control)
        if len(at.positions.photo):
            by_photo, by_common, off = at.positions.scaled()
            np.add.at(
                photos.reshape(m, problem.unknowns, k), at.positions.photo, by_photo.swapaxes(1, 2) @ columns.positions
            )
            common += np.einsum("nip,nik->pk", by_common, columns.positions)
            squares += np.einsum("nik,nil->kl", columns.positions, columns.positions)
            pull += np.einsum("nik,ni->k", columns.positions, off)
        white = equations.roots @ points
        photos, common = photos - equations.carried @ white, common - equations.common_points.T @ white
        by_photos, by_common = self.shared(photos, common)
        normal = squares - white.T @ white - photos.T @ by_photos - common.T @ by_common
        pull = pull - white.T @ equations.right_points - by_photos.T @ equations.right_photos
        pull = pull - by_common.T @ equations.right_common
        return Explained(pull, 0.5 * (normal + normal.T), np.diag(squares))

    def solved_for_points(self, right: Floats) -> Solved:
        """Solve for right-hand sides (3 q, k) of the points alone."""
        equations = self.equations
        white = equations.roots @ right
        return self.solved(-(equations.carried @ white), white, -(equations.common_points.T @ white))


def factored(equations: NormalEquations, added: Floats | None = None, damping: float = 0.0) -> FactoredEquations | None:
    """Factor the photos' part, with ``added`` (m, u, u) to the photos' own blocks; None when not positive definite."""
    prepared, blocks = equations.prepared, equations.blocks
    m, row, column, own = prepared.problem.photos, prepared.row, prepared.column, prepared.own
    if added is not None:
        blocks = blocks.copy()
        blocks[own] += added
    u = prepared.problem.unknowns
    band = Band(u * m, u * (int((row - column).max()) + 1) - 1, u)
    element = np.arange(u)
    places = band.place((u * row)[:, None, None] + element[:, None], (u * column)[:, None, None] + element)
    upper = np.zeros(places.shape, bool)
    upper[own] = element[:, None] < element
    places[upper] = len(band.flat) - 1  # of the diagonal blocks only the lower half belongs into the band
    band.flat[places] = blocks
    band.flat[-1] = 0.0
    return FactoredEquations(equations, band, damping) if band.factor() else None
