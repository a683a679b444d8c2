"""A project without files: its blocks as a mapping, its tables as columns, read by the reader of files."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from math import isnan
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.formats.files import Source, reading_from
from photostrip.formats.result_files import to_csv

if TYPE_CHECKING:
    from photostrip.notes import Finding, Note

T = TypeVar("T", "Fault", "Finding", "Note")
FILE = "file"  # key of the table of a block
NAMING = "photo", "point"  # columns of which every table has one; as keys of a block they hold one name
MANY = "as many tables, in a list, each with columns by name"
TABLE = "a data frame, a structured array, or a mapping of names of columns to values"
PROJECT, SPECIFICATION = "project", "specification"  # what mappings are called in messages


def source_of(name: str, content: Mapping[str, Any]) -> Source:
    """Write a project, or a specification, and its tables as the files that they stand for; nothing touches the disk.

    content: with tables in place of the names of files: data frames, structured arrays, or mappings of names of columns
        to values. None, NaN and masked values are empty cells. In messages a table is called as its block.
    """
    tables: dict[str, Any] = {}
    files = {name: text_of(_named(content, "", tables), name)}
    files |= {each: _text(each, table) for each, table in tables.items()}
    return Source({each: _encoded(text, each) for each, text in files.items()})


def with_tables(content: Mapping[str, Any], overrides: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Take tables among overrides, ``observations=table``, into the blocks of a project; return it and the others.

    A list of blocks takes a list of tables, one of a single block a table alone.
    Raises InputError where the tables of a list are not as many as its blocks.
    """
    found, rest = {**content}, dict[str, Any]()
    for key, value in overrides.items():
        block, tables = found.get(key, {}), value if isinstance(value, list) else [value]
        if not tables or not all(map(_is_frame, tables)):
            rest[key] = value
        elif isinstance(block, list) and len(block) == len(tables):
            found[key] = [{**each, FILE: table} for each, table in zip(block, tables, strict=True)]
        elif isinstance(block, Mapping) and len(tables) == 1:
            found[key] = {**block, FILE: tables[0]}
        else:
            count = len(block) if isinstance(block, list) else 1
            message = f"{len(tables)} tables are given for {count} of `{key}`"
            raise InputError(Fault(message, "table-shape", PROJECT, key=key, expected=MANY))
    return found, rest


def _is_frame(value: object) -> bool:
    """Whether a value can be a table only: a data frame of any library, an array, or columns by name."""
    columns = [value.get(each, "") for each in NAMING] if isinstance(value, Mapping) else []
    by_name = any(hasattr(each, "__len__") and not isinstance(each, str) for each in columns)
    return hasattr(value, "columns") or isinstance(value, np.ndarray) or by_name


def _named(value: Any, path: str, tables: dict[str, Any]) -> Any:  # noqa: ANN401 (values of a project file)
    """Return a value with names in place of tables, which are taken out, each named as the block that holds it."""
    if isinstance(value, list | tuple):
        return [_named(each, f"{path}[{k}]" if len(value) > 1 else path, tables) for k, each in enumerate(value)]
    if not isinstance(value, Mapping):
        return value
    found = {}
    for key, each in value.items():
        if key == FILE and not isinstance(each, str | PathLike):
            found[key] = _table_names(each, path, tables)
        else:
            found[key] = _named(each, f"{path}.{key}" if path else str(key), tables)
    return found


def _table_names(given: Any, path: str, tables: dict[str, Any]) -> Any:  # noqa: ANN401 (tables of any library)
    """Return the name of a table, or names of several in a list."""
    if isinstance(given, list) and given:
        several = (f"{path}.{FILE}[{k}]" for k in range(len(given)))
        return [each if isinstance(each, str) else _table_names(each, next(several), tables) for each in given]
    tables[path] = given
    return path


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
        message = f"is a {type(table).__name__}, no table"
        raise InputError(Fault(message, "table-shape", name, expected=TABLE)) from None
    lengths = {each: column.shape for each, column in zip(names, columns, strict=True)}
    if not names or (isinstance(table, Mapping) and () in lengths.values()):
        raise InputError(Fault("has no columns with names", "table-shape", name, expected=TABLE))
    if any(len(shape) != 1 for shape in lengths.values()) or len(set(lengths.values())) > 1:
        found = ", ".join(f"{each} {shape}" for each, shape in lengths.items())
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
