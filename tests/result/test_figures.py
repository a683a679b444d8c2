"""The worked examples of the norms, and the factors against the distributions they come from."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
import pytest
from scipy import stats

from photostrip.result import statement
from photostrip.result.statement import class_of, figures_of

# ASPRS Positional Accuracy Standards, edition 1 (2014), annex D, table D.1: measured minus surveyed, metres.
ANNEX_D = [
    (-0.140, -0.070, -0.071),
    (-0.100, -0.100, 0.010),
    (0.017, -0.070, 0.102),
    (-0.070, 0.150, -0.100),
    (0.130, 0.120, 0.087),
]
# Photogrammetric Engineering & Remote Sensing 80 (2014) 5, p. 397, table 3, metres.
MAPPING_MATTERS = [
    (-0.060, 0.080, 0.055),
    (0.100, -0.045, -0.006),
    (-0.060, 0.080, -0.017),
    (-0.112, 0.007, 0.042),
    (-0.120, 0.150, -0.011),
    (-0.100, -0.045, 0.013),
    (-0.060, 0.080, 0.048),
]


def of(rows: object, sigma: float = 0.0) -> dict[str, Any]:
    differences = np.array(rows, float)
    return figures_of(differences, np.full(differences.shape, sigma))


def test_the_example_of_the_asprs_standard_comes_out_to_the_printed_digit() -> None:
    found = of(ANNEX_D)
    printed = {"east": ("-0.033", "0.102"), "north": ("0.006", "0.106"), "up": ("0.006", "0.081")}
    axes: dict[str, Any] = found["axes"]
    assert {axis: (f"{each['mean']:.3f}", f"{each['rmse']:.3f}") for axis, each in axes.items()} == printed
    assert f"{found['plan']['rmse']:.3f}" == "0.147"
    assert f"{found['circle']['radial95']:.3f}" == "0.255"
    assert f"{found['line']['le95']:.3f}" == "0.160"


def test_the_scatter_of_a_published_column_follows_from_rms_and_mean() -> None:
    found = of(MAPPING_MATTERS)["axes"]
    for axis, printed in {"east": "0.075", "north": "0.073", "up": "0.030"}.items():
        mean, rmse = found[axis]["mean"], found[axis]["rmse"]
        assert f"{sqrt(7 / 6 * (rmse**2 - mean**2)):.3f}" == printed


def test_the_accuracy_of_a_published_survey_comes_out() -> None:
    # vertical accuracy report of the lidar survey of Barataria and Jean Lafitte (USGS, 2013): RMSEz and AccuracyZ
    heights = of([(0.0, 0.0, 0.0574002119585), (0.0, 0.0, -0.0574002119585)])
    assert heights["line"]["le95"] == pytest.approx(0.112504415439, abs=1e-12)


def test_the_error_of_the_survey_is_counted() -> None:
    found = of([(0.03, 0.04, 0.12), (-0.03, -0.04, -0.12)], sigma=0.05)
    assert found["plan"]["rmse"] == pytest.approx(0.05)
    assert found["plan"]["survey"] == pytest.approx(0.05 * sqrt(2))
    assert found["plan"]["accuracy"] == pytest.approx(0.05 * sqrt(3))
    assert found["height"]["accuracy"] == pytest.approx(0.13)
    assert found["space"]["accuracy"] == pytest.approx(sqrt(0.05**2 * 3 + 0.13**2))


def test_the_factors_are_those_of_normal_errors() -> None:
    assert f"{stats.norm.ppf(0.95):.4f}" == f"{statement.LINE_90:.4f}"
    assert f"{stats.norm.ppf(0.975):.4f}" == f"{statement.LINE_95:.4f}"
    assert f"{stats.rayleigh.ppf(0.90):.4f}" == f"{statement.CIRCLE_90:.4f}"
    assert f"{stats.rayleigh.ppf(0.95):.4f}" == f"{statement.CIRCLE_95:.4f}"
    assert f"{stats.rayleigh.ppf(0.95) / sqrt(2):.4f}" == f"{statement.RADIAL_95:.4f}"


def test_no_circle_is_stated_for_unequal_errors() -> None:
    found = of([(1.0, 0.59, 0.1), (-1.0, -0.59, 0.1)])["circle"]
    assert found["ratio"] == pytest.approx(0.59)
    assert np.isnan([found["ce90"], found["ce95"], found["radial95"]]).all()


def test_at_most_one_difference_in_ten_is_larger() -> None:
    for count, beyond in ((9, 0), (10, 1), (19, 1), (30, 3)):
        heights = np.arange(1.0, count + 1)
        rows = np.column_stack([np.zeros(count), np.zeros(count), heights])
        found = of(rows)["height"]["p90"]
        assert np.sum(heights > found) == beyond


def test_points_that_are_given_in_part_count_where_they_are() -> None:
    nothing = float("nan")
    found = of([(0.1, 0.1, nothing), (nothing, nothing, 0.2), (0.3, nothing, nothing)])
    assert (found["plan"]["count"], found["height"]["count"]) == (1, 1)
    assert found["axes"]["east"]["rmse"] == pytest.approx(0.1)
    nobody = of(np.zeros((0, 3)))
    assert nobody["plan"]["count"] == 0
    assert np.isnan(nobody["plan"]["accuracy"])
    assert nobody["plan"]["class_cm"] is None


@pytest.mark.parametrize(("metres", "class_cm"), [(0.12, 12), (0.1201, 13), (0.0, 1), (0.004, 1), (1.0, 100)])
def test_a_class_is_whole_centimetres(metres: float, class_cm: int) -> None:
    assert class_of(metres) == class_cm
