"""A result that is read again, checked against the description of its keys: a user may have edited the file.

Every table has the columns that it must have, of one length; every value is of the kind that its key is described with,
every number is finite and every text can be written. Keys that are not described may be there, if they can be written.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import chain, islice
from typing import Any

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.notes import Document
from photostrip.result.description import Block, Columns, Quantity, described
from photostrip.result.table import Table, as_array

LARGEST_NUMBER = 1e100  # its square is a number yet
LARGEST_COUNT = 10**15
MOST_FAULTS = 20
DEEPEST = 50  # lists and blocks in each other
WORDS = {
    "text": "a text",
    "word": "a text",
    "count": "a whole number",
    "flag": "true or false",
    "number": "a number",
    "any": "a value",
}
Wrong = tuple[str, str, str]  # key, what is wrong with it, what is expected there


def read(
    document: Document,
    file: str,
    block: Block | None = None,
    fix: str = "run the project again",
    lacking: Collection[str] = (),
) -> Document:
    """Return a document with its tables, from what JSON has in their place.

    block: what it holds; without one, a result.
    lacking: blocks and tables that may be missing, as from a baseline.
    Raises InputError with every key that is missing or has a value of another kind, the first of many.
    """
    wrong: list[Wrong] = []
    found = _block(document, described() if block is None else block, "", wrong, lacking)
    if not wrong:
        return found
    raise InputError(
        Fault(
            message,
            "result-value" if expected else "result-incomplete",
            file,
            key=key,
            expected=expected or "a whole result.json",
            fix=fix,
        )
        for key, message, expected in wrong[:MOST_FAULTS]
    )


def _block(
    value: dict[str, Any], block: Block, path: str, wrong: list[Wrong], lacking: Collection[str] = ()
) -> Document:
    """Return a block with the tables in it; what is wrong goes to a list."""
    found: Document = {}
    for key, below in value.items():
        entry, here = block.get(key), f"{path}.{key}" if path else key
        if unwritable(key):
            wrong.append((path, f"holds the key {key!a}, which cannot be written", "a name"))
        elif isinstance(entry, Columns):
            found[key] = _table(below, entry, here, wrong)
        elif isinstance(entry, Block):
            if isinstance(below, dict):
                found[key] = _block(below, entry, here, wrong)
            elif below is None and entry.optional:
                found[key] = below
            else:
                wrong.append((here, f"holds {_shown(below)}", "a block of keys"))
        else:
            wrong.extend(islice(_wrong_value(below, entry, here), MOST_FAULTS))
            found[key] = below
    for key, entry in block.items():
        if key not in value and key not in lacking and not _may_be_missing(entry):
            wrong.append((f"{path}.{key}" if path else key, "is missing", ""))
    return found


def _may_be_missing(entry: Quantity | Block) -> bool:
    return entry.optional or (isinstance(entry, Block) and bool(entry) and all(map(_may_be_missing, entry.values())))


def _table(value: Any, entries: Columns, path: str, wrong: list[Wrong]) -> Table:  # noqa: ANN401 (any JSON)
    before = len(wrong)
    if not isinstance(value, dict) or not all(isinstance(column, list) for column in value.values()):
        shown = "a block of keys that are no columns" if isinstance(value, dict) else _shown(value)
        wrong.append((path, f"holds {shown}", "a table: a block of columns, each a list"))
        return Table(path, {}, entries)
    size = len(next(iter(value.values()), ()))
    for key, entry in entries.items():
        if key not in value and not entry.optional:
            wrong.append((f"{path}.{key}", "is missing", ""))
    for key, column in value.items():
        if unwritable(key):
            wrong.append((path, f"holds the key {key!a}, which cannot be written", "a name"))
        elif len(column) != size:
            wrong.append((f"{path}.{key}", f"holds {len(column)} values", f"{size}, as many as its first column"))
        else:
            wrong.extend(islice(_wrong_column(column, entries.get(key), f"{path}.{key}"), MOST_FAULTS))
    if len(wrong) > before:
        return Table(path, {}, entries)
    every = {key: entries.get(key, Quantity("", "any")) for key in (*entries, *value)}
    return Table(path, {key: as_array(every[key], column) for key, column in value.items()}, every)


def _wrong_column(column: list[Any], entry: Quantity | None, path: str) -> Iterator[Wrong]:
    """Look at all values of a column together, in a tenth of the time; where something is wrong, one by one."""
    if not _alike(column, entry):
        for number, value in enumerate(column):
            yield from _wrong_value(value, entry, f"{path}[{number}]")


def _alike(column: list[Any], entry: Quantity | None) -> bool:
    """Whether a column certainly holds values of its kind, of one type."""
    kinds = set(map(type, column)) - {type(None)}
    if entry is None or entry.many or len(kinds) > 1:
        return not kinds
    present = [value for value in column if value is not None]
    if kinds == {str}:
        return _is("".join(present), entry.kind)
    if kinds == {int} and entry.kind == "flag":
        return {*present} <= {0, 1}
    if kinds in ({float}, {int}):
        largest = float(np.abs(np.array(present, float)).max()) if kinds == {float} else max(map(abs, present))
        return _is(largest, entry.kind)
    return not kinds or (kinds == {bool} and entry.kind in {"flag", "any"})


def _wrong_value(value: object, entry: Quantity | None, path: str) -> Iterator[Wrong]:
    if value is None:
        return
    if entry is None or entry.kind == "any":
        yield from _wrong_anything(value, path, 0)
    elif not entry.many:
        if not _is(value, entry.kind):
            yield path, f"holds {_shown(value)}", WORDS[entry.kind]
    elif not isinstance(value, list):
        yield path, f"holds {_shown(value)}", "a list"
    else:
        for number, each in enumerate(value):
            if each is not None and not _is(each, entry.kind):
                yield f"{path}[{number}]", f"holds {_shown(each)}", WORDS[entry.kind]


def _wrong_anything(value: object, path: str, depth: int) -> Iterator[Wrong]:
    """Check a value that is not described: its numbers are finite, its texts can be written."""
    if depth > DEEPEST:
        yield path, "is nested too deeply", "a value"
    elif isinstance(value, dict):
        for key, each in value.items():
            if unwritable(key):
                yield path, f"holds the key {key!a}, which cannot be written", "a name"
            else:
                yield from _wrong_anything(each, f"{path}.{key}", depth + 1)
    elif isinstance(value, list):
        yield from chain.from_iterable(
            _wrong_anything(each, f"{path}[{number}]", depth + 1) for number, each in enumerate(value)
        )
    elif value is not None and not _is(value, "any"):
        yield path, f"holds {_shown(value)}", WORDS["text" if isinstance(value, str) else "number"]


def _is(value: object, kind: str) -> bool:
    """Whether a value is of a kind; any number, text or flag that is sound is of kind ``any``."""
    if isinstance(value, float):  # neither NaN nor infinite: they are not within any limits
        return kind in {"number", "any"} and -LARGEST_NUMBER <= value <= LARGEST_NUMBER
    if isinstance(value, str):
        return kind in {"text", "word", "any"} and not unwritable(value)
    if isinstance(value, bool):
        return kind in {"flag", "any"}
    if kind == "flag":
        return value in (0, 1)
    most = LARGEST_COUNT if kind == "count" else LARGEST_NUMBER
    return kind in {"count", "number", "any"} and isinstance(value, int) and -most <= value <= most


def unwritable(text: str) -> bool:
    """Whether a text has halves of characters (surrogates) in it."""
    return not text.isascii() and any("\ud800" <= sign <= "\udfff" for sign in text)


def _shown(value: object) -> str:
    if isinstance(value, dict):
        return "a block of keys"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, str):
        return f"the text {value[:40]!a}" if unwritable(value) else f"the text {value[:40]!r}"
    if value is None or isinstance(value, bool):
        return "null" if value is None else str(value).lower()
    if isinstance(value, int) and abs(value) > LARGEST_COUNT:
        return "a whole number that is too large"
    return f"{value}"
