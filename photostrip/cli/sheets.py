"""Sheets on the command line: the options that all of them have, printed in the form asked for, written by ending."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from photostrip.cli.options import require_target
from photostrip.cli.stdout import ascii_only, print_sections
from photostrip.visible import visible

if TYPE_CHECKING:
    from photostrip.notes import Note
    from photostrip.sheets.sheet import Sheet

Form = Literal["text", "md", "json", "csv"]
FORMS = {".json": "json", ".csv": "csv", ".md": "md", ".txt": "text", ".html": "html"}  # by the ending of a file
PICTURE = ".svg"

Printed = Annotated[Form, typer.Option("--format", help="How the answer is printed.")]
Assigned = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Set a key of the file, as in end_lap_percent=70; may be repeated."
    ),
]
Written = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o", metavar="FILE", help=f"Write it: {', '.join(FORMS)}, or a picture where it has one."
    ),
]


def check_target(output: Path | None, depfile: Path | None = None, *, picture: bool = False) -> bool:
    """Refuse what cannot be written before anything is computed; return whether a picture is wanted."""
    require_target(depfile, output)
    if output is None or output.suffix.lower() in FORMS:
        return False
    if picture and output.suffix.lower() == PICTURE:
        return True
    known = ", ".join([*FORMS, PICTURE] if picture else FORMS)
    raise typer.BadParameter(f"nothing is written as '{output.suffix}': the name may end in {known}", param_hint="-o")


def deliver(
    sheet: Sheet, form: str, output: Path | None = None, *, quiet: bool = False, width: int | None = None
) -> None:
    """Write a sheet where a file is named; print it."""
    if output is not None and output.suffix.lower() in FORMS:
        from photostrip.formats.text.writing import write_text

        write_text(output, sheet.rendered(FORMS[output.suffix.lower()]))
    if output is not None and quiet:
        return
    if form == "json":
        from photostrip.formats.output.result_json import to_json

        sys.stdout.write(to_json(sheet.document(), ascii_only=ascii_only()))
    elif form == "csv":
        sys.stdout.write(visible(sheet.csv()))
    else:
        print_sections(sheet.title, sheet.sections(), width, markdown=form == "md")


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
