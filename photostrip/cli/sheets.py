"""Sheets: plans, single steps of the method, computations of a phototheodolite, what the sources print."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.failures import failures_as
from photostrip.cli.options import Assigned, Printed, Rule, Silent, Written
from photostrip.cli.output import Messages, check_target, deliver, write_rule
from photostrip.errors import EXIT_DONE, EXIT_TOLERANCE, PhotostripError
from photostrip.planning import PlanKind
from photostrip.strip import STEPS, StepName
from photostrip.terrestrial import TerrestrialKind

Keys = Annotated[
    Path | None,
    typer.Argument(metavar="FILE", help="Keys (YAML); without one those that are set say all.", show_default=False),
]


def plan(
    *,
    kind: Annotated[PlanKind, typer.Argument(metavar="KIND", help="What is planned.", show_default=False)],
    file: Keys = None,
    assignments: Assigned = None,
    form: Printed = "text",
    output: Written = None,
    depfile: Rule = None,
    quiet: Silent = False,
) -> None:
    """Compute expected accuracy: of one model, of a strip and its control, of displacements; compare cameras.

    model: errors all over it, and what each source of errors does alone. strip: along it, for layouts of control and
    methods of adjustment. camera: by the efficiency coefficient K = f m_p, the smaller, the fewer photos.
    displacement: how well it will be known, and the smallest that will be found. screening: the published experiment
    with gross errors in pairs, or one of your own. `photostrip schema --plan KIND` lists the keys.
    """
    with failures_as(form):
        from photostrip.library.sheets import planned
        from photostrip.report.pictures.commands import strip_plan_picture

        check_target(output, depfile, picture=kind == "strip")
        found = planned(kind, file, assignments or [])
        draw = strip_plan_picture if kind == "strip" else None
        deliver(found.sheet, form, output, quiet=quiet, draw=draw)
        write_rule(depfile, output, found.files)


def terrestrial(
    *,
    kind: Annotated[TerrestrialKind, typer.Argument(metavar="KIND", help="What is computed.", show_default=False)],
    file: Keys = None,
    assignments: Assigned = None,
    form: Printed = "text",
    output: Written = None,
    depfile: Rule = None,
    quiet: Silent = False,
) -> None:
    """Compute directions of a phototheodolite, and displacements between epochs.

    directions: of image points; photo: where directions meet the photo; accuracy: with which directions must be
    measured, all over the photo; theodolite: which image accuracy one can vouch for; orientation: of a photo, by
    directions to points in it. displacement: of points between epochs, from photos of two stations; one-station: from
    one, with known distances. cameras: those that can be named. `photostrip schema --terrestrial KIND` lists the keys.
    """
    with failures_as(form):
        from photostrip.library.sheets import terrestrial as computed
        from photostrip.report.pictures.commands import displacement_picture

        moved = kind == "displacement"
        check_target(output, depfile, picture=moved)
        found = computed(kind, file, assignments or [])
        for note in found.notes if form == "csv" or not moved else ():  # the sheet of displacements has its notes
            Messages(quiet=quiet).say(f"{note.severity}: {note.message}")
        deliver(found.sheet, form, output, quiet=quiet, draw=displacement_picture if moved else None)
        write_rule(depfile, output, found.files)


def step(
    *,
    name: Annotated[StepName, typer.Argument(metavar="NAME", help="Which step.", show_default=False)],
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Table of points (CSV).", show_default=False)],
    assignments: Assigned = None,
    trace: Annotated[
        bool, typer.Option("--trace", help="The equations with their numbers, too: every iteration, every point.")
    ] = False,
    form: Printed = "text",
    output: Written = None,
    quiet: Silent = False,
) -> None:
    """Take one step of the method alone, from a table of points; image coordinates in mm.

    `photostrip schema --step NAME` lists its keys: principal_distance, base, unit, angles and others.
    Angles are degrees; weights may be left out.

    \b
    Columns of FILE:
    """  # noqa: D301 (the sign by which a paragraph keeps its lines)
    with failures_as(form):
        from photostrip.library.step import step as computed

        check_target(output)
        deliver(computed(name, str(file), assignments or [], trace=trace), form, output, quiet=quiet)


_columns = (f"  {name:<13} {columns.replace(';', ',')}" for name, (_, columns) in STEPS.items())
step.__doc__ = (step.__doc__ or "") + "\n    ".join(_columns)


def sources(
    place: Annotated[
        str | None,
        typer.Argument(metavar="PLACE", help="Do what stands there, as '001 eq. 138'.", show_default=False),
    ] = None,
    form: Printed = "text",
    inputs: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Write what the commands of the sources read."),
    ] = None,
) -> int:
    """Compute every worked number of the sources again; with a place, run what shows it.

    Lists every misprint, every conclusion with whether it holds, and for every equation its number, command and
    function. Exit code 1: a number is not the one that is known.
    """
    with failures_as(form):
        from photostrip.sheets.sources import found_places, places_sheet, shown_places, sources_sheet, write_inputs

        if inputs is not None:
            write_inputs(inputs)
        if place is None:
            if inputs is None:
                deliver(sources_sheet(), form)
            return 0
        shown = shown_places(found_places(place), _typed)
        deliver(places_sheet(shown), form)
        return 0 if all(each.agrees for each in shown) else 1


def _typed(arguments: Sequence[str], folder: Path) -> str:
    """Run a command of this program in a folder, as a shell would, and return what it prints."""
    here = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}  # also where the program is not installed
    command = [sys.executable, "-m", "photostrip", *arguments]
    done = subprocess.run(  # noqa: S603 (a row of the table)
        command, cwd=folder, env=os.environ | here, capture_output=True, text=True, encoding="utf-8", check=False
    )
    if done.returncode not in {EXIT_DONE, EXIT_TOLERANCE}:
        raise PhotostripError(f"`photostrip {shlex.join(arguments)}` ended with {done.returncode}: {done.stderr}")
    return done.stdout
