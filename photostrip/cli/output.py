"""What the commands print on stdout, write into files, and say on stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from photostrip.cli.options import SHEET_FORMS, Format, form_of, require_target
from photostrip.visible import visible

if TYPE_CHECKING:
    from photostrip.notes import Document
    from photostrip.report.page.parts import Section
    from photostrip.report.pictures.svg import Picture
    from photostrip.sheets.sheet import Sheet

PICTURE = ".svg"


class Messages:
    """What is said on stderr; failures are not in it, see ``failures``."""

    def __init__(self, *, quiet: bool = False, verbose: bool = False) -> None:
        self.quiet, self.verbose, self._begin = quiet, verbose, time.perf_counter()

    def say(self, text: str) -> None:
        """Say something that everybody should know."""
        if not self.quiet:
            sys.stderr.write(f"{visible(text)}\n")

    def step(self, text: str) -> None:
        """Say what was done, and the seconds since the step before."""
        now = time.perf_counter()
        if self.verbose:
            self.say(f"{text} ({now - self._begin:.2f} s)")
        self._begin = now


def ascii_only() -> bool:
    """Whether stdout can show ASCII letters only."""
    from photostrip.report.page import layout

    return not layout.speaks_unicode(sys.stdout)


def print_json(document: Document) -> None:
    """Print a document as result.json is written."""
    from photostrip.formats.result_json import to_json

    sys.stdout.write(to_json(document, ascii_only=ascii_only()))


def print_sections(title: str, sections: Iterable[Section], width: int | None = None, *, markdown: bool) -> None:
    """Print sections as Markdown, or as text: in colours and as wide as the terminal, where there is one."""
    from photostrip.report.page import layout

    if markdown:
        sys.stdout.write(layout.to_markdown(title, sections, ascii_only=ascii_only()))
    else:
        layout.print_report(title, sections, sys.stdout, width)


def print_result(document: Document, form: Format, width: int | None, **parts: Any) -> None:  # noqa: ANN401 (of report_sections)
    """Print the report of a result; JSON is the content of result.json, GITHUB its notes as annotations."""
    from photostrip.library.result import report_of, report_sections
    from photostrip.report.page.layout import page_width

    if form == "text":
        print_sections(*report_sections(document, width=width or page_width(), **parts), width, markdown=False)
    else:
        sys.stdout.write(report_of(document, form, ascii_only=ascii_only(), **parts))


def check_target(output: Path | None, depfile: Path | None = None, *, picture: bool = False) -> None:
    """Refuse what a sheet cannot be written into, before anything is computed."""
    require_target(depfile, output)
    if output is not None:
        form_of(output, "-o", SHEET_FORMS | ({PICTURE: "svg"} if picture else {}))


def deliver(
    sheet: Sheet,
    form: str,
    output: Path | None = None,
    *,
    quiet: bool = False,
    width: int | None = None,
    draw: Callable[[Document], Picture] | None = None,
) -> None:
    """Write a sheet, or what is drawn of it, where a file is named; print it."""
    if output is not None:
        from photostrip.formats.files import write_text

        if draw is not None and output.suffix.lower() == PICTURE:
            write_text(output, draw(sheet.document()).file())
        else:
            write_text(output, sheet.rendered(form_of(output, "-o", SHEET_FORMS), draw=draw))
        if quiet:
            return
    if form == "json":
        print_json(sheet.document())
    elif form == "csv":
        sys.stdout.write(visible(sheet.csv()))
    else:
        print_sections(sheet.title, sheet.sections(), width, markdown=form == "md")


def write_rule(depfile: Path | None, target: Path | str | None, files: Sequence[str | Path]) -> None:
    """Write the rule for make, if one is asked for; none of the files that were read is replaced."""
    if depfile is not None and target is not None:
        from photostrip.formats.files import make_rule, write_text

        write_text(depfile, make_rule(str(target), files), files)
