"""Error theory of one oriented model: what errors of orientation, measurement and control do to its points.

The pair is held dependent: left photo fixed, base b along x. A point is ``x, y`` and its depth ``Z`` below the
perspective centres, ``x`` counted from the left nadir along the flight, ``y`` to the left, heights upwards; all in one
unit, for example millimetres at photo scale (then Z = f in level ground). The elements of the right photo are

    dby, dbz    its perspective centre to the left and upwards, in that unit
    dkappa, dalpha, domega    its turns, radians; positive: counter-clockwise, looking forward, looking to the left

An error of a point has three parts, dx1 of measurement, dx2 of relative and dx3 of absolute orientation. The absolute
orientation is a plane similarity in plan and a tilted plane in height, both fitted to control with equal weights; to
the first order, and for a nearly level model with little relief, it is the similarity in space.

Source: [000] eq. 1-8, with the corrections listed in docs/sources.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from photostrip.errors import GeometryError
from photostrip.triangulation.relative_orientation import six_points

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]
    Rows = NDArray[np.intp]

ELEMENTS = ("dby", "dbz", "dkappa", "dalpha", "domega")
FREE = ("dkappa", "dbz", "dalpha2", "domega")  # dalpha2: the turn against the base, dalpha - dbz / b
PARAMETERS = ("dX0", "dY0", "dZ0", "dlambda", "dtheta", "deta", "dxi")
FLATTEST = 1e-6  # of control in height: A against c1 c2; below that it lies on a line
CLOSEST = 1e-12  # of control in plan: B against the square of the size of its coordinates; below that it is one point


@dataclass(frozen=True, eq=False)
class Control:
    """Control points of a model."""

    points: Array  # (n, 3): x, y and depth
    # plan, height: (n,): whether the point is given in plan, in height
    plan: Flags
    height: Flags
    measured: Array  # (n, 3, 3): covariance of the measured model coordinates
    given: Array  # (n, 3, 3): covariance of the given coordinates


@dataclass(frozen=True, eq=False)
class Expected:
    """Expected errors of points."""

    covariance: Array  # (q, 3, 3): covariance of x, y and height
    # (q, 3, 3): what each source contributes: ``measuring`` of the point itself (for a control point with what its own
    # measurement does through the orientation), ``orientation`` relative, ``control measured``, ``control given``. They
    # add up to the covariance
    sources: dict[str, Array]
    # (q, 3, 4): standard deviations from each of `FREE` alone. Their squares add up to the variances of ``orientation``
    # where the four are not correlated, as with six standard points
    elements: Array

    @property
    def sigmas(self) -> Array:
        """Standard deviations of x, y and height, shape (q, 3)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


# ------------------------------------------------------------------------------------- influence of the elements


def influence(points: ArrayLike, base: float) -> Array:
    """Errors of model points per error of each element of relative orientation.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        x, y, depth Z > 0.
    base : float
        b, in the same unit.

    Returns
    -------
    ndarray, shape (n, 3, 5)
        Partial derivatives of x, y and height in the order of `ELEMENTS`.

    Notes
    -----
    The right ray meets the level of the point ``px`` and ``py`` away from it. Intersection with the fixed left ray
    gives the point; y is the mean of both rays.

    Source: [000] eq. 2, rederived; checked against differences of the exact intersection.
    """
    x, y, z = np.moveaxis(np.asarray(points, float), -1, 0)
    right, zero = x - base, np.zeros_like(x)
    px = np.stack([zero, right / z, -y, (right**2 + z**2) / z, right * y / z], axis=-1)
    py = np.stack([zero + 1.0, y / z, right, right * y / z, z + y**2 / z], axis=-1)
    along, across, up = ((value / base)[..., None] * px for value in (x, y, -z))
    return np.stack([along, across + py / 2, up], axis=-2)


def free_influence(points: ArrayLike, base: float) -> Array:
    """Return the same for the four elements that are independent with six standard points.

    Returns
    -------
    ndarray, shape (n, 3, 4)
        In the order of `FREE`. dby is left out: it shifts all points alike, which the control takes back.

    Notes
    -----
    dalpha and dbz are correlated; dalpha = dalpha2 + dbz / b separates them.

    Source: [000], last paragraphs.
    """
    rows = influence(points, base)
    shift, kappa, alpha, omega = (rows[..., k] for k in range(1, 5))
    return np.stack([kappa, shift + alpha / base, alpha, omega], axis=-1)


