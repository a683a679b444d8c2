"""Error theory of one oriented model: what errors of orientation, measurement and control do to its points.

The pair is held dependent: left photo fixed, base b along x. A point is ``x, y`` and its depth ``Z`` below the
perspective centres, ``x`` counted from the left nadir along the flight, ``y`` to the left, heights upwards; all in one
unit, for example millimetres at photo scale (then Z = f in level ground). The elements of the right photo are

    dby, dbz    its perspective centre to the left and upwards, in that unit
    dkappa, dalpha, domega    its turns, radians; positive: counter-clockwise, looking forward, looking to the left

An error of a point has three parts, dx1 of measurement, dx2 of relative and dx3 of absolute orientation. The absolute
orientation is the similarity in space to the first order, fitted to control with equal weights; on level ground it
falls into a plane similarity in plan and a tilted plane in height, as in the source. It leaves the deformation that the
elements cause; ``adjust_model`` takes them as unknowns too.

Source: [000] eq. 1-8 and last paragraphs, with the corrections that ``photostrip sources`` lists.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import GeometryError
from photostrip.notes import counted
from photostrip.strip import relative_orientation

ELEMENTS = ("dby", "dbz", "dkappa", "dalpha", "domega")
FREE = ("dkappa", "dbz", "dalpha2", "domega")  # dalpha2: the turn against the base, dalpha - dbz / b
PARAMETERS = ("dX0", "dY0", "dZ0", "dlambda", "dtheta", "deta", "dxi")
FLATTEST = 1e-6  # of control in height: A against c1 c2; below that it lies on a line
CLOSEST = 1e-12  # of control in plan: B against the square of the size of its coordinates; below that it is one point


def influence(points: ArrayLike, base: float) -> Floats:
    """Errors of model points (x, y, depth Z > 0) per error of each element of relative orientation, shape (n, 3, 5).

    The right ray meets the level of the point ``px`` and ``py`` away from it. Intersection with the fixed left ray
    gives the point; y is the mean of both rays. Rows are x, y and height, columns `ELEMENTS`.

    Source: [000] eq. 2, rederived; checked against differences of the exact intersection.
    """
    px, py = parallaxes(points, base)
    along, across, up = ((value / base)[..., None] * px for value in np.asarray(points, float).T * [[1], [1], [-1]])
    return np.stack([along, across + py / 2, up], axis=-2)


def parallaxes(points: ArrayLike, base: float) -> tuple[Floats, Floats]:
    """Shifts (n, 5) along and across the base, per error of each element, of the right rays at the level of points."""
    x, y, z = np.moveaxis(np.asarray(points, float), -1, 0)
    right, zero = x - base, np.zeros_like(x)
    px = np.stack([zero, right / z, -y, (right**2 + z**2) / z, right * y / z], axis=-1)
    py = np.stack([zero + 1.0, y / z, right, right * y / z, z + y**2 / z], axis=-1)
    return px, py


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
    turn = relative_orientation.dependent_from_base(base)
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


def influence_after_orientation(
    points: ArrayLike,
    control: ModelControl,
    base: float,
    of_elements: Callable[[ArrayLike, float], Floats] = free_influence,
) -> tuple[Floats, Floats]:
    """Return the operator (q, 3, n, 3), and the influence (q, 3, ...) of elements less what control takes back."""
    operator = orientation_operator(points, control)
    of_control = np.einsum("qanb,nbk->qak", operator, of_elements(control.points, base))
    return operator, np.asarray(of_elements(points, base) - of_control, float)


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
    operator, shape = influence_after_orientation(points, control, base)
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


@dataclass(frozen=True, eq=False)
class AdjustedModel:
    control: ModelControl
    base: float
    parameters: Floats  # (7,): absolute orientation, in the order of `PARAMETERS`
    elements: Floats  # (4,): estimated errors of the relative orientation: dkappa, dbz, dalpha2, domega
    cofactors: Floats  # (11, 11): covariance of both

    def correction(self, points: ArrayLike) -> Floats:
        """Return what is to be subtracted from model points (q, 3): absolute orientation and deformation together."""
        return np.asarray(self._rows(points) @ np.concatenate([self.parameters, self.elements]), float)

    def covariance(self, points: ArrayLike, measured: ArrayLike) -> Floats:
        """Covariance (q, 3, 3) of corrected points, none of them control; ``measured`` as in ``expected_errors``."""
        rows = self._rows(points)
        return np.asarray(measured, float) + rows @ self.cofactors @ np.swapaxes(rows, 1, 2)

    def _rows(self, points: ArrayLike) -> Floats:
        return _rows_with_elements(points, self.control, self.base)


def _rows_with_elements(points: ArrayLike, control: ModelControl, base: float) -> Floats:
    """Rows (q, 3, 11) by absolute orientation and elements."""
    return np.concatenate([parameter_rows(points, control), free_influence(points, base)], axis=2)


def adjust_model(control: ModelControl, misclosures: ArrayLike, base: float, elements: ArrayLike) -> AdjustedModel:
    """Orient a model with the errors of its relative orientation as further unknowns.

    misclosures: (n, 3), W: model minus given; coordinates that are not given do not count.
    elements: (4, 4), a-priori covariance of dkappa, dbz, dalpha2, domega.
    """
    rows = _rows_with_elements(control.points, control, base)
    counts = np.stack([control.plan, control.plan, control.height], axis=1)
    noise = control.measured + control.given
    off = ~counts
    noise = np.where(off[:, :, None] | off[:, None, :], 0.0, noise)
    noise[off[:, :, None] & np.eye(3, dtype=bool)] = 1.0
    weights = np.asarray(np.linalg.inv(noise), np.float64)
    weights[off[:, :, None] & np.eye(3, dtype=bool)] = 0.0
    weighted = np.swapaxes(rows, 1, 2) @ weights
    normal = (weighted @ rows).sum(axis=0)
    first = len(PARAMETERS)
    normal[first:, first:] += np.linalg.inv(np.asarray(elements, float))
    right = np.einsum("nka,na->k", weighted, np.where(counts, np.asarray(misclosures, float), 0.0))
    size = np.sqrt(np.diag(normal))  # the unknowns differ by many orders of magnitude
    cofactors = np.linalg.inv(normal / np.outer(size, size)) / np.outer(size, size)
    solution = cofactors @ right
    return AdjustedModel(
        control=control,
        base=base,
        parameters=solution[:first],
        elements=solution[first:],
        cofactors=cofactors,
    )
