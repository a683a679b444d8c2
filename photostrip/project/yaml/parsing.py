"""YAML text to a tree of texts with their places, over the events of PyYAML.

What makes YAML files hard to trust is refused: keys that stand twice, merge keys, tags, several documents in one file.
Aliases stand for what their anchors name, as programs write shared lists; what they make of a file counts towards its
size. What the parser refuses is reported in the words of the user.
"""

from __future__ import annotations

import re
from typing import Any

import yaml

from photostrip.errors import Fault, InputError
from photostrip.formats.text.files import BYTE_ORDER_MARK, MEGABYTE, decode, read_bytes
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.numbers import shown
from photostrip.notes import Note
from photostrip.project.yaml.tree import Node, Place, type_names

LARGEST_PROJECT = 10 * MEGABYTE
MOST_VALUES = 100_000  # a strip of a thousand photos has two thousand
DEEPEST = 20
LOADER: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)  # the C parser is ten times faster where it is there
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\ufffe\uffff]")


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
    builder = _Builder(file, findings)
    try:
        text.encode()
        for event in yaml.parse(text, Loader=LOADER):
            builder.take(event)
    except yaml.YAMLError as error:
        findings.add(_syntax(error, text, file))
        return None
    except UnicodeEncodeError:
        findings.add(Fault("is not valid Unicode text", "encoding", file))
        return None
    except InputError as error:  # no document that a person would write
        findings.add(*error.faults)
        return None
    return builder.root if builder.sound else None


class _Builder:
    """Builds the tree from the events of the YAML parser, without recursion."""

    def __init__(self, file: str, findings: Findings) -> None:
        self.file, self.findings = file, findings
        self.root = Node("", Place(file, 1, 1))
        self.sound = True
        self.open: list[Node] = []
        self.key: list[tuple[str, Place] | None] = []  # for each open node the key that waits for its value
        self.named: dict[str, Node] = {}  # by anchor
        self.documents = self.values = 0

    def take(self, event: yaml.Event) -> None:
        mark = event.start_mark
        place = Place(self.file, mark.line + 1, mark.column + 1) if mark is not None else Place(self.file)
        if isinstance(event, yaml.DocumentStartEvent):
            self._document(place)
        elif isinstance(event, yaml.AliasEvent):
            self._put(self._meant(event.anchor or "", place))
        elif isinstance(event, yaml.ScalarEvent):
            node = Node(self._text(event, place), place)
            self._properties(event, node)
            self._put(node)
        elif isinstance(event, yaml.SequenceStartEvent | yaml.MappingStartEvent):
            node = Node([] if isinstance(event, yaml.SequenceStartEvent) else {}, place)
            self._properties(event, node)
            self._open(node)
        elif isinstance(event, yaml.SequenceEndEvent | yaml.MappingEndEvent):
            self.open.pop()
            self.key.pop()

    def _refuse(self, place: Place, message: str, code: str, fix: str = "", expected: str = "") -> None:
        self.findings.add(place.fault(message, code, expected=expected, fix=fix))

    def _document(self, place: Place) -> None:
        self.documents += 1
        if self.documents > 1:
            message = "a second document (`---`) begins"
            raise InputError(place.fault(message, "yaml", expected="one project in one file"))

    def _properties(self, event: Any, node: Node) -> None:  # noqa: ANN401 (three kinds of event, without a type)
        """Remember what an anchor names; refuse tags: a value is what is typed."""
        if event.anchor is not None:
            self.named[event.anchor] = node
        if event.tag is not None:
            tag = event.tag.replace("tag:yaml.org,2002:", "!!")
            self._refuse(node.place, f"the tag {shown(tag)} cannot be used", "tag", "remove it")

    def _meant(self, anchor: str, place: Place) -> Node:
        """Return a copy of what an alias stands for."""
        node = self.named.get(anchor)
        if node is not None and not any(each is node for each in self.open):
            return self._copied(node, place, len(self.open))
        what = f"the alias *{shown(anchor)} stands for " + ("nothing" if node is None else "something it is part of")
        fix = f"name a value with &{shown(anchor)} before, or put * between quotation marks" if node is None else ""
        self._refuse(place, what, "alias", fix or "write the value itself")
        self.sound = False
        return Node("", place)

    def _copied(self, node: Node, place: Place, depth: int) -> Node:
        """Copy a value to another place, what is in it keeps its own."""
        self._count(node, depth)
        if isinstance(node.value, str):
            return Node(node.value, place)
        if isinstance(node.value, list):
            return Node([self._copied(each, each.place, depth + 1) for each in node.value], place)
        entries = {key: self._copied(each, each.place, depth + 1) for key, each in node.value.items()}
        return Node(entries, place, dict(node.keys))

    def _count(self, node: Node, depth: int) -> None:
        """Refuse what no person would write."""
        self.values += 1
        if self.values > MOST_VALUES:
            message = f"the file has more than {MOST_VALUES} values"
            raise InputError(Fault(message, "file-size", self.file, expected="a project"))
        if depth >= DEEPEST and not isinstance(node.value, str):
            message = f"values are nested more than {DEEPEST} deep"
            raise InputError(node.place.fault(message, "yaml", expected="a project"))

    def _text(self, event: yaml.ScalarEvent, place: Place) -> str:
        text: str = event.value
        stripped = text.strip()
        if stripped != text and event.style in {"'", '"'}:
            message = f"blanks around `{shown(text)}` removed"
            self.findings.notes.append(place.note("stray-blanks", message))
        return stripped

    def _open(self, node: Node) -> None:
        self._put(node)
        self.open.append(node)
        self.key.append(None)

    def _put(self, node: Node) -> None:
        """Return a new value its place in the tree."""
        self._count(node, len(self.open))
        if not self.open:
            self.root = node
            return
        parent, waiting = self.open[-1], self.key[-1]
        if isinstance(parent.value, list):
            parent.value.append(node)
        elif waiting is None:
            self.key[-1] = self._key(node)
        else:
            self.key[-1] = None
            self._enter(parent, *waiting, node)

    def _key(self, node: Node) -> tuple[str, Place]:
        place = node.place
        if not isinstance(node.value, str):
            self._refuse(place, f"{type_names[type(node.value)]} is used as a key", "key", expected="a single word")
            self.sound = False
        elif not node.value:
            self._refuse(place, "a key is empty", "key", expected="a name before the colon")
            self.sound = False
        elif node.value == "<<":
            self._refuse(place, "merge keys cannot be used", "merge-key", "write the keys, or use `extends`")
            self.sound = False
        return node.text, place

    def _enter(self, parent: Node, key: str, place: Place, node: Node) -> None:
        """Put a value under its key; the first of two equal keys counts."""
        first = parent.keys.get(key)
        if first is not None:
            where = f"line {first.line}" if first.line != place.line else f"column {first.column}"
            message = f"the key `{shown(key)}` appears a second time; it is first given in {where}"
            self.findings.add(place.fault(message, "duplicate-key", key=shown(key), fix="keep one of them"))
            return
        parent.entries[key] = node
        parent.keys[key] = place


def _syntax(error: yaml.YAMLError, text: str, file: str) -> Fault:
    """Say where YAML breaks off and what may be the matter."""
    problem = str(getattr(error, "problem", None) or error).splitlines()[0]
    mark = getattr(error, "problem_mark", None)
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


_PROBLEMS = (
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
