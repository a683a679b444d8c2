"""Expected accuracy, before any photo is taken or measured."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from photostrip.library.project import assignments_of, reading_from
from photostrip.notes import Document

PlanKind = Literal["model", "strip", "camera", "displacement", "screening"]


class Plan:
    """What a plan lets expect."""

    def __init__(self, document: Document, files: Iterable[str] = ()) -> None:
        self.document = document
        """What ``photostrip plan --format json`` prints."""
        self.files = tuple(files)
        """Every file that was read."""

    def report(self, form: Literal["text", "md"] = "text") -> str:
        """Return the plan as text or Markdown."""
        from photostrip.report.commands.plans.report import plan_report
        from photostrip.report.page.text import to_markdown, to_text

        return (to_markdown if form == "md" else to_text)(*plan_report(self.document))

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
            from photostrip.formats.output.plans.model import model_document
            from photostrip.planning.model_plan import given_errors, plan_model
            from photostrip.project.plans.model import load_model_plan

            model = load_model_plan(path, assignments)
            document = model_document(model.name, model.camera, plan_model(model.spec), given_errors(model.spec), None)
            return Plan(document, model.files)
        case "strip":
            from photostrip.formats.output.plans.strip import strip_document
            from photostrip.project.plans.strip import load_strip_plan

            strip = load_strip_plan(path, assignments)
            return Plan(strip_document(strip.name, strip.computed()), strip.reading.files)
        case "camera":
            from photostrip.errors import Fault, InputError
            from photostrip.formats.output.plans.cameras import camera_document
            from photostrip.project.plans.cameras import load_camera_plan

            if path is None:
                raise InputError(Fault("no cameras are given", "plan-cameras", fix="give a file or a mapping"))
            cameras = load_camera_plan(path, assignments)
            document = camera_document(cameras.name, cameras.cameras, cameras.reference, cameras.survey)
            return Plan(document, cameras.files)
        case "displacement":
            from photostrip.formats.output.plans.displacement import displacement_document
            from photostrip.project.plans.displacement import load_displacement_plan

            survey = load_displacement_plan(path, assignments)
            return Plan(displacement_document(survey.name, survey.spec), survey.files)
        case "screening":
            from photostrip.formats.output.plans.screening import screening_document
            from photostrip.planning.screening import screening_experiment
            from photostrip.project.plans.screening import load_screening_plan

            experiment = load_screening_plan(path, assignments)
            return Plan(screening_document(experiment.name, screening_experiment(experiment.spec)), experiment.files)
    message = f"there is no plan {kind!r}: model, strip, camera, displacement or screening"
    raise ValueError(message)
