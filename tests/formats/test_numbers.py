"""What counts as a number, and what is said about the rest."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from photostrip.formats.faults import LARGEST_NUMBER, NotANumber, number, shown
from photostrip.formats.tables import floats


@given(st.floats(-LARGEST_NUMBER, LARGEST_NUMBER))
@example(-0.0)
@example(LARGEST_NUMBER)
@example(5e-324)
def test_every_number_python_writes_is_read_back(value: float) -> None:
    assert number(repr(value)) == value
    assert number(f" {value!r}\t") == value
    assert number(f"{value:.6f}") == float(f"{value:.6f}")


@pytest.mark.parametrize(
    ("text", "value"),
    [("1", 1.0), ("+1", 1.0), ("-.5", -0.5), ("5.", 5.0), ("1e3", 1000.0), ("007", 7.0), ("1E-2", 0.01)],
)
def test_forms_of_numbers(text: str, value: float) -> None:
    assert number(text) == value


@pytest.mark.parametrize(
    ("text", "message", "fix"),
    [
        ("", "no value is given", ""),
        ("nan", "not a measured value", ""),
        ("-Infinity", "not a measured value", ""),
        ("1e400", "too large", ""),
        ("-1.1e15", "too large", ""),
        ("1,5", "decimal comma", "1.5"),
        (",5", "decimal comma", ".5"),
        ("1_000", "digits in groups", "without separators"),
        ("4 649 871.40", "digits in groups", "without separators"),
        ("4\u00a0649", "digits in groups", "without separators"),
        ("12'345", "digits in groups", "without separators"),
        ("1_0.5", "underscore", "10.5"),
        ("１２", "ASCII", "12"),
        ("−5", "ASCII", "-5"),
        ("٣", "ASCII", "3"),
        ("12°30'15\"", "one number", "decimal degrees"),
        ("12:30", "one number", "decimal degrees"),
        ("12 30 15", "one number", "decimal degrees"),
        ("3.5 mm", "unit", "3.5"),
        ("3.5m", "unit", "3.5"),
        ("0x1F", "not a number", ""),
        ("1e", "unit", "1"),
        ("1.2.3", "not a number", ""),
        ("--1", "not a number", ""),
        ("x" * 99, "xxx…`", ""),
    ],
)
def test_what_is_no_number_is_explained(text: str, message: str, fix: str) -> None:
    with pytest.raises(NotANumber) as caught:
        number(text)
    assert message in caught.value.message
    assert fix in caught.value.fix


cells = st.one_of(
    st.floats().map(repr),
    st.text(max_size=6),
    st.text(alphabet="0123456789+-.eE_, naif\u0663１", max_size=6),
)


@pytest.mark.slow
@given(st.lists(cells, min_size=1, max_size=4))
@example(["1_0"])
@example(["\u0663"])
@example(["1", "infinity"])
def test_a_column_is_converted_at_once_only_if_every_cell_is_a_number(column: list[str]) -> None:
    def is_number(cell: str) -> bool:
        try:
            number(cell)
        except NotANumber:
            return False
        return True

    fast = floats(column)
    if fast is None:
        return
    assert all(map(is_number, column))
    assert fast.tolist() == [number(cell) for cell in column]


@pytest.mark.parametrize(
    ("text", "expected"),
    [("a\tb", "a\\tb"), ("a\u200bb", "a\u200bb"), ("🛩️", "🛩️"), ("x" * 41, "x" * 40 + "…"), ("\x00", "\\x00")],
)
def test_a_text_in_a_message_stays_on_its_line(text: str, expected: str) -> None:
    assert shown(text) == expected
