"""``photostrip plan camera``."""

from __future__ import annotations

from typing import Annotated

import typer

from photostrip.cli.commands.plan.delivery import Delivery
from photostrip.cli.commands.plan.options import PlanFile


def camera(
    *,
    file: PlanFile = None,
    source_table: Annotated[
        bool, typer.Option("--source-table", help="The table of the source, with what is misprinted in it.")
    ] = False,
    delivery: Delivery,
) -> None:
    """Compare cameras by their efficiency coefficient K = f m_p: the smaller, the fewer photos."""
    from photostrip.errors import Fault, InputError
    from photostrip.formats.output.plans.cameras import source_document

    if source_table == (file is not None):
        message = "a list of cameras and --source-table exclude each other" if file else "no cameras are given"
        raise InputError(Fault(message, "plan-cameras", fix="name a YAML file, or use --source-table"))
    if file is None:
        delivery.require_output("camera")
        delivery.deliver(source_document(), ())
    else:
        delivery.plan("camera", file, {})
