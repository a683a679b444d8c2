"""How terrestrial commands hand out what they computed: text, Markdown, JSON, CSV."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from photostrip.notes import Note
    from photostrip.report.page.parts import Section

Document = dict[str, Any]
Form = Literal["text", "md", "json", "csv"]


@contextmanager
def told(form: Form) -> Iterator[None]:
    """Tell failures in the form that was asked for: as JSON on stdout, else as lines on stderr."""
    from photostrip.cli.failures import failures_as
    from photostrip.cli.stdout import Format

    with failures_as(Format.JSON if form == "json" else Format.TEXT):
        yield


def hand_out(
    document: Document,
    form: Form,
    report: Callable[[Document], tuple[str, tuple[Section, ...]]],
    table: Callable[[Document], str],
) -> None:
    """Print a document in the form that was asked for.

    Parameters
    ----------
    form : str
        ``"text"``, ``"md"``, ``"json"`` or ``"csv"``.
    """
    from photostrip.report.page import console, layout, text

    ascii_only = not console.speaks_unicode(sys.stdout)
    if form == "json":
        from photostrip.formats.output.result_json import to_json

        sys.stdout.write(to_json(document, ascii_only=ascii_only))
    elif form == "csv":
        sys.stdout.write(table(document))
    elif form == "md":
        page = text.to_markdown(*report(document))
        sys.stdout.write(layout.plain_ascii(page) if ascii_only else page)
    else:
        console.print_report(*report(document), sys.stdout)


def say(notes: Iterable[Note], *, quiet: bool) -> None:
    """Say on stderr what a computation had to say beside its numbers."""
    if not quiet:
        for note in notes:
            typer.echo(f"{note.severity}: {note.message}", err=True)
