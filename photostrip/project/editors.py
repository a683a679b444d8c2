"""JSON Schemas of the files that users write, for editors, draft 2020-12: every key, its default and its unit."""

from __future__ import annotations

from copy import deepcopy
from importlib import import_module
from inspect import getdoc
from types import EllipsisType
from typing import Annotated, Any, get_args, get_origin

from photostrip.project.schema.sections import Key, Length, OneOrMany, Read, Section, bare, types
from photostrip.project.schema.values import AUTO

KINDS = {  # where the keys of each kind of file stand, and its title
    "project": ("schema.project_file", "ProjectFile", "photostrip project"),
    "simulation": ("simulation", "SimulationFile", "photostrip simulation"),
    "tolerances": ("profiles.tolerances", "ToleranceFile", "photostrip tolerance profile"),
    "model": ("plans.model", "ModelPlanFile", "photostrip plan model"),
    "strip": ("plans.strip", "StripPlanFile", "photostrip plan strip"),
    "camera": ("plans.cameras", "CameraPlanFile", "photostrip plan camera"),
    "displacement": ("plans.displacement", "DisplacementPlanFile", "photostrip plan displacement"),
    "screening": ("plans.screening", "ScreeningPlanFile", "photostrip plan screening"),
}
MEASURED = {  # in a project
    "allOf": [
        {"anyOf": [{"required": ["cameras", "observations"]}, {"required": ["models"]}]},
        {"anyOf": [{"required": ["strips"]}, {"required": ["photos"]}]},
    ]
}


def schema_of(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file; the same on every call."""
    module, name, title = KINDS[kind]
    file: type[Section] = getattr(import_module(f"photostrip.project.{module}"), name)
    blocks: dict[str, Any] = {}
    whole = _section(file, blocks)
    needed = MEASURED if kind == "project" else {}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    return {**head, **({"$defs": dict(sorted(blocks.items()))} if blocks else {}), **whole, **needed}


def _section(kind: type[Section], blocks: dict[str, Any]) -> dict[str, Any]:
    """Describe a section; those below it become `blocks`."""
    keys = {name: _key(entry, types(kind)[name], blocks) for name, entry in kind.keys.items()}
    required = [name for name, entry in kind.keys.items() if isinstance(entry.default, EllipsisType)]
    return {
        "additionalProperties": False,
        "description": getdoc(kind),
        "properties": keys,
        **({"required": required} if required else {}),
        "type": "object",
    }


def _key(entry: Key, annotation: Any, blocks: dict[str, Any]) -> dict[str, Any]:  # noqa: ANN401 (a type)
    found: dict[str, Any] = {"description": entry.description}
    value = _value(annotation, blocks)
    default = entry.default
    if isinstance(default, Section):  # the keys of the section carry their own
        found["default"] = {}
    elif default is None and AUTO in value.get("anyOf", []):
        found["default"] = "auto"
    elif default is not None and default is not ...:
        found["default"] = list(default) if isinstance(default, tuple) else default
    if entry.unit:
        found["unit"] = entry.unit
    return dict(sorted({**found, **value}.items()))


def _value(annotation: Any, blocks: dict[str, Any]) -> dict[str, Any]:  # noqa: ANN401 (a type)
    """Describe values of a type."""
    kinds = [each for each in get_args(annotation) if isinstance(each, type) and issubclass(each, Section)]
    if len(kinds) > 1:
        return {"anyOf": [_value(each, blocks) for each in kinds]}
    inner = bare(annotation)
    if get_origin(inner) is Annotated:
        own = [each.schema for each in inner.__metadata__ if isinstance(each, Read)]
        found = deepcopy(own[0]) if own else _value(inner.__origin__, blocks)
        for each in inner.__metadata__:
            if isinstance(each, Length):
                kind = "Items" if found["type"] == "array" else "Properties"
                found |= {f"min{kind}": each.least, **({f"max{kind}": each.most} if each.most else {})}
        if any(isinstance(each, OneOrMany) for each in inner.__metadata__):
            found = {"anyOf": [found["items"], found]}
        return found
    if isinstance(inner, type) and issubclass(inner, Section):
        if inner.__name__ not in blocks:
            blocks[inner.__name__] = {}
            blocks[inner.__name__] = _section(inner, blocks)
        return {"$ref": f"#/$defs/{inner.__name__}"}
    parts = get_args(inner)
    if get_origin(inner) is tuple:
        entries = [_value(each, blocks) for each in parts]
        return {"type": "array", "prefixItems": entries, "minItems": len(parts), "maxItems": len(parts)}
    if get_origin(inner) is list:
        return {"type": "array", "items": _value(parts[0], blocks)}
    return {"type": "object", "additionalProperties": _value(parts[1], blocks)}
