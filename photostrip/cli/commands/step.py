"""``photostrip step``: single steps of the method, from a table of points, for teaching and checking."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.failures import failures_as
from photostrip.cli.options import Silent
from photostrip.cli.sheets import Assigned, Printed, Written, check_target, deliver
from photostrip.strip import StepName


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

    `photostrip schema --step NAME` lists its keys: principal_distance, base, unit, sigma_um and others.

    \b
    Columns of FILE:
      interior      mark, x, y, x_photo, y_photo
      refine        point, x, y
      relative      point, x_left, y_left, x_right, y_right
      intersection  the same
      chain         photo, omega, phi, kappa (degrees)
      scale         point, x, y, z, x_next, y_next, z_next
      strip         photo, point, x, y
      absolute      point, x, y, z, x_ground, y_ground, z_ground
      polynomial    point, x, y, z, misclosure
      resection     point, x, y, x_ground, y_ground, z_ground
      bundle        photo, point, x, y
    """  # noqa: D301 (the sign by which a paragraph keeps its lines)
    with failures_as(form):
        check_target(output)
        from photostrip.library.step import step as computed

        deliver(computed(name, str(file), assignments or [], trace=trace), form, output, quiet=quiet)
