"""The terminal shows the lines of the plain text, in colour only where the user has a terminal and wants it."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys

import pytest

from photostrip.report.page.layout import has_colours, page_width, print_report, speaks_unicode, to_text
from photostrip.report.sections.accuracy_report import sections_of, title_of
from tests.reports import saved
from tests.source_tree import ROOT

ESCAPE = re.compile(r"\x1b\[[0-9;]*m")


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def shown(stream: io.StringIO, width: int | None = 100, *, colour: bool | None = None) -> str:
    print_report(title_of(saved()), sections_of(saved()), stream, width, colour=colour)
    return stream.getvalue()


def plain(width: int = 100) -> str:
    return to_text(title_of(saved()), sections_of(saved()), width)


def test_a_pipe_gets_the_plain_text() -> None:
    assert shown(io.StringIO()) == plain()


@pytest.mark.parametrize("width", [60, 100, 200])
def test_colours_change_nothing_but_colours(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("TERM", "xterm-256color")
    text = shown(Terminal(), width)
    assert "\x1b[1;31m" in text
    assert ESCAPE.sub("", text) == plain(width)


def test_no_color_is_respected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("NO_COLOR", "1")
    assert shown(Terminal()) == plain()


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
