"""A result that is read again, checked against the description of its keys: a user may have edited the file.

A key that is missing is told where it is asked for, with the keys that lead to it: a baseline holds a part only. Every
value is of the kind that its key is described with, every number is finite and every text can be written. The values of
a key in all records are looked at together, in a tenth of the time; where something is wrong, one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from itertools import chain, islice
from math import hypot
from types import NoneType
from typing import Any, ClassVar

from photostrip.errors import Fault, InputError
from photostrip.result.description import Quantity, Table, described, lists

LARGEST_NUMBER = 1e100  # its square is a number yet
LARGEST_COUNT = 10**15
MOST_FAULTS = 20
DEEPEST = 50  # lists and blocks in each other
MAY_BE_NULL = {"choices.left_out", "corrections.interior", "models.elements", "photos.sigma"}  # blocks of keys
WORDS = {"text": "a text", "word": "a text", "count": "a whole number", "flag": "true or false", "number": "a number"}


def faults_of(
    document: dict[str, Any], file: str, table: Table | None = None, fix: str = "run the project again"
) -> list[Fault]:
    """Return what keeps a document from being a result, or what a table describes: wrong kinds of values, by key.

    Keys that are missing are not among them: a baseline holds a part of a result only.
    """
    whole = described() if table is None else table
    shapes = [] if table else list(islice(_misshapen(document, whole, ""), MOST_FAULTS))
    if not shapes and _blocks_right([document], whole):
        return []
    found: list[Fault] = []
    for key, message, expected in shapes or _wrong(document, whole, ""):
        found.append(Fault(message, "result-value", file, key=key, expected=expected, fix=fix))
        if len(found) == MOST_FAULTS:
            break
    return found


Wrong = tuple[str, str, str]  # key, what is wrong with it, what is expected there


class Located(dict[str, Any]):
    """A block of a saved result, which says of what file it is and which keys lead to one that it lacks."""

    __slots__ = ()
    document: ClassVar[list[Any]]  # the only element; of a class for the blocks of each document
    file: ClassVar[str]

    def __missing__(self, key: str) -> Any:  # noqa: ANN401 (it never returns)
        path = next(_paths_to(self, self.document[0], ""), "")
        message = f"key '{path}.{key}' is missing" if path else f"key '{key}' is missing"
        fix = "run the project again"
        raise InputError(Fault(message, "result-incomplete", self.file, expected="a whole result.json", fix=fix))

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        """Travel and be copied as a dictionary: the class is known to this document only."""
        return (_found_again, (dict(self), self.file)) if self is self.document[0] else (dict, (dict(self),))


def located(made: Callable[[type[Located]], Any], file: str) -> Any:  # noqa: ANN401 (any document)
    """Give the document of a file, whose blocks know it.

    made: makes the document with the class of its blocks, which takes the dictionary of each.
    """

    class Block(Located):  # not a function that tells each block its document: a result has tens of thousands
        __slots__ = ()
        document: ClassVar[list[Any]] = []

    Block.file = file
    Block.document.append(made(Block))
    return Block.document[0]


def made_anew(value: Any, block: type[Located]) -> Any:  # noqa: ANN401 (any part of a document)
    """Make the blocks of a document that is there already."""
    if isinstance(value, dict):
        return block({key: made_anew(each, block) for key, each in value.items()})
    return [made_anew(each, block) for each in value] if isinstance(value, list) else value


def _found_again(document: dict[str, Any], file: str) -> Any:  # noqa: ANN401 (any document)
    return located(lambda block: made_anew(document, block), file)


def _paths_to(block: Located, value: object, path: str) -> Iterator[str]:
    if value is block:
        yield path
    elif isinstance(value, dict):
        for key, each in value.items():
            yield from _paths_to(block, each, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        for number, each in enumerate(value):
            yield from _paths_to(block, each, f"{path}[{number}]")


def _misshapen(block: dict[str, Any], table: Table, path: str, place: str = "") -> Iterator[Wrong]:
    """Check that lists of records are lists, and other blocks are none; a null is one of few.

    path, place: the keys that lead to the block, without and with the numbers of records.
    """
    for key, below in table.items():
        if not isinstance(below, dict) or key not in block:
            continue
        value, name, here = block[key], f"{path}{key}", f"{place}{key}"
        if name in lists():
            if not isinstance(value, list):
                yield here, f"holds {_shown(value)}", "a list of blocks"
            elif any(isinstance(each, dict) for each in below.values()):
                for number, record in enumerate(value):
                    if isinstance(record, dict):
                        yield from _misshapen(record, below, f"{name}.", f"{here}[{number}].")
        elif isinstance(value, dict):
            yield from _misshapen(value, below, f"{name}.", f"{here}.")
        elif value is not None or name not in MAY_BE_NULL:
            yield here, f"holds {_shown(value)}", "a block of keys"


def _blocks_right(blocks: Sequence[dict[str, Any]], table: Table) -> bool:
    """Whether nothing is wrong with blocks that are described alike."""
    for key, values in _by_key(blocks):
        entry = table.get(key)
        if (entry is None and _unwritable(key)) or not _right(values, entry):
            return False
    return True


def _by_key(blocks: Sequence[dict[str, Any]]) -> Iterator[tuple[str, Sequence[Any]]]:
    """Give each key with its values in all blocks, None where a block lacks it."""
    keys = [*blocks[0]] if blocks else []
    if list(chain.from_iterable(blocks)) == keys * len(blocks):  # as photostrip writes them: no key is looked up
        values = list(chain.from_iterable(map(dict.values, blocks)))
        for place, key in enumerate(keys):
            yield key, values[place :: len(keys)]
        return
    for key in set().union(*blocks):
        yield key, [block.get(key) for block in blocks]


def _right(values: Sequence[Any], entry: Quantity | Table | None) -> bool:
    """Whether nothing is wrong with the values of a key, or with what is in the lists that stand there."""
    kinds = set(map(type, values))
    if NoneType in kinds:  # which may stand under any key
        return _right([value for value in values if value is not None], entry)
    if not kinds:
        return True
    within, listed = values, kinds == {list}
    if listed:
        within = list(chain.from_iterable(values))
        kinds = set(map(type, within))
    if isinstance(entry, dict):
        if all(issubclass(kind, dict) for kind in kinds):
            return _blocks_right(within, entry)
    else:
        kind = entry.kind if entry else "any"
        if (kind == "any" or (entry and entry.many == listed)) and _alike(within, kinds, kind):
            return True
    return not any(True for value in values for _ in _wrong_entry(value, entry, ""))


def _alike(values: Sequence[Any], kinds: AbstractSet[object], kind: str) -> bool:
    """Whether values are certainly of a kind, None aside: of one type, and together not too large."""
    present = [*filter(None, values)] if NoneType in kinds else values
    only = kinds - {NoneType}
    if only == {str}:
        return _is("".join(present), kind)
    if only == {float}:
        return _is(hypot(*present), kind)  # not finite where one is not, else as large as the largest at least
    if only == {int}:
        return _is(sum(map(abs, present)), kind)
    return not only or (only == {bool} and kind in {"flag", "any"})


def _wrong(block: dict[str, Any], table: Table, path: str) -> Iterator[Wrong]:
    """Check the keys of a block; of keys that are not described, what all values have in common."""
    for key, value in block.items():
        entry = table.get(key)
        if entry is None and _unwritable(key):
            yield path, f"holds the key {key!a}, which cannot be written", "a name"
            continue
        yield from _wrong_entry(value, entry, f"{path}.{key}" if path else key)


def _wrong_entry(value: object, entry: Quantity | Table | None, path: str) -> Iterator[Wrong]:
    if isinstance(entry, dict):
        yield from _wrong_block(value, entry, path)
    elif entry is None or entry.kind == "any":
        yield from _wrong_anything(value, path, 0)
    elif value is not None:
        yield from _wrong_value(value, entry, path)


def _wrong_block(value: object, table: Table, path: str) -> Iterator[Wrong]:
    if isinstance(value, dict):
        yield from _wrong(value, table, path)
    elif isinstance(value, list):
        for number, record in enumerate(value):
            if isinstance(record, dict):
                yield from _wrong(record, table, f"{path}[{number}]")
            else:
                yield f"{path}[{number}]", f"holds {_shown(record)}", "a block of keys"
    elif value is not None:
        yield path, f"holds {_shown(value)}", "a block of keys, or a list of them"


def _wrong_value(value: object, entry: Quantity, path: str) -> Iterator[Wrong]:
    if not entry.many:
        if not _is(value, entry.kind):
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
    """Whether a value is of a kind; any number, text or flag that is sound is of kind ``any``."""
    if isinstance(value, float):  # neither NaN nor infinite: they are not within any limits
        return kind in {"number", "any"} and -LARGEST_NUMBER <= value <= LARGEST_NUMBER
    if isinstance(value, str):
        return kind in {"text", "word", "any"} and not _unwritable(value)
    if isinstance(value, bool):
        return kind in {"flag", "any"}
    most = LARGEST_COUNT if kind == "count" else LARGEST_NUMBER
    return kind in {"count", "number", "any"} and isinstance(value, int) and -most <= value <= most


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
    if value is None or isinstance(value, bool):
        return "null" if value is None else str(value).lower()
    if isinstance(value, int) and abs(value) > LARGEST_COUNT:
        return "a whole number that is too large"
    return f"{value}"
