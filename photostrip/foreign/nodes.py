"""What stands in a JSON file of another program, asked for by name, with the record where it stands."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import InputError
from photostrip.foreign.places import Place
from photostrip.formats.faults import LARGEST_NUMBER, shown
from photostrip.formats.tables import read_json


@dataclass(frozen=True)
class Node:
    """A value with its place; what is asked of it and not there is refused with file and record."""

    place: Place
    value: Any

    def wrong(self, message: str, code: str = "foreign", *, expected: str = "", fix: str = "") -> InputError:
        return self.place.wrong(message, code, expected=expected, fix=fix)

    def at(self, key: str, record: str = "") -> Node:
        """Give what stands under a key; None where nothing does."""
        found = self.value.get(key) if isinstance(self.value, dict) else None
        return Node(self.place._replace(record=record or f"{self.place.record} {key}".strip()), found)

    def entries(self, what: str) -> Iterator[tuple[str, Node]]:
        if not isinstance(self.value, dict):
            raise self.wrong("is missing, or no block of names")
        for name, value in self.value.items():
            yield name, Node(self.place._replace(record=f"{what} {shown(name)}"), value)

    def items(self, what: str) -> Iterator[Node]:
        if not isinstance(self.value, list):
            raise self.wrong("is missing, or no list")
        for number, value in enumerate(self.value, 1):
            yield Node(self.place._replace(record=f"{what} {number} of {len(self.value)}"), value)

    def text(self) -> str:
        if not isinstance(self.value, str):
            raise self.wrong("is missing, or no text")
        return self.value

    def number(self, default: float | None = None) -> float:
        value = default if self.value is None else self.value
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST_NUMBER:
            raise self.wrong("is missing, or no number", "number")
        return float(value)

    def numbers(self, count: int) -> Floats:
        if not isinstance(self.value, list) or len(self.value) != count:
            raise self.wrong(f"is missing, or no list of {count} numbers", "number")
        return np.array([each.number() for each in self.items(f"{self.place.record} value")])


def read_nodes(file: str) -> Node:
    return Node(Place(file), read_json(file))
