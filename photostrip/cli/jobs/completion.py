"""What a shell is answered when it asks what can stand at the cursor: commands, options, keys of the project file."""

from __future__ import annotations

import os
import sys

from photostrip.cli.command_table import COMPLETION


def answer(instruction: str) -> int:
    """Answer a shell.

    The instruction is ``source_bash`` for its script, ``complete_bash`` for what can stand at the cursor, which the
    script describes in further variables.
    """
    from photostrip.cli.whole_program import whole_program

    os.environ[COMPLETION] = instruction
    try:
        whole_program(completing=True)(args=[], prog_name="photostrip", standalone_mode=False)
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 0
    finally:
        del os.environ[COMPLETION]
        sys.stdout.flush()
    return 0


def keys(incomplete: str) -> list[str]:
    """Return the keys of the project file that an assignment of ``--set`` may begin with, each with ``=`` behind it."""
    from photostrip.project.editors import schema_of

    schema = schema_of("project")
    return [f"{path}=" for path in _paths(schema, schema) if path.startswith(incomplete)]


def _paths(schema: dict[str, object], part: object, path: str = "") -> list[str]:
    """Return the paths of all single values below a part of the schema; lists and the names of users are left out."""
    part = _resolved(schema, part)
    properties = part.get("properties")
    if isinstance(properties, dict):
        return [
            each for name, inner in properties.items() for each in _paths(schema, inner, f"{path}.{name}".strip("."))
        ]
    leaf = path and part.get("type") not in ("array", "object")
    return [path] if leaf else []


def _resolved(schema: dict[str, object], part: object) -> dict[str, object]:
    """Follow a reference of the schema, also where None is allowed beside it."""
    found = part if isinstance(part, dict) else {}
    for choice in found.get("anyOf", ()):
        if "$ref" in choice:
            found = choice
    if "$ref" in found:
        target: object = schema
        for step in str(found["$ref"]).removeprefix("#/").split("/"):
            target = target[step] if isinstance(target, dict) else {}
        return _resolved(schema, target)
    return found
