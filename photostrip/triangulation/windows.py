"""Windows of a strip: a few neighbouring photos adjusted together, all rays of their points at once.

What photos far away say about a ray is lost in the strip's deformation; three photos on either side say nearly
everything. A window is a free network: its photos and points hang together, its place and scale do not matter. The
adjustment is linear, about a strip that has been formed. Points are eliminated; what a point's rays demand of their
photos is left.

Windows are solved in batches: the arrays of a batch have the window as their first axis.

Source: derived; see docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.rotation import cross_matrix

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]
    Flags = NDArray[np.bool_]

RIDGE = 1e-11  # relative; holds the place and scale of a window, which no residual feels
PARAMETERS = 6  # of a photo: shift of its centre, rotation
CONCORDANT = 1e-9  # smallest share of a condition that the others do not hold already
INVERTIBLE = 1e-9  # keeps a point that holds its photos alone from stopping the others
FEWEST = 2  # rays


@dataclass(frozen=True, eq=False)
class Rays:
    """Image points of a strip, linearised, in units of their standard deviations.

    Parameters
    ----------
    row : ndarray of int, shape (n,)
        Row in the observations.
    photo : ndarray of int, shape (n,)
        Place of the photo in the strip.
    point : ndarray of int, shape (n,)
        Number of the point.
    by_point : ndarray, shape (n, 2, 3)
        Derivatives of the image coordinates by the point.
    by_photo : ndarray, shape (n, 2, 6)
        Derivatives by shift and rotation of the photo.
    misfit : ndarray, shape (n, 2)
        Measured minus computed.
    sigma : ndarray, shape (n, 2)
        Standard deviations of the image coordinates, mm.
    """

    row: Numbers
    photo: Numbers
    point: Numbers
    by_point: Floats
    by_photo: Floats
    misfit: Floats
    sigma: Floats

    def take(self, rows: Numbers) -> Rays:
        """Give some of the rays."""
        return Rays(
            self.row[rows],
            self.photo[rows],
            self.point[rows],
            self.by_point[rows],
            self.by_photo[rows],
            self.misfit[rows],
            self.sigma[rows],
        )


def linearise(
    place: tuple[Numbers, Numbers, Numbers],
    image: tuple[Floats, Floats, float],
    photos: tuple[Floats, Floats],
    xyz: Floats,
) -> Rays:
    """Linearise the collinearity equations of rays.

    Parameters
    ----------
    place : tuple of ndarray of int, shape (n,)
        Row, photo and point of each ray.
    image : tuple
        Image coordinates (n, 2) in mm, their standard deviations (n, 2) in mm, principal distance in mm.
    photos : tuple of ndarray
        Perspective centres (m, 3) and rotations (m, 3, 3), photo to strip.
    xyz : ndarray, shape (n, 3)
        Approximate position of the point of each ray, strip coordinates.

    Returns
    -------
    Rays
        The rays; not finite where a point lies behind its camera.
    """
    row, photo, point = place
    xy, sigma, focal = image
    centers, rotations = photos
    turn = rotations[photo]
    u = np.einsum("nji,nj->ni", turn, xyz - centers[photo])
    with np.errstate(all="ignore"):
        depth = np.where(u[:, 2] < 0, -u[:, 2], np.nan)
        computed = focal * u[:, :2] / depth[:, None]
        slope = np.zeros((len(u), 2, 3))
        slope[:, 0, 0] = slope[:, 1, 1] = focal / depth
        slope[:, :, 2] = computed / depth[:, None]
        slope /= sigma[:, :, None]
        by_point = np.einsum("nik,njk->nij", slope, turn)
        by_photo = np.empty((len(u), 2, PARAMETERS))
        by_photo[:, :, :3] = -by_point
        by_photo[:, :, 3:] = slope @ cross_matrix(u)
        misfit = (xy - computed) / sigma
    return Rays(row, photo, point, by_point, by_photo, misfit, sigma)


def size_of(reach: int) -> tuple[int, int]:
    """Photos in a window and from window to window, for points that reach over so many photos."""
    return 2 * reach + 4, reach + 1


def starts(photos: int, reach: int) -> Numbers:
    """First photos of the windows that cover a strip."""
    length, step = size_of(reach)
    if photos <= length:
        return np.zeros(1, np.intp)
    return np.unique(np.minimum(np.arange(0, photos - length + step, step), photos - length)).astype(np.intp)


def homes(middle: Floats, first: Numbers, reach: int) -> Numbers:
    """Window in whose middle each point stands."""
    length, _ = size_of(reach)
    centers = first + (length - 1) / 2
    return np.asarray(np.abs(middle[:, None] - centers).argmin(axis=1), np.intp)


@dataclass(frozen=True, eq=False)
class Group:
    """Points with equally many rays in their window.

    Parameters
    ----------
    window : ndarray of int, shape (k,)
        Window of each point, counted within the batch.
    ray : ndarray of int, shape (k, r)
        Rays of the point, in flight order.
    column : ndarray of int, shape (k, r)
        Place of their photos in the window.
    by_point : ndarray, shape (k, 2r, 3)
        Derivatives of all coordinates by the point.
    by_photo : ndarray, shape (k, 2r, 6r)
        Derivatives by the photos of the point, one after the other.
    misfit : ndarray, shape (k, 2r)
        Measured minus computed.
    """

    window: Numbers
    ray: Numbers
    column: Numbers
    by_point: Floats
    by_photo: Floats
    misfit: Floats

    def take(self, rows: Flags) -> Group:
        """Give some of the points."""
        return Group(
            self.window[rows],
            self.ray[rows],
            self.column[rows],
            self.by_point[rows],
            self.by_photo[rows],
            self.misfit[rows],
        )

    @property
    def parameters(self) -> Numbers:
        """Place of the parameters of its photos among those of the window, shape (k, 6r)."""
        found: Numbers = (PARAMETERS * self.column[:, :, None] + np.arange(PARAMETERS)).reshape(len(self.window), -1)
        return found


def groups(rays: Rays, first: Numbers, length: int) -> list[Group]:
    """Sort the rays of some windows by point, and the points by their number of rays.

    Parameters
    ----------
    rays : Rays
        Rays of the strip, ordered by point and photo.
    first : ndarray of int, shape (w,)
        First photo of each window.
    length : int
        Photos in a window.

    Returns
    -------
    list of Group
        Points with two rays, with three and so on; points with one ray in a window are left out.
    """
    inside = (rays.photo >= first[:, None]) & (rays.photo < first[:, None] + length)
    window, ray = np.nonzero(inside)
    key = window * (int(rays.point.max(initial=0)) + 1) + rays.point[ray]
    begin = np.flatnonzero(np.diff(key, prepend=-1))
    count = np.diff(np.append(begin, len(key)))
    found = []
    for r in np.unique(count[count > 1]).tolist():
        place = begin[count == r, None] + np.arange(r)
        of_point, own = ray[place], window[begin[count == r]]
        k = len(own)
        design = np.zeros((k, r, 2, r, PARAMETERS))
        design[:, range(r), :, range(r), :] = rays.by_photo[of_point].transpose(1, 0, 2, 3)
        found.append(
            Group(
                own,
                of_point,
                rays.photo[of_point] - first[own, None],
                rays.by_point[of_point].reshape(k, 2 * r, 3),
                design.reshape(k, 2 * r, PARAMETERS * r),
                rays.misfit[of_point].reshape(k, 2 * r),
            )
        )
    return found


def projectors(group: Group, weight: Floats) -> Floats:
    """Matrices that take the point out of its weighted rays.

    Parameters
    ----------
    group : Group
        Points.
    weight : ndarray, shape (k, r)
        1 for a ray that counts, 0 for one that does not; a point needs two.

    Returns
    -------
    ndarray, shape (k, 2r, 2r)
        Projections P with P A = 0, A the derivatives by the point; zero for a point with fewer than two rays.
    """
    root = np.repeat(weight, 2, axis=1)[:, :, None]
    design = group.by_point * root
    normal = design.transpose(0, 2, 1) @ design
    enough = weight.sum(axis=1) >= FEWEST
    normal[~enough] = np.eye(3)
    inside = design @ np.linalg.solve(normal, design.transpose(0, 2, 1))
    matrix = np.eye(design.shape[1]) * root - inside
    matrix[~enough] = 0.0
    return np.asarray(matrix, float)


@dataclass(frozen=True, eq=False)
class Solved:
    """Windows adjusted.

    Parameters
    ----------
    estimate : ndarray, shape (w, 6 length)
        Changes of the photos.
    cofactors : ndarray, shape (w, 6 length, 6 length)
        Their cofactors, place and scale of the window free.
    """

    estimate: Floats
    cofactors: Floats

    def of(self, group: Group) -> tuple[Floats, Floats]:
        """Give changes and cofactors of the photos of each point, shapes (k, 6r) and (k, 6r, 6r)."""
        place, window = group.parameters, group.window
        return self.estimate[window[:, None], place], self.cofactors[
            window[:, None, None], place[:, :, None], place[:, None, :]
        ]


@dataclass(frozen=True, eq=False)
class Conditions:
    """Conditions of points on the photos of their windows, padded with zeros to equal numbers.

    Parameters
    ----------
    design : ndarray, shape (w, c, 6 length)
        Derivatives by the photos.
    misfit : ndarray, shape (w, c)
        Misclosures.
    """

    design: Floats
    misfit: Floats

    def left(self, solved: Solved) -> Floats:
        """Sizes of what an adjustment leaves of the misclosures, shape (w, c)."""
        return np.abs(self.misfit - (self.design @ solved.estimate[:, :, None])[:, :, 0])

    def solved(self, weight: Floats) -> Solved:
        """Adjust the windows with weights of the conditions, shape (w, c)."""
        weighted = self.design * weight[:, :, None]
        normal = weighted.transpose(0, 2, 1) @ self.design
        right = (weighted * self.misfit[:, :, None]).sum(axis=1)
        size = normal.shape[1]
        diagonal = normal[:, np.arange(size), np.arange(size)]
        scale = 1 / np.sqrt(np.maximum(diagonal, 1e-12 * diagonal.max(axis=1, keepdims=True)))
        normal = normal * scale[:, :, None] * scale[:, None, :]
        normal[:, np.arange(size), np.arange(size)] += RIDGE
        cofactors = np.linalg.inv(normal) * scale[:, :, None] * scale[:, None, :]
        return Solved(np.einsum("wij,wj->wi", cofactors, right), cofactors)


def stacked(parts: list[tuple[Group, Floats]], count: int, length: int) -> Conditions:
    """Put conditions of groups into their windows.

    Parameters
    ----------
    parts : list of tuple
        Groups with matrices (k, c, 2r) that form conditions out of the coordinates.
    count, length : int
        Number of windows and photos in each.

    Returns
    -------
    Conditions
        All conditions by window.
    """
    window = np.concatenate([np.repeat(group.window, matrix.shape[1]) for group, matrix in parts])
    order = np.argsort(window, kind="stable")
    place = np.empty(len(window), np.intp)
    place[order] = np.arange(len(window)) - np.searchsorted(window[order], window[order])
    design = np.zeros((count, int(place.max(initial=-1)) + 1, PARAMETERS * length))
    misfit = np.zeros(design.shape[:2])
    done = 0
    for group, matrix in parts:
        k, c = matrix.shape[:2]
        at = place[done : done + k * c].reshape(k, c)
        design[group.window[:, None, None], at[:, :, None], group.parameters[:, None, :]] = matrix @ group.by_photo
        misfit[group.window[:, None], at] = np.einsum("kij,kj->ki", matrix, group.misfit)
        done += k * c
    return Conditions(design, misfit)


def without(group: Group, weight: Floats, solved: Solved) -> tuple[Floats, Floats]:
    """Take each point out of the adjustment of its window.

    Parameters
    ----------
    group : Group
        Points.
    weight : ndarray, shape (k, r)
        Rays that took part, 1 or 0.
    solved : Solved
        The adjustment.

    Returns
    -------
    tuple of ndarray, shapes (k, 6r), (k, 6r, 6r)
        Changes of the photos of each point and their cofactors, from all other points.
    """
    estimate, cofactors = solved.of(group)
    matrix = projectors(group, weight)
    design = matrix @ group.by_photo
    gap = np.einsum("kij,kj->ki", matrix, group.misfit) - np.einsum("kij,kj->ki", design, estimate)
    pull = design @ cofactors
    rest = np.eye(design.shape[1]) * (1 + INVERTIBLE) - pull @ design.transpose(0, 2, 1)
    gain = pull.transpose(0, 2, 1) @ np.linalg.inv(rest)
    return estimate - np.einsum("kij,kj->ki", gain, gap), cofactors + gain @ pull


def coplanarities(group: Group) -> Floats:
    """Conditions of rays of neighbouring photos, then what more the rays of a point demand.

    An error along the base leaves the first r - 1 alone, which are y parallaxes.

    Parameters
    ----------
    group : Group
        Points with r rays.

    Returns
    -------
    ndarray, shape (k, 2r - 3, 2r)
        Rows of unit length: r - 1 coplanarities, then r - 2 rows across them.
    """
    k, coordinates = group.misfit.shape
    r = coordinates // 2
    result = np.zeros((k, 2 * r - 3, 2 * r))
    for number in range(r - 1):
        part = group.by_point[:, 2 * number : 2 * number + 4]
        row = np.stack([(-1) ** i * np.linalg.det(np.delete(part, i, axis=1)) for i in range(4)], axis=1)
        result[:, number, 2 * number : 2 * number + 4] = row / np.maximum(
            np.linalg.norm(row, axis=1, keepdims=True), 1e-300
        )
    if r > FEWEST:
        pairs = result[:, : r - 1]
        gram = pairs @ pairs.transpose(0, 2, 1) + CONCORDANT * np.eye(r - 1)
        rest = projectors(group, np.ones((k, r))) - pairs.transpose(0, 2, 1) @ np.linalg.solve(gram, pairs)
        _, vectors = np.linalg.eigh(rest)
        result[:, r - 1 :] = vectors[:, :, -(r - 2) :].transpose(0, 2, 1)
    return result
