"""``photostrip simulate``: a synthetic project with known truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.options import Rule


def simulate(
    spec: Annotated[Path, typer.Argument(metavar="SPEC", help="Specification of the simulation (YAML).")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder to write the project into.")],
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key, as in flight.photos=20; may be repeated."),
    ] = None,
    depfile: Rule = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but errors.")] = False,
) -> None:
    """Write a synthetic project with known truth, ready to run.

    DIR gets project.yaml with its tables, and truth.json: the true coordinates, perspective centres and rotations,
    and the gross errors that were put in. The same SPEC gives the same files on every machine.
    """
    from photostrip.formats.text.writing import make_rule, write_text
    from photostrip.library.simulation import simulated

    simulation = simulated(spec, assignments or [])
    simulation.write(output)
    target = str(output / "project.yaml")
    if depfile is not None:
        write_text(depfile, make_rule(target, simulation.files_read))
    if not quiet:
        typer.echo(f"{target}: {simulation.summary}", err=True)
