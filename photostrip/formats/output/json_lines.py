"""Records as lines of JSON, column by column."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import accumulate, chain
from operator import attrgetter
from types import NoneType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from photostrip import number_columns
from photostrip.number_columns import Cells, Column, Texts
from photostrip.result.numbers import Plain, RoundedColumn
from photostrip.result.records import Grouped, Named, Records

if TYPE_CHECKING:
    from photostrip.formats.output.json_encoder import Encoder

FLAGS = "false", "true"
kind_of = attrgetter("__class__")  # in a third of the time of a loop


def joined(columns: Mapping[str, Sequence[Plain]], between: str, encode: Encoder) -> str:
    """Write records, given as columns, one after the other with something between them."""
    return number_columns.joined(_objects(columns, encode), between)


def columns_of(records: Sequence[Mapping[str, Plain]]) -> dict[str, list[Plain]] | None:
    """Turn records with the same keys into columns."""
    keys = list(records[0])
    if not keys or any(list(record) != keys for record in records):
        return None
    return {key: [record[key] for record in records] for key in keys}


def with_texts(records: Records, encode: Encoder) -> Records:
    """Write the texts that stand once for all records, however many of these are written at a time."""
    return Records({key: _with_texts(column, encode) for key, column in records.columns.items()})


def _with_texts(column: Sequence[Plain], encode: Encoder) -> Sequence[Plain]:
    if isinstance(column, Records):
        return with_texts(column, encode)
    if isinstance(column, Grouped):
        return Grouped(_with_texts(column.values, encode), column.ends)
    return Named(_encoded(tuple(column.names), encode), column.numbers) if isinstance(column, Named) else column


@lru_cache(maxsize=2)  # the points of a result stand in several blocks
def _encoded(names: tuple[str, ...], encode: Encoder) -> Texts:
    return number_columns.texts_of(list(map(encode.text, names)))


def _objects(columns: Mapping[str, Sequence[Plain]], encode: Encoder) -> list[Column]:
    parts: list[Column] = []
    sign = "{"
    for key, column in columns.items():
        parts += [number_columns.repeated(f"{sign}{encode.text(key)}: ", len(column)), *_parts(column, encode)]
        sign = ", "
    return [*parts, number_columns.repeated("}", len(column))]


def _parts(column: Sequence[Plain], encode: Encoder) -> list[Column]:
    if isinstance(column, RoundedColumn) and column.values.ndim > 1:
        each = column.values.shape[1]
        column = Grouped(RoundedColumn(column.values.ravel()), range(0, column.values.size + 1, each))
    if isinstance(column, Records):
        return _objects(column.columns, encode)
    kinds: set[type] = set() if isinstance(column, RoundedColumn | Named | Grouped) else set(map(kind_of, column))
    if kinds == {list}:
        column = Grouped(list(chain.from_iterable(column)), [0, *accumulate(map(len, column))])
    if isinstance(column, Grouped):
        return [number_columns.listed(_cells(column.values, encode), column.ends)]
    if kinds == {dict} and (parts := columns_of(column)) is not None:
        return _objects(parts, encode)
    return [_cells(column, encode)]


def _cells(column: Sequence[Plain], encode: Encoder) -> Cells:
    if isinstance(column, Named):
        return number_columns.as_texts(np.asarray(column.names)[column.numbers])
    if isinstance(column, RoundedColumn):
        return _of_array(column.values)
    kinds = set(map(kind_of, column))
    if _of_numbers(kinds):
        return _numbers(column, kinds, encode)
    return number_columns.as_texts(_texts(column, kinds, encode))


def _of_array(values: NDArray[Any]) -> Cells:
    if values.dtype.kind == "f":
        return number_columns.as_repr(values, "null")
    return number_columns.as_whole(values) if values.dtype.kind in "iu" else number_columns.as_flags(values, FLAGS)


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
