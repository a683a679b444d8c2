"""Quantiles and critical values against printed tables and the formula book."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
import pytest

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
from tests.vectors import cases

if TYPE_CHECKING:
    from photostrip.arrays import Floats
    from tests.vectors import Vector


def test_printed_quantiles() -> None:
    """Normal, Student's, chi-square and F distributions, each at both tails and few and many degrees of freedom."""
    assert [normal_quantile(p) for p in (0.5, 0.975, 0.9995)] == pytest.approx([0.0, 1.96, 3.2905], abs=0.0000501)
    assert normal_quantile(0.025) == pytest.approx(-1.96, abs=0.0000501)
    for probability, dof, printed in [(0.95, 1, 6.314), (0.975, 10, 2.228), (0.9995, 120, 3.373)]:
        assert t_quantile(probability, dof) == pytest.approx(printed, abs=0.0005)
        assert t_p_value(printed, dof) == pytest.approx(2 * (1 - probability), rel=0.002)
    for probability, dof, printed in [(0.95, 1, 3.841), (0.999, 11, 31.264), (0.05, 20, 10.851)]:
        assert chi2_quantile(probability, dof) == pytest.approx(printed, abs=0.0006)
    for upper, dofs, printed in [(0.05, (3, 10), 3.708), (0.01, (5, 12), 5.064), (0.05, (12, 15), 2.475)]:
        assert f_p_value(printed, *dofs) == pytest.approx(upper, rel=0.002)


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


def test_the_noncentrality_of_one_error_is_that_of_geodesy() -> None:
    assert noncentrality(0.001, 0.8, 1) ** 0.5 == pytest.approx(4.13, abs=0.003)
