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
    match kind:
        case "model":
            from photostrip.planning.model_plan import both_forms, given_errors, plan_model
            from photostrip.project.plans import load_model_plan
            from photostrip.sheets.model_plan import model_sheet

            model = load_model_plan(path, assignments)
            spec, printed = model.spec, model.closed_form == "printed"
            forms = None if model.closed_form == "no" else both_forms(spec)
            forecast, errors = plan_model(spec), given_errors(spec)
            return Plan(model_sheet(model.name, model.camera, forecast, errors, forms, printed=printed), model.files)
        case "strip":
            from photostrip.project.plans import load_strip_plan
            from photostrip.sheets.strip_plan import strip_sheet

            strip = load_strip_plan(path, assignments)
            return Plan(strip_sheet(strip.name, strip.computed()), strip.reading.files)
        case "camera":
            from photostrip.errors import Fault, InputError
            from photostrip.project.plans import load_camera_plan
            from photostrip.sheets.plans import camera_sheet

            if path is None:
                raise InputError(Fault("no cameras are given", "plan-cameras", fix="name a YAML file"))
            cameras = load_camera_plan(path, assignments)
            return Plan(camera_sheet(cameras.name, cameras.cameras, cameras.reference, cameras.survey), cameras.files)
        case "displacement":
            from photostrip.project.plans import load_displacement_plan
            from photostrip.sheets.plans import displacement_sheet

            survey = load_displacement_plan(path, assignments)
            return Plan(displacement_sheet(survey.name, survey.spec), survey.files)
        case "screening":
            from photostrip.planning.screening import screening_experiment
            from photostrip.project.plans import load_screening_plan
            from photostrip.sheets.plans import screening_sheet

            experiment = load_screening_plan(path, assignments)
            return Plan(screening_sheet(experiment.name, screening_experiment(experiment.spec)), experiment.files)
    message = f"there is no plan {kind!r}: model, strip, camera, displacement or screening"
    raise ValueError(message)
