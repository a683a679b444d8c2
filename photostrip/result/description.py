"""Every key of result.json described once, in ``quantities.txt``: as quantities, as JSON Schema and as a page."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

SCHEMA = 2  # number of the format of result.json
LIST = " list"
KINDS = {"text", "word", "count", "flag", "any"}
BESIDE = {"refined", "truth"}  # what is described and not in result.json
# What a baseline is without: what is ours, what the other numbers are made of, and what is made of them.
LEFT_OUT = (
    "version",
    "statement",
    "certificate",
    "residuals",
    "link_residuals",
    "correlations",
    "fiducial_marks",
)
FIELDS = re.compile(r" \|(?= |$)")
BRACES = re.compile(r"\{([^}]*)\}")


@dataclass(frozen=True)
class Quantity:
    """The value of a key, or each value of a column."""

    meaning: str
    kind: str  # text, word (one of a few), count, flag, number, any (described elsewhere)
    unit: str = ""  # m, um, deg, ...; empty for ratios; frame: that of its coordinates; angle: that of its angles
    decimals: int | None = None
    digits: int | None = None  # significant ones, where a number has no natural size
    unit_key: str = ""  # key of the same block or table that names the unit
    many: bool = False  # whether a list of such values stands there
    optional: bool = False  # whether it may be missing, where a kind of project does not have it
    derived: bool = False  # whether other columns tell it: it does not stand in result.json
    # kind of tolerance by which two results are compared; name: a column that names its rows; empty: not compared
    compared: str = ""
    head: str = ""  # of its column in reports; * stands for the axis of the frame
    shown: str = ""  # how reports print it, as ``page.tables`` reads it; empty: as usual for its unit
    below: str = ""  # second line of the head, in place of the unit
    angles: str = ""  # unit in which reports print an angle

    @classmethod
    def of(cls, form: str, meaning: str) -> Quantity:
        """Read a form, as ``um 2``, ``ratio 4 digits``, ``by unit``, ``frame``, ``any m`` or ``text list``."""
        if form.endswith(LIST):
            return replace(cls.of(form.removesuffix(LIST), meaning), many=True)
        kind, *rest = form.split()
        if kind in KINDS:
            return cls(meaning, kind, "".join(rest))
        if kind == "by":
            return cls(meaning, "number", unit_key=rest[0])
        if not rest:
            return cls(meaning, "number", kind)
        places, unit = int(rest[0]), "" if kind == "ratio" else kind
        if rest[1:]:
            return cls(meaning, "number", unit, digits=places)
        return cls(meaning, "number", unit, decimals=places)


class Block(dict[str, Any]):
    """What stands under the keys of a block: quantities, blocks and tables."""

    optional = False  # whether it may be missing, where a kind of project does not have it


class Columns(Block):
    """What the columns of a table are."""


def described() -> Block:
    """Return what stands under each key of a result, blocks within blocks; tables are ``Columns``."""
    return Block((key, entry) for key, entry in _everything().items() if key not in BESIDE)


@cache
def _everything() -> Block:
    found = Block()
    places = [found]
    for line in Path(__file__).with_name("quantities.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            kind = Columns if line.startswith("[[") else Block
            places = [_made(found, path, kind) if path else found for path in _expanded(line.strip("[]?"))]
            for place in places:
                place.optional = line.endswith("?")
        elif line and not line.startswith("#"):
            keys, form, meaning, *more = (part.strip() for part in FIELDS.split(line))
            compared, head, shown, below, *_ = *more, *[""] * 4
            entry = replace(Quantity.of(form, meaning), optional=keys[-1] in "?*", derived=keys.endswith("*"))
            heads = list(_expanded(head))
            for number, path in enumerate(_expanded(keys.rstrip("?*"))):
                above, _, last = path.rpartition(".")
                head = heads[number % len(heads)]
                own = replace(entry, compared=compared, head=head, shown=shown, below=below)
                for place in places:
                    (_made(place, above, Block) if above else place)[last] = own
    return found


def _made(above: Block, path: str, kind: type[Block]) -> Block:
    """Return the block or the table below a block, made where it is not there."""
    *blocks, last = path.split(".")
    for key in blocks:
        above = above.setdefault(key, Block())
    made: Block = above.setdefault(last, kind())
    return made


def _expanded(path: str) -> Iterator[str]:
    """Write ``{a b}.c`` out as ``a.c`` and ``b.c``."""
    fixed = BRACES.split(path)
    for names in product(*(choice.split() for choice in fixed[1::2])):
        yield "".join(part for pair in zip(fixed[::2], (*names, ""), strict=True) for part in pair)


def block_at(path: str) -> Block:
    """Return what is described below a block, as ``precision.check``, or of a table, as ``precision.along``."""
    place = _everything()
    for key in path.split("."):
        place = place[key]
    return place


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
