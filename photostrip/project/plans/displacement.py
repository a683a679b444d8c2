"""The plan of a survey of displacements: the YAML file and its keys."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from photostrip.project.plans.flown import SigmaUm
from photostrip.project.schema.sections import (
    After,
    FirstSchema,
    Fraction,
    Number,
    Range,
    Section,
    Words,
    bounded,
    key,
    length,
    one_of,
    rule,
    wrong,
)
from photostrip.project.terrestrial.cameras import Camera, CameraOrName, only_camera
from photostrip.project.terrestrial.ranges import BASE, DISTANCE, SIGNIFICANCE
from photostrip.project.yaml.reading import read_keys
from photostrip.terrestrial.accuracy import DisplacementSpec
from photostrip.units import MICROMETRES

PRESET = "UMK 10/1318"
CONVERGENCE = Range(-45.0, 45.0, "deg")
POWER = Range(0.5, 0.9999, "")
Metres = Annotated[Number, After(bounded(DISTANCE))]


class DisplacementPlanFile(Section):
    """Expected accuracy of displacements. Every key but the first has a default."""

    photostrip_plan_displacement: FirstSchema = key("Number of this schema: 1")
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    name: Words = key("Name of the plan", "displacements")
    camera: CameraOrName = key(
        "Camera: its name in a list, or preset, principal_distance, format", Camera(preset=PRESET)
    )
    presets: Words | None = key("A list of cameras of your own", None)
    stations: Annotated[Words, After(one_of("2", "1"))] = key(
        "2, at the ends of a base, or 1, with known distances", "2"
    )
    base: Annotated[Number, After(bounded(BASE))] = key("Length of the base", 20.0, unit="m")
    convergence_deg: Annotated[Number, After(bounded(CONVERGENCE))] = key(
        "Turn of each camera towards the other", 0.0, unit="deg"
    )
    distances: Annotated[list[Metres], length(1, 50)] = key(
        "Distances of the object from the base", [50.0, 100.0, 200.0], unit="m"
    )
    sigma_um: SigmaUm | None = key("Standard deviation of an image coordinate of each epoch", None, unit="um")
    sigma_d_um: SigmaUm | None = key("That of a pseudo-parallax, instead; default: 5", None, unit="um")
    significance: Annotated[Fraction, After(bounded(SIGNIFICANCE))] = key(
        "Probability of calling a point moved that did not move", DisplacementSpec.significance
    )
    power: Annotated[Fraction, After(bounded(POWER))] = key(
        "Probability with which the displacements stated are found", DisplacementSpec.power
    )

    @rule
    def _one_precision(self) -> None:
        if self.sigma_um is not None and self.sigma_d_um is not None:
            message = "the standard deviation of a coordinate and that of a pseudo-parallax are both given"
            raise wrong(message, code="two-keys", at="sigma_d_um", fix="remove one")
        if self.stations == "1" and self.convergence_deg:
            raise wrong("one camera has no other to be turned towards", at="convergence_deg", fix="remove it")


class DisplacementPlan(NamedTuple):
    name: str
    spec: DisplacementSpec
    files: Sequence[str]


def load_displacement_plan(path: Path | None, assignments: Sequence[str]) -> DisplacementPlan:
    """Read the plan of a survey, or raise its faults; without a file the assignments and defaults are the plan."""
    given, reading = read_keys(DisplacementPlanFile, path, assignments)
    camera = only_camera(given.camera, reading, whole=True)
    change = given.sigma_d_um or 5.0
    if given.sigma_um is not None:
        change = float(np.sqrt(2.0)) * given.sigma_um  # of a coordinate in two epochs
    spec = DisplacementSpec(
        camera,
        distances=tuple(given.distances),
        sigma=change / MICROMETRES,
        base=given.base if given.stations == "2" else None,
        convergence=float(np.radians(given.convergence_deg)),
        significance=given.significance,
        power=given.power,
    )
    return DisplacementPlan(name=str(given.name), spec=spec, files=reading.files)
