"""The files that users write, as JSON Schema 2020-12 and as a page: every key, its default and its unit."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from importlib import import_module
from typing import TYPE_CHECKING, Any, get_args, get_origin

from pydantic.json_schema import GenerateJsonSchema

from photostrip.planning import PlanKind
from photostrip.project.sections import AUTO, Section, bare, is_section
from photostrip.strip import STEPS
from photostrip.terrestrial import TerrestrialKind

if TYPE_CHECKING:
    from pydantic_core import core_schema


def _class(kind: str, last: str) -> str:
    """Return the name of the class that holds the keys of a kind of file: ``OneStationFile`` of ``one-station``."""
    return kind.title().replace("-", "") + last


KINDS = {  # where the keys of each kind of file stand, and its title
    "project": ("keys", "ProjectFile", "photostrip project"),
    "simulation": ("simulation", "SimulationFile", "photostrip simulation"),
    "tolerances": ("tolerances", "ToleranceFile", "photostrip tolerance profile"),
    **{kind: ("plans", _class(kind, "PlanFile"), f"photostrip plan {kind}") for kind in get_args(PlanKind)},
    **{
        f"terrestrial {kind}": ("terrestrial", _class(kind, "File"), f"photostrip terrestrial {kind}")
        for kind in get_args(TerrestrialKind)
    },
    **{f"step {kind}": ("plans", _class(kind, "Keys"), f"photostrip step {kind}") for kind in STEPS},
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
    found = file.model_json_schema(schema_generator=_ForEditors)
    needed = MEASURED if kind == "project" else {}
    return {"$schema": _ForEditors.schema_dialect, **found, "title": title, **needed}


def keys_page(kind: str) -> str:
    """Return a page of Markdown with the keys of a kind of file, a table for each section."""
    schema, lines = schema_of(kind), []
    for path, section in _sections(schema, schema.get("$defs", {}), ""):
        lines += [f"### `{path}`", ""] if path else []
        lines += [section["description"], "", "| key | default | what it says |", "|---|---|---|"]
        for name, entry in section.get("properties", {}).items():
            default = entry.get("default", "required" if name in section.get("required", ()) else "")
            value = default if isinstance(default, str) else json.dumps(default, ensure_ascii=False)
            value = "" if value in {"{}", "[]"} else value
            lines.append(f"| `{name}` | {value} | {entry.get('description', '')} |")
        lines.append("")
    return "\n".join(lines)


def _sections(section: dict[str, Any], parts: dict[str, Any], path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Return a section and those below it, each with the keys that lead to it."""
    yield path, section
    for name, entry in section.get("properties", {}).items():
        for part in dict.fromkeys(re.findall(r"#/\$defs/(\w+)", json.dumps(entry))):
            yield from _sections(parts[part], parts, f"{path}.{name}" if path else name)


class _ForEditors(GenerateJsonSchema):
    """JSON Schema without titles made of names, and without ``null``, which no file has."""

    def field_title_should_be_set(self, schema: Any) -> bool:  # noqa: ANN401, ARG002 (of pydantic)
        return False

    def model_schema(self, schema: core_schema.ModelSchema) -> dict[str, Any]:
        return {name: each for name, each in super().model_schema(schema).items() if name != "title"}

    def nullable_schema(self, schema: core_schema.NullableSchema) -> dict[str, Any]:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> dict[str, Any]:
        found, default = self.generate_inner(schema["schema"]), schema.get("default")
        if default is None:
            return {**found, "default": "auto"} if AUTO in found.get("anyOf", ()) else found
        return {**found, "default": {} if isinstance(default, Section) else default}


def single_keys() -> Iterator[str]:
    """Return the paths of all single values of a project file; below lists and names of users there are none."""
    from photostrip.project.keys import ProjectFile

    for above, name, annotation in ProjectFile.described():
        if not is_section(bare(annotation)) and get_origin(bare(annotation)) not in {list, dict, tuple}:
            yield f"{above}.{name}".removeprefix(".")
