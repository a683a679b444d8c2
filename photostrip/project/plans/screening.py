"""The plan of an experiment with gross errors in pairs: the YAML file and its keys."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

from photostrip.planning.screening import ZONES, PairLayout, ScreeningSpec
from photostrip.project.plans.flown import SigmaUm
from photostrip.project.schema.sections import (
    After,
    FirstSchema,
    Fraction,
    NotNegative,
    Number,
    Positive,
    Range,
    Section,
    Whole,
    Words,
    bounded,
    choice,
    key,
    length,
    rule,
    wrong,
)
from photostrip.project.yaml.reading import read_keys
from photostrip.strip.relative_orientation.orientation import SCREENINGS

MICROMETRES = 1000.0  # in a millimetre
USUAL = ScreeningSpec()
FOCAL, LENGTH = Range(10.0, 1000.0, "mm"), Range(1.0, 500.0, "mm")
TILT, RELIEF = Range(0.0, 10.0, "deg"), Range(0.0, 50.0, "%")
POINTS, MODELS = Range(0, 100, ""), Range(1, 1000, "")
REPETITIONS = Range(1, 1000, "")

Size = Annotated[Number, After(bounded(LENGTH))]
Count = Annotated[Whole, After(bounded(POINTS))]


class ScreeningPlanFile(Section):
    """An experiment with gross errors in pairs; the defaults are the published one."""

    photostrip_plan_screening: FirstSchema = key("Number of this schema: 1")
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    name: Words = key("Name of the plan", "screening")
    principal_distance: Annotated[Number, After(bounded(FOCAL))] = key(
        "Principal distance", USUAL.layout.focal, unit="mm"
    )
    base: Size = key("Photo base", USUAL.layout.base, unit="mm")
    width: Size = key("Distance of the side zones from the base", USUAL.layout.width, unit="mm")
    zone_points: Annotated[list[Count], length(ZONES, ZONES)] = key(
        "Points in each of the standard zones 1 to 6", list(USUAL.layout.counts)
    )
    zone_reach: NotNegative = key(
        "How far points lie from the middle of their zone, in x and y, at most", USUAL.layout.scatter, unit="mm"
    )
    tilt: Annotated[Number, After(bounded(TILT))] = key("Largest tilt", USUAL.layout.tilt, unit="deg")
    relief_percent: Annotated[Number, After(bounded(RELIEF))] = key(
        "Largest relief, up and down, of the flying height", 100 * USUAL.layout.relief, unit="%"
    )
    parallax_sigma_um: SigmaUm = key(
        "Standard deviation of a y parallax", MICROMETRES * USUAL.layout.parallax_sigma, unit="um"
    )
    models: Annotated[Whole, After(bounded(MODELS))] = key("Pairs, each with an error", USUAL.models)
    second_errors: Annotated[Whole, After(bounded(Range(0, 1000, "")))] = key(
        "Pairs of them that have a second one", USUAL.second
    )
    error_sizes_um: Annotated[list[Positive], length(1, 20)] = key(
        "Sizes of the errors, each as often as any other", [MICROMETRES * size for size in USUAL.sizes], unit="um"
    )
    methods: Annotated[list[Annotated[str, choice(SCREENINGS)]], length(1)] = key(
        "Methods, of `processing.relative.screening`", list(USUAL.methods)
    )
    grubbs_alpha: Fraction = key("Probability of rejecting a good point of a pair", USUAL.grubbs_alpha)
    parallax_limit: Positive = key("Limit of `parallax+grubbs`", USUAL.parallax_limit, unit="mm")
    repetitions: Annotated[Whole, After(bounded(REPETITIONS))] = key(
        "How often the experiment is made", USUAL.repetitions
    )
    seed: Whole = key("Number that makes the drawn pairs and errors the same again", USUAL.seed)

    @rule
    def _errors_have_pairs(self) -> None:
        if self.second_errors > self.models:
            message = f"{self.second_errors} second errors do not go into {self.models} pairs"
            raise wrong(message, code="range", at="second_errors", expected=f"0 to {self.models}")


class ScreeningPlan(NamedTuple):
    name: str
    spec: ScreeningSpec
    files: Sequence[str]


def load_screening_plan(path: Path | None, assignments: Sequence[str]) -> ScreeningPlan:
    """Read the plan of an experiment, or raise its faults; without a file the assignments and defaults are the plan."""
    given, reading = read_keys(ScreeningPlanFile, path, assignments)
    layout = PairLayout(
        focal=given.principal_distance,
        base=given.base,
        width=given.width,
        counts=tuple(given.zone_points),
        scatter=given.zone_reach,
        tilt=given.tilt,
        relief=given.relief_percent / 100,
        parallax_sigma=given.parallax_sigma_um / MICROMETRES,
    )
    spec = ScreeningSpec(
        layout=layout,
        models=given.models,
        second=given.second_errors,
        sizes=tuple(size / MICROMETRES for size in given.error_sizes_um),
        methods=tuple(dict.fromkeys(map(str, given.methods))),
        grubbs_alpha=given.grubbs_alpha,
        parallax_limit=given.parallax_limit,
        repetitions=given.repetitions,
        seed=given.seed,
    )
    return ScreeningPlan(name=str(given.name), spec=spec, files=reading.files)
