"""result.json: blocks of keys, and tables as blocks of columns; each block, key of one and column on a line."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Iterator
from typing import Any

from photostrip.formats.files import MEGABYTE, decode, read_bytes, refuse
from photostrip.formats.tables import parsed_json
from photostrip.notes import Document
from photostrip.result.derived import with_derived
from photostrip.result.description import LEFT_OUT, SCHEMA
from photostrip.result.reading import read
from photostrip.result.table import Table, in_frame, stored
from photostrip.visible import visible_json

RESULT = "a result.json of photostrip"
LARGEST_RESULT = 1000 * MEGABYTE
LONGEST_LINE = 160  # characters up to which a block stands on one line


def to_json(document: Document, *, ascii_only: bool = False) -> str:
    """Return a document as JSON, as result.json is written."""
    return "".join(json_pieces(document, ascii_only=ascii_only))


def json_pieces(document: Document, *, ascii_only: bool = False) -> Iterator[str]:
    """Give the text of result.json piece by piece: with many points it takes as much memory as all else."""
    encode = json.JSONEncoder(ensure_ascii=ascii_only, allow_nan=False, separators=(",", ":"), default=list).encode
    return map(visible_json, _pieces(document, "", encode))


def _pieces(value: Any, indent: str, encode: Any) -> Iterator[str]:  # noqa: ANN401 (any part of a document)
    if isinstance(value, Table):
        items: Any = stored(value).items()
    elif isinstance(value, dict) and (not indent or _has_tables(value) or len(encode(value)) > LONGEST_LINE):
        items = value.items()
    elif isinstance(value, list) and value and isinstance(value[0], dict):  # rows of a document that has no tables
        yield "[\n" + ",\n".join(map(encode, value)) + "\n]"
        return
    else:
        yield encode(value)
        return
    before = "{\n"
    for key, each in items:
        yield f"{before}{indent}{encode(key)}: "
        yield from _pieces(each, f"{indent} ", encode)
        before = ",\n"
    yield "{}" if before == "{\n" else "\n}" if indent else "\n}\n"


def _has_tables(value: Any) -> bool:  # noqa: ANN401 (any part of a document)
    return isinstance(value, Table) or (isinstance(value, dict) and any(map(_has_tables, value.values())))


def on_one_line(value: Any) -> str:  # noqa: ANN401 (any JSON)
    return json.dumps(value, ensure_ascii=False, allow_nan=False, default=list)


def text_of(file: str) -> str:
    """Read the text of a file of JSON."""
    return decode(file, read_bytes(file, LARGEST_RESULT))[0]


def parsed(file: str) -> Any:  # noqa: ANN401 (any JSON)
    """Read a file of JSON, or raise what keeps it from being one."""
    fix = "a result.json that was not written to its end? run the project again"
    return parsed_json(text_of(file), file, "result-json", expected=RESULT, fix=fix)


def read_result(file: str) -> Document:
    """Read a result.json, or raise what keeps it from being one."""
    return checked(parsed(file), file)


def read_baseline(file: str) -> Document:
    """Read a result.json or what is kept of one as a baseline."""
    return checked(parsed(file), file, LEFT_OUT)


def checked(document: Any, file: str, lacking: Collection[str] = ()) -> Document:  # noqa: ANN401 (any JSON)
    """Return a result with its tables from what JSON has of it, or raise what keeps it from being one.

    lacking: blocks that it may lack.
    """
    if not isinstance(document, dict) or "photostrip_result" not in document:
        refuse(file, "result-kind", "has no key `photostrip_result`", expected=RESULT)
    if document["photostrip_result"] != SCHEMA:
        refuse(
            file,
            "result-schema",
            f"has the result format {document['photostrip_result']!a:.40}",
            expected=str(SCHEMA),
            fix="run the project again with this version of photostrip",
        )
    try:
        whole = read(document, file, lacking=lacking)
    except RecursionError:
        refuse(file, "result-json", "is nested too deeply", expected=RESULT)
    from photostrip.result.certificate import faults_of_edited  # with scipy

    with faults_of_edited("read", (whole, file)):
        return in_frame(with_derived(whole))


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
