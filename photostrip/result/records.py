"""Records of the document of a result, kept as columns; read without mathematics."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, cast, overload

from photostrip.notes import Document

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.arrays import Numbers
    from photostrip.result.numbers import Plain


class Row(Mapping[str, Any]):
    """A record that is not made: 50 bytes in place of 1400 for a given point."""

    __slots__ = ("columns", "place")

    def __init__(self, columns: Mapping[str, Sequence[Plain]], place: int) -> None:
        self.columns, self.place = columns, place

    def __getitem__(self, key: str) -> Plain:
        return self.columns[key][self.place]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)


class Named(Sequence[str]):
    """A column of texts of which many are the same: each text stands once, the column holds its number."""

    def __init__(self, names: Sequence[Any] | NDArray[Any], numbers: NDArray[Any]) -> None:
        self.names, self.numbers = names, numbers

    def __len__(self) -> int:
        return len(self.numbers)

    @overload
    def __getitem__(self, place: int) -> str: ...
    @overload
    def __getitem__(self, place: slice) -> Named: ...
    def __getitem__(self, place: int | slice) -> str | Named:
        if isinstance(place, slice):
            return Named(self.names, self.numbers[place])
        return str(self.names[self.numbers[place]])

    def __iter__(self) -> Iterator[str]:
        return map(self.names.__getitem__, self.numbers.tolist())

    def taken(self, order: Numbers) -> Named:
        return Named(self.names, self.numbers[order])


class Grouped(Sequence[list[Any]]):
    """A column of lists, kept as one column of their values."""

    def __init__(self, values: Sequence[Plain], ends: Sequence[int]) -> None:
        self.values, self.ends = values, ends  # of each list, its first value and that of the next

    def __len__(self) -> int:
        return len(self.ends) - 1

    @overload
    def __getitem__(self, place: int) -> list[Plain]: ...
    @overload
    def __getitem__(self, place: slice) -> Grouped: ...
    def __getitem__(self, place: int | slice) -> list[Plain] | Grouped:
        if isinstance(place, slice):
            start, stop, _ = place.indices(len(self))
            ends = self.ends[start : stop + 1]
            return Grouped(self.values[ends[0] : ends[-1]], [end - ends[0] for end in ends])
        first = place if place >= 0 else place + len(self)
        start, stop = self.ends[first], self.ends[first + 1]
        return list(self.values[start:stop]) if start < stop else []

    def __iter__(self) -> Iterator[list[Plain]]:
        values = list(self.values)
        return (values[start:stop] for start, stop in pairwise(self.ends))


class Records(Sequence[dict[str, Any]]):
    """Records as they are written, kept as columns of equal length: a record is made when it is asked for."""

    def __init__(self, columns: Mapping[str, Sequence[Plain]]) -> None:
        self.columns = dict(columns)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def __iter__(self) -> Iterator[Document]:
        return (dict(zip(self.columns, row, strict=True)) for row in zip(*self.columns.values(), strict=True))

    @overload
    def __getitem__(self, place: int) -> Document: ...
    @overload
    def __getitem__(self, place: slice) -> Records: ...
    def __getitem__(self, place: int | slice) -> Document | Records:
        found = {key: column[place] for key, column in self.columns.items()}
        return Records(found) if isinstance(place, slice) else found

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]

    def only(self, *keys: str) -> Records:
        """Return records of some keys: going through records makes the values of all their columns at once."""
        return Records({key: self.columns[key] for key in keys})

    def rows(self) -> list[Row]:
        """Return records that read their values when they are asked for."""
        return [Row(self.columns, place) for place in range(len(self))]

    def taken(self, order: Numbers) -> Records:
        places, columns = order.tolist(), cast("dict[str, Any]", self.columns)
        taken = {
            key: [column[place] for place in places] if isinstance(column, list) else column.taken(order)
            for key, column in columns.items()
        }
        return Records(taken)

    @classmethod
    def joined(cls, parts: Iterable[Records]) -> Records:
        columns: dict[str, list[Plain]] = {}
        tables = list(parts)
        if len(tables) == 1:
            return tables[0]
        for part in tables:
            for key, column in part.columns.items():
                columns.setdefault(key, []).extend(column)
        return cls(columns)


def as_lists(value: Plain) -> Plain:
    """Return a document with lists of records in place of columns, as it is read again."""
    if isinstance(value, dict):
        found = {key: as_lists(each) for key, each in value.items()}
        return value if all(found[key] is each for key, each in value.items()) else found  # saved ones hold lists
    return list(value) if isinstance(value, Records) else value


def column_of(rows: Records | Sequence[Mapping[str, Plain]], key: str, *, optional: bool = False) -> Sequence[Plain]:
    """Return the values of a key in all records; None where it is missing and may be."""
    if isinstance(rows, Records) and len(rows):
        return rows.columns[key]
    return [row.get(key) if optional else row[key] for row in rows]


def as_records(columns: Mapping[str, Sequence[Plain]]) -> list[Document]:
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
