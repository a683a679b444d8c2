"""Documents of plans and terrestrial computations: printed in the form asked for, written by the ending of a file."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from photostrip.cli.stdout import Document, print_json, print_sections
from photostrip.visible import visible

if TYPE_CHECKING:
    from photostrip.notes import Note
    from photostrip.report.page.parts import Section

Form = Literal["text", "md", "json", "csv"]

FORMS: dict[str, Form] = {".json": "json", ".csv": "csv", ".md": "md", ".txt": "text"}  # by the ending of a file


@dataclass(frozen=True)
class Rendering:
    """How documents of one kind become a report, and a table."""

    report: Callable[[Document], tuple[str, tuple[Section, ...]]]
    table: Callable[[Document], str]

    def rendered(self, document: Document, form: Form) -> str:
        """Return a document as a file holds it."""
        from photostrip.formats.output.result_json import to_json
        from photostrip.report.page.text import to_markdown, to_text

        if form in {"json", "csv"}:
            return to_json(document) if form == "json" else self.table(document)
        return (to_markdown if form == "md" else to_text)(*self.report(document))

    def show(self, document: Document, form: Form) -> None:
        if form == "json":
            print_json(document)
        elif form == "csv":
            sys.stdout.write(visible(self.table(document)))
        else:
            print_sections(*self.report(document), markdown=form == "md")


def say(notes: Iterable[Note], *, quiet: bool) -> None:
    """Say on stderr what a computation had to say beside its numbers."""
    if not quiet:
        for note in notes:
            typer.echo(f"{note.severity}: {note.message}", err=True)


def write_rule(depfile: Path | None, target: Path | None, files: Iterable[str]) -> None:
    """Write the rule for make, if one is asked for."""
    if depfile is not None and target is not None:
        from photostrip.formats.text.writing import make_rule, write_text

        write_text(depfile, make_rule(str(target), files))
