"""Windows of a strip: a few neighbouring photos adjusted together, all rays of their points at once.

What photos far away say about a ray is lost in the strip's deformation; three photos on either side say nearly
everything. A window is a free network: its photos and points hang together, its place and scale do not matter. The
adjustment is linear, about a strip that has been formed. Points are eliminated
(``window_points``); what a point's rays demand of their photos is adjusted
(``window_adjustment``).

Windows are solved in batches: the arrays of a batch have the window as their first axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.rotation import cross_matrix

if TYPE_CHECKING:
    from photostrip.arrays import Floats, Numbers


PHOTO_PARAMETERS = 6  # of a photo: shift of its centre, rotation
FEWEST = 2  # rays


@dataclass(frozen=True, eq=False)
class WindowRays:
    """Image points of a strip, linearised, in units of their standard deviations."""

    row: Numbers  # (n,): row in the observations
    photo: Numbers  # (n,): place of the photo in the strip
    point: Numbers  # (n,): number of the point
    by_point: Floats  # (n, 2, 3): derivatives of the image coordinates by the point
    by_photo: Floats  # (n, 2, 6): derivatives by shift and rotation of the photo
    misfit: Floats  # (n, 2): measured minus computed
    sigma: Floats  # (n, 2): standard deviations of the image coordinates, mm

    def take(self, rows: Numbers) -> WindowRays:
        """Give some of the rays."""
        return WindowRays(
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
) -> WindowRays:
    """Linearise the collinearity equations of rays at approximate points (n, 3); not finite behind a camera."""
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
        by_photo = np.empty((len(u), 2, PHOTO_PARAMETERS))
        by_photo[:, :, :3] = -by_point
        by_photo[:, :, 3:] = slope @ cross_matrix(u)
        misfit = (xy - computed) / sigma
    return WindowRays(row, photo, point, by_point, by_photo, misfit, sigma)


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
    after = np.clip(np.searchsorted(centers, middle), 1, max(len(centers) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(centers) - 1)
    # of two windows equally near the first
    nearer = np.abs(middle - centers[before]) <= np.abs(middle - centers[after])
    return np.asarray(np.where(nearer, before, after), np.intp)