def free_covariance(dependent: ArrayLike, base: float) -> Array:
    """Covariance of the elements `FREE`.

    Parameters
    ----------
    dependent : array_like, shape (5, 5)
        Covariance of `ELEMENTS`.

    Returns
    -------
    ndarray, shape (4, 4)
        Covariance of dkappa, dbz, dalpha2, domega.
    """
    take = np.zeros((4, 5))
    take[0, 2] = take[1, 1] = take[2, 3] = take[3, 4] = 1.0
    take[2, 1] = -1.0 / base
    found: Array = take @ np.asarray(dependent, float) @ take.T
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


def element_covariance(points: ArrayLike, base: float, sigma: float) -> Array:
    """Covariance of the dependent elements from any points that orient the pair.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        x, y, depth of at least five points.
    base : float
        b, in the same unit.
    sigma : float
        Standard deviation of one y parallax at the depth at which the unit of the model is that of the photo: with
        depths Z and the principal distance f = mean depth, that of a y parallax in the photo.

    Returns
    -------
    ndarray, shape (5, 5)
        Covariance of `ELEMENTS`.

    Raises
    ------
    GeometryError
        When the points do not determine the orientation.

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


def measured_covariance(points: ArrayLike, base: float, focal: float, sigma: float) -> Array:
    """Covariance of model coordinates from the measurement of the point itself.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        x, y, depth.
    base : float
        b, in the same unit.
    focal : float
        Principal distance in the unit of `sigma`.
    sigma : float
        Standard deviation of an image coordinate; x1, y1, x2, y2 are independent of each other.

    Returns
    -------
    ndarray, shape (n, 3, 3)
        Covariance of x, y and height in the unit of the model.
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
    found: Array = rows @ np.swapaxes(rows, -1, -2)
    return found


# ------------------------------------------------------------------------------------------ absolute orientation


def orientation_operator(points: ArrayLike, control: Control) -> Array:
    """Return what the absolute orientation gives to points, per misclosure at the control.

    Parameters
    ----------
    points : array_like, shape (q, 3)
        x, y, depth; only x and y matter.

    Returns
    -------
    ndarray, shape (q, 3, n, 3)
        H: the part dx3 of point j is the sum over control i of ``H[j, :, i, :] @ W[i]``, with W = model minus given.
        It is subtracted from the model.

    Raises
    ------
    GeometryError
        When the control does not determine the seven parameters.

    Source: [000] eq. 3-7 in operator form.
    """
    where, at = np.asarray(points, float), control.points
    operator = np.zeros((len(where), 3, len(at), 3))
    here, there, size = _plan_control(where, control)
    count = int(control.plan.sum())
    turned = there[:, ::-1] * (1.0, -1.0)  # (Y_i, -X_i)
    rows = np.flatnonzero(control.plan)
    straight, crossed = 1 / count + here @ there.T / size, here @ turned.T / size
    operator[:, 0, rows, 0] = operator[:, 1, rows, 1] = straight
    operator[:, 0, rows, 1], operator[:, 1, rows, 0] = crossed, -crossed
    rows = np.flatnonzero(control.height)
    operator[:, 2, rows, 2] = _height_operator(where, control)
    return operator


def _plan_control(where: Array, control: Control) -> tuple[Array, Array, float]:
    """Points and plan control about the control's centre, and B."""
    xy = control.points[control.plan, :2]
    if len(xy) < 2:
        message = f"{len(xy)} control points in plan do not determine position, azimuth and scale; two are needed"
        raise GeometryError(message, code="plan-control")
    centre = xy.mean(axis=0)
    there = xy - centre
    size = float((there**2).sum())
    if size <= CLOSEST * float((xy**2).sum()):
        raise GeometryError("all control points in plan lie at one place", code="plan-control")
    return where[:, :2] - centre, there, size


def _height_operator(where: Array, control: Control) -> Array:
    """Hz, shape (q, control points in height)."""
    xy = control.points[control.height, :2]
    if len(xy) < 3:
        message = f"{len(xy)} control points in height do not determine height and tilts; three are needed"
        raise GeometryError(message, code="plan-control")
    centre = xy.mean(axis=0)
    there, here = xy - centre, where[:, :2] - centre
    moments = there.T @ there
    area = moments[0, 0] * moments[1, 1] - moments[0, 1] ** 2
    if area <= FLATTEST * moments[0, 0] * moments[1, 1] or min(moments[0, 0], moments[1, 1]) == 0:
        message = "all control points in height lie on one line: the tilt about it is not determined"
        raise GeometryError(message, code="plan-control")
    return np.asarray(1 / len(xy) + here @ np.linalg.solve(moments, there.T))


