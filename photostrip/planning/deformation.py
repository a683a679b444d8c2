"""Simple accuracy formulas of a model, and the surface into which errors of relative orientation bend it.

Photo coordinates x, y count from the left nadir, in millimetres; m is the denominator of the photo scale, b the photo
base, f the principal distance. Elements are those of the base frame: alpha1', kappa1', alpha2', omega2', kappa2'.

Source: [003] eq. 10.7-10.12, with results of Lobanov and of Skiridov.

What given errors do to the points of one model.

They are errors of elements and of measured and given coordinates, or the misclosures that were found at the control.
Points, elements and their signs are those of ``single_model``; lengths are in one unit, as there.

Source: [000] eq. 1, 5-8; [003] eq. 10.8, 10.12.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.planning.single_model import (
    AdjustedModel,
    ModelControl,
    adjust_model,
    influence,
    measured_covariance,
    orientation_operator,
    orientation_parameters,
    parallaxes,
)
from photostrip.statistics import normal_quantile, t_quantile
from photostrip.strip import relative_orientation

DEFORMATION_TERMS = ("E0", "A", "B", "C", "D")
LEAST_POINTS = 5
LEAST_REDUNDANCY = 3  # below it a standard deviation from the residuals is mostly luck
RANK_TOLERANCE = 5e-3  # of the singular values of the scaled columns: below it x² is as good as a multiple of x


def relative_errors(
    image: ArrayLike, focal: float, errors: ArrayLike, *, base: float = 0.0, principal_distance: float = 0.0
) -> Floats:
    """Relative errors dX/X, dY/Y, dZ/Z (..., 3) of points of the normal case: X = N x, Y = N y, Z = -N f, N = B/p.

    image, errors: (..., 3), x, y and x parallax p of the left photo, and their errors, mm; y and x must not be zero.
    base: relative error of the base B.
    principal_distance: error of f, mm.

    Source: [003] eq. 10.7.
    """
    x, y, p = np.moveaxis(np.asarray(image, float), -1, 0)
    dx, dy, dp = np.moveaxis(np.asarray(errors, float), -1, 0)
    common = base - dp / p
    return np.stack(np.broadcast_arrays(common + dx / x, common + dy / y, common + principal_distance / focal), axis=-1)


def parallax_error(xy: ArrayLike, elements: ArrayLike, focal: float, base: float) -> Floats:
    """Return the quantity c, mm, that errors of the elements go through (eq. 10.8, without that of the x parallax).

    xy: (n, 2), x and y.
    elements: (..., 5), errors of the elements, radians. A constant f (dalpha2' - dalpha1') is left out of c, which is
        scale and height datum only.
    """
    x, y = np.moveaxis(np.asarray(xy, float), -1, 0)
    al1, ka1, al2, om2, ka2 = np.moveaxis(np.asarray(elements, float), -1, 0)
    right = x - base
    turned = (right**2 * al2 - x**2 * al1 + right * y * om2) / focal
    return np.asarray(turned - y * (ka2 - ka1), float)


class Constants(NamedTuple):
    """Factors of the standard deviation of one y parallax."""

    # plan, height: with m they give ground units: m_D = plan m m_q, m_Z = height m (f/b) m_q
    plan: float
    height: float


SIDE, CENTRAL = "side", "central"
# as printed, rounded to one decimal
PRINTED = {SIDE: Constants(3.5, 2.3), CENTRAL: Constants(2.1, 1.6)}
# the worked example of the source, micrometres at photo scale, and what it is computed for
PRINTED_EXAMPLE = {SIDE: Constants(35.0, 23.0), CENTRAL: Constants(22.0, 16.0)}
EXAMPLE_SIGMA_UM = 10.0  # m_q; f = b = a


def assumed_constants() -> dict[str, Constants]:
    """Return the printed constants before rounding, under the assumptions that give them.

    With a = b: alpha counts 1/2, omega 3/4 and the measured x parallax 2, as if each of its two coordinates were as
    uncertain as a y parallax. The side points take m_kappa = m_q / b for each of the two kappas, which is not what six
    points give, omega at the left edge and plan at the right edge; c counts as independent of the left image point.

    Source: [003] eq. 10.10, 10.11; the assumptions are found by trying.
    """
    side, central = 0.5 + 0.75 + 2.0 + 2.0, 0.5 + 2.0
    # plan: x = b; a side point has an error in y as in x, a central point has none from c
    return {
        SIDE: Constants(sqrt(2 * (side + 1)), sqrt(side)),
        CENTRAL: Constants(sqrt(central + 2), sqrt(central)),
    }


def rigorous_covariance(xy: ArrayLike, focal: float, width: float, base: float, sigma: float) -> Floats:
    """Covariance (n, 3, 3) of new points, mm² at photo scale, from six standard points and the measuring of the point.

    sigma: standard deviation of each image coordinate, mm. A y parallax has sqrt(2) times as much, an x parallax too,
        and the left coordinate is part of the x parallax; nothing of it counts as independent that is not.

    y is the mean of both rays. Left out is what eq. 10.8 and 10.9 leave out, because the absolute orientation takes it
    back: the turn of the left photo, which is shift, azimuth and tilt, and f (dalpha2' - dalpha1'), which is scale and
    height datum. Heights have the tilts of the base frame.
    """
    place = np.asarray(xy, float)
    level = np.column_stack([place, np.full(len(place), focal)])
    rows = influence(level, base) @ relative_orientation.dependent_from_base(base)
    stretch = focal / base * np.array([-1.0, 0.0, 1.0, 0.0, 0.0])
    rows[:, :2] -= place[:, :, None] * stretch
    units = np.moveaxis(np.array([parallax_error(place, unit, focal, base) for unit in np.eye(5)]), 0, -1)
    rows[:, 2] = -focal / base * units
    cofactors = relative_orientation.cofactors(focal, width, base)
    return 2 * sigma**2 * rows @ cofactors @ np.swapaxes(rows, 1, 2) + measured_covariance(level, base, focal, sigma)


def base_frame_elements(dependent: ArrayLike, base: float) -> Floats:
    """Return alpha1', kappa1', alpha2', omega2', kappa2' for dby, dbz, dkappa, dalpha, domega of the right photo."""
    return np.asarray(
        np.linalg.solve(relative_orientation.dependent_from_base(base), np.asarray(dependent, float)), float
    )


