"""Pages of any width: nothing wider than the page, nothing lost that should be there, the same words everywhere."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.report.page.layout import NARROWEST, WIDEST_PAGE, cells, clamp, cut, lay_out, pad, plain_ascii, wrapped
from photostrip.report.page.parts import Column, Facts, Section, Table, Words

WORDS = st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Zl", "Zp")), max_size=90)
NUMBERS = st.floats(-1e6, 1e6).map(lambda value: f"{value:.3f}")


@st.composite
def tables(draw: st.DrawFn) -> Table:
    columns = tuple(
        Column(
            draw(st.sampled_from(["point", "σ0", "d east", "condition"])), draw(st.sampled_from(["", "µm"])), left, rank
        )
        for left, rank in draw(st.lists(st.tuples(st.booleans(), st.integers(0, 3)), min_size=1, max_size=12))
    )
    row = st.tuples(*(WORDS if column.left else NUMBERS for column in columns))
    return Table(columns, tuple(draw(st.lists(row, min_size=1, max_size=2))), note=draw(WORDS))


SECTIONS = st.builds(
    Section,
    st.sampled_from(["", "Verdict"]),
    st.lists(
        st.one_of(
            tables(),
            st.builds(Words, WORDS, st.just(""), st.sampled_from(["", "1.", "-"])),
            st.builds(Facts, st.lists(st.tuples(WORDS, WORDS), max_size=2).map(tuple)),
        ),
        max_size=2,
    ).map(tuple),
)


@pytest.mark.slow
@given(WORDS, st.lists(SECTIONS, max_size=2), st.integers(0, 300), st.booleans())
def test_no_line_is_wider_than_the_page_or_ends_in_a_blank(
    title: str, sections: list[Section], width: int, ascii_only: bool
) -> None:
    lines = [line.text for line in lay_out(title, sections, width, ascii_only=ascii_only)]
    assert [line for line in lines if cells(line) > clamp(width)] == []
    assert [line for line in lines if line != line.rstrip() or "\n" in line] == []


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 3), st.integers(3, 30)), min_size=5, max_size=14))
def test_a_table_gives_way_as_soon_as_it_is_one_cell_too_wide(columns: list[tuple[bool, int, int]]) -> None:
    """The pages that its own lines just fill, and those a cell narrower."""
    row = tuple("x" * size for _, _, size in columns)
    table = Table(tuple(Column("d", "", left, rank) for left, rank, _ in columns), (row,))

    def widest(page: int) -> int:
        return max(cells(line.text) for line in lay_out("", [Section("", (table,))], page))

    width = widest(WIDEST_PAGE)
    while NARROWEST < width <= WIDEST_PAGE:
        assert widest(width) == width
        width, wider = widest(width - 1), width
        assert width < wider


@given(WORDS, st.integers(20, 200))
def test_wrapping_keeps_every_word(text: str, width: int) -> None:
    lines = wrapped(text, width)
    assert "".join(lines).replace(" ", "") == "".join(text.split()).replace(" ", "")
    assert [line for line in lines if cells(line) > width] == []


@pytest.mark.parametrize(
    ("text", "width"),
    [("abc", 3), ("точка", 5), ("点", 2), ("点A点", 5), ("e\u0301", 1), ("\u200bab", 2), ("σ0", 2), ("🛩", 1)],
)
def test_cells_of_letters(text: str, width: int) -> None:
    assert cells(text) == width


def test_cutting_leaves_room_for_the_dots() -> None:
    assert cut("abcdefgh", 8, "…") == "abcdefgh"
    assert cut("abcdefgh", 5, "…") == "abcd…"
    assert cut("abcdefgh", 5, "...") == "ab..."
    assert cut("点点点", 5, "…") == "点点…"
    assert pad("点", 4, left=True) == "点  "
    assert pad("1", 3, left=False) == "  1"


def test_widths_have_limits() -> None:
    assert [clamp(width) for width in (0, 60, 100, 999)] == [NARROWEST, 60, 100, WIDEST_PAGE]


def lines(table: Table, width: int) -> list[str]:
    return [line.text for line in lay_out("", [Section("", (table,))], width)]


def test_columns_of_low_rank_go_first_and_together() -> None:
    columns = (
        Column("point", left=True),
        Column("value", "m"),
        Column("first" * 6, rank=1),
        Column("second" * 5, rank=2),
        Column("third" * 6, rank=2),
    )
    table = Table(columns, (("P1", "1.000", "1", "2", "3"),))
    assert [word[:5] for word in lines(table, 200)[0].split()] == ["point", "value", "first", "secon", "third"]
    assert [word[:5] for word in lines(table, 100)[0].split()] == ["point", "value", "first"]
    assert [word[:5] for word in lines(table, 60)[0].split()] == ["point", "value", "first"]
    assert lines(table, 60)[1].split() == ["m"]


def test_long_ids_are_shortened_before_numbers_are_touched() -> None:
    columns = (Column("point", left=True), *(Column(f"v{n}", "m") for n in range(5)))
    (head, _, row) = lines(Table(columns, (("P" * 200, *["123.456"] * 5),)), 60)
    assert cells(row) == 60
    assert row.count("123.456") == 5
    assert "…" in row
    assert head.split() == ["point", "v0", "v1", "v2", "v3", "v4"]


def test_ascii_keeps_ids_and_writes_the_rest_plainly() -> None:
    text = plain_ascii("σ0 4.8 µm – точка … α ω κ ± 2°")
    assert text == "sigma0 4.8 um - точка ... alpha omega kappa +- 2deg"
    assert plain_ascii("1001 – 1002") == "1001 - 1002"
