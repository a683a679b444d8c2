"""Columns of numbers as text against what Python writes, one number at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from photostrip import number_columns

if TYPE_CHECKING:
    from photostrip.number_columns import Cells

NUMBERS = st.lists(
    st.floats(allow_nan=False, allow_infinity=False, width=64)
    | st.builds(lambda number, decimals: number / 10.0**decimals, st.integers(-(10**13), 10**13), st.integers(0, 13)),
    min_size=1,
    max_size=60,
)


def written(cells: Cells) -> list[str]:
    return number_columns.joined([cells], "\n").split("\n")


@given(NUMBERS)
def test_numbers_are_written_as_python_writes_them(numbers: list[float]) -> None:
    values = np.array(numbers) + 0.0  # -0.0 has no place in a result
    assert written(number_columns.as_repr(values, "null")) == list(map(repr, values.tolist()))


@given(NUMBERS, st.integers(0, 12))
def test_decimals_are_those_of_a_format(numbers: list[float], decimals: int) -> None:
    said = written(number_columns.as_fixed(np.array(numbers), decimals, ""))
    assert said == [f"{each:.{decimals}f}" for each in numbers]


def test_middles_between_two_decimals_go_where_their_binary_digits_lie() -> None:
    middles = np.arange(-4000, 4000) / 1000 + 0.0005
    assert written(number_columns.as_fixed(middles, 3, "")) == [f"{each:.3f}" for each in middles.tolist()]


def test_what_is_no_number_is_missing_and_texts_stay() -> None:
    values = np.array([1.5, np.nan, -2.0, 1e-7])
    assert written(number_columns.as_repr(values, "null")) == ["1.5", "null", "-2.0", "1e-07"]
    assert written(number_columns.as_fixed(values, 1, "")) == ["1.5", "", "-2.0", "0.0"]
    assert written(number_columns.as_whole(np.array([0, -17, 4000]))) == ["0", "-17", "4000"]
    assert written(number_columns.as_texts(["a", "", "Höhe 2"])) == ["a", "", "Höhe 2"]
