"""What errors of measurement and of relative orientation do to points of one model, and how large they are.

Points, elements and their signs are those of ``single_model``.

Source: [000] eq. 2 and last paragraphs, rederived; ``photostrip sources`` lists the corrections.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.strip.relative_orientation import six_points

ELEMENTS = ("dby", "dbz", "dkappa", "dalpha", "domega")
FREE = ("dkappa", "dbz", "dalpha2", "domega")  # dalpha2: the turn against the base, dalpha - dbz / b


def influence(points: ArrayLike, base: float) -> Floats:
    """Errors of model points (x, y, depth Z > 0) per error of each element of relative orientation, shape (n, 3, 5).

    The right ray meets the level of the point ``px`` and ``py`` away from it. Intersection with the fixed left ray
    gives the point; y is the mean of both rays. Rows are x, y and height, columns `ELEMENTS`.

    Source: [000] eq. 2, rederived; checked against differences of the exact intersection.
    """
    x, y, z = np.moveaxis(np.asarray(points, float), -1, 0)
    right, zero = x - base, np.zeros_like(x)
    px = np.stack([zero, right / z, -y, (right**2 + z**2) / z, right * y / z], axis=-1)
    py = np.stack([zero + 1.0, y / z, right, right * y / z, z + y**2 / z], axis=-1)
    along, across, up = ((value / base)[..., None] * px for value in (x, y, -z))
    return np.stack([along, across + py / 2, up], axis=-2)


def free_influence(points: ArrayLike, base: float) -> Floats:
    """Return the same for the elements `FREE`, which are independent with six standard points, shape (n, 3, 4).

    dby is left out: it shifts all points alike, which the control takes back. dalpha and dbz are correlated;
    dalpha = dalpha2 + dbz / b separates them.

    Source: [000], last paragraphs.
    """
    rows = influence(points, base)
    shift, kappa, alpha, omega = (rows[..., k] for k in range(1, 5))
    return np.stack([kappa, shift + alpha / base, alpha, omega], axis=-1)


def free_covariance(dependent: ArrayLike, base: float) -> Floats:
    """Covariance (4, 4) of the elements `FREE` from that (5, 5) of `ELEMENTS`."""
    take = np.zeros((4, 5))
    take[0, 2] = take[1, 1] = take[2, 3] = take[3, 4] = 1.0
    take[2, 1] = -1.0 / base
    return np.asarray(take @ np.asarray(dependent, float) @ take.T, float)


def element_covariance(points: ArrayLike, base: float, sigma: float) -> Floats:
    """Covariance (5, 5) of `ELEMENTS` from any points (x, y, depth) that orient the pair.

    sigma: standard deviation of one y parallax at the depth at which the unit of the model is that of the photo: with
        depths Z and the principal distance f = mean depth, that of a y parallax in the photo.
    Raises GeometryError when the points do not determine the orientation.

    Source: rows of the linear condition at zero elements, and Q_dep = T Q T^T; derived.
    """
    x, y, z = np.moveaxis(np.asarray(points, float), -1, 0)
    focal = float(z.mean())
    # image coordinates of the level pair
    left, right, side = focal * x / z, focal * (x - base) / z, focal * y / z
    rows = np.column_stack([left * side, focal * left, -right * side, -(focal**2 + side**2), -focal * right]) / focal
    size = np.linalg.norm(rows, axis=0)
    if len(rows) < len(ELEMENTS) or np.any(size == 0) or np.linalg.matrix_rank(rows / size) < len(ELEMENTS):
        raise GeometryError(
            "the points do not determine the relative orientation: at least five are needed, spread over the model",
            code="plan-orientation",
        )
    inverse = np.linalg.inv((rows / size).T @ (rows / size)) / np.outer(size, size)
    turn = six_points.dependent_from_base(base)
    return sigma**2 * turn @ inverse @ turn.T


def measured_covariance(points: ArrayLike, base: float, focal: float, sigma: float) -> Floats:
    """Covariance (n, 3, 3) of model coordinates from the measurement of the points (x, y, depth) themselves.

    focal: principal distance in the unit of `sigma`.
    sigma: standard deviation of an image coordinate; x1, y1, x2, y2 are independent of each other.
    """
    x, y, z = np.moveaxis(np.asarray(points, float), -1, 0)
    one, zero = np.ones_like(x), np.zeros_like(x)
    rows = np.stack(
        [
            np.stack([1 - x / base, zero, x / base, zero], axis=-1),
            np.stack([-y / base, one / 2, y / base, one / 2], axis=-1),
            np.stack([z / base, zero, -z / base, zero], axis=-1),
        ],
        axis=-2,
    )
    rows *= (z / focal * sigma)[:, None, None]
    return np.asarray(rows @ np.swapaxes(rows, -1, -2), float)