def orientation_parameters(control: Control, misclosures: ArrayLike) -> Array:
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
    _, plan, size = _plan_control(control.points, control)
    _height_operator(control.points, control)  # refuses what cannot be levelled
    xy = control.points[control.height, :2]
    level = xy - xy.mean(axis=0)
    in_plan, in_height = misclosure[control.plan, :2], misclosure[control.height, 2]
    x, y = plan.T
    scale = (x @ in_plan[:, 0] + y @ in_plan[:, 1]) / size
    turn = (x @ in_plan[:, 1] - y @ in_plan[:, 0]) / size
    tilts = np.linalg.solve(level.T @ level, level.T @ in_height)
    return np.array([*in_plan.mean(axis=0), in_height.mean(), scale, turn, *tilts])


def parameter_rows(points: ArrayLike, control: Control) -> Array:
    """Rows F that give the part dx3 of points from the seven parameters.

    Parameters
    ----------
    points : array_like, shape (q, 3)
        x, y, depth.
    control : Control
        Control, whose centres are the origins: that of the plan control for plan, that of the heights for heights.

    Returns
    -------
    ndarray, shape (q, 3, 7)
        F.
    """
    where = np.asarray(points, float)
    x, y = (where[:, :2] - control.points[control.plan, :2].mean(axis=0)).T
    u, v = (where[:, :2] - control.points[control.height, :2].mean(axis=0)).T
    rows = np.zeros((len(where), 3, len(PARAMETERS)))
    rows[:, [0, 1, 2], [0, 1, 2]] = 1.0
    rows[:, 0, 3], rows[:, 0, 4] = x, -y
    rows[:, 1, 3], rows[:, 1, 4] = y, x
    rows[:, 2, 5], rows[:, 2, 6] = u, v
    return rows


def deformation(points: ArrayLike, control: Control, base: float) -> Array:
    """Return what the elements do to points of the oriented model: their influence less what the control takes back.

    Parameters
    ----------
    points : array_like, shape (q, 3)
        x, y, depth; relief is allowed.

    Returns
    -------
    ndarray, shape (q, 3, 4)
        Coefficients of `FREE`.
    """
    there = free_influence(control.points, base)
    found: Array = free_influence(points, base) - np.einsum(
        "qanb,nbk->qak", orientation_operator(points, control), there
    )
    return found


# --------------------------------------------------------------------------------------------- expected errors


def expected_errors(
    points: ArrayLike, measured: ArrayLike, control: Control, base: float, elements: ArrayLike, row: Rows | None = None
) -> Expected:
    """Covariance of points of the oriented model before anything is measured.

    Parameters
    ----------
    points : array_like, shape (q, 3)
        x, y, depth.
    measured : array_like, shape (q, 3, 3)
        Covariance of their measured model coordinates.
    elements : array_like, shape (4, 4)
        Covariance of `FREE`.
    row : ndarray of int, shape (q,), optional
        The control point that a point is, -1 for none; default: none of them is control.

    Returns
    -------
    Expected
        Covariances and their parts.

    Notes
    -----
    Errors of the elements and of the measured coordinates of the same image points count as independent, as in the
    source.

    Source: [000], last paragraphs.
    """
    operator = orientation_operator(points, control)
    shape = deformation(points, control, base)
    variance = np.asarray(elements, float)
    own = np.array(measured, float)
    others = operator.copy()
    if row is not None:
        is_control = np.flatnonzero(row >= 0)
        same = np.eye(3) - operator[is_control, :, row[is_control]]
        own[is_control] = same @ control.measured[row[is_control]] @ np.swapaxes(same, 1, 2)
        others[is_control, :, row[is_control]] = 0.0
    sources = {
        "measuring": own,
        "orientation": shape @ variance @ np.swapaxes(shape, 1, 2),
        "control measured": _through(others, control.measured),
        "control given": _through(operator, control.given),
    }
    return Expected(sum(sources.values(), np.zeros_like(own)), sources, np.abs(shape) * np.sqrt(np.diag(variance)))


def _through(operator: Array, covariance: Array) -> Array:
    """Carry independent covariances of the control through the operator."""
    found: Array = np.einsum("qanb,nbc,qdnc->qad", operator, covariance, operator, optimize=True)
    return found
