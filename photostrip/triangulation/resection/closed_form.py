"""One thing from what is known: a photo from known points (space resection), points from known photos (intersection).

Both need no approximate values, and both come with their precision. A photo starts from three of its points, in closed
form; a point from the place where its rays come nearest to each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.triangulation.resection.resection import project, resect

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from photostrip.triangulation.resection.resection import Resection

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

LEAST_POINTS = 4  # of a photo: three have up to four solutions
TRIPLES = 12  # sets of three points that are tried
ON_A_LINE = 1e-6  # ratio of the spreads of points that lie on one line
REAL = 1e-6  # imaginary part of a root, relative, that rounding makes of a double one
ITERATIONS = 12
CONVERGED = 1e-12  # of the distance of a point from its photos
PARALLEL = 1e-9  # reciprocal condition of rays that meet nowhere


@dataclass(frozen=True, eq=False)
class OrientedPhoto:
    """A photo oriented on known points."""

    center: Floats  # (3,): perspective centre, metres, in the frame of the points
    rotation: Floats  # (3, 3): photo to that frame
    # (6, 6): of the centre (metres) and of the small rotation about the axes of the frame (radians) that turns the
    # photo; for the stated standard deviations
    covariance: Floats
    residuals: Floats  # (n, 2): measured minus computed image coordinates, mm
    sigma0: float  # standard deviation of unit weight; NaN without redundancy
    redundancy: int


@dataclass(frozen=True, eq=False)
class Intersected:
    """Points from known photos."""

    xyz: Floats  # (q, 3): points, metres; NaN where rays do not meet in front of the cameras
    covariance: Floats  # (q, 3, 3): their covariances for the stated standard deviations, metres^2
    residuals: Floats  # (n, 2): measured minus computed image coordinates, mm
    rays: Numbers  # (q,): number of rays of each point


def space_resection(xy: Floats, sigma: Floats, points: Floats, focal: float) -> OrientedPhoto:
    """Orient one photo on known points (n, 3), at any attitude and without approximate values.

    The solution weighs all image points (n, 2) alike; the covariance takes their standard deviations into account.

    Raises
    ------
    GeometryError
        With fewer than four points, with points on one line, or where no orientation fits.
    """
    center, rotation = approximate(xy, points, focal)
    number = np.zeros(len(xy), np.intp)
    f = np.array([focal])
    found: Resection = resect(xy, points, number, f, (center[None], rotation[None]))
    if not found.solved[0]:
        raise GeometryError("the space resection does not settle: the points are too few or too weak", code="resection")
    by_photo, _ = derivatives(points, found.centers, found.rotations, number, f)
    design = (by_photo / sigma[:, :, None]).reshape(-1, 6)
    covariance = _inverse(design)
    redundancy = 2 * len(xy) - 6
    squares = float(((found.residuals / sigma) ** 2).sum())
    sigma0 = float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan")
    return OrientedPhoto(found.centers[0], found.rotations[0], covariance, found.residuals, sigma0, redundancy)


def _inverse(design: Floats) -> Floats:
    """Invert the normal matrix of a weighted design by its singular values, columns brought to one size first."""
    size = np.linalg.norm(design, axis=0)
    _, values, vt = np.linalg.svd(design / size, full_matrices=False)
    if values[-1] < PARALLEL * values[0]:
        raise GeometryError("the points do not determine the photo", code="resection")
    root = vt.T / values / size[:, None]
    return np.asarray(root @ root.T, float)


def approximate(xy: Floats, points: Floats, focal: float) -> tuple[Floats, Floats]:
    """Perspective centre and rotation in closed form: the solution of three points that suits the others best.

    Raises
    ------
    GeometryError
        With fewer than four points, with points on one line, or where no solution sees all points.

    Notes
    -----
    Source: [Grunert 1841] in the form of [Haralick 1994].
    """
    if len(xy) < LEAST_POINTS:
        raise GeometryError(f"{len(xy)} known points do not orient a photo; it needs four", code="resection")
    if collinearity(points) < ON_A_LINE**2:
        raise GeometryError("the known points of the photo lie on one line", code="resection")
    rays = np.column_stack([xy, np.full(len(xy), -focal)])
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    best, found = np.inf, None
    for triple in _triples(xy):
        for center, rotation in _three_points(rays[triple], points[triple]):
            sight = (points - center) @ rotation
            if not (sight[:, 2] < 0).all():
                continue
            # three points fit by construction; of the others the better half decides
            misfit = float(np.sort(np.hypot(*(xy + focal * sight[:, :2] / sight[:, 2:]).T))[2 + (len(xy) - 2) // 2])
            if misfit < best:
                best, found = misfit, (center, rotation)
    if found is None:
        raise GeometryError("no orientation of the photo sees all its known points", code="resection")
    return found


def _triples(xy: Floats) -> list[Numbers]:
    """Choose sets of three points that span large triangles in the photo, the largest first."""
    order = np.argsort(-np.hypot(*(xy - xy.mean(axis=0)).T), kind="stable")[:9]
    sets = [np.array(each, np.intp) for each in combinations(order.tolist(), 3)]
    area = [abs(float(np.linalg.det(np.column_stack([xy[each], np.ones(3)])))) for each in sets]
    return [sets[number] for number in np.argsort(-np.array(area), kind="stable")[:TRIPLES]]


def _three_points(rays: Floats, points: Floats) -> Iterator[tuple[Floats, Floats]]:
    """All orientations under which three points lie on three rays.

    With the distances s1, s2 = u s1, s3 = v s1, the law of cosines in the three triangles gives a quartic in v.
    """
    a2, b2, c2 = (float(((points[i] - points[j]) ** 2).sum()) for i, j in ((1, 2), (0, 2), (0, 1)))
    ca, cb, cg = (float(rays[i] @ rays[j]) for i, j in ((1, 2), (0, 2), (0, 1)))
    if b2 <= 0:
        return
    p, q = (a2 - c2) / b2, (a2 + c2) / b2
    quartic = [
        (p - 1) ** 2 - 4 * c2 / b2 * ca**2,
        4 * (p * (1 - p) * cb - (1 - q) * ca * cg + 2 * c2 / b2 * ca**2 * cb),
        2
        * (
            p**2 - 1 + 2 * p**2 * cb**2 + 2 * (b2 - c2) / b2 * ca**2 - 4 * q * ca * cb * cg + 2 * (b2 - a2) / b2 * cg**2
        ),
        4 * (-p * (1 + p) * cb + 2 * a2 / b2 * cg**2 * cb - (1 - q) * ca * cg),
        (1 + p) ** 2 - 4 * a2 / b2 * cg**2,
    ]
    for root in np.roots(quartic):
        v = float(root.real)
        if abs(root.imag) > REAL * max(1.0, abs(v)) or v <= 0 or abs(cg - v * ca) < REAL**2:
            continue
        u = ((-1 + p) * v**2 - 2 * p * cb * v + 1 + p) / (2 * (cg - v * ca))
        square = 1 + v**2 - 2 * v * cb
        if u <= 0 or square <= 0:
            continue
        distance = np.sqrt(b2 / square) * np.array([1.0, u, v])
        moved = Similarity.from_points(rays * distance[:, None], points)
        yield points.mean(axis=0) - moved.rotation @ (rays * distance[:, None]).mean(axis=0), moved.rotation


def derivatives(
    points: Floats, centers: Floats, rotations: Floats, photo: Numbers, focal: Floats
) -> tuple[Floats, Floats]:
    """Differentiate the image coordinates of rows, each of a point on a photo.

    Returns
    -------
    by_photo : ndarray, shape (n, 2, 6)
        By the centre (mm/m) and by a small rotation of the photo about the axes of the frame (mm/rad).
    by_point : ndarray, shape (n, 2, 3)
        By the point (mm/m).
    """
    arm = points - centers[photo]
    turn = rotations[photo].transpose(0, 2, 1)
    sight = np.einsum("nij,nj->ni", turn, arm)
    f, w = focal[photo], sight[:, 2]
    by_sight = np.zeros((len(points), 2, 3))
    by_sight[:, 0, 0] = by_sight[:, 1, 1] = -f / w
    by_sight[:, :, 2] = f[:, None] * sight[:, :2] / w[:, None] ** 2
    by_point = by_sight @ turn
    # a small rotation theta about the axes of the frame turns the arm by -theta, seen from the photo
    by_turn = -np.cross(arm[:, None, :], by_point)
    return np.concatenate([-by_point, by_turn], axis=2), by_point


def intersect_points(
    xy: Floats, sigma: Floats, rows: tuple[Numbers, Numbers], photos: tuple[Floats, Floats, Floats], count: int
) -> Intersected:
    """Intersect points from photos of known orientation, all points in one batch.

    Parameters
    ----------
    xy, sigma : ndarray, shape (n, 2)
        Ideal image coordinates and their standard deviations, mm.
    rows : tuple of ndarray of int
        Photo and point of each row.
    photos : tuple of ndarray
        Centres (m, 3), rotations (m, 3, 3) and principal distances (m,) in mm.

    Returns
    -------
    Intersected
        Points with their precision, the orientations taken as known. A point with one ray, with parallel rays, or with
        rays that meet behind a camera has no coordinates.
    """
    (photo, point), (centers, rotations, focal) = rows, photos
    rays = np.bincount(point, minlength=count)
    direction = np.einsum("nij,nj->ni", rotations[photo], np.column_stack([xy, -focal[photo]]))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    nearest = np.einsum("nij,nj->ni", across, centers[photo])
    xyz, sound = _solved(_summed(across, point, count), _summed(nearest, point, count))
    far = np.ones(count)
    np.maximum.at(far, point, np.linalg.norm(np.nan_to_num(xyz[point]) - centers[photo], axis=1))
    covariance = np.full((count, 3, 3), np.nan)
    for _ in range(ITERATIONS):
        with np.errstate(invalid="ignore", divide="ignore"):
            _, slope = derivatives(xyz[point], centers, rotations, photo, focal)
            slope = slope / sigma[:, :, None]
            misfit = (xy - project(xyz[point], centers, rotations, photo, focal)) / sigma
        bad = ~np.isfinite(slope).all(axis=(1, 2)) | ~np.isfinite(misfit).all(axis=1)
        slope[bad], misfit[bad] = 0.0, 0.0
        normal = _summed(np.einsum("nki,nkj->nij", slope, slope), point, count)
        step, good = _solved(normal, _summed(np.einsum("nki,nk->ni", slope, misfit), point, count))
        sound &= good
        xyz = xyz + np.where(sound[:, None], step, 0.0)
        if not sound.any() or np.abs(step[sound] / far[sound, None]).max() < CONVERGED:
            break
    covariance[sound] = np.linalg.inv(normal[sound])
    ahead = np.einsum("ni,ni->n", xyz[point] - centers[photo], rotations[photo][:, :, 2]) < 0
    sound &= rays >= 2
    sound[point[~ahead]] = False
    xyz[~sound], covariance[~sound] = np.nan, np.nan
    with np.errstate(invalid="ignore"):
        residuals = xy - project(xyz[point], centers, rotations, photo, focal)
    return Intersected(xyz, covariance, residuals, rays)


def _summed(values: Floats, point: Numbers, count: int) -> Floats:
    """Sum rows by point."""
    flat = values.reshape(len(values), -1)
    sums = np.column_stack([np.bincount(point, column, count) for column in flat.T])
    return np.asarray(sums.reshape(count, *values.shape[1:]), np.float64)


def _solved(normal: Floats, right: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Solve small systems; NaN where one is singular."""
    size = np.sqrt(np.maximum(np.einsum("nii->ni", normal), 0.0))
    size[size == 0.0] = 1.0
    scaled = normal / size[:, :, None] / size[:, None, :]
    values = np.linalg.eigvalsh(scaled)
    sound = values[:, 0] > PARALLEL
    scaled[~sound] = np.eye(3)
    solution = np.linalg.solve(scaled, (right / size)[:, :, None])[:, :, 0] / size
    solution[~sound] = np.nan
    return solution, sound
