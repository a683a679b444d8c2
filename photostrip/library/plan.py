"""Expected accuracy, before any photo is taken or measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from photostrip.library.project import assignments_of, reading_from
from photostrip.notes import Document
from photostrip.planning import PlanKind

if TYPE_CHECKING:
    from photostrip.sheets.sheet import Sheet


class Plan:
    """What a plan lets expect."""

    def __init__(self, sheet: Sheet, files: Sequence[str] = ()) -> None:
        self.sheet = sheet
        self.files = tuple(files)
        """Every file that was read."""

    @property
    def document(self) -> Document:
        """What ``photostrip plan --format json`` prints."""
        return self.sheet.document()

    def report(self, form: Literal["text", "md"] = "text") -> str:
        """Return the plan as text or Markdown."""
        return self.sheet.rendered(form)

    def __repr__(self) -> str:
        """Return the report: a plan is small."""
        return self.report()


def plan(
    kind: PlanKind,
    specification: str | PathLike[str] | Mapping[str, Any] | None = None,
    **overrides: Any,  # noqa: ANN401 (values of a plan)
) -> Plan:
    """Compute a plan, as ``photostrip plan model``, ``strip``, ``camera``, ``displacement`` or ``screening`` does.

    specification: a file, or its content as a mapping; without one the overrides say all.
    overrides: keys with other values: ``plan("model", end_lap_percent=70, control={"layout": "six"})``.
    Raises InputError with every fault of the plan.
    """
    from photostrip.project.in_memory import SPECIFICATION, source_of

    assignments = assignments_of(overrides)
    if isinstance(specification, Mapping):
        number = f"photostrip_plan_{'cameras' if kind == 'camera' else kind}"  # of the schema
        with reading_from(source_of(SPECIFICATION, {number: 1, **specification}, {})):
            return planned(kind, Path(SPECIFICATION), assignments)
    return planned(kind, None if specification is None else Path(specification), assignments)


def planned(kind: str, path: Path | None, assignments: Sequence[str]) -> Plan:
    """Read a plan from its file, or from assignments to its keys alone, and compute it."""
    from photostrip.project import plans
    from photostrip.project.reading import read_keys

    match kind:
        case "model":
            from photostrip.planning.model_plan import both_forms, given_errors, plan_model
            from photostrip.project.simulation import camera_of
            from photostrip.sheets.model_plan import model_sheet

            model, reading = read_keys(plans.ModelPlanFile, path, assignments)
            spec, printed = model.spec, model.closed_form == "printed"
            forms = None if model.closed_form == "no" else both_forms(spec)
            forecast, errors, camera = plan_model(spec), given_errors(spec), camera_of(model.camera)
            return Plan(model_sheet(model.name, camera.name, forecast, errors, forms, printed=printed), reading.files)
        case "strip":
            from photostrip.planning.strip_design import plan_strip
            from photostrip.sheets.strip_plan import strip_sheet

            strip, reading = read_keys(plans.StripPlanFile, path, assignments)
            with reading.places(plans.SIMULATED):
                report = plan_strip(strip.design)
            return Plan(strip_sheet(strip.name, report), reading.files)
        case "camera":
            from photostrip.errors import Fault, InputError
            from photostrip.sheets.plans import camera_sheet

            if path is None:
                raise InputError(Fault("no cameras are given", "plan-cameras", fix="name a YAML file"))
            cameras, reading = read_keys(plans.CameraPlanFile, path, assignments)
            compared = cameras.compared
            reference = next((each for each in compared if each.name == cameras.reference), compared[-1])
            return Plan(camera_sheet(cameras.name, compared, reference, cameras.survey), reading.files)
        case "displacement":
            from photostrip.sheets.plans import displacement_sheet

            survey, reading = read_keys(plans.DisplacementPlanFile, path, assignments)
            return Plan(displacement_sheet(survey.name, survey.spec(reading)), reading.files)
        case "screening":
            from photostrip.planning.screening import screening_experiment
            from photostrip.sheets.plans import screening_sheet

            experiment, reading = read_keys(plans.ScreeningPlanFile, path, assignments)
            return Plan(screening_sheet(experiment.name, screening_experiment(experiment.spec)), reading.files)
    message = f"there is no plan {kind!r}: model, strip, camera, displacement or screening"
    raise ValueError(message)
