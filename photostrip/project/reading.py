"""YAML files: from text to a tree of texts with places, to a model with types, and to faults with their places.

No scalar is given a type by the parser: ``0123``, ``NO``, ``1:20`` and ``~`` stay what the user typed, and the schema
decides what each of them is. What makes YAML files hard to trust is refused: keys that stand twice, merge keys, tags,
several documents in one file. Aliases stand for what their anchors name; what they make of a file counts towards its
size.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, get_args, get_origin

import yaml
from pydantic import ValidationError

from photostrip.errors import Fault, InputError
from photostrip.formats.faults import Findings, NotANumber, shown, suggestion
from photostrip.formats.faults import number as read_number
from photostrip.formats.files import BYTE_ORDER_MARK, MEGABYTE, decode, read_bytes
from photostrip.formats.tables import WORDS, Form
from photostrip.notes import Note, counted
from photostrip.project.sections import Section, WrongValueError, WrongValuesError, bare, is_section, kinds_of, wrong

COMMAND_LINE = "--set"  # the place of values that the command line sets
OVERRIDE = "override"  # the place of those that a script sets
NO_FILES = frozenset({COMMAND_LINE, OVERRIDE})
_STEP = re.compile(r'(?:^|\.)(?:"([^"]*)"|([^."\[\]]+))|\[([0-9]{1,6})\]')
_PLAIN_NAME = re.compile(r"[\w-]+")

KeyPath = tuple[str | int, ...]  # keys and numbers that lead to a value

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
        return Fault(message, code, *self, key=key, expected=expected, fix=fix)

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

    def place_of(self, path: KeyPath) -> Place:
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


def key_path(path: KeyPath) -> str:
    """Write a path as the user reads it: ``cameras.RC30.fiducials.F1[0]``."""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            name = step if _PLAIN_NAME.fullmatch(step) else f'"{shown(step)}"'
            text += f".{name}" if text else name
    return text


def steps(name: str) -> KeyPath:
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


def fault_at(root: Node, path: KeyPath, message: str, code: str, *, expected: str = "", fix: str = "") -> Fault:
    """Make a fault with the place of a value of the project."""
    return at_key(Fault(message, code, expected=expected, fix=fix), root, path)


def at_key(fault: Fault, root: Node, path: KeyPath) -> Fault:
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
        message = f"values are nested more than {DEEPEST} deep"
        findings.add(Place(file, 1, 1).fault(message, "yaml", expected="a project"))
    except InputError as error:  # no document that a person would write
        findings.add(*error.faults)
    return None


class _Tree:
    """Makes a tree of texts of what PyYAML composed; what an alias stands for is copied, and counts each time."""

    def __init__(self, file: str, findings: Findings) -> None:
        self.file, self.findings, self.values, self.sound = file, findings, 0, True

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
            text = given.value.strip()
            if text != given.value and given.style in {"'", '"'}:
                self.findings.notes.append(place.note("stray-blanks", f"blanks around `{shown(given.value)}` removed"))
            return Node(text, place)
        if len(above) >= DEEPEST:
            raise InputError(place.fault(f"values are nested more than {DEEPEST} deep", "yaml", expected="a project"))
        inside = (*above, given)
        if isinstance(given, yaml.SequenceNode):
            return Node([self._node(each, inside) for each in given.value], place)
        node = Node({}, place)
        for key, value in given.value:
            self._enter(node, self._node(key, inside), self._node(value, inside))
        return node

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
    mark, begun = getattr(error, "problem_mark", None), getattr(error, "context_mark", None)
    if mark is None:
        return Fault(f"cannot be read as YAML: {problem}", "yaml", file)
    lines = text.splitlines() or [""]
    if "undefined alias" in problem and (alias := _ALIAS.match(lines[mark.line], mark.column)):
        name = shown(alias[1])
        fix = f"name a value with &{name} before, or put * between quotation marks"
        place = Place(file, mark.line + 1, mark.column + 1)
        return place.fault(f"the alias *{name} stands for nothing", "alias", fix=fix)
    never_closed = "',' or" in problem or "end of stream" in problem or mark.line >= len(lines)
    if begun is not None and never_closed:
        mark = begun  # where something was opened is a better place than where its end is missed
    line = min(mark.line, len(lines) - 1)
    column = mark.column if line == mark.line else 0
    what, fix = _syntax_explained(problem, lines[line], column)
    return Place(file, line + 1, column + 1).fault(what, "yaml", fix=fix)


def _syntax_explained(problem: str, line: str, column: int) -> tuple[str, str]:
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


S = TypeVar("S", bound=Section)
T = TypeVar("T")
LONGEST_CHAIN = 8
MEANT = re.compile(r"did you mean `(.+?)`\?.*")  # a suggestion
MOST_EXPLAINED = 1000  # errors of one file; more of them are only counted
KINDS = {  # of files, by the key that holds the number of their schema
    "photostrip": "a project for `photostrip run`",
    "photostrip_simulation": "a specification for `photostrip simulate`",
    "photostrip_plan_model": "a plan for `photostrip plan model`",
    "photostrip_plan_strip": "a plan for `photostrip plan strip`",
    "photostrip_plan_cameras": "a plan for `photostrip plan camera`",
    "photostrip_plan_displacement": "a plan for `photostrip plan displacement`",
    "photostrip_plan_screening": "a plan for `photostrip plan screening`",
    "photostrip_terrestrial": "a file for `photostrip terrestrial`",
    "photostrip_cameras": "a list of cameras for `photostrip terrestrial`",
    "photostrip_tolerances": "a tolerance profile for `photostrip compare --tol`",
    "photostrip_result": "a result for `photostrip report` and `photostrip compare`",
}
EXPECTED = {
    "model_type": "a mapping (lines `key: value`)",
    "dict_type": "a mapping (lines `key: value`)",
    "list_type": "a list ([a, b] or lines `- a`)",
    "tuple_type": "a list of values in brackets",
}
ENTRIES = {"photos": "photo", "cameras": "camera", "strips": "strip"}
SEPARATORS = {word: sign for sign, word in WORDS.items()}
DECIMALS = {"point": ".", "comma": ","}


@dataclass(eq=False)
class Reading:
    """A file that is read, with the files that it extends and names; nothing is raised before all faults are known."""

    file: str
    root: Node  # the tree of the file: it knows where each value stands
    findings: Findings
    files: list[str]  # every file that was read, the file itself first

    @classmethod
    def of(cls, kind: type[Section], path: Path | None, assignments: Sequence[str] = ()) -> Reading:
        """Read a file and apply what the command line sets, or make one of that; raises why it is no YAML."""
        findings, files = Findings(), list[str]()
        if path is None:
            place, number = (
                Place(COMMAND_LINE),
                next(name for name in kind.model_fields if name.startswith("photostrip")),
            )
            root: Node | None = Node({number: Node("1", place)}, place, {number: place})
        else:
            root = read_tree(str(path), findings, files)
        if root is None:
            raise InputError(findings.faults)
        return cls(COMMAND_LINE if path is None else str(path), override(root, assignments, findings), findings, files)

    def checked(self, kind: type[S]) -> S | None:
        """Return the file with types and defaults; None when there are faults."""
        return checked(kind, self.root, self.findings)

    def complete(self, read: T | None) -> T:
        """Return what was read, or raise every fault of every file."""
        self.findings.stop()
        if read is None:  # cannot be: whatever is not read has a fault, and stop() raised it
            raise InputError(f"{self.file} is not valid")
        return read

    def read(self, kind: type[S]) -> S:
        """Return the file with types and defaults, or raise all its faults."""
        return self.complete(self.checked(kind))

    def refuse(self, path: KeyPath, message: str, code: str, *, expected: str = "", fix: str = "") -> None:
        """Keep a fault of a value of the file."""
        self.findings.add(fault_at(self.root, path, message, code, expected=expected, fix=fix))

    def table(self, key: KeyPath, read: Callable[[str, Findings], T | None]) -> T | None:
        """Read the file that a key names; None where it names none, and where there are faults."""
        return self.tables(key, lambda paths, inner: read(paths[0], inner)) if self.root.word(*key) else None

    def tables(self, key: KeyPath, read: Callable[[list[str], Findings], T | None]) -> T | None:
        """Read the same of a key that names one file or a list of them.

        Faults of a file as a whole are reported where it is named, those without a file at their own key.
        """
        node = self.root.find(*key)
        if node is None:
            return None
        nodes = {(*key, number): each for number, each in enumerate(node.elements)} or {key: node}
        named = {path_of(each, self.file): where for where, each in nodes.items() if each.text}
        if not named:
            return None

        def placed(fault: Fault) -> Fault:
            where = named.get(fault.file, key)
            return where_named(fault, self.root, where) if fault.file else at_own_key(fault, self.root)

        inner = Findings(self.findings.notes)
        found = read(list(named), inner)
        self.findings.absorb(inner, placed)
        self.files += [path for path in named if path not in self.files]
        return found

    @contextmanager
    def places(self, keys: Mapping[str, str] | None = None) -> Iterator[None]:
        """Give faults that know only a key the place of that key; `keys` are those of the file for other names."""
        try:
            yield
        except InputError as error:
            named = (replace(fault, key=(keys or {}).get(fault.key, fault.key)) for fault in error.faults)
            raise InputError(at_own_key(fault, self.root) for fault in named) from None


def read_keys(kind: type[S], path: Path | None, assignments: Sequence[str] = ()) -> tuple[S, Reading]:
    """Read a file of which every key can be set, or make one of assignments alone, or raise every fault."""
    reading = Reading.of(kind, path, assignments)
    return reading.read(kind), reading


def path_of(node: Node, project: str) -> str:
    """Return the path of the file that a value names, as the user could type it.

    Values that stand in no file are relative to the project file.
    """
    owner = project if node.place.file in NO_FILES else node.place.file
    return str(Path(owner).parent / node.text)  # `..` stays: behind a link it does not cancel the folder before it


def read_tree(file: str, findings: Findings, files: list[str]) -> Node | None:
    """Read a project file and what it extends; None when the file cannot be read."""
    files.append(file)
    root = read_document(file, findings)
    if root is None:
        return None
    chain = [os.path.realpath(file)]
    merged = child = root
    while "extends" in child.entries:
        parent = _parent(root, child, chain, findings, files)
        if parent is None:
            break
        merged = merge(parent, merged)
        child = parent
    merged.entries.pop("extends", None)
    return merged


def _parent(root: Node, child: Node, chain: list[str], findings: Findings, files: list[str]) -> Node | None:
    node = child.entries["extends"]
    if not node.text:
        what = "no value is given" if node.value == "" else "only one file can be extended"
        findings.add(fault_at(child, ("extends",), what, "type", expected="the path of one file"))
        return None
    path = path_of(node, root.place.file)
    real = os.path.realpath(path)
    if real in chain or len(chain) > LONGEST_CHAIN:
        message = f"{path} extends itself" if real in chain else f"more than {LONGEST_CHAIN} files extend each other"
        findings.add(fault_at(child, ("extends",), message, "extends-cycle", fix="remove one `extends`"))
        return None
    chain.append(real)
    files.append(path)
    inner = Findings(findings.notes)
    parent = read_document(path, inner)
    findings.absorb(inner, lambda fault: where_named(_of_preset(fault), child, ("extends",)))
    return parent


def _of_preset(fault: Fault) -> Fault:
    """Say where the presets of the program lie, if a file is not there."""
    if fault.code != "file-missing" or fault.fix:
        return fault
    return replace(fault, fix="the presets lie in `configs/` of the source tree: copy the one that you want")


def where_named(fault: Fault, owner: Node, key: KeyPath) -> Fault:
    """Return a fault of a file as a whole with the place where the file is named; others keep their own."""
    if fault.line:
        return fault
    fix = fault.fix if fault.code != "file-directory" else ""  # there a project was looked for
    return replace(at_key(fault, owner, key), message=f"{shown(fault.file, 200)} {fault.message}", fix=fix)


def merge(base: Node, over: Node) -> Node:
    """Lay one tree over another: mappings are merged; of lists and values that both have, those of `over` count.

    Every value keeps the place where it stands.
    """
    if not (isinstance(base.value, dict) and isinstance(over.value, dict)):
        return over
    entries = dict(base.value)
    for key, node in over.value.items():
        entries[key] = merge(entries[key], node) if key in entries else node
    return Node(entries, over.place, {**base.keys, **over.keys})


def override(root: Node, assignments: Sequence[str], findings: Findings) -> Node:
    """Apply ``path=value`` assignments, the value being YAML, such as ``strips[0].camera=RC30``."""
    for assignment in assignments:
        name, equals, text = assignment.partition("=")
        path = steps(name.strip())
        place = place_of(assignment)
        if not equals or not path:
            typed, expected = assignment, "key.path=value, as in observations.sigma=0.004"
            if place.file == OVERRIDE:
                typed, expected = name, "a path of keys, as in strips[0].camera"
            findings.add(place.fault(f"`{shown(typed)}` sets nothing", "set", expected=expected))
            continue
        if path == ("extends",):
            findings.add(place.fault("`extends` cannot be set", "set", fix="set the keys themselves"))
            continue
        value = parse(text, place.file, findings)
        if value is not None:
            root = _assigned(root, path, _moved(value, place), name, findings)
    return root


def _moved(node: Node, place: Place) -> Node:
    """Return a tree that stands in no file one place, without a line."""
    if isinstance(node.value, list):
        return Node([_moved(each, place) for each in node.value], place)
    if isinstance(node.value, dict):
        entries = {key: _moved(each, place) for key, each in node.value.items()}
        return Node(entries, place, dict.fromkeys(entries, place))
    return Node(node.value, place)


def _assigned(root: Node, path: KeyPath, value: Node, name: str, findings: Findings) -> Node:
    """Return a copy of the tree in which one value is replaced."""
    if not path:
        return value
    step, rest = path[0], path[1:]
    if isinstance(root.value, list):
        number = int(step) if str(step).isdecimal() else len(root.value)
        if number < len(root.value):
            elements = list(root.value)
            elements[number] = _assigned(elements[number], rest, value, name, findings)
            return Node(elements, root.place)
        message = f"there is no element {step} in a list of {len(root.value)}"
        expected = "a number, the first element being 0"
        findings.add(value.place.fault(message, "set", key=name, expected=expected))
        return root
    if isinstance(root.value, str) and root.value:
        message = f"there is nothing below the value `{shown(root.value)}`"
        findings.add(value.place.fault(message, "set", key=name))
        return root
    key = str(step)
    inner = root.entries.get(key, Node({} if rest else "", value.place))
    entries = {**root.entries, key: _assigned(inner, rest, value, name, findings)}
    return Node(entries, root.place, {key: value.place, **root.keys})


def checked(kind: type[S], root: Node, findings: Findings) -> S | None:
    """Return a file with types and defaults; None when there are faults. A file of another kind is refused at once."""
    given = [name for name in KINDS if name in root.entries]
    if given and not any(name in kind.model_fields for name in given):
        raise InputError(fault_at(root, (given[0],), f"this is {KINDS[given[0]]}", "other-file"))
    try:
        return kind.model_validate(root.plain)
    except ValidationError as error:
        problems = error.errors(include_url=False)
        told = (fault for each in problems[:MOST_EXPLAINED] for fault in _faults(kind, root, each))
        findings.add(*_once(dict.fromkeys(told)))
        findings.count(root.place.file, len(problems[MOST_EXPLAINED:]))
        return None


def _once(faults: Iterable[Fault]) -> Iterator[Fault]:
    """Leave out that a key is missing where it is misspelled."""
    faults = list(faults)
    meant = {
        f"{above}.{found[1]}".removeprefix(".")
        for fault in faults
        if fault.code == "unknown-key" and (found := MEANT.fullmatch(fault.fix))
        for above in [fault.key.rpartition(".")[0]]
    }
    return (fault for fault in faults if fault.code != "missing-key" or fault.key not in meant)


def valid_section(kind: type[S], value: object) -> S | None:
    """Return one section of a project of which other parts may be at fault; None when it is at fault itself.

    value: a mapping of texts or the node of one; without any the section has all its defaults.
    """
    try:
        return kind.model_validate(value.plain if isinstance(value, Node) else value or {})
    except ValidationError:
        return None


def _faults(kind: type[Section], root: Node, problem: Any) -> Iterator[Fault]:  # noqa: ANN401 (a mapping of pydantic)
    """Say what is wrong in the words of the user, with its place in the file."""
    path, owner = _followed(kind, root, problem["loc"])
    if get_origin(owner) is tuple and problem["type"] == "missing":  # one of its values; it has too few
        path = path[:-1]
    if isinstance(together := problem.get("ctx", {}).get("error"), WrongValuesError):
        errors = together.told
    else:
        errors = (_explained(problem, str(path[-1]) if path else "", owner),)
    for error in errors:
        at, fix, expected = (*path, *error.at.split(".")) if error.at else path, error.fix, error.expected
        place = root.place_of(at)
        if error.code == "unknown-key":
            name, node = str(path[-1]), root.find(*path[:-1])
            place = node.keys.get(name, place) if node is not None else place
            if not fix and name in homes(kind):
                fix = f"`{name}` belongs in `{homes(kind)[name]}`"
            expected = "" if fix else expected
        elif error.code == "schema-number":
            expected = f"{key_path(at)}: {expected}"
        yield place.fault(error.message, error.code, key=key_path(at), expected=expected, fix=fix)


def _followed(kind: type[Section], root: Node, steps: KeyPath) -> tuple[KeyPath, Any]:
    """Return the path in the tree of what pydantic found, and the type of what its last step leads out of."""
    path: list[str | int] = []
    owner: Any = kind
    inner: Any = kind
    for step in steps:
        if (tagged := kinds_of(inner).get(str(step))) is not None:  # a tag, which stands in no file
            inner = tagged
            continue
        owner = bare(inner)
        node = root.find(*path)
        if not (isinstance(step, int) and node is not None and node.entries):  # one that stands without its list
            path.append(step)
        described = owner.model_fields.get(str(step)) if is_section(owner) else None
        inner = described.annotation if described is not None else next(reversed(get_args(owner)), None)
    return tuple(path), bare(inner) if get_origin(bare(inner)) is tuple else owner


def _explained(problem: Any, name: str, owner: Any) -> WrongValueError:  # noqa: ANN401 (as above; a type)
    """Say what is wrong in the words of the user; name: the key that is at fault."""
    kind, value = problem["type"], problem["input"]
    if kind == "value_error":
        return problem["ctx"]["error"]
    if kind == "extra_forbidden":
        known = list(owner.model_fields)
        message, fix = f"the key `{shown(name)}` is not known", owner.gone.get(name) or suggestion(name, known)
        return wrong(message, code="unknown-key", expected=f"one of {', '.join(known)}", fix=fix)
    if kind in EXPECTED:
        message = "no value is given" if value == "" else f"{type_names[type(value)]} is given here"
        return wrong(message, code="type", expected=EXPECTED[kind])
    if get_origin(owner) is tuple:
        return wrong(
            f"{counted(len(value), 'value')} in the list", code="length", expected=f"{len(get_args(owner))} values"
        )
    if kind == "missing":
        told = owner.model_fields[name].description or ""
        told = told[:1].lower() + told[1:] if told[1:2].islower() else told
        return wrong(f"`{name}` is missing", code="missing-key", expected=told)
    what, bounds = ENTRIES.get(name, "entry"), problem["ctx"]
    message = f"there are {len(value)} entries" if value else f"there is no {what}"
    least = kind == "too_short"
    bound = f"at least {counted(bounds['min_length'], what)}" if least else f"at most {bounds['max_length']}"
    return wrong(message, code="length", expected=bound)


def homes(schema: type[Section]) -> dict[str, str]:
    """Return the path above each key that stands below another one: ``processing.relative`` for ``grubbs_alpha``."""
    return {name: above for above, name, _ in reversed([*schema.described()]) if above}


def form_of(node: Node | None) -> Form:
    """Read the form of a table at its block of the project; what is no word of the schema counts as not said."""
    if node is None:
        return Form()
    try:
        skipped = int(read_number(node.word("skip") or "0"))
    except NotANumber:
        skipped = 0
    return Form(
        separator=SEPARATORS.get(node.word("separator"), ","),
        decimal=DECIMALS.get(node.word("decimal"), "."),
        skipped=max(skipped, 0),
        columns={name: each.text for name, each in node.mapping_at("columns").items() if each.text},
    )
