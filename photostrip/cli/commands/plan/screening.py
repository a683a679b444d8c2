"""``photostrip plan screening``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from photostrip.cli.commands.plan.delivery import Delivery
from photostrip.cli.commands.plan.options import PlanFile, PlanOptions, Sets


@dataclass(frozen=True)
class Experiment(PlanOptions):
    """Options that describe the pairs and their errors."""

    principal_distance: Annotated[
        str | None, Sets("--principal-distance", "MM", "Principal distance.", "principal_distance")
    ] = None
    base: Annotated[str | None, Sets("--base", "MM", "Photo base.", "base")] = None
    width: Annotated[str | None, Sets("--width", "MM", "Distance of the side zones from the base.", "width")] = None
    zone_points: Annotated[
        str | None,
        Sets("--zone-points", "N,N,N,N,N,N", "Points in the standard zones 1 to 6.", "zone_points", several=True),
    ] = None
    sigma_um: Annotated[
        str | None, Sets("--parallax-sigma-um", "UM", "Standard deviation of a y parallax.", "parallax_sigma_um")
    ] = None
    sizes: Annotated[
        str | None, Sets("--sizes-um", "UM,UM", "Sizes of the errors of y parallaxes.", "error_sizes_um", several=True)
    ] = None
    methods: Annotated[
        str | None, Sets("--methods", "A,B", "Methods of search, as auto,parallax+grubbs.", "methods", several=True)
    ] = None
    repetitions: Annotated[
        str | None, Sets("--repetitions", "N", "How often the experiment is made.", "repetitions")
    ] = None


def screening(*, file: PlanFile = None, experiment: Experiment, delivery: Delivery) -> None:
    """Repeat the published experiment with gross errors in pairs, with a layout of your own.

    Tells what each method finds, by zone and by size, and what an error that is not found does to the elements.
    """
    delivery.plan("screening", file, experiment.keys())
