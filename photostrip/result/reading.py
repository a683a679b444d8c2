"""A result that is read again, checked against the description of its keys: a user may have edited the file.

A key that is missing is told where it is asked for, with the keys that lead to it: a baseline holds a part only. Every
value is of the kind that its key is described with, every number is finite and every text can be written.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from photostrip.errors import Fault
from photostrip.result.description import Quantity, Table, described

LARGEST_NUMBER = 1e100  # its square is a number yet
LARGEST_COUNT = 10**15
MOST_FAULTS = 20
DEEPEST = 50  # lists and blocks in each other
WORDS = {"text": "a text", "word": "a text", "count": "a whole number", "flag": "true or false", "number": "a number"}


def faults_of(
    document: dict[str, Any], file: str, table: Table | None = None, fix: str = "run the project again"
) -> list[Fault]:
    """Return what keeps a document from being a result, or what a table describes: wrong kinds of values, by key.

    Keys that are missing are not among them: a baseline holds a part of a result only.
    """
    found: list[Fault] = []
    for key, message, expected in _wrong(document, described() if table is None else table, ""):
        found.append(Fault(message, "result-value", file, key=key, expected=expected, fix=fix))
        if len(found) == MOST_FAULTS:
            break
    return found


Wrong = tuple[str, str, str]  # key, what is wrong with it, what is expected there


class Located(dict[str, Any]):
    """A block of a result that knows which keys lead to it, and says so of a key that it lacks."""

    path: str

    def __missing__(self, key: str) -> Any:  # noqa: ANN401 (it never returns)
        raise KeyError(f"{self.path}.{key}" if self.path else key)


def located(value: Any, path: str = "") -> Any:  # noqa: ANN401 (any part of a document)
    """Give the blocks of a document the keys that lead to them."""
    if isinstance(value, list):
        numbers = bool(value) and not isinstance(value[0], dict | list)
        return value if numbers else [located(each, f"{path}[{place}]") for place, each in enumerate(value)]
    if not isinstance(value, dict):
        return value
    block = Located(value)
    block.path = path
    for key, each in value.items():
        if isinstance(each, dict | list):
            block[key] = located(each, f"{path}.{key}" if path else key)
    return block


def _wrong(block: dict[str, Any], table: Table, path: str) -> Iterator[Wrong]:
    """Check the keys of a block; of keys that are not described, what all values have in common."""
    for key, value in block.items():
        entry = table.get(key)
        if entry is None and _unwritable(key):
            yield path, f"holds the key {key!a}, which cannot be written", "a name"
            continue
        if value is None or (isinstance(entry, Quantity) and not entry.many and _is(value, entry.kind)):
            continue
        below = f"{path}.{key}" if path else key
        if isinstance(entry, dict):
            yield from _wrong_block(value, entry, below)
        elif entry is None or entry.kind == "any":
            yield from _wrong_anything(value, below, 0)
        else:
            yield from _wrong_value(value, entry, below)


def _wrong_block(value: object, table: Table, path: str) -> Iterator[Wrong]:
    if isinstance(value, dict):
        yield from _wrong(value, table, path)
    elif isinstance(value, list):
        for number, record in enumerate(value):
            if isinstance(record, dict):
                yield from _wrong(record, table, f"{path}[{number}]")
            else:
                yield f"{path}[{number}]", f"holds {_shown(record)}", "a block of keys"
    else:
        yield path, f"holds {_shown(value)}", "a block of keys, or a list of them"


def _wrong_value(value: object, entry: Quantity, path: str) -> Iterator[Wrong]:
    if not entry.many:
        yield path, f"holds {_shown(value)}", WORDS[entry.kind]
    elif not isinstance(value, list):
        yield path, f"holds {_shown(value)}", "a list"
    else:
        yield from _wrong_list(value, entry, path)


def _wrong_list(values: list[Any], entry: Quantity, path: str) -> Iterator[Wrong]:
    for number, value in enumerate(values):
        if isinstance(value, list):  # a matrix, row by row
            yield from _wrong_list(value, entry, f"{path}[{number}]")
        elif value is not None and not _is(value, entry.kind):
            yield f"{path}[{number}]", f"holds {_shown(value)}", WORDS[entry.kind]


def _wrong_anything(value: object, path: str, depth: int) -> Iterator[Wrong]:
    """Check a value that is not described: its numbers are finite, its texts can be written."""
    if depth > DEEPEST:
        yield path, "is nested too deeply", "a value"
    elif isinstance(value, dict):
        for key, each in value.items():
            if _unwritable(key):
                yield path, f"holds the key {key!a}, which cannot be written", "a name"
            else:
                yield from _wrong_anything(each, f"{path}.{key}", depth + 1)
    elif isinstance(value, list):
        for number, each in enumerate(value):
            yield from _wrong_anything(each, f"{path}[{number}]", depth + 1)
    elif isinstance(value, str):
        if _unwritable(value):
            yield path, f"holds {_shown(value)}", WORDS["text"]
    elif value is not None and not isinstance(value, bool) and not _is(value, "number"):
        yield path, f"holds {_shown(value)}", WORDS["number"]


def _is(value: object, kind: str) -> bool:
    if isinstance(value, float):  # neither NaN nor infinite: they are not within any limits
        return kind == "number" and -LARGEST_NUMBER <= value <= LARGEST_NUMBER
    if isinstance(value, str):
        return kind in {"text", "word"} and not _unwritable(value)
    if isinstance(value, bool):
        return kind == "flag"
    most = LARGEST_COUNT if kind == "count" else LARGEST_NUMBER
    return kind in {"count", "number"} and isinstance(value, int) and -most <= value <= most


def _unwritable(text: str) -> bool:
    """Whether a text has halves of characters (surrogates) in it."""
    return not text.isascii() and any("\ud800" <= sign <= "\udfff" for sign in text)


def _shown(value: object) -> str:
    if isinstance(value, dict):
        return "a block of keys"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, str):
        return f"the text {value[:40]!a}" if _unwritable(value) else f"the text {value[:40]!r}"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and abs(value) > LARGEST_COUNT:
        return "a whole number that is too large"
    return f"{value}"
