"""Space resection of one photo without approximate values, with its precision: closed form, then least squares.

Source: [Grunert 1841] in the form of [Haralick 1994] for three points.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.geometry.similarity import Similarity, collinearity
from photostrip.notes import counted
from photostrip.strip.resection.collinearity import KnownPhotos, derivatives
from photostrip.strip.resection.resection import Resection, resect

LEAST_POINTS = 4  # of a photo: three have up to four solutions
TRIPLES = 12  # sets of three points that are tried
ON_A_LINE = 1e-6  # ratio of the spreads of points that lie on one line
REAL = 1e-6  # imaginary part of a root, relative, that rounding makes of a double one
SINGULAR = 1e-9  # smallest over largest singular value: points that do not determine a photo


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
    if values[-1] < SINGULAR * values[0]:
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
