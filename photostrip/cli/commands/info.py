"""``photostrip info``: what is installed and what is missing; ``photostrip sources``: what it goes back to."""

from __future__ import annotations

from typing import Annotated

import typer

from photostrip.cli.failures import failures_as
from photostrip.cli.sheets import Printed, deliver
from photostrip.cli.stdout import Format


def info(
    form: Annotated[
        Format, typer.Option("--format", envvar="PHOTOSTRIP_FORMAT", help="How the answer is printed: text or json.")
    ] = "text",
) -> None:
    """Print versions and formats, and how to get what is missing.

    Include it in every report of a problem.
    """
    from photostrip.cli.jobs.installation import as_text, installation

    found = installation()
    if form == "json":
        import json

        typer.echo(json.dumps(found, indent=1))
        return
    typer.echo(as_text(found), nl=False)


def sources(form: Printed = "text") -> None:
    """Compute every worked number of the sources again.

    Lists every misprint, and the command and the function for every equation.
    """
    with failures_as(form):
        from photostrip.sheets.sources import sources_sheet

        deliver(sources_sheet(), form)
