"""``photostrip init``: the first files of a project, to be filled in."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.options import Silent


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the new project; made when it is missing.")],
    quiet: Silent = False,
) -> None:
    """Write a commented project file and the headers of its tables.

    DIR gets project.yaml, observations.csv, control.csv and fiducials.csv. Nothing is overwritten: when one of the
    files exists, none is written. `photostrip check` then names what is still to be filled in.
    """
    from photostrip.formats.text.writing import write_files
    from photostrip.project.template import refuse_existing, template_files

    files = template_files(folder.resolve().name or "project")
    refuse_existing(folder, list(files))
    write_files(folder, files)
    if not quiet:
        typer.echo(f"wrote {', '.join(files)} to {folder}; next: photostrip check {folder / 'project.yaml'}", err=True)
