"""Collinearity: the rays of a batch projected, and their partials by point and photo.

The partials are taken along the axes of each photo: there they are functions of the image point and its depth alone.
A photo's six parameters are the shift of its perspective centre along its own axes, and its rotation about them, the
first of the three with the opposite sign (that saves a pass over all rays; ``SIGNS``).

With the arm a = R^T (X - S) in photo axes, ratio r = -(a_x, a_y) / a_z and the principal distance f, the image point is
f r. Source: derived.
"""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.frozen import dataclass
from photostrip.triangulation.bundle.observations.ray_batches import RayBatch

PHOTO = 6  # parameters of a photo
SIGNS = np.array([1.0, 1.0, 1.0, -1.0, 1.0, 1.0])  # of a photo's parameters, see above


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays of a batch at one state."""

    turn: Floats  # (3, 3, k, S): photo axes as rows of object components: the transposed rotation of each ray
    ratio: Floats  # (2, k, S): computed image coordinates divided by the principal distance
    depth: Floats  # (k, S): reciprocal of the third photo coordinate, 1/m; negative in front of the camera
    pull: Floats  # (2, k, S): principal distance divided by sigma
    misfit: Floats  # (2, k, S): measured minus computed image coordinates in units of sigma


def view(batch: RayBatch, xyz: Floats, photos: Floats) -> Rays:
    """Project the points (3, S) of a batch.

    ``photos`` (13, m): nine elements of the transposed rotation by rows, perspective centre, principal distance.
    """
    k, slots = batch.photo.shape
    of_ray = photos.take(batch.photo, axis=1, mode="clip")
    turn, center, focal = of_ray[:9].reshape(3, 3, k, slots), of_ray[9:12], of_ray[12]
    arm = xyz[:, None, :] - center
    along = turn[:, 0] * arm[0]
    part = turn[:, 1] * arm[1]
    along += part
    np.multiply(turn[:, 2], arm[2], out=part)
    along += part
    depth = 1.0 / along[2]
    ratio = along[:2]
    ratio *= -depth
    pull = batch.weight * focal
    misfit = batch.xy * batch.weight
    misfit -= ratio * pull
    return Rays(turn=turn, ratio=ratio, depth=depth, pull=pull, misfit=misfit)


def by_point(rays: Rays) -> Floats:
    """Differentiate the computed image coordinates by the points: (3, 2, k, S), in units of sigma per metre.

    d(x, y)/dX = -f/a_z (R_x + r_x R_z, R_y + r_y R_z), R_x to R_z the photo axes.
    """
    partials: Floats = rays.turn[2][:, None] * rays.ratio
    partials += rays.turn[:2].transpose(1, 0, 2, 3)
    partials *= rays.pull * -rays.depth
    return partials


def by_photo(rays: Rays, more: int) -> Floats:
    """Differentiate the computed image coordinates by the photo's parameters, the misfit as last row.

    Shape (6 + more + 1, 2, k, S), in units of sigma per metre and radian; ``more`` rows for common parameters between
    the photo's and the misfit are left to be filled.
    """
    partials = np.empty((PHOTO + more + 1, *rays.ratio.shape))
    ratio, pull = rays.ratio, rays.pull
    lean = ratio * pull
    np.multiply(pull[0], rays.depth, out=partials[0, 0])
    np.multiply(pull[1], rays.depth, out=partials[1, 1])
    partials[0, 1] = partials[1, 0] = 0.0
    np.multiply(lean, rays.depth, out=partials[2])
    np.multiply(lean, ratio[1], out=partials[3])
    partials[3, 1] += pull[1]
    np.multiply(lean, ratio[0], out=partials[4])
    partials[4, 0] += pull[0]
    np.multiply(pull[0], ratio[1], out=partials[5, 0])
    np.multiply(pull[1], ratio[0], out=partials[5, 1])
    np.negative(partials[5, 1], out=partials[5, 1])
    partials[-1] = rays.misfit
    return partials
