"""``photostrip plan screening``."""

from __future__ import annotations

from typing import Annotated

import typer

from photostrip.cli.commands.plan.delivery import Delivery
from photostrip.cli.commands.plan.options import PlanFile, PlanOptions, Sets
from photostrip.cli.failures import failures_as
from photostrip.frozen import dataclass


@dataclass(frozen=True)
class Experiment(PlanOptions):
    """Options that describe the pairs and their errors."""

    principal_distance: Annotated[
        str | None,
        typer.Option("--principal-distance", metavar="MM", help="Principal distance."),
        Sets("principal_distance"),
    ] = None
    base: Annotated[str | None, typer.Option("--base", metavar="MM", help="Photo base."), Sets("base")] = None
    width: Annotated[
        str | None,
        typer.Option("--width", metavar="MM", help="Distance of the side zones from the base."),
        Sets("width"),
    ] = None
    zone_points: Annotated[
        str | None,
        typer.Option("--zone-points", metavar="N,N,N,N,N,N", help="Points in the standard zones 1 to 6."),
        Sets("zone_points", several=True),
    ] = None
    sigma_um: Annotated[
        str | None,
        typer.Option("--parallax-sigma-um", metavar="UM", help="Standard deviation of a y parallax."),
        Sets("parallax_sigma_um"),
    ] = None
    sizes: Annotated[
        str | None,
        typer.Option("--sizes-um", metavar="UM,UM", help="Sizes of the errors of y parallaxes."),
        Sets("error_sizes_um", several=True),
    ] = None
    methods: Annotated[
        str | None,
        typer.Option("--methods", metavar="A,B", help="Methods of search, as auto,parallax+grubbs."),
        Sets("methods", several=True),
    ] = None
    repetitions: Annotated[
        str | None,
        typer.Option("--repetitions", metavar="N", help="How often the experiment is made."),
        Sets("repetitions"),
    ] = None


def screening(*, file: PlanFile = None, experiment: Experiment, delivery: Delivery) -> None:
    """Repeat the published experiment with gross errors in pairs, with a layout of your own.

    Tells what each method finds, by zone and by size, and what an error that is not found does to the elements.
    """
    with failures_as(delivery.form):
        from photostrip.library.plan import planned

        delivery.require_output()
        with delivery.assigned(experiment.keys()) as assignments:
            plan = planned("screening", file, assignments)
        delivery.deliver(plan.document, plan.files)
