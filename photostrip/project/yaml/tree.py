"""Values of a YAML file as a tree of texts that know where they stand, and faults at their places.

No scalar is given a type here: ``0123``, ``NO``, ``1:20`` and ``~`` stay what the user typed, and the schema decides
what each of them is. What makes YAML files hard to trust is refused: keys that stand twice, merge keys, tags, several
documents in one file. Aliases stand for what their anchors name; what they make of a file counts towards its size.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import yaml

from photostrip.errors import Fault, InputError
from photostrip.formats.text.files import BYTE_ORDER_MARK, MEGABYTE, decode, read_bytes
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.numbers import shown
from photostrip.notes import Note

COMMAND_LINE = "--set"  # the place of values that the command line sets
OVERRIDE = "override"  # the place of those that a script sets
NO_FILES = frozenset({COMMAND_LINE, OVERRIDE})
_STEP = re.compile(r'(?:^|\.)(?:"([^"]*)"|([^."\[\]]+))|\[([0-9]{1,6})\]')
_PLAIN_NAME = re.compile(r"[\w-]+")

Path = tuple[str | int, ...]  # keys and numbers that lead to a value

type_names = {str: "a single value", list: "a list", dict: "a mapping (lines `key: value`)"}
LARGEST_PROJECT = 10 * MEGABYTE
MOST_VALUES = 100_000  # a strip of a thousand photos has two thousand
DEEPEST = 20
LOADER: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)  # the C parser is ten times faster where it is there
TAGS = {f"tag:yaml.org,2002:{each}" for each in ("str", "seq", "map")}  # of what has none
_ALIAS = re.compile(r"\*([^\s,\[\]{}]+)")
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\ufffe\uffff]")
_PROBLEMS = (
    ("another document", "a second document (`---`) begins", "write one project in one file"),
    ("second occurrence", "two values are named with the same &", "give one of them another name"),
    ("maximum nesting depth", f"values are nested more than {DEEPEST} deep", "write a project"),
    ("mapping values are not allowed", "a second colon, or a key where none can stand",
     "put the value between quotation marks, or correct the indentation"),
    ("did not find expected ',' or", "a bracket is not closed", "close it"),
    ("expected ',' or", "a bracket is not closed", "close it"),
    ("did not find expected key", "the line does not fit the one above", "indent it like its neighbours"),
    ("did not find expected '-'", "the line does not fit the list above", "indent it like its neighbours"),
    ("did not find expected node content", "a value is missing, or begins with a character that is not allowed there",
     "put the value between quotation marks"),
    ("expected <block end>", "the line does not fit the one above", "indent it like its neighbours"),
    ("expected the node content", "a value is missing", "put the value between quotation marks"),
    ("expected <document start>", "the line does not fit the one above", "indent it like its neighbours"),
    ("expected '<document start>'", "the line does not fit the one above", "indent it like its neighbours"),
    ("unexpected end of stream", "a quotation mark is not closed", "close it"),
    ("unknown escape", "a backslash between double quotation marks begins an escape",
     "use single quotation marks, or / in paths"),
    ("could not find expected ':'", "a line without a colon", "write `key: value`, with a blank after the colon"),
)  # fmt: skip


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


def read_document(file: str, findings: Findings) -> Node | None:
    """Read a YAML file as a mapping; None when it cannot be read further."""
    findings.meet(file)
    try:
        text, marked = decode(file, read_bytes(file, LARGEST_PROJECT))
    except InputError as error:
        findings.add(*error.faults)
        return None
    if marked:
        findings.notes.append(Note("byte-order-mark", BYTE_ORDER_MARK, "note", file=file, line=1))
    root = parse(text, file, findings)
    if root is None:
        return None
    if root.value == "":
        findings.add(Fault("has no content", "file-empty", file, expected="a project (lines `key: value`)"))
        return None
    if not isinstance(root.value, dict):
        message = f"the file holds {type_names[type(root.value)]}"
        findings.add(root.place.fault(message, "type", expected=type_names[dict]))
        return None
    return root


def parse(text: str, file: str, findings: Findings) -> Node | None:
    """Turn YAML text into a tree; None when it cannot be trusted. A text without content gives an empty text."""
    bad = _CONTROL.search(text)
    if bad:
        line = text.count("\n", 0, bad.start()) + 1
        column = bad.start() - text.rfind("\n", 0, bad.start())
        message = f"the character U+{ord(bad[0]):04X} is not allowed in YAML"
        findings.add(Fault(message=message, code="yaml", file=file, line=line, column=column, fix="remove it"))
        return None
    try:
        text.encode()
        composed = yaml.compose(text, Loader=LOADER)
        return Node("", Place(file, 1, 1)) if composed is None else _Tree(file, findings).whole(composed)
    except yaml.YAMLError as error:
        findings.add(_syntax(error, text, file))
    except UnicodeEncodeError:
        findings.add(Fault("is not valid Unicode text", "encoding", file))
    except RecursionError:
        findings.add(
            Place(file, 1, 1).fault(f"values are nested more than {DEEPEST} deep", "yaml", expected="a project")
        )
    except InputError as error:  # no document that a person would write
        findings.add(*error.faults)
    return None


class _Tree:
    """Makes a tree of texts of what PyYAML composed; what an alias stands for is copied, and counts each time."""

    def __init__(self, file: str, findings: Findings) -> None:
        self.file, self.findings = file, findings
        self.sound = True
        self.values = 0

    def whole(self, composed: yaml.Node) -> Node | None:
        """Return the tree, None when it cannot be trusted; raises InputError for what no person would write."""
        root = self._node(composed, ())
        return root if self.sound else None

    def _node(self, given: yaml.Node, above: tuple[yaml.Node, ...]) -> Node:
        place = Place(self.file, given.start_mark.line + 1, given.start_mark.column + 1)
        self.values += 1
        if self.values > MOST_VALUES:
            message = f"the file has more than {MOST_VALUES} values"
            raise InputError(Fault(message, "file-size", self.file, expected="a project"))
        if given in above:
            message = "an alias below this value stands for the value itself"
            raise InputError(place.fault(message, "alias", fix="write what is meant"))
        if given.tag not in TAGS:
            tag = given.tag.replace("tag:yaml.org,2002:", "!!")
            self.findings.add(place.fault(f"the tag {shown(tag)} cannot be used", "tag", fix="remove it"))
        if isinstance(given, yaml.ScalarNode):
            return Node(self._text(given, place), place)
        if len(above) >= DEEPEST:
            message = f"values are nested more than {DEEPEST} deep"
            raise InputError(place.fault(message, "yaml", expected="a project"))
        if isinstance(given, yaml.SequenceNode):
            return Node([self._node(each, (*above, given)) for each in given.value], place)
        node = Node({}, place)
        for key, value in given.value:
            self._enter(node, self._node(key, (*above, given)), self._node(value, (*above, given)))
        return node

    def _text(self, given: yaml.ScalarNode, place: Place) -> str:
        text: str = given.value
        stripped = text.strip()
        if stripped != text and given.style in {"'", '"'}:
            message = f"blanks around `{shown(text)}` removed"
            self.findings.notes.append(place.note("stray-blanks", message))
        return stripped

    def _enter(self, parent: Node, key: Node, value: Node) -> None:
        """Put a value under its key; the first of two equal keys counts."""
        name, place, first = key.text, key.place, parent.keys.get(key.text)
        if not isinstance(key.value, str):
            fault = place.fault(f"{type_names[type(key.value)]} is used as a key", "key", expected="a single word")
        elif not name:
            fault = place.fault("a key is empty", "key", expected="a name before the colon")
        elif name == "<<":
            fault = place.fault("merge keys cannot be used", "merge-key", fix="write the keys, or use `extends`")
        elif first is not None:
            where = f"line {first.line}" if first.line != place.line else f"column {first.column}"
            message = f"the key `{shown(name)}` appears a second time; it is first given in {where}"
            fault = place.fault(message, "duplicate-key", key=shown(name), fix="keep one of them")
        else:
            parent.entries[name], parent.keys[name] = value, place
            return
        self.findings.add(fault)
        self.sound &= first is not None


def _syntax(error: yaml.YAMLError, text: str, file: str) -> Fault:
    """Say where YAML breaks off and what may be the matter."""
    problem = str(getattr(error, "problem", None) or error).splitlines()[0]
    mark = getattr(error, "problem_mark", None)
    if (
        "undefined alias" in problem
        and mark is not None
        and (alias := _ALIAS.match(text.splitlines()[mark.line], mark.column))
    ):
        message, fix = (
            f"the alias *{shown(alias[1])} stands for nothing",
            f"name a value with &{shown(alias[1])} before",
        )
        fix += ", or put * between quotation marks"
        return Fault(message, "alias", file, line=mark.line + 1, column=mark.column + 1, fix=fix)
    begun = getattr(error, "context_mark", None)
    lines = text.splitlines() or [""]
    if mark is None:
        return Fault(f"cannot be read as YAML: {problem}", "yaml", file)
    never_closed = "',' or" in problem or "end of stream" in problem or mark.line >= len(lines)
    if begun is not None and never_closed:
        mark = begun  # where something was opened is a better place than where its end is missed
    line = min(mark.line, len(lines) - 1)
    column = mark.column if line == mark.line else 0
    what, fix = _explained(problem, lines[line], column)
    return Fault(message=what, code="yaml", file=file, line=line + 1, column=column + 1, fix=fix)


def _explained(problem: str, line: str, column: int) -> tuple[str, str]:
    """Turn the parser's words into the user's."""
    blank = line[: len(line) - len(line.lstrip())]
    if "\t" in blank or line[column : column + 1] == "\t":
        return "there is a tab where YAML needs blanks", "indent with blanks"
    if "cannot start any token" in problem:
        return f"a value cannot begin with {line[column : column + 1] or 'this'}", "put it between quotation marks"
    for words, what, fix in _PROBLEMS:
        if words in problem:
            return what, fix
    return f"cannot be read as YAML: {problem}", ""
