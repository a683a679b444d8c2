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
from photostrip.notes import counted
from photostrip.planning.element_errors import free_influence

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from photostrip.arrays import Flags, Floats, Numbers

PARAMETERS = ("dX0", "dY0", "dZ0", "dlambda", "dtheta", "deta", "dxi")
FLATTEST = 1e-6  # of control in height: A against c1 c2; below that it lies on a line
CLOSEST = 1e-12  # of control in plan: B against the square of the size of its coordinates; below that it is one point


@dataclass(frozen=True, eq=False)
class ModelControl:
    """Control points of a model."""

    points: Floats  # (n, 3): x, y and depth
    # plan, height: (n,): whether the point is given in plan, in height
    plan: Flags
    height: Flags
    measured: Floats  # (n, 3, 3): covariance of the measured model coordinates
    given: Floats  # (n, 3, 3): covariance of the given coordinates


@dataclass(frozen=True, eq=False)
class ExpectedErrors:
    """Expected errors of points."""

    covariance: Floats  # (q, 3, 3): covariance of x, y and height
    # (q, 3, 3): what each source contributes: ``measuring`` of the point itself (for a control point with what its own
    # measurement does through the orientation), ``orientation`` relative, ``control measured``, ``control given``. They
    # add up to the covariance
    sources: dict[str, Floats]
    # (q, 3, 4): standard deviations from each of `FREE` alone. Their squares add up to the variances of ``orientation``
    # where the four are not correlated, as with six standard points
    elements: Floats

    @property
    def sigmas(self) -> Floats:
        """Standard deviations of x, y and height, shape (q, 3)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


def orientation_operator(points: ArrayLike, control: ModelControl) -> Floats:
    """Return what the absolute orientation gives to points, per misclosure at the control.

    Returns (q, 3, n, 3), H: the part dx3 of point j is the sum over control i of ``H[j, :, i, :] @ W[i]``, with W =
        model minus given. It is subtracted from the model.
    Raises GeometryError when the control does not determine the seven parameters.

    Source: [000] eq. 3-7 in operator form.
    """
    where = np.asarray(points, float)
    operator = np.zeros((len(where), 3, len(control.points), 3))
    rows = np.flatnonzero(control.plan)
    straight, crossed = _plan_operator(where, control)
    operator[:, 0, rows, 0] = operator[:, 1, rows, 1] = straight
    operator[:, 0, rows, 1], operator[:, 1, rows, 0] = crossed, -crossed
    rows = np.flatnonzero(control.height)
    operator[:, 2, rows, 2] = _height_operator(where, control)
    return operator


def _plan_operator(where: Floats, control: ModelControl) -> tuple[Floats, Floats]:
    """Parts of Hx = Hy' along and across a misclosure, shape (q, control points in plan) each."""
    xy = control.points[control.plan, :2]
    if len(xy) < 2:
        message = f"{counted(len(xy), 'control point')} in plan cannot give position, azimuth and scale; two are needed"
        raise GeometryError(message, code="plan-control")
    center = xy.mean(axis=0)
    control_xy, point_xy = xy - center, where[:, :2] - center
    size = float((control_xy**2).sum())  # B
    if size <= CLOSEST * float((xy**2).sum()):
        raise GeometryError("all control points in plan lie at one place", code="plan-control")
    turned = control_xy[:, ::-1] * (1.0, -1.0)  # (Y_i, -X_i)
    return np.asarray(1 / len(xy) + point_xy @ control_xy.T / size), np.asarray(point_xy @ turned.T / size)


def _height_operator(where: Floats, control: ModelControl) -> Floats:
    """Hz, shape (q, control points in height)."""
    xy = control.points[control.height, :2]
    if len(xy) < 3:
        message = f"{counted(len(xy), 'control point')} in height cannot give height and tilts; three are needed"
        raise GeometryError(message, code="plan-control")
    center = xy.mean(axis=0)
    control_xy, point_xy = xy - center, where[:, :2] - center
    moments = control_xy.T @ control_xy
    area = moments[0, 0] * moments[1, 1] - moments[0, 1] ** 2
    if area <= FLATTEST * moments[0, 0] * moments[1, 1] or min(moments[0, 0], moments[1, 1]) == 0:
        message = "all control points in height lie on one line: the tilt about it is not determined"
        raise GeometryError(message, code="plan-control")
    return np.asarray(1 / len(xy) + point_xy @ np.linalg.solve(moments, control_xy.T))


def parameter_rows(points: ArrayLike, control: ModelControl) -> Floats:
    """Rows F, shape (q, 3, 7), that give the part dx3 of points from the seven `PARAMETERS`.

    The centres of the control are the origins: that of the plan control for plan, that of the heights for heights.
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


def deformation(points: ArrayLike, control: ModelControl, base: float) -> Floats:
    """Influence of the elements `FREE` on points of the oriented model, less what control takes back, (q, 3, 4)."""
    operator, of_control = orientation_operator(points, control), free_influence(control.points, base)
    return np.asarray(free_influence(points, base) - np.einsum("qanb,nbk->qak", operator, of_control))


def expected_errors(
    points: ArrayLike,
    measured: ArrayLike,
    control: ModelControl,
    base: float,
    elements: ArrayLike,
    row: Numbers | None = None,
) -> ExpectedErrors:
    """Covariance of points of the oriented model before anything is measured.

    Errors of the elements and of the measured coordinates of the same image points count as independent, as in the
    source.

    points: (q, 3), x, y, depth.
    measured: (q, 3, 3), covariance of their measured model coordinates.
    elements: (4, 4), covariance of `FREE`.
    row: (q,), optional, the control point that a point is, -1 for none; default: none of them is control.
    """
    operator = orientation_operator(points, control)
    shape = deformation(points, control, base)
    variance = np.asarray(elements, float)
    measuring = np.array(measured, float)
    others = operator.copy()
    if row is not None:
        is_control = np.flatnonzero(row >= 0)
        same = np.eye(3) - operator[is_control, :, row[is_control]]
        measuring[is_control] = same @ control.measured[row[is_control]] @ np.swapaxes(same, 1, 2)
        others[is_control, :, row[is_control]] = 0.0
    sources = {
        "measuring": measuring,
        "orientation": shape @ variance @ np.swapaxes(shape, 1, 2),
        "control measured": _through(others, control.measured),
        "control given": _through(operator, control.given),
    }
    return ExpectedErrors(
        sum(sources.values(), np.zeros_like(measuring)), sources, np.abs(shape) * np.sqrt(np.diag(variance))
    )


def _through(operator: Floats, covariance: Floats) -> Floats:
    """Carry independent covariances of the control through the operator."""
    return np.asarray(np.einsum("qanb,nbc,qdnc->qad", operator, covariance, operator, optimize=True), float)
