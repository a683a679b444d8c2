"""Progress: for people at a terminal, and for nobody else."""

from __future__ import annotations

import io
import time

import pytest

from photostrip.report.page.progress import progress

WIPED = "\x1b[2K"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


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


def test_short_work_shows_nothing() -> None:
    stream = Terminal()
    with progress(stream) as line:
        line.at("short")
        time.sleep(0.05)
    assert stream.getvalue() == ""


def test_a_failure_takes_the_line_away() -> None:
    stream = Terminal()

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
        monkeypatch.setattr(stream, "write", _broken)
        line.at("going on")
        time.sleep(0.2)


def _broken(_text: str) -> int:
    raise OSError


def test_the_bar_of_a_batch_shows_control_characters_and_sends_none() -> None:
    stream = Terminal()
    with progress(stream, 2, patience=0.0) as shown:
        shown.begun("a\x1b]0;title\x07/project.yaml")
        time.sleep(0.2)
        shown.say("b\x1b]0;title\x07: faulty")
        shown.finished("a\x1b]0;title\x07/project.yaml")
    assert "\x1b]" not in stream.getvalue()
    assert stream.getvalue().count("\\x1b]0;title\\x07") >= 2
