"""Records as lines of JSON, column by column."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate, chain
from operator import attrgetter
from types import NoneType
from typing import TYPE_CHECKING

import numpy as np

from photostrip.formats.text import number_columns
from photostrip.formats.text.number_columns import Cells
from photostrip.result.numbers import Plain, RoundedColumn
from photostrip.result.records import Grouped, Records

if TYPE_CHECKING:
    from photostrip.formats.output.json_encoder import Encoder

kind_of = attrgetter("__class__")  # in a third of the time of a loop


def joined(columns: Mapping[str, Sequence[Plain]], between: str, encode: Encoder) -> str:
    """Write records, given as columns, one after the other with something between them."""
    count = len(next(iter(columns.values())))
    return number_columns.joined([*_objects(columns, encode), number_columns.repeated(between, count)])[: -len(between)]


def columns_of(records: Sequence[Mapping[str, Plain]]) -> dict[str, list[Plain]] | None:
    """Turn records with the same keys into columns."""
    keys = list(records[0])
    if not keys or any(list(record) != keys for record in records):
        return None
    return {key: [record[key] for record in records] for key in keys}


def _objects(columns: Mapping[str, Sequence[Plain]], encode: Encoder) -> list[Cells]:
    parts, sign = [], "{"
    for key, column in columns.items():
        parts += [number_columns.repeated(f"{sign}{encode.text(key)}: ", len(column)), _cells(column, encode)]
        sign = ", "
    return [*parts, number_columns.repeated("}", len(column))]


def _cells(column: Sequence[Plain], encode: Encoder) -> Cells:
    if isinstance(column, RoundedColumn) and column.values.ndim == 1:
        return number_columns.as_repr(np.where(np.isfinite(column.values), column.values, np.nan), "null")
    if isinstance(column, Records):
        return np.concatenate(_objects(column.columns, encode))
    kinds: set[type] = set() if isinstance(column, Grouped) else set(map(kind_of, column))
    if kinds == {list}:
        column = Grouped(list(chain.from_iterable(column)), [0, *accumulate(map(len, column))])
    if isinstance(column, Grouped):
        return number_columns.listed(_cells(column.values, encode), column.ends)
    if _of_numbers(kinds):
        return _numbers(column, kinds, encode)
    if kinds == {dict} and (parts := columns_of(column)) is not None:
        return np.concatenate(_objects(parts, encode))
    return number_columns.as_texts(_texts(column, kinds, encode))


def _texts(column: Sequence[Plain], kinds: set[type], encode: Encoder) -> list[str]:
    if kinds == {str}:
        return list(map(encode.text, column))
    if kinds <= {str, bool, NoneType}:
        written = {value: encode.value(value) for value in set(column)}
        return [written[value] for value in column]
    return [encode.value(value) for value in column]


def _of_numbers(kinds: set[type]) -> bool:
    return kinds == {int} or (float in kinds and kinds <= {float, NoneType})


def _numbers(column: Sequence[Plain], kinds: set[type], encode: Encoder) -> Cells:
    if kinds == {int}:
        return number_columns.as_whole(np.array(column, np.int64))
    values = np.array(column, float)
    if np.count_nonzero(np.isfinite(values)) + column.count(None) < len(column):
        encode.value(list(column))  # refuses what is no number
    return number_columns.as_repr(values, "null")
