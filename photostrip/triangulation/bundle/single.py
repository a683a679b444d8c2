"""Photos against known points, and further points against known photos: each alone, with its precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_vector
from photostrip.triangulation.bundle import defects
from photostrip.triangulation.bundle.layout import Batch
from photostrip.triangulation.bundle.linearise import PHOTO, SIGNS, backward, by_photo, eliminate, view
from photostrip.triangulation.bundle.model import model_of, state_of
from photostrip.triangulation.bundle.precision import carried, inverse_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.triangulation.bundle.linearise import Eliminated
    from photostrip.triangulation.bundle.model import Model
    from photostrip.triangulation.bundle.problem import Problem
    from photostrip.triangulation.bundle.solution import Solution

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

ITERATIONS = 30
CONVERGED = 1e-6  # standard deviations
NEEDED = 3  # points
SINGULAR = 1e-10  # least eigenvalue of a scaled normal matrix


@dataclass(frozen=True, eq=False)
class Resected:
    """Photos oriented on known points.

    Parameters
    ----------
    centers : ndarray, shape (m, 3)
        Perspective centres, metres.
    rotations : ndarray, shape (m, 3, 3)
        Rotations, photo to Cartesian frame.
    cofactors : ndarray, shape (m, 6, 6)
        Cofactors as those of ``Precision.photos``; the points count as free of errors.
    residuals : ndarray, shape (n, 2)
        Measured minus computed image coordinates, mm.
    sigma0 : ndarray, shape (m,)
        Standard deviation of unit weight of each photo; NaN with three points.
    """

    centers: Floats
    rotations: Floats
    cofactors: Floats
    residuals: Floats
    sigma0: Floats


@dataclass(frozen=True, eq=False)
class Intersected:
    """Points intersected from known photos.

    Parameters
    ----------
    points : ndarray, shape (q, 3)
        Points, metres; NaN without rays.
    cofactors : ndarray, shape (q, 3, 3)
        Their cofactors, m^2; NaN without rays.
    residuals : ndarray, shape (n, 2)
        Measured minus computed image coordinates, mm.
    """

    points: Floats
    cofactors: Floats
    residuals: Floats


def resect(problem: Problem) -> Resected:
    """Orient each photo on its points, which are known.

    Parameters
    ----------
    problem : Problem
        Rays, cameras, known points (``start.points``) and start orientations. Control, positions and attitudes do
        not count.

    Returns
    -------
    Resected
        Orientations with their cofactors.

    Raises
    ------
    GeometryError
        Naming photos with fewer than three points, on a line or a dangerous circle (``bundle-resection``), and
        photos that do not converge.
    """
    rays, starts = _by_photo(problem)
    counts = np.bincount(problem.images.photo, minlength=problem.photos)
    _refuse(problem, counts < NEEDED, "have fewer than three points")
    xyz = np.ascontiguousarray(problem.start.points[rays.point].T)
    centers, rotations = np.array(problem.start.centers, float), np.array(problem.start.rotations, float)
    focal = problem.cameras.focal[problem.cameras.of_photo]
    for _ in range(ITERATIONS):
        normal, right, misfit = _normals(rays, xyz, (centers, rotations, focal), starts)
        scale = 1.0 / np.sqrt(np.einsum("nii->ni", normal))
        scaled = normal * scale[:, :, None] * scale[:, None, :]
        _refuse(problem, np.linalg.eigvalsh(scaled)[:, 0] < SINGULAR, "are not determined by their points")
        inverse = np.linalg.inv(scaled) * scale[:, :, None] * scale[:, None, :]
        step = np.einsum("nij,nj->ni", inverse, right)
        open_ = np.einsum("ni,ni->n", step, right) > CONVERGED**2
        own = step * SIGNS
        centers = centers + np.einsum("nij,nj->ni", rotations, own[:, :3])
        rotations = rotations @ from_vector(own[:, 3:])
        if not open_.any():
            break
    else:
        _refuse(problem, open_, "do not converge on their points")
    misfit = _normals(rays, xyz, (centers, rotations, focal), starts)[2]
    residuals = np.empty((len(problem.images), 2))
    residuals[rays.row[0]] = misfit.T
    squares = np.add.reduceat((misfit**2).sum(axis=0), starts)
    redundancy = 2 * counts - PHOTO
    turn = np.zeros((problem.photos, PHOTO, PHOTO))
    turn[:, :3, :3] = turn[:, 3:, 3:] = rotations
    turn *= SIGNS
    return Resected(
        centers,
        rotations,
        turn @ inverse @ turn.swapaxes(1, 2),
        residuals * problem.images.sigma,
        np.sqrt(np.where(redundancy > 0, squares / np.maximum(redundancy, 1), np.nan)),
    )


def _refuse(problem: Problem, bad: NDArray[np.bool_], trouble: str) -> None:
    """Raise an error for photos."""
    if bad.any():
        names = [problem.photo_name(number) for number in np.flatnonzero(bad).tolist()]
        raise GeometryError(
            f"space resection: {defects.listed('photo', names)} {trouble}", photos=names, code="bundle-resection"
        )


def _by_photo(problem: Problem) -> tuple[Batch, Numbers]:
    """Give all rays in one batch, sorted by photo, and the first of each photo."""
    images = problem.images
    order = np.argsort(images.photo, kind="stable")
    none = np.zeros(0, np.intp)
    batch = Batch(
        point=images.point[order],
        real=np.arange(len(order)),
        dummy=none,
        photo=images.photo[order][None],
        row=order[None],
        xy=images.xy[order].T[:, None],
        weight=1.0 / images.sigma[order].T[:, None],
        runs=(),
        sets=none.reshape(0, 1),
        control=none,
        control_normal=np.zeros((3, 3, 0)),
        control_right=np.zeros((3, 0)),
    )
    return batch, np.searchsorted(batch.photo[0], np.arange(problem.photos))


def _normals(
    rays: Batch, xyz: Floats, photos: tuple[Floats, Floats, Floats], starts: Numbers
) -> tuple[Floats, Floats, Floats]:
    """Sum normal matrices (m, 6, 6) and right-hand sides (m, 6) of photos; and misfits (2, n) in sigmas."""
    centers, rotations, focal = photos
    table = np.concatenate([rotations.transpose(2, 1, 0).reshape(9, -1), centers.T, focal[None]])
    partials = by_photo(view(rays, xyz, table), 0)[:, :, 0]
    row, column = np.tril_indices(PHOTO + 1)
    sums = np.add.reduceat((partials[row] * partials[column]).sum(axis=1), starts, axis=1)
    whole = np.empty((len(centers), PHOTO + 1, PHOTO + 1))
    whole[:, row, column] = whole[:, column, row] = sums.T
    return whole[:, :PHOTO, :PHOTO], whole[:, :PHOTO, PHOTO], partials[PHOTO]


def intersect(problem: Problem, solution: Solution | None = None) -> Intersected:
    """Intersect points from photos that are known.

    Parameters
    ----------
    problem : Problem
        Rays of the points, with control of theirs if there is any. Start values of the points need not be good.
    solution : Solution or None
        An adjustment of the same photos, in the same order: its orientations and calibration are used, and their
        cofactors enter those of the points (not those of a free network, which depend on its datum). None: the
        photos are those of ``problem.start``, free of errors.

    Returns
    -------
    Intersected
        The points.

    Raises
    ------
    GeometryError
        Naming points whose rays do not meet at an angle (``bundle-rays``), and points that do not converge
        (``bundle-diverged``).
    """
    model = model_of(problem)
    photos = problem.start if solution is None else solution
    more = len(model.calibrated)
    common = np.zeros(more) if solution is None else solution.common[:more]
    state = state_of(
        model, photos.centers, photos.rotations, _meeting(problem, photos.centers, photos.rotations), common
    )
    table = model.table(state)
    inverse = None if solution is None or solution.free else inverse_of(solution)
    points = np.full((problem.points, 3), np.nan)
    cofactors = np.full((problem.points, 3, 3), np.nan)
    residuals = np.zeros((len(problem.images), 2))
    for batch, start in zip(model.structure.batches, state.xyz, strict=True):
        xyz, eliminated = _intersected(model, batch, start, table, common)
        found = np.zeros((3, 3, len(batch.point)))
        found[range(3), range(3)] = 1.0
        if inverse is not None and solution is not None:
            sets = solution.model.structure.rank[model.structure.order[batch.sets]]
            joint = inverse.joint(sets, more)
            rows = eliminated.rows[:-1]
            found += np.einsum("pcs,pds->cds", rows, carried(batch, joint, rows))
        backward(eliminated.root, found)
        found = found.transpose(1, 0, 2)
        backward(eliminated.root, found)
        real = batch.real
        points[batch.point[real]] = xyz[:, real].T
        cofactors[batch.point[real]] = found[..., real].transpose(2, 0, 1)
        misfit = model.rays(batch, xyz, table, common)[0].misfit
        residuals[batch.row[:, real].ravel()] = np.moveaxis(misfit[:, :, real], 0, 2).reshape(-1, 2)
    return Intersected(points, cofactors, residuals * problem.images.sigma)


def _meeting(problem: Problem, centers: Floats, rotations: Floats) -> Floats:
    """Points nearest to their rays in space, shape (q, 3); the start where a point has one ray or none."""
    images = problem.images
    focal = problem.cameras.focal[problem.cameras.of_photo[images.photo]]
    ray = np.einsum("nij,nj->ni", rotations[images.photo], np.column_stack([images.xy, -focal]))
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    across = np.eye(3) - ray[:, :, None] * ray[:, None, :]
    normal, right = np.zeros((problem.points, 3, 3)), np.zeros((problem.points, 3))
    np.add.at(normal, images.point, across)
    np.add.at(right, images.point, np.einsum("nij,nj->ni", across, centers[images.photo]))
    several = np.linalg.det(normal) > defects.PARALLEL
    points = np.array(problem.start.points, float)
    points[several] = np.linalg.solve(normal[several], right[several][:, :, None])[:, :, 0]
    return points


def _intersected(model: Model, batch: Batch, start: Floats, table: Floats, common: Floats) -> tuple[Floats, Eliminated]:
    """Intersect the points of a batch: where they are, and their last elimination."""
    xyz = start.copy()
    for _ in range(ITERATIONS):
        rays, partials = model.rays(batch, xyz, table, common)
        eliminated = eliminate(batch, xyz, rays, partials)
        defects.refuse_weak(model, [batch], [eliminated])
        step = eliminated.rows[-1].copy()
        length = np.sqrt((step**2).sum(axis=0))[batch.real]
        backward(eliminated.root, step)
        xyz += step
        if (length < CONVERGED).all():
            return xyz, eliminated
    names = [model.problem.point_name(n) for n in batch.point[batch.real][length >= CONVERGED].tolist()]
    raise GeometryError(
        f"intersection: {defects.listed('point', names)} did not come to an end", points=names, code="bundle-diverged"
    )
