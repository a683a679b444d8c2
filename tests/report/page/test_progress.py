"""The line of progress: for people at a terminal, and for nobody else."""

from __future__ import annotations

import io
import time

import pytest

from photostrip.report.page import progress as module
from photostrip.report.page.layout import cells
from photostrip.report.page.progress import WIPE, Progress, batch_progress, progress, wanted


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_nothing_is_written_into_a_pipe() -> None:
    stream = io.StringIO()
    with progress(stream) as line:
        line.at("adjusting")
    assert stream.getvalue() == ""


@pytest.mark.parametrize(
    ("quiet", "term", "shown"), [(False, "xterm", True), (True, "xterm", False), (False, "dumb", False)]
)
def test_a_terminal_sees_it_and_it_goes_away(
    monkeypatch: pytest.MonkeyPatch, *, quiet: bool, term: str, shown: bool
) -> None:
    monkeypatch.setattr(module, "PATIENCE", 0.0)
    monkeypatch.setattr(module, "LOOK_EVERY", 0.01)
    monkeypatch.setenv("TERM", term)
    stream = Terminal()
    with progress(stream, 3, quiet=quiet) as line:
        line.at("first")
        line.at("second")
        time.sleep(0.1)
    written = stream.getvalue()
    assert ("2 of 3 second" in written) is shown
    assert written.endswith(WIPE) is shown


def test_short_work_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LOOK_EVERY", 0.01)
    monkeypatch.setenv("TERM", "xterm")
    stream = Terminal()
    with progress(stream) as line:
        line.at("short")
        time.sleep(0.05)
    assert stream.getvalue() == ""


def test_the_line_never_breaks() -> None:
    line = Progress(Terminal(), 12)
    line.at("reading " + "x" * 500)
    for width in (20, 60, 200):
        assert cells(line.line(3.0, width)) < width


def test_a_failure_takes_the_line_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATIENCE", 0.0)
    monkeypatch.setattr(module, "LOOK_EVERY", 0.01)
    monkeypatch.setenv("TERM", "xterm")
    stream = Terminal()

    def work() -> None:
        with progress(stream) as line:
            line.at("failing")
            time.sleep(0.05)
            raise ValueError

    with pytest.raises(ValueError):  # noqa: PT011 (its own)
        work()
    assert stream.getvalue().endswith(WIPE)


def test_a_terminal_that_is_gone_stops_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATIENCE", 0.0)
    monkeypatch.setattr(module, "LOOK_EVERY", 0.01)
    monkeypatch.setenv("TERM", "xterm")
    stream = Terminal()
    with progress(stream) as line:
        monkeypatch.setattr(stream, "write", _broken)
        line.at("going on")
        time.sleep(0.05)
    assert wanted(stream, {"TERM": "xterm"})


def _broken(_text: str) -> int:
    raise OSError


def test_the_bar_of_a_batch_shows_control_characters_and_sends_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    stream = Terminal()
    with batch_progress(stream, 2) as shown:
        shown.begun("a\x1b]0;title\x07/project.yaml")
        assert shown._bar is not None
        shown._bar.refresh()
        shown.say("b\x1b]0;title\x07: faulty")
    assert "\x1b]" not in stream.getvalue()
    assert stream.getvalue().count("\\x1b]0;title\\x07") >= 2
