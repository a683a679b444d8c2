"""Normal equations of the photos and the common parameters, after all points are eliminated."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.frozen import dataclass
from photostrip.triangulation.bundle.normal_equations.band import Band
from photostrip.triangulation.bundle.normal_equations.point_elimination import Eliminated, blocks_of, eliminate, squares
from photostrip.triangulation.bundle.normal_equations.sparse import Sparse
from photostrip.triangulation.bundle.observations.collinearity import PHOTO, by_photo
from photostrip.triangulation.bundle.observations.given_orientations import (
    LinearisedOrientations,
    attitudes_at,
    positions_at,
)
from photostrip.triangulation.bundle.parameters import Parameters, PreparedProblem

Factor = Band | Sparse
WIDE = 1e11  # multiplications for the factor of a band, some seconds: from there a sparse factor is tried


@dataclass(frozen=True, eq=False)
class Reduced:
    """Normal equations at one state."""

    blocks: Floats  # (b, 6, 6): blocks of pairs of photos
    border: Floats  # (m, 6, p + 1): photos with common parameters, and right-hand sides, in the order of the band
    # (p + 1, p + 1): common parameters, their right-hand sides; last the sum of squares that no step can reach below,
    # before the photos and common parameters move
    corner: Floats
    chi_square: float  # weighted sum of squares of all misfits at the state
    points: tuple[Eliminated, ...]  # the eliminated points of each batch


def reduce(prepared: PreparedProblem, state: Parameters, damping: float = 0.0) -> Reduced:
    """Linearise everything at a state and eliminate the points.

    ``damping`` is the part of its diagonal by which the normal matrix of each point is made larger.
    """
    structure, p, more = prepared.structure, len(state.common), len(prepared.calibrated)
    blocks = np.zeros((len(structure.rows), PHOTO, PHOTO))
    border, corner = np.zeros((len(structure.order), PHOTO, p + 1)), np.zeros((p + 1, p + 1))
    inner = np.r_[0:more, p]
    table, chi_square, points = prepared.table(state), 0.0, []
    narrow = border if more == p else np.zeros((len(border), PHOTO, more + 1))
    every = zip(structure.batches, state.xyz, structure.pairs, structure.singles, strict=True)
    for batch, xyz, pairs, singles in every:
        rays, common = prepared.rays(batch, xyz, table, state.common)
        eliminated = eliminate(batch, xyz, rays, common, damping)
        partials = by_photo(rays, more)
        if common is not None:
            partials[PHOTO:-1] = common
        products = squares(batch, partials, eliminated.rows)
        chi_square += float(products.added[0, 0, -1, -1])
        contributed = blocks_of(products, len(batch.photo))
        pairs.add(contributed.pairs, blocks)
        singles.add(contributed.border, narrow)
        corner[np.ix_(inner, inner)] += contributed.corner
        points.append(eliminated)
    if narrow is not border:
        border[:, :, inner] = narrow
    if not all(np.isfinite(each.strength).all() for each in points):
        chi_square = np.inf  # a step too far: rays that do not meet
    chi_square += _add_given(prepared, state, blocks, border, corner)
    chi_square += control_squares(prepared, state)
    return Reduced(blocks=blocks, border=border, corner=corner, chi_square=chi_square, points=tuple(points))


def _add_given(prepared: PreparedProblem, state: Parameters, blocks: Floats, border: Floats, corner: Floats) -> float:
    """Add camera positions, attitudes and a-priori values; give their sum of squares."""
    structure, total = prepared.structure, 0.0
    given_too = len(prepared.problem.positions) or len(prepared.problem.attitudes)
    for linear in given_at(prepared, state) if given_too else ():
        by_photos, others = linear.scaled()
        place = structure.rank[linear.photo]
        np.add.at(blocks, structure.diagonal[place], by_photos.swapaxes(1, 2) @ by_photos)
        np.add.at(border, place, by_photos.swapaxes(1, 2) @ others)
        corner += np.einsum("gai,gaj->ij", others, others)
        total += float((others[:, :, -1] ** 2).sum())
    weight = prepared.prior**-2.0
    diagonal = np.arange(len(weight))
    corner[diagonal, diagonal] += weight
    corner[diagonal, -1] -= weight * state.common
    corner[-1, diagonal] -= weight * state.common
    return total + float((weight * state.common**2).sum())


def given_at(prepared: PreparedProblem, state: Parameters) -> tuple[LinearisedOrientations, LinearisedOrientations]:
    """Linearise camera positions and attitudes at a state."""
    problem, calibrated = prepared.problem, len(prepared.calibrated)
    positions = positions_at(problem.positions, state.centers, state.rotations, state.common, calibrated)
    return positions, attitudes_at(problem.attitudes, state.rotations, len(state.common))


def points_of(prepared: PreparedProblem, state: Parameters) -> Floats:
    """Collect the points from the batches, shape (q, 3); a point without rays keeps its start."""
    points = np.array(prepared.problem.start.points, float)
    for batch, xyz in zip(prepared.structure.batches, state.xyz, strict=True):
        points[batch.point[batch.real]] = xyz[:, batch.real].T
    return points


def control_residuals(prepared: PreparedProblem, state: Parameters) -> Floats:
    """Give adjusted minus given coordinates of control along its axes, metres, shape (c, 3)."""
    control = prepared.problem.control
    if not len(control):
        return np.zeros((0, 3))
    points = np.array(prepared.problem.start.points[control.point], float)
    where = np.zeros(prepared.problem.points, np.intp)
    where[control.point] = np.arange(len(control))
    for batch, xyz in zip(prepared.structure.batches, state.xyz, strict=True):
        points[where[batch.point[batch.control]]] = xyz[:, batch.control].T
    points = points[where[control.point]]
    return np.asarray(np.einsum("nij,nj->ni", control.axes, points - control.xyz))


def control_squares(prepared: PreparedProblem, state: Parameters) -> float:
    """Weighted sum of squares of the control of points with rays."""
    control = prepared.problem.control
    if not len(control):
        return 0.0
    return float(((control_residuals(prepared, state) / control.sigma) ** 2).sum())


def factored(prepared: PreparedProblem, reduced: Reduced, add: Floats | None = None) -> Factor | None:
    """Assemble the matrix of the photos and factor it: in a band, or sparse where the band is wide.

    ``add`` (m, 6, 6) goes to the photos' own blocks. None when the matrix is not positive definite.
    """
    structure = prepared.structure
    blocks = reduced.blocks
    if add is not None:
        blocks = blocks.copy()
        blocks[structure.diagonal] += add
    if PHOTO * len(structure.order) * (PHOTO * structure.width) ** 2 > WIDE:
        matrix = Sparse(len(structure.order), structure.rows, structure.columns, blocks)
        return matrix if matrix.factor() else None
    band = Band(PHOTO * len(structure.order), PHOTO * (structure.width + 1) - 1)
    element = np.arange(PHOTO)
    row = (PHOTO * structure.rows)[:, None, None] + element[:, None]
    column = (PHOTO * structure.columns)[:, None, None] + element
    places = band.place(row, column)
    upper = np.zeros(places.shape, bool)
    upper[structure.diagonal] = element[:, None] < element
    places[upper] = len(band.flat) - 1  # of the diagonal blocks only the lower half belongs into the band
    band.flat[places] = blocks
    band.flat[-1] = 0.0
    return band if band.factor() else None
