"""Cofactors of everything that was adjusted: of single points, photos and residuals, and joint ones.

With Z the inverse of the photos' part of the normal matrix, W = Z times the border and K the cofactors of the common
parameters, the inverse is that without common parameters and E K E', E what a common parameter does to everything else:
-W to the photos, M W - V^-1 B'C to the points. The photos of a point lie within the band, where the elements of Z are
known; with M = V^-1 B'A of each ray, A and B its derivatives by photo and point, V the normal matrix of the point, the
cofactors of a point are V^-1 + sum M_i Z_ij M_j', those between its photos and it -sum Z_ij M_j'.

Parameters that the observations hardly tell apart: correlations by name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.sparse import csr_array

from photostrip.arrays import Floats, Numbers
from photostrip.network import defects
from photostrip.network.adjustment import BundleSolution, Cofactors
from photostrip.network.normal_equations import FactoredEquations
from photostrip.network.observations import LinearisedOrientations, whitening
from photostrip.network.problem import BundleProblem


def cofactors_of(solution: BundleSolution) -> Cofactors:
    """Cofactors of all parameters and residuals; ``bundle-rank`` when the normal matrix is singular at the solution.

    Points and photos of a rough solution of a free network stay in its datum, which no residual feels.
    """
    prepared, found = solution.prepared, solution.factored
    problem, at, p = prepared.problem, found.equations.linearised, len(solution.common)
    m, q, u = problem.photos, problem.points, problem.unknowns
    inverse, rank = found.inverse, prepared.rank
    photos = inverse.blocks(rank, rank)
    points, cross = _of_points(solution)

    # what common parameters do to everything else
    to_photos = -found.cross.reshape(m, u, p)
    back = found.equations.common_points.toarray() - found.equations.carried.T @ found.cross
    to_points = -(found.equations.root.swapaxes(1, 2) @ back.reshape(q, 3, p))
    by_photo, by_point, image = at.rays.by_photo, at.rays.by_point, problem.images
    to_rays = by_photo @ to_photos[image.photo] + by_point @ to_points[image.point]
    to_rays[..., : prepared.calibrated] += at.rays.by_common.toarray().reshape(*at.rays.misfit.shape, -1)
    half = by_photo @ cross @ by_point.swapaxes(1, 2)
    of_rays = (
        np.eye(at.rays.misfit.shape[1])
        - by_photo @ photos[image.photo] @ by_photo.swapaxes(1, 2)
        - half
        - half.swapaxes(1, 2)
    )
    of_rays -= by_point @ points[image.point] @ by_point.swapaxes(1, 2)
    of_rays -= to_rays @ found.common @ to_rays.swapaxes(1, 2)
    points = points + to_points @ found.common @ to_points.swapaxes(1, 2)
    of_photos = np.empty((m, u + p, u + p))
    of_photos[:, :u, :u] = photos + to_photos @ found.common @ to_photos.swapaxes(1, 2)
    of_photos[:, :u, u:] = to_photos @ found.common
    of_photos[:, u:, :u] = of_photos[:, :u, u:].swapaxes(1, 2)
    of_photos[:, u:, u:] = found.common
    positions, attitudes = (_given(each, of_photos) for each in (at.positions, at.attitudes))
    if solution.free and not solution.rough:
        points, of_photos = _inner(solution, points, of_photos)
    points[~prepared.measured] = np.nan
    turn = _turns(solution.rotations, u)
    weights = prepared.prior**-2.0
    return Cofactors(
        points=points,
        photos=turn @ of_photos[:, :u, :u] @ turn.swapaxes(1, 2),
        common=found.common,
        image_residuals=_unwhitened(problem, of_rays),
        control_residuals=_control(solution, points),
        position_residuals=positions,
        attitude_residuals=attitudes,
        common_residuals=np.where(weights > 0.0, prepared.prior**2 - np.diag(found.common), 0.0),
        photo_common=turn @ of_photos[:, :u, u:],
    )


def _unwhitened(problem: BundleProblem, of_rays: Floats) -> Floats:
    """Cofactors of the residuals of rays or model coordinates in mm^2, out of those in units of sigma."""
    sigma = problem.images.sigma
    if not problem.of_models:
        return np.asarray(of_rays * sigma[:, :, None] * sigma[:, None, :])
    unwhite = np.linalg.inv(whitening(problem.images))
    return np.asarray(unwhite @ of_rays @ unwhite.swapaxes(1, 2))


def _of_points(solution: BundleSolution) -> tuple[Floats, Floats]:
    """Cofactors of points (q, 3, 3) and between the photo of each ray and its point (n, u, 3), common ones held."""
    found, prepared = solution.factored, solution.prepared
    u = prepared.problem.unknowns
    rays, inverse = found.equations.linearised.rays, found.inverse
    inner = found.equations.root.swapaxes(1, 2) @ found.equations.root
    share = rays.by_photo.swapaxes(1, 2) @ (rays.by_point @ inner[prepared.problem.images.point])  # (n, u, 3): M'
    points, cross = inner.copy(), np.empty_like(share)
    for near in prepared.near:
        photos, s = len(near.photos), len(near.points)
        row, column = near.photos[:, None], near.photos[None, :]
        held = inverse.holds(row, column)  # others share no point
        blocks = np.where(held[..., None, None], inverse.blocks(row, np.where(held, column, row)), 0.0)
        pull = np.zeros((photos, u, s, 3))
        pull[near.photo, :, near.point] = share[near.ray]
        carried = blocks.swapaxes(1, 2).reshape(u * photos, -1) @ pull.reshape(u * photos, -1)
        carried = carried.reshape(photos, u, s, 3)
        cross[near.ray] = -carried[near.photo, :, near.point]
        points[near.points] += np.einsum("upsi,upsj->sij", pull, carried)
    return points, cross


def _control(solution: BundleSolution, points: Floats) -> Floats:
    """Cofactors of the residuals of control, along its axes."""
    control = solution.prepared.problem.control
    found = -control.axes @ points[control.point] @ control.axes.swapaxes(1, 2)
    found[:, range(3), range(3)] += np.where(np.isfinite(control.sigma), control.sigma, 0.0) ** 2
    return found


def _given(linear: LinearisedOrientations, of_photos: Floats) -> Floats:
    """Cofactors of the residuals of camera positions or attitudes."""
    if not len(linear.photo):
        return np.zeros((0, 3, 3))
    partials = np.concatenate([linear.by_photo, linear.by_common], axis=2)
    found: Floats = -partials @ of_photos[linear.photo] @ partials.swapaxes(1, 2)
    with np.errstate(divide="ignore"):
        found[:, range(3), range(3)] += np.where(linear.weight > 0.0, linear.weight**-2.0, 0.0)
    return found


def _turns(rotations: Floats, unknowns: int) -> Floats:
    """Turn steps of photos or models in their own axes into the Cartesian frame: matrices (m, u, u)."""
    turn = np.tile(np.eye(unknowns), (len(rotations), 1, 1))
    turn[:, :3, :3] = turn[:, 3:6, 3:6] = rotations
    return turn


def _inner(solution: BundleSolution, points: Floats, of_photos: Floats) -> tuple[Floats, Floats]:
    """Carry cofactors of points and photos (with common parameters) over to inner constraints on the points.

    With G the generators of the similarity, E the choice of the points, H = (G'EG)^-1 and P = Q E G H: the cofactors
    are Q - G P' - P G' + G (H G'E P) G'.
    """
    state, m, p, u = solution.state, len(of_photos), len(solution.common), solution.prepared.problem.unknowns
    origin, moves = defects.point_generators(solution.prepared, state)
    flat = moves.reshape(-1, defects.DEFECT)
    inverse = np.asarray(np.linalg.inv(flat.T @ flat), float)
    swept = solution.factored.solved_for_points(flat)
    middle = inverse @ (flat.T @ swept.points) @ inverse
    found = points + _carried_over(moves, (swept.points @ inverse).reshape(moves.shape), middle)
    turned = np.zeros((m, u + p, defects.DEFECT))
    turned[:, :u] = defects.photo_generators(state, origin, u)
    shared = np.broadcast_to(swept.common, (m, p, defects.DEFECT))
    own = np.concatenate([swept.photos.reshape(m, u, -1), shared], axis=1) @ inverse
    return found, of_photos + _carried_over(turned, own, middle)


def _carried_over(moves: Floats, swept: Floats, middle: Floats) -> Floats:
    """Give G M G' - G P' - P G'."""
    product = moves @ swept.swapaxes(1, 2)
    return np.asarray(moves @ middle @ moves.swapaxes(1, 2) - product - product.swapaxes(1, 2))


def joint_cofactors(solution: BundleSolution, functions: csr_array) -> Floats:
    """Joint cofactors (k, k) of k linear functions (k, 3 q) of the points' coordinates; not of a free network.

    With F the functions and L L' the normal matrices of the points: F L^-T L^-1 F' + G Q G', where G = F L^-T T' and Q
    are the cofactors of photos and common parameters.
    """
    found = solution.factored
    white = found.equations.roots @ functions.T
    by_photos = (found.equations.carried @ white).toarray()
    by_common = (found.equations.common_points.T @ white).toarray()
    photos, common = found.shared(by_photos, by_common)
    joint = by_photos.T @ photos + by_common.T @ common + (white.T @ white).toarray()
    return np.asarray(0.5 * (joint + joint.T), float)


def coordinates_of(solution: BundleSolution, points: Numbers) -> csr_array:
    """Functions (3 k, 3 q) that are the coordinates of k points."""
    columns = (3 * points[:, None] + np.arange(3)).ravel()
    shape = (len(columns), 3 * len(solution.points))
    return csr_array((np.ones(len(columns)), (np.arange(len(columns)), columns)), shape=shape)


@dataclass(frozen=True, eq=False)
class JointCofactors:
    """Joint cofactors of several photos; of a free network in some datum, which nothing feels that can be observed."""

    factored: FactoredEquations
    rotations: Floats  # (m, 3, 3): photo to Cartesian frame

    @classmethod
    def of_solution(cls, solution: BundleSolution) -> Self:
        return cls(solution.factored, solution.rotations)

    def of(self, photos: Numbers, partials: Floats) -> Floats:
        """Joint cofactors (g, k c, k c) of c functions of each of k photos, in g sets of photos (g, k).

        partials: (g, k, c, u): by shift (m) and rotation vector (rad) of the unit in the Cartesian frame, and the
            logarithm of the scale of a model.
        """
        (g, k, c, u), found = partials.shape, self.factored
        inner = partials @ _turns(self.rotations, u)[photos]
        half = inner @ self._blocks(found.equations.prepared.rank[photos]).swapaxes(2, 3).reshape(g, k, u, -1)
        whole = half.reshape(g, k * c, k, u).swapaxes(1, 2) @ inner.swapaxes(2, 3)
        joint = whole.swapaxes(1, 2).reshape(g, k * c, -1)
        cross = (inner @ found.cross.reshape(len(self.rotations), u, -1)[photos]).reshape(g, k * c, -1)
        return np.asarray(joint + cross @ found.common @ cross.swapaxes(1, 2), float)

    def _blocks(self, sets: Numbers) -> Floats:
        """Blocks (g, k, k, u, u) of Z between the photos of sets (g, k) of places in the band."""
        inverse, factor = self.factored.inverse, self.factored.band
        row, column = np.broadcast_arrays(sets[:, :, None], sets[:, None, :])
        near = inverse.holds(row, column)
        if near.all():
            return inverse.blocks(row, column)
        u = factor.block
        found = np.empty((*row.shape, u, u))
        found[near] = inverse.blocks(row[near], column[near])
        far, m = np.unique(column[~near]), factor.size // u
        unit = np.zeros((m, u, len(far), u))
        unit[far, :, np.arange(len(far))] = np.eye(u)
        solved = factor.solve(unit.reshape(m * u, -1)).reshape(unit.shape)
        found[~near] = solved[row[~near], :, np.searchsorted(far, column[~near])]
        return found


LIMIT = 0.95
ELEMENTS = (
    "shift along x",
    "shift along y",
    "shift along z",
    "rotation about x",
    "rotation about y",
    "rotation about z",
    "scale",
)
"""Elements of a photo or model, along and about its own axes, where shift and rotation that replace each other show."""


@dataclass(frozen=True)
class Correlation:
    """Two parameters that depend on each other."""

    # first, second: names: ``camera RC30: c``, ``photo 1003: shift along x``
    first: str
    second: str
    value: float


def correlations(solution: BundleSolution, precision: Cofactors) -> tuple[Correlation, ...]:
    """List correlations above ``LIMIT``: between common parameters, between these and photos, and within photos.

    In this order; each the largest first.
    """
    problem = solution.prepared.problem
    names = problem.common_names()
    turn = np.tile(np.eye(problem.unknowns), (problem.photos, 1, 1))
    turn[:, :3, :3] = turn[:, 3:6, 3:6] = np.swapaxes(solution.rotations, 1, 2)
    photos = turn @ precision.photos @ turn.swapaxes(1, 2)
    cross = turn @ precision.photo_common
    sigma = np.sqrt(np.einsum("nii->ni", photos))

    def element(photo: int, number: int) -> str:
        return f"{problem.unit} {problem.photo_name(photo)}: {ELEMENTS[number]}"

    shared = np.sqrt(np.diag(precision.common))
    found = _named(precision.common[None] / np.outer(shared, shared), lambda _, i, j: (names[i], names[j]))
    found += _named(cross / (sigma[:, :, None] * shared), lambda n, i, j: (element(n, i), names[j]), lower=False)
    found += _named(photos / (sigma[:, :, None] * sigma[:, None]), lambda n, i, j: (element(n, i), element(n, j)))
    return tuple(found)


def _named(ratio: Floats, name: Callable[[int, int, int], tuple[str, str]], *, lower: bool = True) -> list[Correlation]:
    """Name the elements (n, i, j) above the limit, the largest first; of squares only the lower half."""
    chosen = np.abs(ratio) > LIMIT
    if lower:
        chosen &= np.tri(ratio.shape[1], k=-1, dtype=bool)
    places, values = np.argwhere(chosen), ratio[chosen]
    order = np.argsort(-np.abs(values), kind="stable")
    return [Correlation(*name(*places[k].tolist()), float(values[k])) for k in order]
