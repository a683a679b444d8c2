"""A project without files: its blocks as a mapping, its tables as columns, read by the reader of files."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from math import isnan
from os import fspath
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.formats.files import Source, reading_from
from photostrip.formats.result_files import to_csv

if TYPE_CHECKING:
    from photostrip.notes import Finding, Note

T = TypeVar("T", "Fault", "Finding", "Note")
PROJECT, SPECIFICATION = "project", "specification"  # what mappings are called in messages


def source_of(name: str, content: Mapping[str, Any], tables: Mapping[str, Any]) -> Source:
    """Write a project, or a specification, and its tables as the files that they stand for; nothing touches the disk.

    tables: by the name under which the project names them (``file:``): a data frame, a structured array, or a mapping
        of names of columns to values. None, NaN and masked values are empty cells.
    """
    files = {each: _text(each, table) for each, table in tables.items()} | {name: text_of(content, name)}
    return Source({each: _encoded(text, each) for each, text in files.items()})


def text_of(value: Any, file: str, key: str = "") -> str:  # noqa: ANN401 (values of a project file)
    """Return a value as a project file has it; file and key are its place.

    Raises InputError for what no project file can hold.
    """
    try:
        return json.dumps(value, default=_plain, ensure_ascii=False, allow_nan=False)
    except (TypeError, ValueError) as error:
        message = f"holds a value that a project file cannot hold ({error})"
        raise InputError(Fault(message, "type", file, key=key, expected="texts, numbers, lists, mappings")) from None


@contextmanager
def in_memory(source: Source) -> Iterator[None]:
    """Read from memory; a fault of a mapping has its key, and no line, as it stands in no file."""
    try:
        with reading_from(source):
            yield
    except InputError as error:
        placed = InputError(unplaced(error.faults))
        placed.findings = unplaced(error.findings)
        raise placed from None


def unplaced(found: Iterable[T]) -> tuple[T, ...]:
    """Take its line from what was found in a mapping."""
    return tuple(replace(each, line=0, column=0) if each.file in {PROJECT, SPECIFICATION} else each for each in found)


def _plain(value: Any) -> Any:  # noqa: ANN401 (what JSON does not know)
    """Return a value of numpy or a path as a project file has it."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else fspath(value)


def _text(name: str, table: Any) -> str:  # noqa: ANN401 (data frames of any library)
    try:
        names = _names(table)
        columns = [_values(table[each]) for each in names]
    except (AttributeError, IndexError, KeyError, TypeError):
        expected = "a data frame, a structured array, or a mapping of names of columns to values"
        raise InputError(
            Fault(f"is a {type(table).__name__}, no table", "table-shape", name, expected=expected)
        ) from None
    lengths = {each: column.shape for each, column in zip(names, columns, strict=True)}
    if not names or any(len(shape) != 1 for shape in lengths.values()) or len(set(lengths.values())) > 1:
        found = ", ".join(f"{each} {shape}" for each, shape in lengths.items()) or "no columns"
        raise InputError(Fault(f"has columns of different shapes: {found}", "table-shape", name, expected="(n,) each"))
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return to_csv(map(str, names), ([_cell(value) for value in row] for row in rows))


def _names(table: Any) -> list[Any]:  # noqa: ANN401 (data frames of any library)
    """Return the names of the columns of a data frame, a structured array or a mapping."""
    if isinstance(table, np.ndarray):
        return list(table.dtype.names or ())
    for names in ("column_names", "columns"):  # arrow has both, the second are its values
        if hasattr(table, names):
            return list(getattr(table, names))
    return list(table.keys())


def _values(column: Any) -> np.ndarray[Any, Any]:  # noqa: ANN401 (columns of any library)
    """Return a column as an array; in a list every value stays what it is, as one text makes no texts of all."""
    return np.asarray(column, object) if isinstance(column, list | tuple) else np.asanyarray(column)


def _cell(value: object) -> object:
    if value is None or (isinstance(value, float) and isnan(value)) or type(value).__name__ == "NAType":  # of pandas
        return None
    return value.decode("utf-8", "surrogateescape") if isinstance(value, bytes) else value


def _encoded(text: str, file: str) -> bytes:
    try:
        return text.encode()
    except UnicodeEncodeError:
        raise InputError(Fault("is not valid Unicode text", "encoding", file)) from None
