"""Formulas of the sources that only check what the planning room computes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.planning.deformation import CENTRAL, SIDE, Constants

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


def source_constants() -> dict[str, Constants]:
    """Return the printed constants before rounding, under the assumptions of the source.

    Returns
    -------
    dict of str to Constants
        For side points (y = b) and central points (y = 0).

    Notes
    -----
    With a = b: alpha counts 1/2, omega 3/4 and the measured parallax 2. The side points take m_kappa = m_q / b for
    each of the two kappas, which is not what six points give, omega at the left edge and plan at the right edge.

    Source: [003] eq. 10.10, 10.11; the assumptions are found by trying.
    """
    found = {}
    for name, parts, sides in ((SIDE, (0.5, 0.75, 2.0, 2.0), 2), (CENTRAL, (0.5, 2.0), 1)):
        variance = sum(parts)
        # plan: x = b; a side point has an error in y as in x, a central point has none from c
        plan = np.sqrt(2 * (variance + 1)) if sides == 2 else np.sqrt(variance + 2)
        found[name] = Constants(float(plan), float(np.sqrt(variance)))
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
    """Parameters of the absolute orientation.

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


def paraboloid(elements: ArrayLike, scale: float, focal: float, base: float) -> Array:
    """Return the surface into which errors of the elements bend the heights of a model.

    Returns (5,), E0, A, B, C, D of dZ = E0 + A x + B y + C x y + D x²; dZ in ground mm for x, y in mm. E0, A and B go
        into the absolute orientation; C is twist, D is bending along the base.
    """
    al1, ka1, al2, om2, ka2 = np.asarray(elements, float)
    m, b = scale, base
    return np.array(
        [-m * b * al2, 2 * m * al2, m * om2 + m * focal / b * (ka2 - ka1), -m * om2 / b, -m * (al2 - al1) / b]
    )
