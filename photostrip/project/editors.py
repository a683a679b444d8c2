"""JSON Schemas of the files that users write, for editors, draft 2020-12: every key, its default and its unit."""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import Any

from photostrip.project.schema.values import AUTO, Section

KINDS = {  # where the keys of each kind of file stand, and its title
    "project": ("schema.project_file", "ProjectFile", "photostrip project"),
    "simulation": ("simulation", "SimulationFile", "photostrip simulation"),
    "tolerances": ("tolerance_profile", "ToleranceFile", "photostrip tolerance profile"),
    "model": ("plans.model", "ModelPlanFile", "photostrip plan model"),
    "strip": ("plans.strip", "StripPlanFile", "photostrip plan strip"),
    "camera": ("plans.cameras", "CameraPlanFile", "photostrip plan camera"),
    "displacement": ("plans.displacement", "DisplacementPlanFile", "photostrip plan displacement"),
    "screening": ("plans.screening", "ScreeningPlanFile", "photostrip plan screening"),
}
MEASURED = {"anyOf": [{"required": ["cameras", "observations"]}, {"required": ["models"]}]}  # in a project


def schema_of(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file; the same on every call."""
    module, name, title = KINDS[kind]
    file: type[Section] = getattr(import_module(f"photostrip.project.{module}"), name)
    _build(file)
    with warnings.catch_warnings():
        # defaults of nested sections are encoded twice, and the second time a tuple of words is a list
        warnings.filterwarnings("ignore", message="Pydantic serializer warnings", category=UserWarning)
        schema = _for_editors(file.model_json_schema())
    needed = MEASURED if kind == "project" else {}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, **schema, **needed}


def _build(kind: type[Section]) -> None:
    """Build all sections: early versions of pydantic cannot describe a default of one that is not built yet."""
    for field in kind.model_fields.values():
        if isinstance(field.annotation, type) and issubclass(field.annotation, Section):
            _build(field.annotation)
    kind.model_rebuild()


def _for_editors(schema: Any) -> Any:  # noqa: ANN401 (JSON)
    """Take out what pydantic adds: titles made of names, and null, which no key accepts."""
    if isinstance(schema, list):
        return [_for_editors(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    result = {name: _for_editors(each) for name, each in schema.items() if name != "title" or isinstance(each, dict)}
    if "allOf" in result:  # early versions of pydantic wrap a reference that has a description
        result |= result.pop("allOf")[0]
    if result.get("type") == "object" and "minLength" in result:
        result["minProperties"] = result.pop("minLength")
    kinds = [each for each in result.get("anyOf", []) if each != {"type": "null"}]
    if "anyOf" in result:
        del result["anyOf"]
        result |= kinds[0] if len(kinds) == 1 else {"anyOf": kinds}
    if isinstance(result.get("default"), dict):
        result["default"] = {}  # the keys of the section carry their own
    if "default" in result and result["default"] is None:
        del result["default"]
        if AUTO in kinds:
            result["default"] = "auto"
    return result
