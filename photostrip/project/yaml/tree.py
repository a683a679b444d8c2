"""Values of a YAML file as a tree of texts that know where they stand, and faults at their places.

No scalar is given a type here: ``0123``, ``NO``, ``1:20`` and ``~`` stay what the user typed, and the schema decides
what each of them is.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from photostrip.errors import Fault
from photostrip.formats.text.numbers import shown
from photostrip.notes import Note

COMMAND_LINE = "--set"  # the place of values that the command line sets
OVERRIDE = "override"  # the place of those that a script sets
NO_FILES = frozenset({COMMAND_LINE, OVERRIDE})
_STEP = re.compile(r'(?:^|\.)(?:"([^"]*)"|([^."\[\]]+))|\[([0-9]{1,6})\]')
_PLAIN_NAME = re.compile(r"[\w-]+")

Path = tuple[str | int, ...]  # keys and numbers that lead to a value

type_names = {str: "a single value", list: "a list", dict: "a mapping (lines `key: value`)"}


class Place(NamedTuple):
    """Where something stands: file as the user knows it, line and column counted from 1 (0: nowhere in a file)."""

    file: str
    line: int = 0
    column: int = 0

    def fault(self, message: str, code: str, *, key: str = "", expected: str = "", fix: str = "") -> Fault:
        return Fault(
            message=message,
            code=code,
            file=self.file,
            line=self.line,
            column=self.column,
            key=key,
            expected=expected,
            fix=fix,
        )

    def note(self, code: str, message: str, severity: str = "note", *, key: str = "") -> Note:
        return Note(code, message, severity, file=self.file, line=self.line, column=self.column, key=key)


class Override(str):
    """An assignment ``path=value`` of a script; others are of the command line."""

    __slots__ = ()


def place_of(assignment: str) -> Place:
    return Place(OVERRIDE if isinstance(assignment, Override) else COMMAND_LINE)


@dataclass(slots=True, eq=False)
class Node:
    """A value of the file: a text, a list of nodes or a mapping of nodes."""

    value: str | list[Node] | dict[str, Node]
    place: Place
    keys: dict[str, Place] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """Its text; empty when it is a list or a mapping."""
        return self.value if isinstance(self.value, str) else ""

    @property
    def elements(self) -> list[Node]:
        """Its elements; none when it is not a list."""
        return self.value if isinstance(self.value, list) else []

    @property
    def entries(self) -> dict[str, Node]:
        """Its entries; none when it is not a mapping."""
        return self.value if isinstance(self.value, dict) else {}

    def find(self, *path: str | int) -> Node | None:
        """Return the node at a path of keys and numbers; None when there is none."""
        node: Node | None = self
        for step in path:
            if node is None:
                return None
            if isinstance(step, int):
                node = node.elements[step] if step < len(node.elements) else None
            else:
                node = node.entries.get(step)
        return node

    def list_at(self, *path: str | int) -> list[Node]:
        """Return the elements of the list at a path; none when there is none."""
        node = self.find(*path)
        return node.elements if node is not None else []

    def mapping_at(self, *path: str | int) -> dict[str, Node]:
        """Return the entries of the mapping at a path; none when there is none."""
        node = self.find(*path)
        return node.entries if node is not None else {}

    def word(self, *path: str | int) -> str:
        """Return the text at a path; empty when there is none."""
        node = self.find(*path)
        return node.text if node is not None else ""

    def has(self, *path: str | int) -> bool:
        return self.find(*path) is not None

    def place_of(self, path: Path) -> Place:
        """Return the place of what a path leads to, or of the last thing on the way that exists."""
        node = self
        for step in path:
            inner = node.find(step)
            if inner is None:
                return node.place
            node = inner
        return node.place

    @property
    def plain(self) -> object:
        """The same as texts, lists and dicts."""
        if isinstance(self.value, str):
            return self.value
        if isinstance(self.value, list):
            return [each.plain for each in self.value]
        return {key: each.plain for key, each in self.value.items()}


def key_path(path: Path) -> str:
    """Write a path as the user reads it: ``cameras.RC30.fiducials.F1[0]``."""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            name = step if _PLAIN_NAME.fullmatch(step) else f'"{shown(step)}"'
            text += f".{name}" if text else name
    return text


def steps(name: str) -> Path:
    """Split ``cameras."RC.30".fiducials.F1[0]`` into its steps; none when it is no path."""
    steps: list[str | int] = []
    position = 0
    while position < len(name):
        match = _STEP.match(name, position)
        if match is None:
            return ()
        steps.append(int(match[3]) if match[3] else match[1] or match[2])
        position = match.end()
    return tuple(steps)


def fault_at(root: Node, path: Path, message: str, code: str, *, expected: str = "", fix: str = "") -> Fault:
    """Make a fault with the place of a value of the project."""
    return at_key(Fault(message, code, expected=expected, fix=fix), root, path)


def at_key(fault: Fault, root: Node, path: Path) -> Fault:
    """Return a fault with the place of a value of the project."""
    place = root.place_of(path)
    return replace(fault, file=place.file, line=place.line, column=place.column, key=key_path(path))


def at_own_key(fault: Fault, root: Node, *above: str | int) -> Fault:
    """Return a fault that knows only its key, which may stand below others, with the place of that key."""
    return at_key(fault, root, (*above, *steps(fault.key)))
