"""Natural order of ids; rounding."""

from __future__ import annotations

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from photostrip.result.numbers import natural, natural_rank, order_of, rounded, significant


@given(st.lists(st.text("ab-_. 0019\n\0é", max_size=6)))
@example(["P10", "P2", "p2", "7", "07", "a-1", "a1", "a", ""])
@example(["1" * 5000, "9", "line\nbreak", "P2"])
def test_the_rank_of_many_ids_is_the_order_of_the_keys_of_single_ones(names: list[str]) -> None:
    rank = natural_rank(tuple(names))
    assert sorted(names, key=natural) == [names[row] for row in rank.argsort()]


def test_rows_stand_by_number_then_by_rank() -> None:
    number, rank = np.random.default_rng(3).integers(0, 7, (2, 90))
    assert order_of(number, rank).tolist() == np.lexsort((rank, number)).tolist()
    assert order_of(number[:0], rank[:0]).tolist() == []


@given(st.floats(), st.integers(0, 12))
@example(-0.0, 2)
@example(-1e-9, 4)
@example(0.285, 2)
@example(1e308, 4)
def test_a_single_number_is_rounded_as_one_of_many(value: float, decimals: int) -> None:
    with np.errstate(over="ignore"):
        assert repr(rounded(value, decimals)) == repr(rounded([value], decimals)[0])


@given(st.lists(st.floats(), max_size=9), st.integers(1, 12))
@example([0.0, -0.0, 1e300, 5e-324, 999.96, 0.00012345, 2.5, -3.5, 1e23, float("nan"), -float("inf")], 4)
@example([2.5, -3.5, 0.25, 12345.0], 1)
def test_many_numbers_have_the_significant_digits_that_python_writes(values: list[float], digits: int) -> None:
    written = [float(f"{value:.{digits}g}") + 0.0 for value in values]  # 1.5e308 overflows
    expected = [value if np.isfinite(value) else None for value in written]
    assert repr(significant(values, digits)) == repr(expected)
