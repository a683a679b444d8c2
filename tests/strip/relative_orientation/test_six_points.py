"""Six standard points: printed examples, the rigorous solution beside the linear one, the dependent pair both ways."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.geometry.rotation import alpha_omega_kappa, from_alpha_omega_kappa
from photostrip.strip import relative_orientation
from tests.loops import nonempty
from tests.strips import attitude
from tests.vectors import cases

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from tests.vectors import Vector

    Floats = NDArray[np.float64]


SHARES = np.array([2.0, -2.0, -1.0, 1.0, -1.0, 1.0])  # of the six parallaxes in the closing error


@dataclass(frozen=True, eq=False)
class SixPoints:
    """First-order orientation of six standard points."""

    elements: Floats  # (5,): elements in radians
    closing_error: float  # W, the one check that six points give, mm
    sigma: float  # standard deviation of a y parallax from the closing error, mm
    residuals: Floats  # (6,): y parallaxes that remain, mm


def orient_six_points(parallax: ArrayLike, focal: float, width: float, base: float) -> SixPoints:
    """Elements from the y parallaxes q of the six standard points, least squares linearised at zero.

    `focal` is the principal distance f, `width` the distance a of the side points from the middle ones, `base` b.
    """
    q1, q2, q3, q4, q5, q6 = q = np.asarray(parallax, float)
    omega2 = focal * (q3 + q4 + q5 + q6 - 2 * q1 - 2 * q2) / (4 * width**2)
    tilted = omega2 * (focal + 2 * width**2 / (3 * focal))
    alpha1, alpha2 = (focal * dq / (2 * width * base) for dq in (q6 - q4, q5 - q3))
    kappa1, kappa2 = ((tilted - total / 3) / base for total in (q2 + q4 + q6, q1 + q3 + q5))
    closing = float(SHARES @ q)
    elements = np.array([alpha1, kappa1, alpha2, omega2, kappa2])
    return SixPoints(
        elements=elements, closing_error=closing, sigma=abs(closing) / np.sqrt(12.0), residuals=SHARES * closing / 12
    )


def dependent_pair(elements: ArrayLike) -> tuple[Floats, Floats]:
    """Direction of the base and rotation of the right photo in the left photo's frame, from base-frame elements; exact.

    by/bx and bz/bx are ratios of the components of the direction; dalpha, domega, dkappa are angles of the rotation.
    """
    al1, ka1, al2, om2, ka2 = np.moveaxis(np.asarray(elements, float), -1, 0)
    left = from_alpha_omega_kappa(al1, 0.0, ka1)
    return left[..., 0, :], np.swapaxes(left, -1, -2) @ from_alpha_omega_kappa(al2, om2, ka2)


def base_elements(direction: ArrayLike, rotation: ArrayLike) -> Floats:
    """Base-frame elements, shape (..., 5), radians, of a dependent pair; the inverse of ``dependent_pair``.

    The base `direction`, shape (..., 3), may have any length; it must not be parallel to the left principal ray.
    """
    x, y, z = np.moveaxis(np.asarray(direction, float), -1, 0)
    al1, ka1 = -np.arctan2(z, np.hypot(x, y)), -np.arctan2(y, x)
    right = from_alpha_omega_kappa(al1, 0.0, ka1) @ np.asarray(rotation, float)
    return np.stack([al1, ka1, *np.moveaxis(alpha_omega_kappa(right), -1, 0)], axis=-1)


@pytest.mark.parametrize("example", cases("gruber_six_points"))
def test_the_examples_of_the_formula_book(example: Vector) -> None:
    f, a, b = (example.input[name] for name in "fab")
    expected, rel = example.expected, example.tol["rel"]
    found = orient_six_points(example.input["q"], f, a, b)
    assert np.allclose(found.elements, expected["elements_rad"], rtol=rel, atol=0)
    assert found.closing_error == pytest.approx(expected["closing_W"], rel=rel)
    assert found.sigma == pytest.approx(expected["m_q"], rel=rel)
    assert np.allclose(found.residuals, expected["residuals"], rtol=rel, atol=0)
    q = relative_orientation.cofactors(f, a, b)
    assert np.allclose(q, expected["cofactor"], rtol=rel, atol=1e-18)
    t = relative_orientation.dependent_from_base(b)
    dependent = t @ q @ t.T
    formulas = expected["cofactor_formulas"]
    values = {
        "alpha": q[0, 0],
        "omega": q[3, 3],
        "kappa": q[1, 1],
        "kappa2_minus_kappa1": dependent[2, 2],
        "bz": dependent[1, 1],
        "dependent_alpha": dependent[3, 3],
        "dependent_by": dependent[0, 0],
        "cov_bz_dependent_alpha": dependent[1, 3],
    }
    assert values.keys() == formulas.keys()
    for name, value in nonempty(values.items()):
        assert value == pytest.approx(formulas[name], rel=rel), name


@pytest.mark.parametrize("example", cases("base_chain"))
def test_the_dependent_pair_of_the_formula_book(example: Vector) -> None:
    names = ("alpha1p", "kappa1p", "alpha2p", "omega2p", "kappa2p")
    elements = np.radians([example.input[f"{name}_deg"] for name in names])
    direction, rotation = dependent_pair(elements)
    expected, tol = example.expected["dependent_pair"], example.tol["abs"]
    assert direction[1] / direction[0] == pytest.approx(expected["by_over_bx"], abs=tol)
    assert direction[2] / direction[0] == pytest.approx(expected["bz_over_bx"], abs=tol)
    degrees = np.degrees(alpha_omega_kappa(rotation))
    assert np.allclose(degrees, expected["alpha_omega_kappa_right_deg"], rtol=0, atol=tol)
    ratios = [1.0, expected["by_over_bx"], expected["bz_over_bx"]]
    given_rotation = attitude(expected["alpha_omega_kappa_right_deg"])[0]
    assert np.allclose(base_elements(ratios, given_rotation), elements, rtol=0, atol=tol)
