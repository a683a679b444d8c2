"""``photostrip plan displacement``."""

from __future__ import annotations

from typing import Annotated

import typer

from photostrip.cli.commands.plan.delivery import Delivery
from photostrip.cli.commands.plan.options import SIGMA_UM, PlanFile, PlanOptions, Sets
from photostrip.cli.failures import failures_as
from photostrip.frozen import dataclass


@dataclass(frozen=True)
class SurveyOptions(PlanOptions):
    """Options that describe the survey."""

    camera: Annotated[
        str | None, typer.Option("--camera", metavar="NAME", help="Phototheodolite of the list."), Sets("camera")
    ] = None
    stations: Annotated[
        str | None,
        typer.Option("--stations", metavar="N", help="2, or 1 with known distances of the points."),
        Sets("stations"),
    ] = None
    base: Annotated[str | None, typer.Option("--base", metavar="M", help="Length of the base."), Sets("base")] = None
    distances: Annotated[
        str | None,
        typer.Option("--distances", metavar="M,M", help="Distances of the object from the base."),
        Sets("distances", several=True),
    ] = None
    sigma_um: Annotated[str | None, SIGMA_UM, Sets("sigma_um")] = None


def displacement(*, file: PlanFile = None, survey: SurveyOptions, delivery: Delivery) -> None:
    """Compute how well displacements will be known, and the smallest that will be found."""
    with failures_as(delivery.form):
        from photostrip.library.plan import planned

        delivery.require_output()
        with delivery.assigned(survey.keys()) as assignments:
            plan = planned("displacement", file, assignments)
        delivery.deliver(plan.document, plan.files)
