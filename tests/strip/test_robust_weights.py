"""The robust estimator: its weights are the published ones, its scale is that of normal residuals."""

from __future__ import annotations

import numpy as np
import pytest

from photostrip.strip.robust import MEDIAN_SPREAD, falling_weights, medians, scales
from tests.loops import nonempty


def test_weights_fall_beyond_three_standard_deviations() -> None:
    found = falling_weights(np.array([0.0, 2.99, 3.0, 6.0, 1000.0, np.inf]))
    assert found == pytest.approx([1.0, 1.0, 1.0, np.exp(-3.0), 1e-5, 1e-5])


def test_medians_are_the_lower_weighted_ones() -> None:
    values = np.array([5.0, 1.0, 3.0, 2.0, 9.0, 7.0])
    group = np.array([0, 0, 0, 2, 2, 3])
    weight = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])
    assert medians(values, weight, group, 4) == pytest.approx([3.0, np.nan, 2.0, np.nan], nan_ok=True)
    assert medians(values[:3], np.array([5.0, 1.0, 1.0]), group[:3], 1) == pytest.approx([5.0])


def test_the_median_of_a_long_group_is_that_of_its_values() -> None:
    rng = np.random.default_rng(1)
    values, group = rng.normal(size=501), rng.integers(0, 4, 501)
    found = medians(values, np.ones(501), group, 4)
    for number in nonempty(range(4)):
        assert found[number] == np.sort(values[group == number])[((group == number).sum() - 1) // 2]


@pytest.mark.slow
def test_the_scale_of_normal_residuals_and_its_spread() -> None:
    rng = np.random.default_rng(2)
    size = np.abs(rng.normal(0, 2.0, (3000, 201)))
    found = scales(size.ravel(), np.ones(size.size), np.repeat(np.arange(3000), 201), 3000) / 2.0
    assert found.mean() == pytest.approx(1.0, abs=0.01)
    assert found.std() * np.sqrt(201) == pytest.approx(MEDIAN_SPREAD, rel=0.05)
