"""The distribution functions against scipy's, over all the range the tests of photostrip use and beyond."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from photostrip.statistics import beta_cdf, chi2_quantile, f_p_value, gamma_cdf, t_quantile, t_sf

RELATIVE = 1e-9
DOF = st.one_of(st.integers(1, 60).map(float), st.floats(1.0, 20_000.0))
TAIL = st.one_of(st.floats(1e-8, 0.5), st.floats(0.5, 0.999))


@given(tail=TAIL, dof=DOF)
def test_quantiles_of_student_are_those_of_scipy(tail: float, dof: float) -> None:
    assert -t_quantile(tail, dof) == pytest.approx(-special.stdtrit(dof, tail), rel=RELATIVE, abs=1e-9)


@given(t=st.floats(0.0, 60.0), dof=DOF)
def test_tails_of_student_are_those_of_scipy(t: float, dof: float) -> None:
    assert t_sf(t, dof) == pytest.approx(special.stdtr(dof, -t), rel=1e-8, abs=1e-250)


@given(f=st.floats(0.0, 1000.0), numerator=DOF, denominator=DOF)
def test_tails_of_f_are_those_of_scipy(f: float, numerator: float, denominator: float) -> None:
    assert f_p_value(f, numerator, denominator) == pytest.approx(
        special.fdtrc(numerator, denominator, f), rel=1e-8, abs=1e-14
    )


@given(probability=st.floats(1e-6, 0.999999), dof=DOF)
def test_quantiles_of_chi_square_are_those_of_scipy(probability: float, dof: float) -> None:
    assert chi2_quantile(probability, dof) == pytest.approx(
        special.chdtri(dof, 1 - probability), rel=RELATIVE, abs=1e-12
    )


@given(x=st.floats(0.0, 1.0), a=st.floats(0.5, 500.0), b=st.floats(0.5, 500.0))
def test_the_incomplete_beta_function_is_that_of_scipy(x: float, a: float, b: float) -> None:
    assert beta_cdf(x, a, b) == pytest.approx(special.betainc(a, b, x), rel=1e-8, abs=1e-14)


@given(x=st.floats(0.0, 2000.0), a=st.floats(0.5, 1000.0))
def test_the_incomplete_gamma_function_is_that_of_scipy(x: float, a: float) -> None:
    assert gamma_cdf(x, a) == pytest.approx(special.gammainc(a, x), rel=1e-8, abs=1e-14)


@pytest.mark.parametrize(
    ("dof", "tail", "printed"),
    [
        (1, 0.05, 6.314),
        (1, 0.005, 63.657),
        (5, 0.025, 2.571),
        (10, 0.01, 2.764),
        (30, 0.05, 1.697),
        (120, 0.025, 1.980),
    ],
)
def test_quantiles_of_student_are_the_printed_ones(dof: float, tail: float, printed: float) -> None:
    assert round(-t_quantile(tail, dof), 3) == printed


@pytest.mark.parametrize(
    ("dof", "probability", "printed"), [(1, 0.95, 3.841), (2, 0.99, 9.210), (7, 0.999, 24.322), (11, 0.999, 31.264)]
)
def test_quantiles_of_chi_square_are_the_printed_ones(dof: float, probability: float, printed: float) -> None:
    assert round(chi2_quantile(probability, dof), 3) == printed


def test_the_median_and_the_ends() -> None:
    assert -t_quantile(0.5, 7) == 0.0
    assert f_p_value(0.0, 3, 4) == 1.0
    assert gamma_cdf(0.0, 2.0) == 0.0
    assert (beta_cdf(0.0, 2, 3), beta_cdf(1.0, 2, 3)) == (0.0, 1.0)
