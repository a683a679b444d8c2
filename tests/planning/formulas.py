"""Formulas of the sources that only check what the planning room computes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.geometry.rotation import from_alpha_omega_kappa
from photostrip.planning.deformation import parallax_error
from photostrip.strip import relative_orientation

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from photostrip.planning.single_model import ModelControl

    Array = NDArray[np.float64]


def relative_differentials(
    base: float, parallax: float, image: ArrayLike, errors: ArrayLike, focal: float
) -> tuple[float, float, float]:
    """dX/X, dY/Y and dZ/Z of a point in the normal case.

    Parameters
    ----------
    image : array_like, shape (2,)
        x and y.
    errors : array_like, shape (3,)
        dx, dy and df.
    """
    (x, y), (dx, dy, df) = np.asarray(image, float), np.asarray(errors, float)
    common = base - parallax
    return common + dx / x, common + dy / y, common + df / focal


def ground_errors(
    xy: ArrayLike, parallax: ArrayLike, scale: float, focal: float, base: float, image: ArrayLike = (0.0, 0.0)
) -> Array:
    """Errors of points from c.

    Parameters
    ----------
    xy : array_like, shape (n, 2)
        x and y, mm.
    parallax : array_like, shape (n,)
        c, mm.
    scale : float
        m, denominator of the photo scale.
    focal, base : float
        f and b, mm.
    image : array_like, shape (2,) or (n, 2)
        Errors dx, dy of the left image point, mm.

    Returns
    -------
    ndarray, shape (n, 3)
        Errors along, across and up, ground mm.
    """
    place, c = np.asarray(xy, float), np.asarray(parallax, float)
    plan = place / base * c[..., None] + np.asarray(image, float)
    found: Array = scale * np.concatenate([plan, (-focal / base * c)[..., None]], axis=-1)
    return found


def six_point_variances(sigma: float, depth: float, width: float, base: float) -> Array:
    """Variances of the elements `FREE` from six standard points.

    Parameters
    ----------
    sigma : float
        Standard deviation of one y parallax, in the unit of the model.
    depth, width, base : float
        Z, the distance a of the side points from the middle ones, and b.

    Returns
    -------
    ndarray, shape (4,)
        Variances of dkappa, dbz, dalpha2, domega; the four are not correlated.
    """
    z, a, b = depth, width, base
    shares = [2 / (3 * b**2), z**2 / (2 * a**2), z**2 / (2 * a**2 * b**2), 3 * z**2 / (4 * a**4)]
    return sigma**2 * np.array(shares)


def orientation_parameters(control: ModelControl, misclosures: ArrayLike) -> Array:
    """Parameters of the absolute orientation of a level model, eq. 5.

    Parameters
    ----------
    misclosures : array_like, shape (n, 3)
        W: model minus given; coordinates that are not given do not matter.

    Returns
    -------
    ndarray, shape (7,)
        In the order of `PARAMETERS`: shifts at the centre of the control, scale, azimuth, tilts.
    """
    misclosure = np.asarray(misclosures, float)
    plan, level = (control.points[given, :2] for given in (control.plan, control.height))
    plan, level = plan - plan.mean(axis=0), level - level.mean(axis=0)
    size = float((plan**2).sum())
    in_plan, in_height = misclosure[control.plan, :2], misclosure[control.height, 2]
    x, y = plan.T
    scale = (x @ in_plan[:, 0] + y @ in_plan[:, 1]) / size
    turn = (x @ in_plan[:, 1] - y @ in_plan[:, 0]) / size
    tilts = np.linalg.solve(level.T @ level, level.T @ in_height)
    return np.array([*in_plan.mean(axis=0), in_height.mean(), scale, turn, *tilts])


def intersected(xyz: Array, base: float, elements: Array, focal: float = 120.0) -> Array:
    """Model points from the images of an exact pair whose right photo has turned and moved; y from both rays."""
    dby, dbz, dkappa, dalpha, domega = elements
    left = np.column_stack([xyz[:, 0], xyz[:, 1], -xyz[:, 2]])
    right = left - (base, 0.0, 0.0)
    in_right = -focal * right / right[:, 2:]  # what is measured: the photo was level
    ray1 = -focal * left / left[:, 2:]
    ray2 = in_right @ from_alpha_omega_kappa(dalpha, domega, dkappa).T
    bx, by, bz = base, dby, dbz
    scale1 = (bz * ray2[:, 0] - bx * ray2[:, 2]) / (ray1[:, 2] * ray2[:, 0] - ray1[:, 0] * ray2[:, 2])
    scale2 = (scale1 * ray1[:, 2] - bz) / ray2[:, 2]
    y = (scale1 * ray1[:, 1] + by + scale2 * ray2[:, 1]) / 2
    return np.column_stack([scale1 * ray1[:, 0], y, scale1 * ray1[:, 2]])


def orientation_factors(xy: ArrayLike, focal: float, width: float, base: float) -> Array:
    """Variance of c from the relative orientation, in units of the variance of a y parallax, shape (n,).

    The cofactors are those of six standard points; `width` is the distance a of the side points from the middle ones.
    """
    place = np.asarray(xy, float)
    rows = np.stack([parallax_error(place, unit, focal, base) for unit in np.eye(5)], axis=-1)
    return np.asarray(
        np.einsum("...i,ij,...j->...", rows, relative_orientation.cofactors(focal, width, base), rows), float
    )