def surface_of_elements(elements: ArrayLike, scale: float, focal: float, base: float) -> Floats:
    """Return the surface into which errors of the elements bend the heights of a model.

    Returns (5,), E0, A, B, C, D of dZ = E0 + A x + B y + C x y + D x², dZ in ground mm for x, y in mm at photo scale.
        E0, A and B go into the absolute orientation; C is twist, D is bending along the base.

    Source: [003] eq. 10.12.
    """
    al1, ka1, al2, om2, ka2 = np.asarray(elements, float).tolist()
    m, b = scale, base
    return np.array(
        [-m * b * al2, 2 * m * al2, m * om2 + m * focal / b * (ka2 - ka1), -m * om2 / b, -m * (al2 - al1) / b]
    )


@dataclass(frozen=True, eq=False)
class Paraboloid:
    """A deformation paraboloid fitted to height residuals."""

    coefficients: Floats  # (5,): E0, A, B, C, D, in the unit of the residuals for x, y in their unit
    # (5,): standard deviations: from the residuals with a `redundancy` of three or more, else from the stated ones
    sigmas: Floats
    redundancy: int
    sigma0: float  # standard deviation of unit weight from the residuals; NaN without redundancy

    @property
    def t_values(self) -> Floats:
        """C and D over their standard deviations, shape (2,)."""
        with np.errstate(divide="ignore", invalid="ignore"):  # parallaxes without any error
            return np.asarray(self.coefficients[3:] / self.sigmas[3:], float)

    def critical(self, alpha: float = 0.05) -> float:
        """Return what |t| exceeds by chance with probability `alpha`; the normal quantile with stated sigmas."""
        if self.redundancy < LEAST_REDUNDANCY:
            return normal_quantile(1 - alpha / 2)
        return t_quantile(1 - alpha / 2, self.redundancy)

    def elements(self, scale: float, base: float) -> tuple[float, float]:
        """domega2' and dalpha2' - dalpha1', radians, that bend a model so (residuals in the unit of b)."""
        twist, bend = self.coefficients[3:]
        return -float(twist) * base / scale, -float(bend) * base / scale


def paraboloid_rows(xy: ArrayLike) -> Floats:
    """Rows 1, x, y, x y, x² of the surface, shape (n, 5)."""
    x, y = np.moveaxis(np.asarray(xy, float), -1, 0)
    return np.stack([np.ones_like(x), x, y, x * y, x**2], axis=-1)


def determines_paraboloid(xy: ArrayLike) -> bool:
    """Whether points (n, 2) determine the five coefficients: five of them, at three or more distances along the base.

    The six standard points do not: there x² = b x.
    """
    place = np.asarray(xy, float)
    if len(place) < LEAST_POINTS:
        return False
    middle = place - place.mean(axis=0)
    half = np.abs(middle).max(axis=0)
    if half.min() == 0:
        return False
    values = np.linalg.svd(paraboloid_rows(middle / half), compute_uv=False)
    return bool(values[-1] > RANK_TOLERANCE * values[0])


def fit_paraboloid(xy: ArrayLike, residuals: ArrayLike, sigmas: ArrayLike) -> Paraboloid:
    """Fit the deformation paraboloid to height residuals.

    xy: (n, 2), x and y, in one unit.
    residuals: (n,), heights of the model minus given heights.
    sigmas: (n,), standard deviations of the residuals, in their unit.
    Raises GeometryError when the points do not determine the surface.

    Source: [003], after eq. 10.12.
    """
    place, height = np.asarray(xy, float), np.asarray(residuals, float)
    if not determines_paraboloid(place):
        raise GeometryError(
            "the height residuals do not determine twist and bending: five points are needed, at three or more"
            " distances along the base",
            code="plan-paraboloid",
        )
    stated = np.broadcast_to(np.asarray(sigmas, float), height.shape)
    rows = paraboloid_rows(place) / stated[:, None]
    size = np.linalg.norm(rows, axis=0)
    found, *_ = np.linalg.lstsq(rows / size, height / stated, rcond=None)
    inverse = np.linalg.inv((rows / size).T @ (rows / size)) / np.outer(size, size)
    left = height / stated - rows @ (found / size)
    redundancy = len(height) - len(DEFORMATION_TERMS)
    sigma0 = float(np.sqrt(left @ left / redundancy)) if redundancy else float("nan")
    scale = sigma0 if redundancy >= LEAST_REDUNDANCY else 1.0
    return Paraboloid(
        coefficients=found / size, sigmas=scale * np.sqrt(np.diag(inverse)), redundancy=redundancy, sigma0=sigma0
    )


