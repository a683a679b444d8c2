"""JSON Schemas of plan files, for editors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from photostrip.project.plans.cameras import CameraPlanFile
from photostrip.project.plans.displacement import DisplacementPlanFile
from photostrip.project.plans.model import ModelPlanFile
from photostrip.project.plans.screening import ScreeningPlanFile
from photostrip.project.plans.strip import StripPlanFile
from photostrip.project.schema.for_editors import described

if TYPE_CHECKING:
    from photostrip.project.schema.values import Section

KINDS: dict[str, type[Section]] = {
    "model": ModelPlanFile,
    "strip": StripPlanFile,
    "camera": CameraPlanFile,
    "displacement": DisplacementPlanFile,
    "screening": ScreeningPlanFile,
}


def plan_schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of the file of one of the commands of ``photostrip plan``."""
    return described(KINDS[kind], f"photostrip plan {kind}")
