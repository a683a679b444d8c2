"""What stands in an XML file of another program, asked for by name, with the line where it stands.

No document type and with it no entity is read, and nothing but the file itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import InputError
from photostrip.foreign.places import LARGEST, Place
from photostrip.formats.faults import LARGEST_NUMBER, NotANumber, shown
from photostrip.formats.faults import number as read_number
from photostrip.formats.files import BOM, decode, read_bytes

DEEPEST = 100  # elements within each other


@dataclass(eq=False)
class Element:
    """An element with its place; what is asked of it and not there is refused with file and line."""

    place: Place
    name: str
    attributes: dict[str, str]
    children: list[Element] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    def wrong(self, message: str, code: str = "foreign", *, expected: str = "", fix: str = "") -> InputError:
        return self.place.wrong(message, code, expected=expected, fix=fix)

    @property
    def text(self) -> str:
        return "".join(self.texts).strip()

    def find(self, *names: str) -> Element | None:
        """Return the first element at a path of names; None where there is none."""
        found: Element | None = self
        for name in names:
            found = None if found is None else next((each for each in found.children if each.name == name), None)
        return found

    def at(self, *names: str) -> Element:
        found = self.find(*names)
        if found is None:
            raise self.wrong(f"has no element {'/'.join(names)}")
        return found

    def within(self, name: str) -> Iterator[Element]:
        """Give all elements of a name in it, at any depth, in the order of the file."""
        waiting = list(reversed(self.children))
        while waiting:
            each = waiting.pop()
            if each.name == name:
                yield each
            else:
                waiting += reversed(each.children)

    def attribute(self, name: str) -> str:
        if name not in self.attributes:
            raise self.wrong(f"has no attribute {name}")
        return self.attributes[name]

    def flag(self, name: str) -> bool:
        """Read a yes or no; true where nothing is said."""
        word = self.attributes.get(name, "true").strip().casefold()
        if word not in {"true", "1", "false", "0"}:
            raise self.wrong(f"{name}: `{shown(word)}` is neither true nor false")
        return word in {"true", "1"}

    def number(self, name: str, default: float | None = None) -> float:
        """Read an attribute that is a number, or the default where there is none."""
        if default is not None and name not in self.attributes:
            return default
        return self._read(self.attribute(name), name)

    def value(self) -> float:
        return self._read(self.text, self.name)

    def numbers(self, count: int) -> Floats:
        words = self.text.split()
        if len(words) != count:
            raise self.wrong(f"holds {len(words)} values", "number", expected=f"{count} numbers")
        return np.array([self._read(word, self.name) for word in words])

    def _read(self, word: str, what: str) -> float:
        try:
            found = read_number(word)
        except NotANumber as error:
            raise self.wrong(f"{what}: {error.message}", "number", fix=error.fix) from None
        if not abs(found) < LARGEST_NUMBER:
            raise self.wrong(f"{what}: {found:g} is too large", "number")
        return found


def read_elements(file: str) -> Element:
    """Read a whole file and return its root.

    Raises InputError with file and line for what is no XML, and for a document type.
    """
    data = read_bytes(file, LARGEST)
    decode(file, data)  # refuses what is no UTF-8 text
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    top = Element(Place(file), "", {})
    open_ones = [top]

    def start(name: str, attributes: dict[str, str]) -> None:
        label = " ".join(filter(None, (name, shown(attributes.get("label") or attributes.get("id") or ""))))
        element = Element(Place(file, parser.CurrentLineNumber, label), name, attributes)
        if len(open_ones) > DEEPEST:
            raise element.wrong(f"stands within more than {DEEPEST} others")
        open_ones[-1].children.append(element)
        open_ones.append(element)

    def text(words: str) -> None:
        open_ones[-1].texts.append(words)

    def refuse_type(*_: object) -> None:
        message = "has a document type, which is not read"
        raise Place(file, parser.CurrentLineNumber).wrong(message, fix="export it again, or remove the line <!DOCTYPE")

    parser.StartElementHandler = start

    def end(_: str) -> None:
        open_ones.pop()

    parser.EndElementHandler = end
    parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = refuse_type
    try:
        parser.Parse(data.removeprefix(BOM), True)  # noqa: FBT003 (its last argument)
    except expat.ExpatError as error:
        message = f"is no XML here: {expat.ErrorString(error.code)}"
        raise Place(file, error.lineno).wrong(message, fix="copy or export it again") from None
    return top.children[0]
