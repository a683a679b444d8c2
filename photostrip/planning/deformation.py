"""Simple accuracy formulas of a model, and the surface into which errors of relative orientation bend it.

Photo coordinates x, y count from the left nadir, in millimetres; m is the denominator of the photo scale, b the photo
base, f the principal distance. Elements are those of the base frame: alpha1', kappa1', alpha2', omega2', kappa2'.

Source: [003] eq. 10.7-10.12, with results of Lobanov and of Skiridov.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import erfc, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.errors import GeometryError
from photostrip.statistics import normal_quantile, t_p_value, t_quantile
from photostrip.triangulation.relative_orientation import six_points

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from photostrip.arrays import Floats

TERMS = ("E0", "A", "B", "C", "D")
LEAST_POINTS = 5
LEAST_REDUNDANCY = 3  # below it a standard deviation from the residuals is mostly luck
RANK_TOLERANCE = 5e-3  # of the singular values of the scaled columns: below it x² is as good as a multiple of x


def parallax_error(xy: ArrayLike, elements: ArrayLike, focal: float, base: float, measured: ArrayLike = 0.0) -> Floats:
    """Return the quantity c, mm, that all errors of a point go through (eq. 10.8).

    xy: (n, 2), x and y.
    elements: (..., 5), errors of the elements, radians. A constant f (dalpha2' - dalpha1') is left out of c, which is
        scale and height datum only.
    measured: error dp of the x parallax, mm.
    """
    x, y = np.moveaxis(np.asarray(xy, float), -1, 0)
    al1, ka1, al2, om2, ka2 = np.moveaxis(np.asarray(elements, float), -1, 0)
    right = x - base
    turned = (right**2 * al2 - x**2 * al1 + right * y * om2) / focal
    return np.asarray(turned - y * (ka2 - ka1) - np.asarray(measured, float), float)


class Constants(NamedTuple):
    """Factors of the standard deviation of one y parallax."""

    # plan, height: with m they give ground units: m_D = plan m m_q, m_Z = height m (f/b) m_q
    plan: float
    height: float


SIDE, CENTRAL = "side", "central"
# as printed, rounded to one decimal
PRINTED = {SIDE: Constants(3.5, 2.3), CENTRAL: Constants(2.1, 1.6)}


def rigorous_factors(xy: ArrayLike, focal: float, width: float, base: float) -> Floats:
    """Variance of c in units of the variance of a y parallax, with the cofactors of six standard points, shape (n,).

    `width` is the distance a of the side points from the middle ones, mm; the measured parallax counts 2.
    """
    place = np.asarray(xy, float)
    rows = np.stack([parallax_error(place, unit, focal, base) for unit in np.eye(5)], axis=-1)
    return np.asarray(np.einsum("...i,ij,...j->...", rows, six_points.cofactors(focal, width, base), rows) + 2, float)


def rigorous_constants(xy: ArrayLike, focal: float, width: float, base: float) -> list[Constants]:
    """Constants for any place in the model; dx and dy of the left point count 1 each, as in the source."""
    place = np.asarray(xy, float)
    variance = rigorous_factors(place, focal, width, base)
    plan = np.sqrt((place**2).sum(axis=-1) / base**2 * variance + 2)
    return [Constants(float(p), float(h)) for p, h in zip(plan, np.sqrt(variance), strict=True)]


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

    @property
    def p_values(self) -> tuple[float, ...]:
        """Probabilities of larger |t| by chance."""
        if self.redundancy < LEAST_REDUNDANCY:
            return tuple(erfc(abs(t) / sqrt(2)) for t in self.t_values.tolist())
        return tuple(t_p_value(t, self.redundancy) for t in self.t_values.tolist())

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
    redundancy = len(height) - len(TERMS)
    sigma0 = float(np.sqrt(left @ left / redundancy)) if redundancy else float("nan")
    scale = sigma0 if redundancy >= LEAST_REDUNDANCY else 1.0
    return Paraboloid(
        coefficients=found / size, sigmas=scale * np.sqrt(np.diag(inverse)), redundancy=redundancy, sigma0=sigma0
    )
