"""Errors of photos that are oriented on their adjusted points: what these points and their images do to them.

Source: derived; see docs/precision.md, eq. 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.strip.error_propagation.strip_errors import StripErrors, blocks, entries_of
from photostrip.strip.resection.collinearity import KnownPhotos, derivatives
from photostrip.strip.resection.resection import Resection

if TYPE_CHECKING:
    from scipy.sparse import csr_array

NUMBERS = 6  # of a photo: shift of its centre, small rotation, in the frame of the ground


@dataclass(frozen=True, eq=False)
class PhotoErrors:
    """Errors of all m photos of a strip; rows of zeros where one could not be oriented."""

    by_point: csr_array  # (6 m, 3 q): by the adjusted points
    by_image: csr_array  # (6 m, ...): by the image coordinates, in the columns of the strip's sparse rows


def differentiate_photos(
    errors: StripErrors, resection: Resection, xyz: Floats, photo: Numbers, point: Numbers, image: Numbers
) -> PhotoErrors:
    """Differentiate the resections: do = N^-1 A^T (dl - B dX), N = A^T A of one photo.

    The points carry the photo with them, and its measurements move it once more.

    xyz: (q, 3), adjusted points of the strip, metres.
    photo, point, image: (e,), rays on which photos were oriented: photo, ascending, point, and row in the project.
    """
    some = resection.solved[photo]
    photo, point, image = photo[some], point[some], image[some]
    focal = np.full(len(resection.centers), errors.orientation.pairs.focal)
    by_photo, by_point = derivatives(xyz[point], KnownPhotos(resection.centers, resection.rotations, focal), photo)
    distance = float(np.linalg.norm(xyz[point] - resection.centers[photo], axis=1).mean())
    unit = np.array([distance] * 3 + [1.0] * 3)  # so that shifts and rotations are of one size
    scaled = (by_photo * unit).transpose(0, 2, 1)
    starts = np.flatnonzero(np.diff(photo, prepend=-1))
    cofactors = np.zeros((len(focal), NUMBERS, NUMBERS))
    normal = np.add.reduceat(scaled @ scaled.transpose(0, 2, 1), starts)
    cofactors[photo[starts]] = unit[:, None] * np.linalg.inv(normal)
    by_image = cofactors[photo] @ scaled
    rows, images = entries_of(photo, NUMBERS), errors.first_error + errors.image_columns(image)
    count = NUMBERS * len(focal)
    return PhotoErrors(
        blocks(rows, entries_of(point, 3), -by_image @ by_point, (count, xyz.size)),
        blocks(rows, images, by_image * errors.sigma[image][:, None, :], (count, errors.width)),
    )
