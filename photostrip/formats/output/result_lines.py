"""Where the records of a result stand in its file, for annotations by line."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any

BLOCK = re.compile(r'^"(\w+)": ')


def line_finder(text: str) -> Callable[[str, str], int]:
    """Index the lines of a result.json as photostrip writes it, each record on a line of its own.

    Returns gives the line, counted from 1, of a block and the id of one of its records; that of the block when there is
        no such record, 0 when there is no such block. A file that another program has written anew gives 0 or the
        block.
    """
    places: dict[tuple[str, str], int] = {}
    block = ""
    for number, line in enumerate(text.splitlines(), 1):
        found = BLOCK.match(line)
        if found:
            block = found[1]
            places.setdefault((block, ""), number)
        elif line.startswith('{"'):
            name = _id_of(line)
            if name is not None:
                places.setdefault((block, name), number)
    return lambda block, name: places.get((block, name), places.get((block, ""), 0))


def _id_of(line: str) -> str | None:
    """Return the id of the record on a line; None when it is none."""
    try:
        record: Any = json.loads(line.rstrip(","))
    except json.JSONDecodeError:
        return None
    if "id" in record:
        return str(record["id"])
    if "left" in record:
        return f"{record['left']} – {record['right']}"
    name = record.get("photo", record.get("point", record.get("strip")))
    return None if name is None else str(name)
