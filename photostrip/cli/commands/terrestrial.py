"""``photostrip terrestrial``: the computations of a phototheodolite."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.failures import failures_as
from photostrip.cli.options import RuleOfOutput, Silent
from photostrip.cli.sheets import Assigned, Printed, Written, check_target, deliver, say, write_rule
from photostrip.terrestrial import TerrestrialKind


def terrestrial(
    *,
    kind: Annotated[TerrestrialKind, typer.Argument(metavar="KIND", help="What is computed.", show_default=False)],
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", help="Keys (YAML); without one those that are set say all.", show_default=False),
    ] = None,
    assignments: Assigned = None,
    form: Printed = "text",
    output: Written = None,
    depfile: RuleOfOutput = None,
    quiet: Silent = False,
) -> None:
    """Compute directions of a phototheodolite, and displacements between epochs.

    directions: of image points; photo: where directions meet the photo; accuracy: with which directions must be
    measured, all over the photo; theodolite: which image accuracy one can vouch for; orientation: of a photo, by
    directions to points in it. displacement: of points between epochs, from photos of two stations; one-station: from
    one, with known distances. cameras: those that can be named. `photostrip schema --terrestrial KIND` lists the keys.
    """
    with failures_as(form):
        from photostrip.library.terrestrial import terrestrial as computed

        picture = check_target(output, depfile, picture=kind == "displacement")
        found = computed(kind, file, assignments or [])
        if picture and output is not None:
            from photostrip.formats.text.writing import write_text
            from photostrip.report.pictures.displacements import displacement_picture

            write_text(output, displacement_picture(found.sheet.document()).file())
        if form not in {"text", "md", "json"} or kind != "displacement":  # the sheet of displacements has its notes
            say(found.notes, quiet=quiet)
        deliver(found.sheet, form, output, quiet=quiet)
        write_rule(depfile, output, found.files)
