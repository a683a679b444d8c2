"""JSON Schemas of plan files, for editors."""

from __future__ import annotations

from typing import Any

from photostrip.project.plans.plan_camera_file import CameraPlanFile
from photostrip.project.plans.plan_model_file import ModelPlanFile
from photostrip.project.plans.plan_strip_file import StripPlanFile
from photostrip.project.yaml.schema import Section, described

KINDS: dict[str, type[Section]] = {"model": ModelPlanFile, "strip": StripPlanFile, "camera": CameraPlanFile}


def plan_schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a plan file.

    Parameters
    ----------
    kind : str
        ``"model"``, ``"strip"`` or ``"camera"``.

    Returns
    -------
    dict
        JSON Schema, draft 2020-12.
    """
    for each in KINDS.values():
        for field in each.model_fields.values():
            if isinstance(field.annotation, type) and issubclass(field.annotation, Section):
                field.annotation.model_rebuild()  # as for the project file
    return described(KINDS[kind], f"photostrip plan {kind}")
