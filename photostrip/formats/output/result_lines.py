"""Where the tables and blocks of a result stand in its file, for annotations by line."""

from __future__ import annotations

import re
from collections.abc import Callable

KEY = re.compile(r'^( *)"(\w+)": ')


def line_finder(text: str) -> Callable[[str, str], int]:
    """Index the lines of a result.json as photostrip writes it: each block, and each of its keys, on one.

    Returns gives the line, counted from 1, of a block and one of its keys or columns; that of the block when there is
        no such key, 0 when there is no such block, as in a file that another program has written anew.
    """
    places: dict[tuple[str, str], int] = {}
    block = ""
    for number, line in enumerate(text.splitlines(), 1):
        if key := KEY.match(line):
            if not key[1]:
                block = key[2]
            places.setdefault((block, key[2] if key[1] else ""), number)
    return lambda block, name: places.get((block, name), places.get((block, ""), 0))
