"""``photostrip info``: what is installed, what it can read and write, and what is missing."""

from __future__ import annotations

from typing import Annotated

import typer

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
