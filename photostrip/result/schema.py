"""What result.json may hold, as JSON Schema and as a page, made from the description of its keys."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from photostrip.result.description import SCHEMA, Block, Columns, Quantity, described

URI = "https://json-schema.org/draft/2020-12/schema"
TYPES = {"text": "string", "word": "string", "count": "integer", "flag": "boolean", "number": "number"}
WORDS = {"text": "text", "word": "word", "count": "count", "flag": "true or false", "any": ""}


def result_schema() -> dict[str, Any]:
    """Return the JSON Schema of result.json.

    Every key may be null, where there is no value. A baseline holds a part of a result: three keys are required, and of
    each table that is there the columns that it always has. A table is a block of columns, each a list.
    """
    blocks: dict[str, Any] = {}
    found = _block(described(), "", blocks)
    found["properties"]["photostrip_result"] = {"const": SCHEMA, "description": "number of the format"}
    head = {"$schema": URI, "title": "photostrip result", "description": f"Content of result.json, format {SCHEMA}."}
    return head | found | {"required": ["photostrip_result", "version", "status"], "$defs": blocks}


def result_page() -> str:
    """Return a page of Markdown with every key, its unit and its meaning."""
    lines = ["| key | unit | what it is |", "|---|---|---|"]
    for path, entry in _quantities(described(), ""):
        absent = " (in CSV and Python: other columns of result.json tell it)" if entry.derived else ""
        lines.append(f"| `{path}` | {_unit(entry)} | {entry.meaning}{absent} |")
    return "\n".join(lines) + "\n"


def _block(block: Block, above: str, blocks: dict[str, Any]) -> dict[str, Any]:
    """Describe a block of keys or columns; what lies below it goes into `blocks` by the keys that lead to it."""
    if isinstance(block, Columns):
        stored = {key: entry for key, entry in block.items() if not entry.derived}
        columns = {key: {"type": "array", "items": _value(entry) | _flag(entry)} for key, entry in stored.items()}
        required = [key for key, entry in block.items() if not entry.optional]
        return {"type": "object", "properties": columns, "required": required}
    found: dict[str, Any] = {}
    for key, entry in block.items():
        path = f"{above}.{key}" if above else key
        if isinstance(entry, Quantity):
            found[key] = _value(entry)
        else:
            blocks[path] = _block(entry, path, blocks)
            one = {"$ref": f"#/$defs/{path}"}
            found[key] = {"anyOf": [one, {"type": "null"}]} if entry.optional else one
    return {"type": "object", "properties": found}


def _flag(entry: Quantity) -> dict[str, Any]:
    """Describe a flag in a table: 1 or 0."""
    return {"type": ["integer", "null"], "enum": [0, 1, None]} if entry.kind == "flag" else {}


def _value(entry: Quantity) -> dict[str, Any]:
    """Describe a value; its unit stands under a key of its own."""
    found: dict[str, Any] = {"description": entry.meaning}
    kind = "number" if entry.kind == "any" and entry.unit else entry.kind  # its decimals are those of its frame
    if kind in TYPES:
        one: dict[str, Any] = {"type": [TYPES[kind], "null"]}
        found |= {"type": ["array", "null"], "items": one} if entry.many else one
    if unit := _unit(entry):
        found["x-unit"] = unit
    if entry.decimals is not None:
        found["x-decimals"] = entry.decimals
    return found


def _unit(entry: Quantity) -> str:
    """Return the unit of a number, or what says it; of anything else its kind."""
    if entry.unit_key:
        return f"that of `{entry.unit_key}`"
    of = {"frame": "that of the frame", "angle": "that of the angles"}
    return of.get(entry.unit, entry.unit) or WORDS.get(entry.kind, "")


def _quantities(block: Block, above: str) -> Iterator[tuple[str, Quantity]]:
    for key, entry in block.items():
        path = f"{above}.{key}" if above else key
        if isinstance(entry, Quantity):
            yield path, entry
        else:
            yield from _quantities(entry, path)
