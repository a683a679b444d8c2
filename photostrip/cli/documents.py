"""Documents of plans and terrestrial computations: printed in the form asked for, written by the ending of a file."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from photostrip.notes import Note
    from photostrip.report.page.parts import Section

Document = dict[str, Any]
Form = Literal["text", "md", "json", "csv"]

FORMS: dict[str, Form] = {".json": "json", ".csv": "csv", ".md": "md", ".txt": "text"}  # by the ending of a file


@contextmanager
def failures_in(form: Form) -> Iterator[None]:
    """Report failures in the form that was asked for: as JSON on stdout, else as lines on stderr."""
    from photostrip.cli.failures import failures_as
    from photostrip.cli.stdout import Format

    with failures_as(Format.JSON if form == "json" else Format.TEXT):
        yield


@dataclass(frozen=True)
class Rendering:
    """How documents of one kind become a report, and a table."""

    report: Callable[[Document], tuple[str, tuple[Section, ...]]]
    table: Callable[[Document], str]

    def rendered(self, document: Document, form: Form, *, ascii_only: bool = False) -> str:
        """Return a document as text without colours."""
        from photostrip.report.page import layout, text

        if form == "json":
            from photostrip.formats.output.result_json import to_json

            return to_json(document, ascii_only=ascii_only)
        if form == "csv":
            return self.table(document)
        if form == "md":
            page = text.to_markdown(*self.report(document))
            return layout.plain_ascii(page) if ascii_only else page
        return text.to_text(*self.report(document))

    def show(self, document: Document, form: Form) -> None:
        """Print a document."""
        from photostrip.report.page import console

        if form == "text":
            console.print_report(*self.report(document), sys.stdout)
        else:
            ascii_only = not console.speaks_unicode(sys.stdout)
            sys.stdout.write(self.rendered(document, form, ascii_only=ascii_only))


def say(notes: Iterable[Note], *, quiet: bool) -> None:
    """Say on stderr what a computation had to say beside its numbers."""
    if not quiet:
        for note in notes:
            typer.echo(f"{note.severity}: {note.message}", err=True)


def require_target(depfile: Path | None, output: Path | None) -> None:
    """Refuse a rule for make without a file to make."""
    if depfile is not None and output is None:
        message = "a rule for make needs a target: give --output as well"
        raise typer.BadParameter(message, param_hint="--depfile")


def write_rule(depfile: Path | None, target: Path | None, files: Iterable[str]) -> None:
    """Write the rule for make, if one is asked for."""
    if depfile is not None and target is not None:
        from photostrip.formats.text.writing import make_rule, write_text

        write_text(depfile, make_rule(str(target), files))
