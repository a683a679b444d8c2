"""Cofactors of everything that was adjusted, from the elements of the inverse within the band.

The photos of a point lie within the band, so that the joint cofactors of its photos are at hand, and with them those of
the point and of its residuals: with T, L as in ``point_elimination`` and Z of the photos and common parameters,
Y = Z T and M = I + T'Y give the cofactors L^-T M L^-1 of the point and -Y L^-1 between photos and point.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.frozen import dataclass
from photostrip.geometry.similarity import similarity_derivatives
from photostrip.triangulation.bundle.normal_equations import datum
from photostrip.triangulation.bundle.normal_equations.factored import Inverse, solved_for
from photostrip.triangulation.bundle.normal_equations.point_elimination import Eliminated
from photostrip.triangulation.bundle.normal_equations.reduced import given_at
from photostrip.triangulation.bundle.observations.collinearity import PHOTO, SIGNS, by_photo, by_point
from photostrip.triangulation.bundle.observations.given_orientations import LinearisedOrientations
from photostrip.triangulation.bundle.observations.ray_batches import RayBatch
from photostrip.triangulation.bundle.parameters import Parameters, PreparedProblem
from photostrip.triangulation.bundle.solution import BundleSolution, Cofactors


def cofactors_of(solution: BundleSolution, *, rough: bool = False) -> Cofactors:
    """Cofactors of all parameters and residuals; ``bundle-rank`` when the normal matrix is singular at the solution.

    rough: leave points and photos of a free network in the datum of its band, which no residual feels.
    """
    prepared = solution.prepared
    state, reduced, inverse = solution.state, solution.factored.reduced, solution.factored.inverse
    points = np.full((prepared.problem.points, 3, 3), np.nan)
    residuals = np.zeros((len(prepared.problem.images), 2, 2))
    table = prepared.table(state)
    for batch, xyz, eliminated in zip(prepared.structure.batches, state.xyz, reduced.points, strict=True):
        of_points, of_rays = _batch(prepared, batch, eliminated, inverse, xyz, table)
        points[batch.point[batch.real]] = of_points[batch.real]
        residuals[batch.row[:, batch.real].ravel()] = of_rays[:, batch.real].reshape(-1, 2, 2)
    of_photos = inverse.cofactors(np.arange(len(table[0]))[:, None], len(state.common))
    positions, attitudes = (_given(prepared, linear, of_photos) for linear in given_at(prepared, state))
    if solution.free and not rough:
        points, of_photos = _inner(solution, state, points, of_photos)
    photos, cross = _turned(prepared, state, of_photos)
    weights = prepared.prior**-2.0
    residuals *= prepared.problem.images.sigma[:, :, None] * prepared.problem.images.sigma[:, None, :]
    return Cofactors(
        points=points,
        photos=photos,
        common=inverse.common,
        image_residuals=residuals,
        control_residuals=_control(prepared, points),
        position_residuals=positions,
        attitude_residuals=attitudes,
        common_residuals=np.where(weights > 0.0, prepared.prior**2 - np.diag(inverse.common), 0.0),
        photo_common=cross,
    )


@dataclass(frozen=True, eq=False)
class JointCofactors:
    """Joint cofactors of several photos; of a free network in some datum, which nothing feels that can be observed."""

    inverse: Inverse
    rank: Numbers  # (m,): places of the photos in the band
    rotations: Floats  # (m, 3, 3): photo to Cartesian frame

    @classmethod
    def of_solution(cls, solution: BundleSolution) -> Self:
        return cls(solution.factored.inverse, solution.prepared.structure.rank, solution.rotations)

    def of(self, photos: Numbers, partials: Floats) -> Floats:
        """Joint cofactors (g, k c, k c) of c functions of each of k photos, in g sets of photos (g, k).

        partials: (g, k, c, 6): by shift (m) and rotation vector (rad) of the photo in the Cartesian frame.
        """
        (g, k, c, _), sets = partials.shape, self.rank[photos]
        inner = partials @ _own_axes(self.rotations)[photos]
        half = inner @ self.inverse.blocks(sets).swapaxes(2, 3).reshape(g, k, PHOTO, -1)
        whole = half.reshape(g, k * c, k, PHOTO).swapaxes(1, 2) @ inner.swapaxes(2, 3)
        found = whole.swapaxes(1, 2).reshape(g, k * c, -1)
        if len(self.inverse.common):
            cross = (inner @ self.inverse.cross[sets]).reshape(g, k * c, -1)
            found += cross @ self.inverse.common @ cross.swapaxes(1, 2)
        return np.asarray(found, float)


def _batch(
    prepared: PreparedProblem, batch: RayBatch, eliminated: Eliminated, inverse: Inverse, xyz: Floats, table: Floats
) -> tuple[Floats, Floats]:
    """Cofactors of the points (S, 3, 3), m^2, and of the residuals (k, S, 2, 2), in units of sigma."""
    more, k, slots = len(prepared.calibrated), *batch.photo.shape
    rays, common = prepared.rays(batch, xyz, table, np.zeros(0) if not more else np.zeros(more))
    white = by_point(rays)
    eliminated.root.forward(white)
    of_sets = inverse.cofactors(batch.sets, more)
    spread = _carried(batch, of_sets, eliminated.rows[:-1])
    of_point = np.einsum("pcs,pds->cds", eliminated.rows[:-1], spread)
    of_point[range(3), range(3)] += 1.0
    partials = by_photo(rays, more)[:-1]
    if common is not None:
        partials[PHOTO:] = common
    mixed = np.einsum(
        "pakr,kpcr->ackr", partials[:PHOTO], spread[: PHOTO * k].reshape(k, PHOTO, 3, slots), optimize=False
    )
    if more:
        mixed += np.einsum("pakr,pcr->ackr", partials[PHOTO:], spread[PHOTO * k :])
    fitted = _quadratic(batch, of_sets, partials)
    # white M white' - B Y white' - (B Y white')' + B Z B'
    half = 0.5 * np.einsum("cds,daks->caks", of_point, white) - mixed.transpose(1, 0, 2, 3)
    product = np.einsum("caks,cbks->abks", half, white)
    fitted += product + product.transpose(1, 0, 2, 3)
    found = -fitted.transpose(2, 3, 0, 1)
    found[..., range(2), range(2)] += 1.0
    eliminated.root.backward(of_point)
    of_point = of_point.transpose(1, 0, 2)
    eliminated.root.backward(of_point)
    return of_point.transpose(2, 0, 1), found


def _carried(batch: RayBatch, of_sets: Floats, rows: Floats) -> Floats:
    """Multiply the rows T of a batch with the joint cofactors of their photos: Z T, shape (q, 3, S)."""
    product = np.empty_like(rows)
    q, done = len(rows), 0
    for first, last, count, size in batch.runs:
        part = rows[..., first:last].reshape(q, 3, count, size).transpose(1, 2, 0, 3)
        carried = of_sets[done : done + count] @ part
        product[..., first:last] = carried.transpose(2, 0, 1, 3).reshape(q, 3, -1)
        done += count
    return product


def _quadratic(batch: RayBatch, of_sets: Floats, partials: Floats) -> Floats:
    """Give B Z B' of each ray, with the photo's and the common parameters, shape (2, 2, k, S)."""
    q, _, k, slots = partials.shape
    n = PHOTO * k
    found, done = np.empty((2, 2, k, slots)), 0
    for first, last, count, size in batch.runs:
        groups = slice(done, done + count)
        of_rays = np.empty((k, count, q, q))
        for ray in range(k):
            number = np.r_[PHOTO * ray : PHOTO * (ray + 1), n : n + q - PHOTO]
            of_rays[ray] = of_sets[groups][:, number[:, None], number]
        part = partials[..., first:last].reshape(q, 2, k, count, size)
        product = of_rays @ part.transpose(1, 2, 3, 0, 4)
        found[..., first:last] = np.einsum("pakgn,bkgpn->abkgn", part, product).reshape(2, 2, k, -1)
        done += count
    return found


def _control(prepared: PreparedProblem, points: Floats) -> Floats:
    """Cofactors of the residuals of control, along its axes."""
    control = prepared.problem.control
    found = -control.axes @ points[control.point] @ control.axes.swapaxes(1, 2)
    found[:, range(3), range(3)] += np.where(np.isfinite(control.sigma), control.sigma, 0.0) ** 2
    return found


def _given(prepared: PreparedProblem, linear: LinearisedOrientations, of_photos: Floats) -> Floats:
    """Cofactors of the residuals of camera positions or attitudes."""
    partials = np.concatenate([linear.by_photo, linear.by_common], axis=2)
    found: Floats = -partials @ of_photos[prepared.structure.rank[linear.photo]] @ partials.swapaxes(1, 2)
    with np.errstate(divide="ignore"):
        variance = np.where(linear.weight > 0.0, linear.weight**-2.0, 0.0)
    found[:, range(3), range(3)] += variance
    return found


def _turned(prepared: PreparedProblem, state: Parameters, of_photos: Floats) -> tuple[Floats, Floats]:
    """Turn the cofactors of photos (and common parameters) into the Cartesian frame and the problem's order."""
    rank, turn = prepared.structure.rank, _own_axes(state.rotations)
    alone = turn @ of_photos[rank, :PHOTO, :PHOTO] @ turn.swapaxes(1, 2)
    return alone, turn @ of_photos[rank, :PHOTO, PHOTO:]


