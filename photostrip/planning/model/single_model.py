"""Error theory of one oriented model: what errors of orientation, measurement and control do to its points.

The pair is held dependent: left photo fixed, base b along x. A point is ``x, y`` and its depth ``Z`` below the
perspective centres, ``x`` counted from the left nadir along the flight, ``y`` to the left, heights upwards; all in one
unit, for example millimetres at photo scale (then Z = f in level ground). The elements of the right photo are

    dby, dbz    its perspective centre to the left and upwards, in that unit
    dkappa, dalpha, domega    its turns, radians; positive: counter-clockwise, looking forward, looking to the left

An error of a point has three parts, dx1 of measurement, dx2 of relative and dx3 of absolute orientation. The absolute
orientation is the similarity in space to the first order, fitted to control with equal weights; on level ground it
falls into a plane similarity in plan and a tilted plane in height, as in the source.

Source: [000] eq. 1-8, with the corrections that ``photostrip sources`` lists.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.notes import counted
from photostrip.planning.model.element_errors import free_influence, influence

PARAMETERS = ("dX0", "dY0", "dZ0", "dlambda", "dtheta", "deta", "dxi")
FLATTEST = 1e-6  # of control in height: A against c1 c2; below that it lies on a line
CLOSEST = 1e-12  # of control in plan: B against the square of the size of its coordinates; below that it is one point


@dataclass(frozen=True, eq=False)
class ModelControl:
    points: Floats  # (n, 3): x, y and depth
    # plan, height: (n,): whether the point is given in plan, in height
    plan: Flags
    height: Flags
    measured: Floats  # (n, 3, 3): covariance of the measured model coordinates
    given: Floats  # (n, 3, 3): covariance of the given coordinates


@dataclass(frozen=True, eq=False)
class ExpectedErrors:
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

    Source: [000] eq. 3-7 in operator form, with the terms of relief.
    """
    solved = _solution(control)
    return np.asarray(np.einsum("qak,knb->qanb", parameter_rows(points, control), solved), float)


def orientation_parameters(control: ModelControl, misclosures: ArrayLike) -> Floats:
    """Return the seven `PARAMETERS` that fit the misclosures (n, 3), model minus given, at the centres of the control.

    Coordinates that are not given do not matter.
    """
    return np.asarray(np.einsum("knb,nb->k", _solution(control), np.asarray(misclosures, float)), float)


def _solution(control: ModelControl) -> Floats:
    """Parameters per misclosure, (7, n, 3): least squares with equal weights; zero where a coordinate is not given."""
    _require_plan(control)
    _require_heights(control)
    counts = np.stack([control.plan, control.plan, control.height], axis=1)
    rows = parameter_rows(control.points, control) * counts[:, :, None]
    size = np.sqrt((rows**2).sum(axis=(0, 1)))
    scaled = rows / size
    inverse = np.linalg.inv(np.einsum("nbk,nbl->kl", scaled, scaled)) / size[:, None]
    return np.asarray(np.einsum("kl,nbl->knb", inverse, scaled), float)


def _require_plan(control: ModelControl) -> None:
    xy = control.points[control.plan, :2]
    if len(xy) < 2:
        message = f"{counted(len(xy), 'control point')} in plan cannot give position, azimuth and scale; two are needed"
        raise GeometryError(message, code="plan-control")
    size = float(((xy - xy.mean(axis=0)) ** 2).sum())  # B
    if size <= CLOSEST * float((xy**2).sum()):
        raise GeometryError("all control points with a plan position lie at one place", code="plan-control")


def _require_heights(control: ModelControl) -> None:
    xy = control.points[control.height, :2]
    if len(xy) < 3:
        message = f"{counted(len(xy), 'control point')} in height cannot give height and tilts; three are needed"
        raise GeometryError(message, code="plan-control")
    control_xy = xy - xy.mean(axis=0)
    moments = control_xy.T @ control_xy
    area = moments[0, 0] * moments[1, 1] - moments[0, 1] ** 2
    if area <= FLATTEST * moments[0, 0] * moments[1, 1] or min(moments[0, 0], moments[1, 1]) == 0:
        message = "all control points with a height lie on one line: the tilt about it is not determined"
        raise GeometryError(message, code="plan-control")


def parameter_rows(points: ArrayLike, control: ModelControl) -> Floats:
    """Rows F, shape (q, 3, 7), that give the part dx3 of points from the seven `PARAMETERS`.

    The centres of the control are the origins: that of the plan control for plan, that of the heights for heights. In
    level ground plan has four parameters and height three, as in the source; a point that stands higher by h than the
    control does on the average is moved by -h deta and -h dxi in plan and by h dlambda in height as well.

    Source: [000] eq. 3, 4; the terms with h are derived.
    """
    where = np.asarray(points, float)
    x, y = (where[:, :2] - control.points[control.plan, :2].mean(axis=0)).T
    u, v = (where[:, :2] - control.points[control.height, :2].mean(axis=0)).T
    h = control.points[:, 2].mean() - where[:, 2]
    rows = np.zeros((len(where), 3, len(PARAMETERS)))
    rows[:, [0, 1, 2], [0, 1, 2]] = 1.0
    rows[:, 0, 3], rows[:, 0, 4], rows[:, 0, 5] = x, -y, -h
    rows[:, 1, 3], rows[:, 1, 4], rows[:, 1, 6] = y, x, -h
    rows[:, 2, 5], rows[:, 2, 6], rows[:, 2, 3] = u, v, h
    return rows


def deformation(points: ArrayLike, control: ModelControl, base: float) -> Floats:
    """Influence of the elements `FREE` on points of the oriented model, less what control takes back, (q, 3, 4)."""
    operator, of_control = orientation_operator(points, control), free_influence(control.points, base)
    return np.asarray(free_influence(points, base) - np.einsum("qanb,nbk->qak", operator, of_control))


def influence_after_orientation(points: ArrayLike, control: ModelControl, base: float) -> tuple[Floats, Floats]:
    """Return the operator (q, 3, n, 3), and the influence (q, 3, 5) of all `ELEMENTS` less what control takes back."""
    operator = orientation_operator(points, control)
    of_control = np.einsum("qanb,nbk->qak", operator, influence(control.points, base))
    return operator, np.asarray(influence(points, base) - of_control, float)


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
