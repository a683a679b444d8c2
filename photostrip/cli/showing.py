"""How the commands that have a result print it."""

from __future__ import annotations

import sys
from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from pathlib import Path

    from photostrip.pipeline import Result


class Format(StrEnum):
    """Forms in which a report is printed."""

    TEXT = "text"
    JSON = "json"
    MD = "md"
    GITHUB = "github"


class BatchFormat(StrEnum):
    """Forms in which the summary of a batch is printed."""

    TEXT = "text"
    CSV = "csv"
    JSON = "json"
    JUNIT = "junit"
    MD = "md"
    GITHUB = "github"


ENDINGS = {".txt": Format.TEXT, ".json": Format.JSON, ".md": Format.MD}


def show(document: dict[str, Any], form: Format, width: int | None, *, quiet: bool, verbose: bool) -> None:
    """Print the report of a result on stdout.

    Parameters
    ----------
    form : Format
        How; JSON is the content of result.json, GITHUB the notes as annotations.
    width : int, optional
        Width of the text in characters; default: that of the terminal.
    """
    from photostrip.report import chosen_sections, title_of
    from photostrip.report.page import console

    if form is Format.TEXT:
        sections = chosen_sections(document, quiet=quiet, everything=verbose)
        console.print_report("" if quiet else title_of(document), sections, sys.stdout, width)
    else:
        sys.stdout.write(
            rendered(
                document, form, width, quiet=quiet, verbose=verbose, ascii_only=not console.speaks_unicode(sys.stdout)
            )
        )


def rendered(
    document: dict[str, Any],
    form: Format,
    width: int | None = None,
    *,
    quiet: bool = False,
    verbose: bool = False,
    ascii_only: bool = False,
) -> str:
    """Return the report of a result as text, without colours.

    Parameters
    ----------
    ascii_only : bool
        Whether the text may have ASCII letters only; ids in Markdown keep theirs.
    """
    from photostrip.report import chosen_sections, title_of
    from photostrip.report.page import layout, text

    if form is Format.JSON:
        from photostrip.formats.output.result_files import to_json

        return to_json(document, ascii_only=ascii_only)
    if form is Format.GITHUB:
        from photostrip.report.page.messages import annotated, result_findings

        return annotated(result_findings(document))
    title, sections = "" if quiet else title_of(document), chosen_sections(document, quiet=quiet, everything=verbose)
    if form is Format.MD:
        page = text.to_markdown(title, sections)
        return layout.plain_ascii(page) if ascii_only else page
    return text.to_text(title, sections, width or layout.USUAL, ascii_only=ascii_only)


def traced(result: Result, form: Format) -> str:
    """Return the trace of a run: every stage and iteration."""
    from photostrip.report.commands.trace_sections import trace_sections, trace_title
    from photostrip.report.page import layout, text
    from photostrip.result.trace.trace import trace_of

    if result.bundle is not None:  # what has stages to be traced is the strip method that started it
        result = replace(result, strips=result.bundle.start.strips, frames=(*result.frames, result.output))
    document = trace_of(result)
    if form is Format.JSON:
        from photostrip.formats.output.result_files import to_json

        return to_json(document)
    title, sections = trace_title(document), trace_sections(document)
    if form is Format.MD:
        return text.to_markdown(title, sections)
    return text.to_text(title, sections, layout.WIDEST)


def form_of(path: Path, option: str = "--output") -> Format:
    """Return the format that the ending of a file name asks for.

    Returns
    -------
    Format
        Its format; text for a name without an ending.

    Raises
    ------
    typer.BadParameter
        For another ending.
    """
    if path.suffix.lower() not in {*ENDINGS, ""}:
        known = ", ".join(ENDINGS)
        message = f"no report is written as '{path.suffix}': the name may end in {known}, or give --format"
        raise typer.BadParameter(message, param_hint=option)
    return ENDINGS.get(path.suffix.lower(), Format.TEXT)
