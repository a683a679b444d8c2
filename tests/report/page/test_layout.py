"""Pages of any width, the terminal and its progress: nothing wider, nothing lost; findings told by examples."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.errors import Fault
from photostrip.notes import Note
from photostrip.plausibility import found
from photostrip.report.page.layout import (
    NARROWEST,
    WIDEST_PAGE,
    cells,
    clamp,
    has_colours,
    lay_out,
    page_width,
    plain_ascii,
    print_report,
    speaks_unicode,
    to_text,
    wrapped,
)
from photostrip.report.page.messages import MOST_OF_A_KIND, finding_of, lines_of
from photostrip.report.page.parts import Column, Facts, Section, Table, Words
from photostrip.report.page.progress import progress
from photostrip.report.sections.accuracy_report import sections_of, title_of
from tests.reports import saved
from tests.source_tree import ROOT

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


def lines(table: Table, width: int) -> list[str]:
    return [line.text for line in lay_out("", [Section("", (table,))], width)]


def test_columns_of_low_rank_go_first_and_together() -> None:
    others = (Column(head, rank=rank) for head, rank in (("first" * 6, 1), ("second" * 5, 2), ("third" * 6, 2)))
    columns = Column("point", left=True), Column("value", "m"), *others
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


ESCAPE = re.compile(r"\x1b\[[0-9;]*m")


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def shown(stream: io.StringIO, width: int | None = 100, *, colour: bool | None = None) -> str:
    print_report(title_of(saved()), sections_of(saved()), stream, width, colour=colour)
    return stream.getvalue()


def plain(width: int) -> str:
    return to_text(title_of(saved()), sections_of(saved()), width)


@pytest.mark.parametrize("width", [60, 100, 200])
def test_colours_change_nothing_but_colours(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("TERM", "xterm-256color")
    text = shown(Terminal(), width)
    assert "\x1b[1;31m" in text
    assert ESCAPE.sub("", text) == plain(width) == shown(io.StringIO(), width)


def test_when_there_are_colours() -> None:
    assert has_colours(Terminal(), {})
    assert has_colours(Terminal(), {"NO_COLOR": ""})
    assert not has_colours(Terminal(), {"NO_COLOR": "0"})
    assert not has_colours(Terminal(), {"TERM": "dumb"})
    assert not has_colours(io.StringIO(), {"TERM": "xterm"})


@pytest.mark.parametrize(
    ("encoding", "unicode"), [("utf-8", True), ("UTF8", True), ("ascii", False), ("cp1252", False), ("latin-1", False)]
)
def test_other_encodings_get_ascii(encoding: str, *, unicode: bool) -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    assert speaks_unicode(stream) is unicode
    print_report(title_of(saved()), sections_of(saved()), stream, 80)
    stream.seek(0)
    text = stream.read()
    assert text == to_text(title_of(saved()), sections_of(saved()), 80, ascii_only=not unicode)
    assert text.isascii() is not unicode
    assert plain_ascii("σ0 – точка ± 2°") == "sigma0 - точка +- 2deg"  # ids stay


@pytest.mark.parametrize(("columns", "width"), [("80", 80), ("20", 60), ("500", 200), ("", 100), ("x", 100)])
def test_the_width_is_that_of_the_terminal(columns: str, width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setattr(os, "get_terminal_size", lambda *_: (_ for _ in ()).throw(OSError))
    assert page_width() == width


@pytest.mark.slow
def test_rich_is_not_loaded_for_a_pipe() -> None:
    code = (
        "import sys\nfrom tests.reports import *\nfrom photostrip.report.page.layout import print_report\n"
        "print_report('', sections_of(saved()), sys.stdout)\n"
        "sys.exit('rich' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True)


SHARED = [found("P301", f"point {number} stands for two points", "", points=(f"{number}",)) for number in range(4427)]
OUTSIDE = found("P402", "control[0] lies elsewhere", "correct the crs")


def test_a_kind_is_told_by_examples_and_a_count() -> None:
    lines = lines_of([finding_of(each) for each in (*SHARED, OUTSIDE)])
    assert len(lines) == MOST_OF_A_KIND + 2
    assert lines[MOST_OF_A_KIND - 1].startswith("warning: P301 point 4 stands")
    assert lines[MOST_OF_A_KIND] == "warning: P301 4422 more of this kind; --format json names all"
    assert lines[-1].startswith("error: P402 ")
    notes = [finding_of(Note("unused", f"row {number} is not used")) for number in range(9)]
    assert len(lines_of(notes)) == MOST_OF_A_KIND + 1
    assert lines_of(notes)[-1] == "warning: unused 4 more of this kind; --format json names all"


def test_faults_are_told_by_column_and_by_the_key_of_a_list() -> None:
    def told(*faults: Fault) -> list[str]:
        return lines_of([finding_of(each) for each in faults])

    rows = [Fault("no number", "not-a-number", "o.csv", line, 9, "x") for line in range(1, 201)]
    more = Fault("and 7 more faults in this file", "more", "o.csv")
    lines = told(*rows, more)
    assert lines[:MOST_OF_A_KIND] == [f"error: o.csv:{line}:9: x: no number" for line in range(1, 6)]
    assert lines[MOST_OF_A_KIND:] == [
        "error: o.csv: not-a-number 195 more of this kind; --format json names all",
        "error: o.csv: and 7 more faults in this file",
    ]
    assert len(told(*(Fault("2 points", "few", "p.yaml", key=f"strips[0].photos[{i}]") for i in range(40)))) == 6
    keys = [Fault("no key", "unknown-key", "p.yaml", key=key) for key in ("a", "b", "c", "d", "e", "f", "g")]
    assert len(told(*keys)) == len(keys)


WIPED = "\x1b[2K"


@pytest.fixture(autouse=True)
def _terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "60")


@pytest.mark.parametrize(
    ("stream", "quiet", "term", "shown"),
    [(Terminal, False, "xterm", True), (Terminal, True, "xterm", False), (Terminal, False, "dumb", False),
     (io.StringIO, False, "xterm", False)],
)  # fmt: skip
def test_a_terminal_sees_it_and_it_goes_away(
    monkeypatch: pytest.MonkeyPatch, stream: type[io.StringIO], *, quiet: bool, term: str, shown: bool
) -> None:
    monkeypatch.setenv("TERM", term)
    written = stream()
    with progress(written, 3, quiet=quiet, patience=0.01) as line:
        line.at("first")
        line.at("second \x1b]0;title\x07" + "x" * 500)
        time.sleep(0.3)
    text = written.getvalue()
    assert ("2/3" in text and "second \\x1b]0;title" in text and "x" * 60 not in text) is shown
    assert (WIPED in text[-12:]) is shown
    assert shown or not text


def test_short_work_shows_nothing_and_a_failure_takes_the_line_away() -> None:
    stream = Terminal()
    with progress(stream) as line:
        line.at("short")
        time.sleep(0.05)
    assert stream.getvalue() == ""

    def work() -> None:
        with progress(stream, patience=0.0) as line:
            line.at("failing")
            raise ValueError

    with pytest.raises(ValueError):  # noqa: PT011 (its own)
        work()
    assert WIPED in stream.getvalue()[-12:]


def test_a_terminal_that_is_gone_stops_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    with progress(stream, patience=0.0) as line:
        monkeypatch.setattr(stream, "write", lambda _: (_ for _ in ()).throw(OSError))
        line.at("going on")
        time.sleep(0.2)


def test_the_bar_of_a_batch_shows_control_characters_and_sends_none() -> None:
    stream = Terminal()
    with progress(stream, 2, patience=0.0) as shown:
        shown.begun("a\x1b]0;title\x07/project.yaml")
        time.sleep(0.2)
        shown.say("b\x1b]0;title\x07: faulty")
        shown.finished("a\x1b]0;title\x07/project.yaml")
    assert "\x1b]" not in stream.getvalue()
    assert stream.getvalue().count("\\x1b]0;title\\x07") >= 2
