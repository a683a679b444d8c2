"""The collinearity condition: image coordinates of points on photos, and their derivatives.

With (u, v, w) = R^T (X - S): x = -f u / w, y = -f v / w. Source: derived.

Exterior orientation of photos from points that are known: space resection, all photos in one batch.

Space resection of one photo without approximate values, with its precision: closed form, then least squares.

Source: [Grunert 1841] in the form of [Haralick 1994] for three points.

Points without a model: those whose good rays come from photos that are no neighbours.

A point on three photos whose middle measurement is wrong stands in no pair, and is yet well determined: its two good
rays meet under twice the angle.

Source: derived; see docs/sources.md.

Points where all rays that saw them meet, from photos of known orientation, with their precision.

A point starts at the place where its rays come nearest to each other; least squares on the image coordinates follow.
Source: derived.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers, pieces
from photostrip.errors import GeometryError
from photostrip.geometry.rotation import from_vector
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.notes import counted
from photostrip.points import PhotoPoints
from photostrip.strip.formed_strip import FormedStrip


class KnownPhotos(NamedTuple):
    centers: Floats  # (m, 3): perspective centres
    rotations: Floats  # (m, 3, 3): photo to the frame of the centres
    focal: Floats  # (m,): principal distances, mm


class PhotoPartials(NamedTuple):
    """Image coordinates and their derivatives by the orientation of the photo along its own axes."""

    # by_x, by_y: (6, m): derivatives of x and y by a shift of the centre and a small rotation
    by_x: Floats
    by_y: Floats
    xy: Floats  # (2, m): image coordinates in mm


def project(points: Floats, photos: KnownPhotos, photo: Numbers) -> Floats:
    """Ideal image coordinates (m, 2), relative to the principal point, of a point and a photo in each row."""
    found = np.empty((len(photo), 2))
    for rows in pieces(len(photo)):
        some = photo[rows]
        ray = np.einsum("mi,mij->mj", points[rows] - photos.centers[some], photos.rotations[some])
        found[rows] = -photos.focal[some, None] * ray[:, :2] / ray[:, 2:]
    return found


def distances(points: Floats, centers: Floats, photo: Numbers) -> Floats:
    """Distances (m,) of points (m, 3) from the perspective centre of the photo in each row."""
    found = np.empty(len(photo))
    for rows in pieces(len(photo)):
        found[rows] = np.linalg.norm(points[rows] - centers[photo[rows]], axis=1)
    return found


def depths(xyz: Floats, point: Numbers, centers: Floats, rotations: Floats, photo: Numbers) -> Floats:
    """Depths (m,) of points before photos, along their viewing direction; point, photo: (m,), which of each."""
    axes, found = rotations[:, :, 2], np.empty(len(photo))
    for rows in pieces(len(photo)):  # all at once take 100 bytes an image point
        some = photo[rows]
        found[rows] = ((centers[some] - xyz[point[rows]]) * axes[some]).sum(axis=1)
    return found


def derivatives(points: Floats, photos: KnownPhotos, photo: Numbers) -> tuple[Floats, Floats]:
    """Differentiate the image coordinates of rows, each of a point on a photo.

    Returns by_photo: (n, 2, 6), by the centre (mm/m) and by a small rotation of the photo about the axes of the frame
        (mm/rad).
    Returns by_point: (n, 2, 3), by the point (mm/m).
    """
    by_point = derivatives_by_point(points, photos, photo)
    # a small rotation theta about the axes of the frame turns the arm by -theta, seen from the photo
    by_turn = -np.cross((points - photos.centers[photo])[:, None, :], by_point)
    return np.concatenate([-by_point, by_turn], axis=2), by_point


def derivatives_by_point(points: Floats, photos: KnownPhotos, photo: Numbers) -> Floats:
    """Differentiate the image coordinates of rows by the point of each, (n, 2, 3), mm/m."""
    turn = photos.rotations[photo].transpose(0, 2, 1)
    sight = np.einsum("nij,nj->ni", turn, points - photos.centers[photo])
    f, w = photos.focal[photo], sight[:, 2]
    by_sight = np.zeros((len(points), 2, 3))
    by_sight[:, 0, 0] = by_sight[:, 1, 1] = -f / w
    by_sight[:, :, 2] = f[:, None] * sight[:, :2] / w[:, None] ** 2
    return np.asarray(by_sight @ turn)


def partials(arm: Floats, rotations: Floats, focal: Floats, distance: Floats) -> PhotoPartials:
    """Image coordinates of points, and their derivatives by the orientation of the photo along its own axes.

    arm: (m, 3), points from the perspective centre of their photo.
    rotations: (m, 3, 3), photo to the frame of the points.
    focal: (m,), principal distances in mm.
    distance: (m,), unit in which the centre moves.
    """
    u, v, w = np.einsum("mi,mij->jm", arm, rotations)
    x, y = -focal * u / w, -focal * v / w
    unit = focal * distance / w  # image shift by moving the centre one distance, at this depth
    zero = np.zeros_like(x)
    by_x = np.stack([unit, zero, unit * x / focal, -x * y / focal, focal + x * x / focal, y])
    by_y = np.stack([zero, unit, unit * y / focal, -(focal + y * y / focal), x * y / focal, -x])
    return PhotoPartials(by_x, by_y, np.stack([x, y]))


ITERATIONS = 20
CONVERGED = 1e-10  # rad, and of the distance to the points; the next step would be its square
UNKNOWNS = 6
AT_A_TIME = 8192  # image points worked on together: what fits into the processor's cache
SINGULAR = 1e-12  # reciprocal condition of a scaled normal matrix


@dataclass(frozen=True, eq=False)
class Resection:
    """Orientation of photos on known points."""

    centers: Floats  # (n, 3): perspective centres in the frame of the points
    rotations: Floats  # (n, 3, 3): photo to that frame
    residuals: Floats  # (m, 2): measured minus computed image coordinates in mm
    rms: Floats  # (n,): root mean square of a photo's residuals in mm
    # (n,): false where a photo kept its start orientation: too few points, or an iteration that does not converge
    solved: Flags


def runs(ends: Numbers, most: int) -> list[tuple[int, int]]:
    """Cut photos, whose rows end where ``ends`` says after a 0, into runs of about `most` rows: first, last + 1."""
    first = np.searchsorted(ends, np.append(np.arange(0, ends[-1], most), ends[-1]))
    return list(pairwise(np.unique(first).tolist()))


def of_known_photos(residuals: Floats, photo: Numbers, photos: KnownPhotos) -> Resection:
    """Photos whose orientation is known already, as a resection: residuals (m, 2) in mm, and the photo of each (m,)."""
    return _with_residuals(residuals, photo, photos, np.ones(len(photos.centers), bool))


def _with_residuals(residuals: Floats, photo: Numbers, photos: KnownPhotos, solved: Flags) -> Resection:
    centers, rotations, _ = photos
    count = len(centers)
    squares = np.bincount(photo, residuals[:, 0] ** 2 + residuals[:, 1] ** 2, count)
    rms = np.sqrt(squares / np.maximum(2 * np.bincount(photo, minlength=count), 1))
    return Resection(centers=centers, rotations=rotations, residuals=residuals, rms=rms, solved=solved)


def resect(
    xy: Floats,
    points: Floats,
    photo: Numbers,
    start: KnownPhotos,
    watch: Callable[[KnownPhotos, Floats], None] | None = None,
) -> Resection:
    """Orient every photo on its points by least squares on the image coordinates.

    xy: (m, 2), image coordinates in mm, reduced to the principal point; rows ordered by photo.
    points: (m, 3), known points of the rows.
    start: orientations to start from. They stay for a photo with fewer than four points, or whose iteration does not
        converge.
    watch: called at every step with the orientations before it, and what is added to them (n, 6): shifts in the frame
        of the points, and small rotations about its axes.
    """
    centers, rotations, focal = start
    counts = np.bincount(photo, minlength=len(centers))
    enough = counts >= UNKNOWNS // 2 + 1
    present = np.flatnonzero(counts)
    starts = np.searchsorted(photo, present)
    distance = np.ones(len(centers))
    distance[present] = np.add.reduceat(distances(points, centers, photo), starts) / counts[present]
    converged = np.zeros(len(centers), bool)
    for _ in range(ITERATIONS):
        step = _steps(xy, points, photo, KnownPhotos(centers, rotations, focal), distance, (present, starts))
        step[~enough] = 0.0
        if watch is not None:
            watch(KnownPhotos(centers, rotations, focal), step * np.repeat([distance, distance**0], 3, axis=0).T)
        centers = centers + step[:, :3] * distance[:, None]
        rotations = from_vector(step[:, 3:]) @ rotations
        converged = np.isfinite(step).all(axis=1) & (np.abs(step).max(axis=1) < CONVERGED)
        if converged.all():
            break
    solved = converged & enough
    centers = np.where(solved[:, None], centers, start.centers)
    rotations = np.where(solved[:, None, None], rotations, start.rotations)
    photos = KnownPhotos(centers, rotations, focal)
    residuals = project(points, photos, photo)
    np.subtract(xy, residuals, out=residuals)
    return _with_residuals(residuals, photo, photos, solved)


def _steps(
    xy: Floats,
    points: Floats,
    photo: Numbers,
    photos: KnownPhotos,
    distance: Floats,
    segments: tuple[Numbers, Numbers],
) -> Floats:
    """Gauss-Newton steps of all photos: shift in units of the distance, rotation in radians, in the points' frame.

    The partials are taken along the photo's own axes, where they are functions of the image point and its depth alone.
    """
    centers, rotations, focal = photos
    present, starts = segments
    ends = np.append(starts, len(photo))
    normal, right = np.zeros((len(centers), UNKNOWNS, UNKNOWNS)), np.zeros((len(centers), UNKNOWNS, 1))
    for low, high in runs(ends, AT_A_TIME):
        rows, some, first = slice(ends[low], ends[high]), present[low:high], starts[low:high] - ends[low]
        number = photo[rows]
        by_x, by_y, computed = partials(
            points[rows] - centers[number], rotations[number], focal[number], distance[number]
        )
        misfit_x, misfit_y = xy[rows].T - computed
        right[some, :, 0] = np.add.reduceat(by_x * misfit_x + by_y * misfit_y, first, axis=1).T
        normal[some, 0] = np.add.reduceat(by_x[0] * by_x, first, axis=1).T  # a shift along x moves x alone
        normal[some, 1, 1:] = np.add.reduceat(by_y[1] * by_y[1:], first, axis=1).T
        for row in range(2, UNKNOWNS):
            products = by_x[row] * by_x[row:]
            products += by_y[row] * by_y[row:]
            normal[some, row, row:] = np.add.reduceat(products, first, axis=1).T
    for row in range(UNKNOWNS):
        normal[:, row:, row] = normal[:, row, row:]
    diagonal = np.arange(UNKNOWNS)
    normal[:, diagonal, diagonal] += SINGULAR * np.maximum(normal[:, diagonal, diagonal], 1e-9)
    along_axes = np.linalg.solve(normal, right)[:, :, 0]
    turned = np.einsum("nij,nkj->nki", rotations, along_axes.reshape(-1, 2, 3))
    return np.asarray(turned.reshape(-1, UNKNOWNS), float)


LEAST_POINTS = 4  # of a photo: three have up to four solutions
TRIPLES = 12  # sets of three points that are tried
ON_A_LINE = 1e-6  # ratio of the spreads of points that lie on one line
REAL = 1e-6  # imaginary part of a root, relative, that rounding makes of a double one
NO_CONE = 1e-9  # smallest over largest singular value: points that do not determine a photo


@dataclass(frozen=True, eq=False)
class OrientedPhoto:
    """One photo oriented on known points, and how well they fit."""

    center: Floats  # (3,): perspective centre, metres, in the frame of the points
    rotation: Floats  # (3, 3): photo to that frame
    # (6, 6): of the centre (metres) and of the small rotation about the axes of the frame (radians) that turns the
    # photo; for the stated standard deviations
    covariance: Floats
    residuals: Floats  # (n, 2): measured minus computed image coordinates, mm
    sigma0: float  # standard deviation of unit weight; NaN without redundancy
    redundancy: int


def space_resection(xy: Floats, sigma: Floats, points: Floats, focal: float) -> OrientedPhoto:
    """Orient one photo on known points (n, 3), at any attitude and without approximate values.

    The solution weighs all image points (n, 2) alike; the covariance takes their standard deviations into account.

    Raises GeometryError with fewer than four points, with points on one line, or where no orientation fits.
    """
    center, rotation = approximate(xy, points, focal)
    number = np.zeros(len(xy), np.intp)
    start = KnownPhotos(center[None], rotation[None], np.array([focal]))
    found: Resection = resect(xy, points, number, start)
    if not found.solved[0]:
        raise GeometryError(
            "the space resection does not converge: too few points, or in a poor arrangement", code="resection"
        )
    by_photo, _ = derivatives(points, KnownPhotos(found.centers, found.rotations, start.focal), number)
    design = (by_photo / sigma[:, :, None]).reshape(-1, 6)
    redundancy = 2 * len(xy) - 6
    squares = float(((found.residuals / sigma) ** 2).sum())
    return OrientedPhoto(
        center=found.centers[0],
        rotation=found.rotations[0],
        covariance=_inverse(design),
        residuals=found.residuals,
        sigma0=float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan"),
        redundancy=redundancy,
    )


def _inverse(design: Floats) -> Floats:
    """Invert the normal matrix of a weighted design by its singular values, columns brought to one size first."""
    size = np.linalg.norm(design, axis=0)
    _, values, vt = np.linalg.svd(design / size, full_matrices=False)
    if values[-1] < NO_CONE * values[0]:
        raise GeometryError("the points do not determine the photo", code="resection")
    root = vt.T / values / size[:, None]
    return np.asarray(root @ root.T, float)


def approximate(xy: Floats, points: Floats, focal: float) -> tuple[Floats, Floats]:
    """Perspective centre and rotation in closed form: the solution of three points that suits the others best.

    Raises GeometryError with fewer than four points, with points on one line, or where no solution sees all points.

    Source: [Grunert 1841] in the form of [Haralick 1994].
    """
    if len(xy) < LEAST_POINTS:
        raise GeometryError(
            f"{counted(len(xy), 'known point')} cannot orient a photo; four are needed", code="resection"
        )
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


SMALLEST_ANGLE = 1e-4  # sine of the angle between the rays


def bridge(
    formed: FormedStrip, observations: PhotoPoints, photos: Sequence[str], focal: float, rows: Numbers
) -> FormedStrip:
    """Return a strip that also holds the points which some rays place without a model.

    Such a point lies in the middle between its first and its last ray.

    rows: rows of the observations: good rays of points that the strip does not hold.
    """
    place = {photo: number for number, photo in enumerate(photos)}
    position = np.array([place[observations.photo_ids[number]] for number in observations.photo[rows]], np.intp)
    order = np.lexsort((position, observations.point[rows]))
    rows, position = rows[order], position[order]
    point, begin, count = np.unique(observations.point[rows], return_index=True, return_counts=True)
    ends = np.column_stack([begin, begin + count - 1])[count > 1]
    if not len(ends):
        return formed
    at = position[ends]
    image = np.concatenate([observations.xy[rows[ends]], np.full((*ends.shape, 1), -focal)], axis=2)
    direction = np.einsum("nkij,nkj->nki", formed.rotations[at], image)
    xyz, sound = meeting(formed.centers[at], direction)
    found, numbers = np.flatnonzero(sound), np.asarray(point[count > 1], np.intp)
    every = np.concatenate([formed.point, numbers[found]])
    order = np.argsort(every, kind="stable")
    home = np.concatenate([np.full(len(formed.point), -1), at[found, 0]])
    return replace(
        formed,
        point=every[order],
        xyz=np.concatenate([formed.xyz, xyz[found]])[order],
        model_count=np.concatenate([formed.model_count, np.zeros(len(found), np.intp)])[order],
        home=home[order],
        bridging=np.sort(rows[np.isin(observations.point[rows], numbers[found])]),
    )


def meeting(centers: Floats, directions: Floats) -> tuple[Floats, Flags]:
    """Middle of two rays where they are nearest, and whether they meet, in front of both cameras and not too flat.

    Centres and directions are (n, 2, 3); the middle is NaN where the rays do not meet.
    """
    unit = directions / np.linalg.norm(directions, axis=2, keepdims=True)
    base = centers[:, 1] - centers[:, 0]
    cosine = np.einsum("ni,ni->n", unit[:, 0], unit[:, 1])
    first, second = (np.einsum("ni,ni->n", base, unit[:, side]) for side in (0, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = 1 - cosine**2
        length = np.column_stack([first - cosine * second, cosine * first - second]) / sine[:, None]
        sound = (sine > SMALLEST_ANGLE**2) & (length > 0).all(axis=1)
        xyz = (centers + length[:, :, None] * unit).mean(axis=1)
    return np.where(sound[:, None], xyz, np.nan), sound


RAY_ITERATIONS = 12
RAY_CONVERGED = 1e-12  # of the distance of a point from its photos
PARALLEL_CONDITION = 1e-9  # reciprocal condition of rays that meet nowhere


@dataclass(frozen=True, eq=False)
class Intersected:
    """Points from known photos."""

    xyz: Floats  # (q, 3): points, metres; NaN where rays do not meet in front of the cameras
    covariance: Floats  # (q, 3, 3): their covariances for the stated standard deviations, metres^2
    residuals: Floats  # (n, 2): measured minus computed image coordinates, mm
    rays: Numbers  # (q,): number of rays of each point


def intersect_points(
    xy: Floats, sigma: Floats, rows: tuple[Numbers, Numbers], photos: KnownPhotos, count: int
) -> Intersected:
    """Intersect points from photos of known orientation, all points in one batch.

    xy, sigma: (n, 2), ideal image coordinates and their standard deviations, mm.
    rows: photo and point of each row.
    Returns points with their precision, the orientations taken as known. A point with one ray, with parallel rays, or
        with rays that meet behind a camera has no coordinates.
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
    for _ in range(RAY_ITERATIONS):
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = derivatives_by_point(xyz[point], photos, photo) / sigma[:, :, None]
            misfit = (xy - project(xyz[point], photos, photo)) / sigma
        bad = ~np.isfinite(slope).all(axis=(1, 2)) | ~np.isfinite(misfit).all(axis=1)
        slope[bad], misfit[bad] = 0.0, 0.0
        normal = _summed(np.einsum("nki,nkj->nij", slope, slope), point, count)
        step, good = _solved(normal, _summed(np.einsum("nki,nk->ni", slope, misfit), point, count))
        sound &= good
        xyz = xyz + np.where(sound[:, None], step, 0.0)
        if not sound.any() or np.abs(step[sound] / far[sound, None]).max() < RAY_CONVERGED:
            break
    covariance[sound] = np.linalg.inv(normal[sound])
    ahead = np.einsum("ni,ni->n", xyz[point] - centers[photo], rotations[photo][:, :, 2]) < 0
    sound &= rays >= 2
    sound[point[~ahead]] = False
    xyz[~sound], covariance[~sound] = np.nan, np.nan
    with np.errstate(invalid="ignore"):
        residuals = xy - project(xyz[point], photos, photo)
    return Intersected(xyz=xyz, covariance=covariance, residuals=residuals, rays=rays)


