"""result.json: written so that results can be compared line by line, and read."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from itertools import chain
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
    return _object(document, ("{\n", ",\n", "\n}\n"), _block, encode)


def _object(
    values: Document, around: tuple[str, str, str], write: Callable[[Plain, Encoder], Iterator[str]], encode: Encoder
) -> Iterator[str]:
    """Write keys with their values; around: what stands before, between and behind them."""
    before, between, behind = around
    for key, value in values.items():
        yield f"{before}{encode.text(key)}: "
        yield from write(value, encode)
        before = between
    yield behind


def _block(value: Plain, encode: Encoder) -> Iterator[str]:
    if value and (isinstance(value, Records) or (isinstance(value, list) and isinstance(value[0], dict))):
        yield "[\n"
        yield from _records(value, ",\n", encode)
        yield "\n]"
        return
    if isinstance(value, dict):
        parts = [[f"{encode.text(key)}: ", *_on_one_line(each, encode)] for key, each in value.items()]
        if sum(map(len, chain.from_iterable(parts))) + 2 * len(parts) > LONGEST_LINE:
            before = "{\n  "
            for part in parts:
                yield before
                yield from part
                before = ",\n  "
            yield "\n}"
            return
    yield from _on_one_line(value, encode)


def _records(records: Records | list[Document], between: str, encode: Encoder) -> Iterator[str]:
    """Write records, some at a time."""
    columns = records.columns.values() if isinstance(records, Records) else ()
    listed = max((len(column.values) for column in columns if isinstance(column, Grouped)), default=0)
    at_once = max(min(LINES, LISTED * len(records) // max(listed, 1)), 1)
    by_columns = len(records) >= FEW_LINES
    if by_columns and isinstance(records, Records):
        from photostrip.formats.output import json_lines  # with numpy, which nobody needs who reads a result

        records = json_lines.with_texts(records, encode)
    for start in range(0, len(records), at_once):
        if start:
            yield between
        yield _joined(records[start : start + at_once], between, encode, by_columns=by_columns)


def _joined(records: Records | list[Document], between: str, encode: Encoder, *, by_columns: bool) -> str:
    if by_columns:
        from photostrip.formats.output import json_lines

        columns = records.columns if isinstance(records, Records) else json_lines.columns_of(records)
        if columns is not None:
            return json_lines.joined(columns, between, encode)
    return between.join(map(encode.value, records))


def _on_one_line(value: Plain, encode: Encoder) -> Iterator[str]:
    if value and isinstance(value, dict):
        yield from _object(value, ("{", ", ", "}"), _on_one_line, encode)
    elif value and isinstance(value, Records):
        yield "["
        yield from _records(value, ", ", encode)
        yield "]"
    else:
        yield encode.value(value)


def text_of(file: str) -> str:
    """Read the text of a file of JSON."""
    return decode(file, read_bytes(file, LARGEST_RESULT))[0]


def parsed(file: str, block: Callable[[Document], Document] | None = None) -> Any:  # noqa: ANN401 (any JSON)
    """Read a file of JSON, or raise what keeps it from being one; `block` makes its blocks from dictionaries."""
    try:
        return json.loads(text_of(file), object_hook=block)
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

    return located(lambda block: parsed(file, block), file)


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
    whole: Document = located(lambda block: made_anew(document, block), file)  # of a script
    return whole
