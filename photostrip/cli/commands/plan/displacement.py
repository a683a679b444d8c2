"""``photostrip plan displacement``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from photostrip.cli.commands.plan.delivery import Delivery
from photostrip.cli.commands.plan.options import SIGMA_UM, PlanFile, PlanOptions, Sets


@dataclass(frozen=True)
class SurveyOptions(PlanOptions):
    """Options that describe the survey."""

    camera: Annotated[str | None, Sets("--camera", "NAME", "Phototheodolite of the list.", "camera")] = None
    stations: Annotated[
        str | None, Sets("--stations", "N", "2, or 1 with known distances of the points.", "stations")
    ] = None
    base: Annotated[str | None, Sets("--base", "M", "Length of the base.", "base")] = None
    distances: Annotated[
        str | None, Sets("--distances", "M,M", "Distances of the object from the base.", "distances", several=True)
    ] = None
    sigma_um: Annotated[str | None, Sets(*SIGMA_UM, "sigma_um")] = None


def displacement(*, file: PlanFile = None, survey: SurveyOptions, delivery: Delivery) -> None:
    """Compute how well displacements will be known, and the smallest that will be found."""
    delivery.plan("displacement", file, survey.keys())
