"""What the commands print on stdout, and the forms in which they do."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import typer

if TYPE_CHECKING:
    from photostrip.report.page.parts import Section
    from photostrip.report.sections.accuracy_report import SectionName

Document = dict[str, Any]
Format = Literal["text", "json", "md", "github"]
StatementFormat = Literal["text", "json", "md"]
BatchFormat = Literal["text", "csv", "json", "junit", "md", "github"]
CompareFormat = Literal["text", "json", "md", "junit", "github"]


class Parts(NamedTuple):
    """How much of a report is wanted: by default a short one."""

    quiet: bool = False  # the verdict alone
    verbose: bool = False  # everything
    names: Sequence[SectionName] = ()  # these sections


ENDINGS: dict[str, Format] = {".txt": "text", ".json": "json", ".md": "md"}


def ascii_only() -> bool:
    """Whether stdout can show ASCII letters only."""
    from photostrip.report.page import layout

    return not layout.speaks_unicode(sys.stdout)


def print_json(document: Document) -> None:
    """Print a document as result.json is written."""
    from photostrip.formats.output.result_json import to_json

    sys.stdout.write(to_json(document, ascii_only=ascii_only()))


def print_sections(title: str, sections: Iterable[Section], width: int | None = None, *, markdown: bool) -> None:
    """Print sections as Markdown, or as text: in colours and as wide as the terminal, where there is one."""
    from photostrip.report.page import layout

    if markdown:
        sys.stdout.write(layout.to_markdown(title, sections, ascii_only=ascii_only()))
    else:
        layout.print_report(title, sections, sys.stdout, width)


def print_result(document: Document, form: Format, width: int | None, parts: Parts) -> None:
    """Print the report of a result; JSON is the content of result.json, GITHUB its notes as annotations."""
    if form == "text":
        from photostrip.report.page.layout import page_width

        print_sections(*_report(document, parts, width or page_width()), width, markdown=False)
    else:
        text = report_text(document, form, width, parts, ascii_letters=ascii_only())
        sys.stdout.write(text)


def report_text(
    document: Document,
    form: Format,
    width: int | None,
    parts: Parts,
    *,
    ascii_letters: bool = False,
) -> str:
    """Return the report of a result as text, without colours."""
    from photostrip.report.page import layout

    if form == "json":
        from photostrip.formats.output.result_json import to_json

        return to_json(document, ascii_only=ascii_letters)
    if form == "github":
        from photostrip.report.page.messages import annotated, result_findings

        return annotated(result_findings(document))
    title, sections = _report(document, parts, width or layout.USUAL)
    if form == "md":
        return layout.to_markdown(title, sections, ascii_only=ascii_letters)
    return layout.to_text(title, sections, width or layout.USUAL, ascii_only=ascii_letters)


def _report(document: Document, parts: Parts, width: int) -> tuple[str, tuple[Section, ...]]:
    """Return title and sections; the title stands over whole reports only."""
    from photostrip.report.sections.accuracy_report import chosen_sections, title_of

    sections = chosen_sections(document, quiet=parts.quiet, everything=parts.verbose, names=parts.names, width=width)
    return "" if parts.quiet or parts.names else title_of(document), sections


def form_of(path: Path, option: str = "--output") -> Format:
    """Return the format that the ending of a file name asks for; text for a name without one."""
    if path.suffix.lower() not in {*ENDINGS, ""}:
        known = ", ".join(ENDINGS)
        rather = ", or give --format" if option == "--output" else ""
        message = f"nothing is written as '{path.suffix}': the name may end in {known}{rather}"
        raise typer.BadParameter(message, param_hint=option)
    return ENDINGS.get(path.suffix.lower(), "text")
