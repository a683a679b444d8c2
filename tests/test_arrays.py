"""Medians, quantiles and distinct values are those of numpy."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from photostrip.arrays import column_medians, distinct, median, quantile

numbers = st.lists(st.floats(-1e9, 1e9) | st.integers(-3, 3) | st.just(np.nan), min_size=1, max_size=12)


@given(numbers)
def test_medians(values: list[float]) -> None:
    np.testing.assert_array_equal(median(values), np.median(values))
    both = np.column_stack([values, values[::-1]])
    np.testing.assert_array_equal(column_medians(both), np.median(both, axis=0))


def test_the_median_of_nothing_is_unknown() -> None:
    assert np.isnan(median([]))
    assert np.isnan(column_medians(np.zeros((0, 3)))).all()


@given(numbers, st.floats(0, 1))
def test_quantiles(values: list[float], share: float) -> None:
    np.testing.assert_array_equal(quantile(np.array(values), share), np.quantile(values, share))


@given(st.lists(st.integers(-3, 3)))
def test_distinct_values(values: list[int]) -> None:
    np.testing.assert_array_equal(distinct(np.array(values, np.intp)), np.unique(values))
    np.testing.assert_array_equal(distinct(np.array(values, str)), np.unique(np.array(values, str)))