@dataclass(frozen=True, eq=False)
class ControlErrors:
    """Errors at the control, (n, 3) each."""

    measured: Floats  # of the measured model coordinates
    given: Floats  # of the given coordinates

    def misclosures(self, control: ModelControl, base: float, elements: Floats) -> Floats:
        """Return W = dx1 + dx2 - dX_geo (eq. 6): model minus given."""
        return self.measured + influence(control.points, base) @ elements - self.given


@dataclass(frozen=True, eq=False)
class ErrorParts:
    """Errors of points, each (q, 3): x, y, height."""

    # eq. 1: dx1 + dx2 - dx3
    measuring: Floats
    orientation: Floats
    absolute: Floats
    # eq. 8, the same total by what causes it: delta1 + delta2 + delta3
    from_measuring: Floats
    from_elements: Floats
    from_control: Floats

    @property
    def total(self) -> Floats:
        """Errors of the oriented model."""
        return self.measuring + self.orientation - self.absolute


def error_parts(
    points: ArrayLike, measured: ArrayLike, control: ModelControl, errors: ControlErrors, base: float, elements: Floats
) -> ErrorParts:
    """Errors of points of the oriented model that follow from given errors.

    points: (q, 3), x, y, depth.
    measured: (q, 3), errors of their measured model coordinates.
    elements: (5,), errors of dby, dbz, dkappa, dalpha, domega.
    """
    operator = orientation_operator(points, control)
    own, of_control = np.asarray(measured, float), influence(control.points, base) @ elements
    of_elements = influence(points, base) @ elements
    return ErrorParts(
        measuring=own,
        orientation=of_elements,
        absolute=_through(operator, errors.misclosures(control, base, elements)),
        from_measuring=own - _through(operator, errors.measured),
        from_elements=of_elements - _through(operator, of_control),
        from_control=_through(operator, errors.given),
    )


@dataclass(frozen=True, eq=False)
class Correction:
    """What misclosures at the control say of a model."""

    parameters: Floats  # (7,): of the plain absolute orientation, in the order of ``single_model.PARAMETERS``
    plain: Floats  # (q, 3): what the plain absolute orientation subtracts from the points: dx3
    adjusted: AdjustedModel  # the same with the elements as unknowns
    corrected: Floats  # (q, 3): what that subtracts


def correct_model(
    points: ArrayLike, control: ModelControl, misclosures: ArrayLike, base: float, elements: ArrayLike
) -> Correction:
    """Orient a model by its misclosures (n, 3), without and with the errors of the elements as unknowns.

    elements: (4, 4), a-priori covariance of the elements.
    """
    found = np.asarray(misclosures, float)
    adjusted = adjust_model(control, found, base, elements)
    return Correction(
        parameters=orientation_parameters(control, found),
        plain=_through(orientation_operator(points, control), found),
        adjusted=adjusted,
        corrected=adjusted.correction(points),
    )


@dataclass(frozen=True, eq=False)
class BentModel:
    """The surface into which errors of the elements bend a model."""

    surface: Floats  # (5,): E0, A, B, C, D of the heights, for x and y in mm at photo scale
    # (q,): what the elements add to the x parallax, eq. 10.9, and the y parallax that they leave, mm
    c: Floats
    parallax: Floats
    raised: Floats  # (q, 3): errors of points in the base frame, eq. 10.8: plan by the left ray, heights by the surface
    left: Floats  # (q, 3): what the absolute orientation leaves of the errors


def bend_model(points: Floats, control: ModelControl, base: float, focal: float, elements: Floats) -> BentModel:
    """Bend a level model by given errors (5,) of its elements; all lengths are in mm at photo scale."""
    xy = points[:, :2]
    turned = base_frame_elements(elements, base)
    c = parallax_error(xy, turned, focal, base)
    none = np.zeros((len(control.points), 3))
    parts = error_parts(points, np.zeros_like(points), control, ControlErrors(none, none), base, elements)
    return BentModel(
        surface=surface_of_elements(turned, 1.0, focal, base),
        c=c,
        parallax=parallaxes(points, base)[1] @ elements,
        raised=np.column_stack([xy / base * c[:, None], -focal / base * c]),
        left=parts.from_elements,
    )


def _through(operator: Floats, misclosures: Floats) -> Floats:
    return np.asarray(np.einsum("qanb,nb->qa", operator, misclosures), float)