def _summed(values: Floats, point: Numbers, count: int) -> Floats:
    flat = values.reshape(len(values), int(np.prod(values.shape[1:])))
    sums = np.column_stack([np.bincount(point, column, count) for column in flat.T])
    return np.asarray(sums.reshape(count, *values.shape[1:]), np.float64)


def two_that_meet(xy: Floats, sigma: Floats, photo: Numbers, photos: KnownPhotos) -> Floats:
    """Places where two of the r rays of each of m points meet, those with which most others agree; NaN: nowhere.

    xy, sigma: (m, r, 2), ideal image coordinates and their standard deviations, mm; photo: (m, r), r at least two.
    """
    xyz = where_two_meet(xy, photo, photos)
    (m, r), pairs = photo.shape, xyz.shape[1]
    seen = project(np.repeat(xyz.reshape(-1, 3), r, axis=0), photos, np.repeat(photo, pairs, axis=0).ravel())
    off = np.abs(xy[:, None] - seen.reshape(m, pairs, r, 2)) / sigma[:, None]
    best = np.log1p(np.nan_to_num(off.max(axis=3), nan=np.inf)).sum(axis=2).argmin(axis=1)
    return np.asarray(xyz[np.arange(m), best], float)


def where_two_meet(xy: Floats, photo: Numbers, photos: KnownPhotos) -> Floats:
    """Places (m, r (r - 1) / 2, 3) where each two of the r rays of m points meet; NaN: nowhere."""
    two = np.column_stack(np.triu_indices(photo.shape[1], 1))
    direction = np.concatenate([xy, -photos.focal[photo][..., None]], axis=2)
    direction = np.einsum("mrij,mrj->mri", photos.rotations[photo], direction)
    xyz, _ = meeting(photos.centers[photo][:, two].reshape(-1, 2, 3), direction[:, two].reshape(-1, 2, 3))
    return np.asarray(xyz.reshape(len(photo), len(two), 3), float)


def _solved(normal: Floats, right: Floats) -> tuple[Floats, Flags]:
    """Solve small systems; NaN where one is singular."""
    size = np.sqrt(np.maximum(np.einsum("nii->ni", normal), 0.0))
    size[size == 0.0] = 1.0
    scaled = normal / size[:, :, None] / size[:, None, :]
    values = np.linalg.eigvalsh(scaled)
    sound = values[:, 0] > PARALLEL_CONDITION
    scaled[~sound] = np.eye(3)
    solution = np.linalg.solve(scaled, (right / size)[:, :, None])[:, :, 0] / size
    solution[~sound] = np.nan
    return solution, sound
