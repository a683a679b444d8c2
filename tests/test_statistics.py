"""Quantiles and critical values: printed tables, closed forms, densities integrated, false alarms counted."""

from __future__ import annotations

from math import exp, gamma, log, pi, sqrt, tan
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import ncx2

from photostrip.statistics import (
    chi2_quantile,
    f_p_value,
    grubbs_limit,
    noncentrality,
    normal_quantile,
    t_p_value,
    t_quantile,
    tau_limit,
)
from tests.loops import nonempty
from tests.vectors import cases, section, vector

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.vectors import Vector

    Floats = NDArray[np.float64]

PROBABILITIES = st.floats(0.001, 0.999)
FREEDOM = st.integers(1, 200)
ALPHAS = st.floats(1e-4, 0.2)


# -------------------------------------------------------------------------------------- Student, F, chi2


@pytest.mark.parametrize(
    ("probability", "printed"), [(0.5, 0.0), (0.90, 1.2816), (0.975, 1.9600), (0.995, 2.5758), (0.9995, 3.2905)]
)
def test_printed_quantiles_of_the_normal_distribution(probability: float, printed: float) -> None:
    assert normal_quantile(probability) == pytest.approx(printed, abs=0.0000501)
    assert normal_quantile(1 - probability) == pytest.approx(-printed, abs=0.0000501)


@pytest.mark.parametrize(
    ("probability", "dof", "printed"),
    [
        (0.95, 1, 6.314),
        (0.975, 4, 2.776),
        (0.975, 10, 2.228),
        (0.99, 7, 2.998),
        (0.995, 30, 2.750),
        (0.9995, 120, 3.373),
    ],
)
def test_printed_quantiles_of_t(probability: float, dof: int, printed: float) -> None:
    assert t_quantile(probability, dof) == pytest.approx(printed, abs=0.0005)
    assert t_p_value(printed, dof) == pytest.approx(2 * (1 - probability), rel=0.002)


