"""``photostrip info``: what is installed and what is missing; ``photostrip sources``: what it goes back to."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli import documents
from photostrip.cli.failures import failures_as
from photostrip.cli.stdout import Format


def info(
    form: Annotated[
        Format, typer.Option("--format", envvar="PHOTOSTRIP_FORMAT", help="How the answer is printed: text or json.")
    ] = Format.TEXT,
) -> None:
    """Print versions, threads, formats and extras, and how to get what is missing.

    Include it in every report of a problem.
    """
    from photostrip.cli.jobs.installation import as_text, installation

    found = installation()
    if form is Format.JSON:
        import json

        typer.echo(json.dumps(found, indent=1))
        return
    typer.echo(as_text(found), nl=False)


def sources(
    form: Annotated[documents.Form, typer.Option("--format", help="How the answer is printed.")] = "text",
    write: Annotated[
        Path | None,
        typer.Option("--write", metavar="FILE", help="Make the tables of docs/sources.md anew, instead of printing."),
    ] = None,
) -> None:
    """Compute every worked number of the sources again, beside what is printed.

    Lists every misprint, and the command and the function for every equation.
    """
    with failures_as(form):
        from photostrip.cli.jobs.sources.tables import sources_document, with_tables
        from photostrip.formats.output.csv_text import to_csv
        from photostrip.report.commands.sources import sources_report

        if write is not None:
            from photostrip.formats.text.files import MEGABYTE, decode, read_bytes
            from photostrip.formats.text.writing import write_text

            page, _ = decode(str(write), read_bytes(str(write), 10 * MEGABYTE))
            write_text(write, with_tables(page, str(write)))
            return
        rendering = documents.Rendering(
            sources_report,
            lambda found: to_csv(list(found["worked"][0]), (row.values() for row in found["worked"])),
        )
        rendering.show(sources_document(), form)
