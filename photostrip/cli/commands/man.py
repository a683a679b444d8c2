"""``photostrip man``: the manual pages, written from the commands themselves."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.options import Silent


def man(
    command: Annotated[
        str, typer.Argument(metavar="[COMMAND]", help="Page of one command; default: that of photostrip itself.")
    ] = "",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Write all pages into DIR, as photostrip*.1.")
    ] = None,
    quiet: Silent = False,
) -> None:
    """Print a manual page, or write all of them.

    With a pager: photostrip man run | man -l -
    """
    from photostrip.cli.jobs.manual import manual_pages
    from photostrip.formats.text.writing import write_files

    pages = manual_pages()
    if output is not None:
        write_files(output, pages)
        if not quiet:
            typer.echo(f"wrote {len(pages)} pages to {output}", err=True)
        return
    name = f"photostrip-{command.replace(' ', '-')}.1" if command else "photostrip.1"
    if name not in pages:
        known = ", ".join(sorted(page.removeprefix("photostrip-").removesuffix(".1") for page in pages if "-" in page))
        raise typer.BadParameter(f"there is no page of '{command}'; there are {known}", param_hint="COMMAND")
    sys.stdout.write(pages[name])