def _own_axes(rotations: Floats) -> Floats:
    """Turn steps of photos in their own axes and signs into the Cartesian frame: matrices (m, 6, 6)."""
    turn = np.zeros((len(rotations), PHOTO, PHOTO))
    turn[:, :3, :3] = turn[:, 3:, 3:] = rotations
    return turn * SIGNS


def _inner(solution: BundleSolution, state: Parameters, points: Floats, of_photos: Floats) -> tuple[Floats, Floats]:
    """Carry cofactors of points and photos over to inner constraints on the points.

    With G the generators of the similarity, E the choice of the points, H = (G'EG)^-1 and P = Q E G H: the cofactors
    are Q - G P' - P G' + G (H G'E P) G'.
    """
    prepared, reduced = solution.prepared, solution.factored.reduced
    origin, inverse = datum.inner(prepared, state)
    p = len(state.common)
    moves = [similarity_derivatives(xyz.T, origin).transpose(1, 2, 0) for xyz in state.xyz]  # (3, 7, S)
    right = np.zeros((len(prepared.structure.order), PHOTO, datum.DEFECT))
    corner = np.zeros((p, datum.DEFECT))
    white = []
    for batch, eliminated, move in zip(prepared.structure.batches, reduced.points, moves, strict=True):
        pushed = move.copy()
        pushed[..., batch.dummy] = 0.0
        eliminated.root.forward(pushed)
        white.append(pushed)
        _push(batch, eliminated, pushed, right, corner)
    photos, common = solved_for(solution.factored, right, corner)
    total = np.zeros((datum.DEFECT, datum.DEFECT))
    shifts = []
    for batch, eliminated, pushed, move in zip(prepared.structure.batches, reduced.points, white, moves, strict=True):
        k = len(batch.photo)
        of_sets = photos[batch.photo]  # (k, S, 6, 7)
        rows = eliminated.rows[: PHOTO * k].reshape(k, PHOTO, 3, -1)
        shift = pushed - np.einsum("kpcs,kspd->cds", rows, of_sets)
        if len(prepared.calibrated):
            shift -= np.einsum("pcs,pd->cds", eliminated.rows[PHOTO * k : -1], common[: len(prepared.calibrated)])
        eliminated.root.backward(shift)
        total += np.einsum("cas,cbs->ab", move[..., batch.real], shift[..., batch.real])
        shifts.append(shift)
    middle = inverse @ total @ inverse
    found = points.copy()
    for batch, move, shift in zip(prepared.structure.batches, moves, shifts, strict=True):
        real = batch.real
        moved, swept = move[..., real].transpose(2, 0, 1), shift[..., real].transpose(2, 0, 1) @ inverse
        found[batch.point[real]] += _carried_over(moved, swept, middle)
    turned = np.zeros((len(photos), PHOTO + p, datum.DEFECT))
    turned[:, :PHOTO] = datum.photo_generators(prepared, state, origin)
    swept = np.concatenate([photos, np.broadcast_to(common, (len(photos), *common.shape))], axis=1) @ inverse
    return found, of_photos + _carried_over(turned, swept, middle)


def _carried_over(moves: Floats, swept: Floats, middle: Floats) -> Floats:
    """Give G M G' - G P' - P G'."""
    product = moves @ swept.swapaxes(1, 2)
    return np.asarray(moves @ middle @ moves.swapaxes(1, 2) - product - product.swapaxes(1, 2))


def _push(batch: RayBatch, eliminated: Eliminated, pushed: Floats, right: Floats, corner: Floats) -> None:
    """Subtract what right-hand sides (3, c, S) of points, multiplied with L^-1, leave for photos and common."""
    k, n = len(batch.photo), PHOTO * len(batch.photo)
    left = np.einsum("kpcs,cds->kspd", eliminated.rows[:n].reshape(k, PHOTO, 3, -1), pushed)
    np.subtract.at(right, batch.photo, left)
    calibrated = len(eliminated.rows) - 1 - n
    corner[:calibrated] -= np.einsum("pcs,cds->pd", eliminated.rows[n:-1], pushed)
