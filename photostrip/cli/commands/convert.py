"""``photostrip convert``: other programs' files as a project."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.options import Silent


def convert(
    source: Annotated[Path, typer.Argument(metavar="SOURCE", help="Folder of a COLMAP model, text or binary.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder to write the project into.")],
    sigma: Annotated[
        float | None,
        typer.Option("--sigma", metavar="PX", help="Standard deviation of an image coordinate in pixels; needed."),
    ] = None,
    pixel_size: Annotated[
        float | None,
        typer.Option(
            "--pixel-size", metavar="MM", help="Size of a pixel; else micrometres in reports stand for pixels."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the files of a project in DIR.")] = False,
    quiet: Silent = False,
) -> None:
    """Write an ordinary project from other programs' files, to be checked, edited and run.

    DIR gets project.yaml, observations.csv and orientations.csv. Printed is what was understood: counts, cameras, one
    photo, frame, units. What the files do not carry is asked for by the name of an option, and never guessed.
    """
    from photostrip.cli.jobs.convert import converted

    lines, written = converted(source, output, sigma, pixel_size, force=force)
    if not quiet:
        typer.echo("\n".join(lines))
        typer.echo(written, err=True)
