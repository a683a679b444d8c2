"""The report on a terminal: the lines of the plain text, in colour where the terminal has it.

Without colours (a pipe, a file, ``NO_COLOR``, a dumb terminal) the lines go out as they are, and rich is not even
imported: what tests and other programs see does not depend on it.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Mapping
from typing import TextIO

from photostrip.report.page.layout import USUAL, Line, clamp, lay_out
from photostrip.report.page.parts import Section

STYLES = {
    "title": "bold cyan",
    "head": "bold",
    "foot": "bold",
    "note": "dim",
    "good": "bold green",
    "look": "bold yellow",
    "unverified": "bold yellow",
    "failed": "bold red",
}


def print_report(
    title: str, sections: Iterable[Section], stream: TextIO, width: int | None = None, *, colour: bool | None = None
) -> None:
    """Print a report as wide as the terminal, 100 where there is none; in colours where the stream has them."""
    lines = lay_out(
        title, sections, page_width() if width is None else clamp(width), ascii_only=not speaks_unicode(stream)
    )
    if has_colours(stream, os.environ) if colour is None else colour:
        _print_coloured(lines, stream)
    else:
        stream.write("".join(f"{line.text}\n" for line in lines))


def page_width() -> int:
    """Width of the terminal (or of ``COLUMNS``), brought between 60 and 200; 100 where there is none."""
    return clamp(shutil.get_terminal_size((USUAL, 24)).columns)


def speaks_unicode(stream: TextIO) -> bool:
    """Whether a stream can show more than ASCII."""
    encoding = (getattr(stream, "encoding", None) or "utf-8").lower().replace("-", "").replace("_", "")
    return encoding in {"utf8", "utf8sig", "cp65001"} or encoding.startswith(("utf16", "utf32"))


def has_colours(stream: TextIO, environment: Mapping[str, str]) -> bool:
    """Whether to use colours on a stream: ``NO_COLOR``, when it is not empty, and ``TERM=dumb`` forbid them."""
    if environment.get("NO_COLOR") or environment.get("TERM", "") in {"dumb", "unknown"}:
        return False
    return stream.isatty()


def _print_coloured(lines: Iterable[Line], stream: TextIO) -> None:
    from rich.console import Console
    from rich.text import Text

    console = Console(file=stream, force_terminal=True, highlight=False, markup=False, soft_wrap=True)
    for line in lines:
        console.print(Text(line.text, style=STYLES.get(line.style, "")))
