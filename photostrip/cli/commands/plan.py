"""``photostrip plan``: how good it would be, before any photo is taken or measured."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.failures import failures_as
from photostrip.cli.options import RuleOfOutput, Silent
from photostrip.cli.sheets import Assigned, Printed, Written, check_target, deliver, write_rule
from photostrip.planning import PlanKind


def plan(
    *,
    kind: Annotated[PlanKind, typer.Argument(metavar="KIND", help="What is planned.", show_default=False)],
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE", help="Plan (YAML); without one the keys that are set say all.", show_default=False
        ),
    ] = None,
    assignments: Assigned = None,
    form: Printed = "text",
    output: Written = None,
    depfile: RuleOfOutput = None,
    quiet: Silent = False,
) -> None:
    """Compute expected accuracy: of one model, of a strip and its control, of displacements; compare cameras.

    model: errors all over it, and what each source of errors does alone. strip: along it, for layouts of control and
    methods of adjustment. camera: by the efficiency coefficient K = f m_p, the smaller, the fewer photos.
    displacement: how well it will be known, and the smallest that will be found. screening: the published experiment
    with gross errors in pairs, or one of your own. `photostrip schema --plan KIND` lists the keys.
    """
    with failures_as(form):
        from photostrip.library.plan import planned

        picture = check_target(output, depfile, picture=kind == "strip")
        found = planned(kind, file, assignments or [])
        if picture and output is not None:
            from photostrip.formats.text.writing import write_text
            from photostrip.report.pictures.plan_strip import strip_plan_picture

            write_text(output, strip_plan_picture(found.document).file())
        deliver(found.sheet, form, output, quiet=quiet)
        write_rule(depfile, output, found.files)