@given(PROBABILITIES)
def test_t_in_closed_form(probability: float) -> None:
    assert t_quantile(probability, 1) == pytest.approx(tan(pi * (probability - 0.5)), rel=1e-8, abs=1e-9)
    two = (2 * probability - 1) / sqrt(2 * probability * (1 - probability))
    assert t_quantile(probability, 2) == pytest.approx(two, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("dof", [1, 3, 5, 11, 40])
@pytest.mark.parametrize("t", [0.0, 0.7, 2.1, -3.3])
def test_the_p_value_is_both_tails_of_the_density(t: float, dof: int) -> None:
    size = gamma((dof + 1) / 2) / (sqrt(dof * pi) * gamma(dof / 2))
    inside, _ = quad(lambda x: size * (1 + x * x / dof) ** (-(dof + 1) / 2), -abs(t), abs(t))
    assert t_p_value(t, dof) == pytest.approx(1 - inside, abs=1e-8)


@given(PROBABILITIES, FREEDOM)
def test_quantile_and_p_value_undo_each_other(probability: float, dof: int) -> None:
    both_tails = 2 * min(probability, 1 - probability)
    assert t_p_value(t_quantile(probability, dof), dof) == pytest.approx(both_tails, rel=1e-6)
    assert t_quantile(1 - probability, dof) == pytest.approx(-t_quantile(probability, dof), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("probability", "dof", "printed"),
    [(0.95, 1, 3.841), (0.95, 10, 18.307), (0.99, 5, 15.086), (0.999, 11, 31.264), (0.05, 20, 10.851), (0.5, 4, 3.357)],
)
def test_printed_quantiles_of_chi_square(probability: float, dof: int, printed: float) -> None:
    assert chi2_quantile(probability, dof) == pytest.approx(printed, abs=0.0006)


@given(PROBABILITIES)
def test_chi_square_with_two_degrees_is_exponential(probability: float) -> None:
    assert chi2_quantile(probability, 2) == pytest.approx(-2 * log(1 - probability), rel=1e-9)


@pytest.mark.parametrize("dof", [1.5, 3, 8, 30])
def test_chi_square_below_its_quantile(dof: float) -> None:
    limit = chi2_quantile(0.9, dof)
    size = 2 ** (dof / 2) * gamma(dof / 2)
    inside, _ = quad(lambda x: x ** (dof / 2 - 1) * exp(-x / 2) / size, 0, limit)
    assert inside == pytest.approx(0.9, abs=1e-6)


@pytest.mark.parametrize(
    ("upper", "dof", "printed"),
    [(0.05, (3, 10), 3.708), (0.05, (1, 4), 7.709), (0.01, (5, 12), 5.064), (0.05, (12, 15), 2.475)],
)
def test_printed_points_of_f(upper: float, dof: tuple[int, int], printed: float) -> None:
    assert f_p_value(printed, *dof) == pytest.approx(upper, rel=0.002)


@given(st.floats(0, 50), st.integers(1, 100))
def test_f_in_closed_form(f: float, dof: int) -> None:
    assert f_p_value(f, 2, dof) == pytest.approx((1 + 2 * f / dof) ** (-dof / 2), rel=1e-9)
    assert f_p_value(f, 1, dof) == pytest.approx(t_p_value(sqrt(f), dof), rel=1e-6, abs=1e-12)


# ----------------------------------------------------------------------------------------- Grubbs and tau


@pytest.mark.parametrize("example", cases("grubbs", "grubbs-critical"))
def test_limits_of_grubbs_in_the_formula_book(example: Vector) -> None:
    table = example.expected["table"]
    assert len(table) == len(example.input["list_of_n"]) * len(example.input["list_of_alpha"])
    for row in nonempty(table):
        both = grubbs_limit(row["n"], row["alpha"])
        one = grubbs_limit(row["n"], 2 * row["alpha"])
        assert both == pytest.approx(row["two_sided"], rel=example.tol["rel"])
        assert one == pytest.approx(row["one_sided"], rel=example.tol["rel"])


@pytest.mark.parametrize("example", cases("grubbs", "tau-critical"))
def test_limits_of_tau_in_the_formula_book(example: Vector) -> None:
    assert example.expected["table"]
    for row in nonempty(example.expected["table"]):
        limit = tau_limit(row["n"], row["unknowns"], row["alpha"])
        assert limit == pytest.approx(row["tau"], rel=example.tol["rel"])


def grubbs_value(sample: Floats) -> tuple[float, int]:
    """Largest deviation from the mean in standard deviations, and whose it is."""
    deviation = np.abs(sample - sample.mean()) / sample.std(ddof=1)
    return float(deviation.max()), int(deviation.argmax())


@pytest.mark.parametrize("example", cases("grubbs", "grubbs-sample"))
def test_samples_of_the_formula_book(example: Vector) -> None:
    sample, alpha = np.array(example.input["sample"]), example.input["alpha"]
    expected, rel, n = example.expected, example.tol["rel"], len(sample)
    value, index = grubbs_value(sample)
    assert value == pytest.approx(expected["G"], rel=rel)
    assert index == expected["index_of_extreme"]
    assert grubbs_limit(n, alpha) == pytest.approx(expected["critical"], rel=rel)
    t = sqrt(n * (n - 2) * value**2 / ((n - 1) ** 2 - n * value**2))
    assert min(1, n * t_p_value(t, n - 2)) == pytest.approx(expected["p_value_bonferroni"], rel=rel)
    left, rejected = list(range(n)), []
    while len(left) > 3:
        value, index = grubbs_value(sample[left])
        if value <= grubbs_limit(len(left), alpha):
            break
        rejected.append(left.pop(index))
    assert rejected == expected["rejected_indices_iterative"]


def test_all_examples_are_here() -> None:
    assert [example.id for example in section("grubbs")][:4] == [
        "grubbs-critical",
        "tau-critical",
        "grubbs-sample-1",
        "grubbs-sample-2",
    ]
    assert vector("grubbs-sample-2").input["sample"]


@given(st.integers(4, 200), ALPHAS)
def test_limits_behave(n: int, alpha: float) -> None:
    both = grubbs_limit(n, alpha)
    assert both < (n - 1) / sqrt(n)  # no sample can reach that
    assert grubbs_limit(n, alpha / 2) > both
    assert grubbs_limit(n + 1, alpha) > both


@given(st.integers(4, 200), ALPHAS)
def test_tau_of_one_unknown_is_grubbs(n: int, alpha: float) -> None:
    assert tau_limit(n, 1, alpha) * sqrt((n - 1) / n) == pytest.approx(grubbs_limit(n, alpha), rel=1e-9)


@given(st.integers(8, 100), st.integers(1, 6), ALPHAS)
def test_tau_stays_below_its_largest_value(n: int, unknowns: int, alpha: float) -> None:
    limit = tau_limit(n, unknowns, alpha)
    assert 0 < limit < sqrt(n - unknowns)
    assert tau_limit(n, unknowns, alpha / 2) > limit


def test_false_alarms_of_grubbs_are_what_alpha_says() -> None:
    samples = np.random.default_rng(1).normal(0, 1, (20_000, 16))
    deviation = np.abs(samples - samples.mean(axis=1, keepdims=True)).max(axis=1) / samples.std(axis=1, ddof=1)
    for alpha in (0.05, 0.01):
        share = (deviation > grubbs_limit(16, alpha)).mean()
        scatter = sqrt(alpha / len(samples))
        assert alpha - 4 * scatter < share < alpha + 4 * scatter


def test_false_alarms_of_tau_are_what_alpha_says() -> None:
    rng = np.random.default_rng(2)
    design = rng.normal(0, 1, (16, 5))
    q, _ = np.linalg.qr(design)
    observed = rng.normal(0, 1, (20_000, 16))
    residuals = observed - observed @ q @ q.T
    redundancy = 1 - (q**2).sum(axis=1)
    sigma0 = np.sqrt((residuals**2).sum(axis=1) / 11)
    tau = (np.abs(residuals) / np.sqrt(redundancy)).max(axis=1) / sigma0
    share = (tau > tau_limit(16, 5, 0.05)).mean()
    assert 0.044 < share < 0.056  # Bonferroni over residuals that are hardly correlated


@pytest.mark.parametrize("dof", [1, 2, 3, 7])
@pytest.mark.parametrize(("significance", "power"), [(0.05, 0.8), (0.001, 0.8), (0.01, 0.999)])
def test_the_noncentrality_has_the_power_asked_for(significance: float, power: float, dof: int) -> None:
    found = noncentrality(significance, power, dof)
    assert ncx2.sf(chi2_quantile(1 - significance, dof), dof, found) == pytest.approx(power, abs=1e-9)


def test_the_noncentrality_of_one_error_is_that_of_geodesy() -> None:
    assert noncentrality(0.001, 0.8, 1) ** 0.5 == pytest.approx(4.13, abs=0.003)
