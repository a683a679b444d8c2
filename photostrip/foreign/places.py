"""Where something stands in another program's file, and what is wrong there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from photostrip.errors import Fault, InputError
from photostrip.formats.faults import shown
from photostrip.formats.files import MEGABYTE

LARGEST = 4000 * MEGABYTE  # of a file of another program


class Place(NamedTuple):
    """Where something stands: a line of a text, a record of a file without lines."""

    file: str
    line: int = 0
    record: str = ""

    def wrong(self, message: str, code: str = "foreign", *, expected: str = "", fix: str = "") -> InputError:
        text = f"{self.record}: {message}" if self.record else message
        return InputError(Fault(text, code=code, file=self.file, line=self.line, expected=expected, fix=fix))


def unique(what: str, entries: Iterable[tuple[Place, Any, Any]]) -> Iterator[tuple[Any, Any]]:
    """Give ids and what they stand for; refuse one that stands twice."""
    seen = set()
    for place, name, entry in entries:
        if name in seen:
            raise place.wrong(f"{what} {shown(str(name))} is already given", fix="keep one of the two")
        seen.add(name)
        yield name, entry
