"""result.json: written so that results can be compared line by line, and read."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from photostrip.errors import Fault, InputError
from photostrip.formats.output import json_encoder
from photostrip.formats.output.json_encoder import Encoder
from photostrip.formats.text.files import MEGABYTE, decode, read_bytes, refuse
from photostrip.notes import Document
from photostrip.result.records import Grouped, Records
from photostrip.visible import visible_json

if TYPE_CHECKING:
    from photostrip.result.numbers import Plain

LARGEST_RESULT = 1000 * MEGABYTE
SCHEMA = 1
LINES = 2000  # that are written at a time
LISTED = 20_000  # values of a column of lists that are written at a time
FEW_LINES = 300  # lines of a block below which their columns are not worth the trouble
LONGEST_LINE = 160  # characters up to which a dictionary stands on one line


def to_json(document: Document, *, ascii_only: bool = False) -> str:
    """Return the text of result.json.

    Each element of a list of records stands on a line of its own, so that results can be compared line by line.
    """
    return "".join(json_pieces(document, ascii_only=ascii_only))


def json_pieces(document: Document, *, ascii_only: bool = False) -> Iterator[str]:
    """Give the text of result.json piece by piece: with many points it takes as much memory as all else."""
    return map(visible_json, _pieces(document, json_encoder.ASCII if ascii_only else json_encoder.UNICODE))


def _pieces(document: Document, encode: Encoder) -> Iterator[str]:
    before = "{\n"
    for key, value in document.items():
        yield f"{before}{encode.text(key)}: "
        yield from _block(value, encode)
        before = ",\n"
    yield "\n}\n"


def _block(value: Plain, encode: Encoder) -> Iterator[str]:
    if value and (isinstance(value, Records) or (isinstance(value, list) and isinstance(value[0], dict))):
        columns = value.columns.values() if isinstance(value, Records) else ()
        listed = max((len(column.values) for column in columns if isinstance(column, Grouped)), default=0)
        at_once = max(min(LINES, LISTED * len(value) // max(listed, 1)), 1)
        for start in range(0, len(value), at_once):
            yield ",\n" if start else "[\n"
            yield _lines(value[start : start + at_once], encode, by_columns=len(value) >= FEW_LINES)
        yield "\n]"
        return
    if isinstance(value, dict):
        parts = [f"{encode.text(key)}: {_text(each, encode)}" for key, each in value.items()]
        if sum(map(len, parts)) + 2 * len(parts) > LONGEST_LINE:
            yield "{\n" + ",\n".join(f"  {part}" for part in parts) + "\n}"
            return
    yield _text(value, encode)


def _lines(records: Records | list[Document], encode: Encoder, *, by_columns: bool) -> str:
    """Write each record on a line of its own."""
    if by_columns:
        from photostrip.formats.output import json_lines  # with numpy, which nobody needs who reads a result

        columns = records.columns if isinstance(records, Records) else json_lines.columns_of(records)
        if columns is not None:
            return json_lines.lines(columns, encode)
    return ",\n".join(map(encode.value, records))


def _text(value: Plain, encode: Encoder) -> str:
    if isinstance(value, dict):
        return f"{{{', '.join(f'{encode.text(key)}: {_text(each, encode)}' for key, each in value.items())}}}"
    return encode.value(value)


def parsed(file: str, block: Callable[[Document], Document] | None = None) -> Any:  # noqa: ANN401 (any JSON)
    """Read a file of JSON, or raise what keeps it from being one; `block` makes its blocks from dictionaries."""
    text, _ = decode(file, read_bytes(file, LARGEST_RESULT))
    try:
        return json.loads(text, object_hook=block)
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
    document = _located(file)
    if isinstance(document, dict) and key in document:
        return document
    return checked(document, file)


def read_result(file: str) -> Document:
    """Read a result.json, or raise what keeps it from being one."""
    return checked(_located(file), file)


def _located(file: str) -> Any:  # noqa: ANN401 (any JSON)
    from photostrip.result.reading import located

    return located(lambda block: parsed(file, block))


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
    from photostrip.result.reading import Located, faults_of, located, made_anew

    try:
        faults = faults_of(document, file)
    except RecursionError:
        refuse(file, "result-json", "is nested too deeply", expected="a result.json of photostrip")
    if faults:
        raise InputError(faults)
    if isinstance(document, Located):
        return document
    whole: Document = located(lambda block: made_anew(document, block))  # of a script
    return whole
