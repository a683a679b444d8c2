"""result.json: written so that results can be compared line by line, and read."""

from __future__ import annotations

import json
from math import isfinite
from types import NoneType
from typing import TYPE_CHECKING, Any

from photostrip.errors import Fault, InputError
from photostrip.formats.text.files import MEGABYTE, decode, read_bytes, refuse
from photostrip.result.reading import faults_of, located
from photostrip.result.records import Records
from photostrip.visible import visible_json

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from photostrip.result.numbers import Document, Plain

LARGEST_RESULT = 1000 * MEGABYTE
SCHEMA = 1
LINES = 1000  # that are written at a time
LINE = 160  # characters up to which a dictionary stands on one line

_encode = json.JSONEncoder(ensure_ascii=False, allow_nan=False, default=list).encode
_encode_ascii = json.JSONEncoder(ensure_ascii=True, allow_nan=False, default=list).encode


def to_json(document: Document, *, ascii_only: bool = False) -> str:
    """Return the text of result.json.

    Each element of a list of records stands on a line of its own, so that results can be compared line by line.
    """
    encode = _encode_ascii if ascii_only else _encode
    return "".join(map(visible_json, _pieces(document, encode)))


def _pieces(document: Document, encode: Callable[[Plain], str]) -> Iterator[str]:
    """Give the text piece by piece, to be joined once: a text of many points is not copied from block to whole."""
    before = "{\n"
    for key, value in document.items():
        yield f"{before}{encode(key)}: "
        yield from _block(value, encode)
        before = ",\n"
    yield "\n}\n"


def _block(value: Plain, encode: Callable[[Plain], str]) -> Iterator[str]:
    if isinstance(value, Records) and len(value):
        for start in range(0, len(value), LINES):
            yield ",\n" if start else "[\n"
            yield ",\n".join(_lines(value[start : start + LINES], encode))
        yield "\n]"
        return
    if isinstance(value, list) and value and isinstance(value[0], dict):
        # One call for the whole list, lines broken afterwards, in front of the first key of each record. Inside a
        # string these signs cannot stand, its quotation marks being escaped; between records a line feed is a blank.
        begin = f"{{{encode(next(iter(value[0])))}: "
        yield "[\n" + encode(value)[1:-1].replace(f"}}, {begin}", f"}},\n{begin}") + "\n]"
        return
    if isinstance(value, dict):
        parts = [f"{encode(key)}: {_text(each, encode)}" for key, each in value.items()]
        if sum(map(len, parts)) + 2 * len(parts) > LINE:
            yield "{\n" + ",\n".join(f"  {part}" for part in parts) + "\n}"
            return
    yield _text(value, encode)


def _text(value: Plain, encode: Callable[[Plain], str]) -> str:
    """Write a value on one line."""
    if isinstance(value, Records):
        return f"[{', '.join(_lines(value, encode))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{encode(key)}: {_text(each, encode)}' for key, each in value.items())}}}"
    return encode(value)


def _lines(records: Records, encode: Callable[[Plain], str]) -> Iterator[str]:
    line = f"{{{', '.join(f'{encode(key)}: %s' for key in records.columns)}}}"
    return (line % row for row in zip(*(_cells(each, encode) for each in records.columns.values()), strict=True))


def _cells(column: Sequence[Plain], encode: Callable[[Plain], str]) -> Iterable[Plain]:
    """Write the values of a column; numbers stay, being written in JSON as Python writes them."""
    kinds = set(map(type, column))
    if kinds <= {float, int, NoneType} and isfinite(sum(filter(None, column))):
        return column if NoneType not in kinds else ["null" if value is None else value for value in column]
    if kinds <= {str, bool}:
        written = {value: encode(value) for value in set(column)}
        return map(written.__getitem__, column)
    for kind, begin, end in ((list, "[", "]"), (dict, "{", "}")):
        cells = encode(column)[2:-2].split(f"{end}, {begin}") if kinds == {kind} else ()
        if len(cells) == len(column):  # no cell holds these signs within it
            return (f"{begin}{cell}{end}" for cell in cells)
    return map(encode, column)


def parsed(file: str) -> Any:  # noqa: ANN401 (any JSON)
    """Read a file of JSON, or raise what keeps it from being one."""
    text, _ = decode(file, read_bytes(file, LARGEST_RESULT))
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        message = f"is not JSON: {error.msg[:1].lower()}{error.msg[1:]}"
        fix = "a result.json that was not written to its end? run the project again"
        raise InputError(
            Fault(message=message, code="result-json", file=file, line=error.lineno, column=error.colno, fix=fix)
        ) from None
    except ValueError:  # Python reads 4300 digits
        refuse(file, "result-json", "holds a number with thousands of digits", expected="a result.json of photostrip")
    except RecursionError:
        refuse(file, "result-json", "is nested too deeply", expected="a result.json of photostrip")


def read_document(file: str, key: str) -> Document:
    """Read a document of another kind, which has this key, or else a result.json."""
    document = parsed(file)
    if isinstance(document, dict) and key in document:
        return document
    return checked(document, file)


def read_result(file: str) -> Document:
    """Read a result.json, or raise what keeps it from being one."""
    return checked(parsed(file), file)


def checked(document: Any, file: str) -> Document:  # noqa: ANN401 (any JSON)
    """Return a result that was read from a file, or is called that, or raise what keeps it from being one."""
    if not isinstance(document, dict) or "photostrip_result" not in document:
        refuse(file, "result-kind", "has no key `photostrip_result`", expected="a result.json of photostrip")
    if document["photostrip_result"] != SCHEMA:
        refuse(
            file,
            "result-schema",
            f"has the result format {document['photostrip_result']!a:.40}",
            expected=str(SCHEMA),
            fix="run the project again with this version of photostrip",
        )
    try:
        faults = faults_of(document, file)
    except RecursionError:
        refuse(file, "result-json", "is nested too deeply", expected="a result.json of photostrip")
    if faults:
        raise InputError(faults)
    whole: Document = located(document)
    return whole
