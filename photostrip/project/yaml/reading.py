"""One reader of every YAML file: what it extends, what the command line sets, its schema, its faults."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any, TypeVar, get_args, get_origin

from pydantic import ValidationError

from photostrip.errors import Fault, InputError
from photostrip.formats.text.findings import Findings, suggestion
from photostrip.formats.text.numbers import NotANumber, shown
from photostrip.formats.text.numbers import number as read_number
from photostrip.formats.text.table_reader import WORDS
from photostrip.formats.text.table_text import Form
from photostrip.notes import counted
from photostrip.project.sections import Section, WrongValueError, bare, is_section, kinds_of, wrong
from photostrip.project.yaml.tree import (
    COMMAND_LINE,
    NO_FILES,
    OVERRIDE,
    Node,
    Path,
    Place,
    at_key,
    at_own_key,
    fault_at,
    key_path,
    parse,
    place_of,
    read_document,
    steps,
    type_names,
)

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
    def of(cls, file: str, assignments: Sequence[str] = ()) -> Reading:
        """Read a file and apply what the command line sets, or raise why it is no YAML."""
        findings, files = Findings(), list[str]()
        root = read_tree(file, findings, files)
        if root is None:
            raise InputError(findings.faults)
        return cls(file=file, root=root, findings=findings, files=files).with_set(assignments)

    @classmethod
    def of_keys(cls, kind: type[Section], path: FilePath | None, assignments: Sequence[str]) -> Reading:
        """Read a file of which every key can be set, or make one of assignments alone."""
        if path is not None:
            return cls.of(str(path), assignments)
        place, number = Place(COMMAND_LINE), next(name for name in kind.model_fields if name.startswith("photostrip"))
        root = Node({number: Node("1", place)}, place, {number: place})
        return cls(file=COMMAND_LINE, root=root, findings=Findings(), files=[]).with_set(assignments)

    def with_set(self, assignments: Sequence[str]) -> Reading:
        return replace(self, root=override(self.root, assignments, self.findings))

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

    def refuse(self, path: Path, message: str, code: str, *, expected: str = "", fix: str = "") -> None:
        """Keep a fault of a value of the file."""
        self.findings.add(fault_at(self.root, path, message, code, expected=expected, fix=fix))

    def named(self, key: Path) -> Iterator[tuple[str, Findings]]:
        """Return the path of the file that a key names, and findings for it; nothing where the key names none.

        Faults of that file as a whole are reported where it is named, those without a file at their own key.
        """
        if self.root.word(*key):
            for paths, inner in self.named_together(key):
                yield paths[0], inner

    def named_together(self, key: Path) -> Iterator[tuple[list[str], Findings]]:
        """Return the same for a key that names one file or a list of them."""
        node = self.root.find(*key)
        if node is None:
            return
        nodes = {(*key, number): each for number, each in enumerate(node.elements)} or {key: node}
        named = {path_of(each, self.file): where for where, each in nodes.items() if each.text}
        if not named:
            return
        inner = Findings(self.findings.notes)
        yield list(named), inner

        def placed(fault: Fault) -> Fault:
            where = named.get(fault.file, key)
            return where_named(fault, self.root, where) if fault.file else at_own_key(fault, self.root)

        self.findings.absorb(inner, placed)
        self.files += [path for path in named if path not in self.files]

    @contextmanager
    def places(self, keys: Mapping[str, str] | None = None) -> Iterator[None]:
        """Give faults that know only a key the place of that key; `keys` are those of the file for other names."""
        try:
            yield
        except InputError as error:
            named = (replace(fault, key=(keys or {}).get(fault.key, fault.key)) for fault in error.faults)
            raise InputError(at_own_key(fault, self.root) for fault in named) from None


def read_keys(kind: type[S], path: FilePath | None, assignments: Sequence[str]) -> tuple[S, Reading]:
    """Read a file of which every key can be set, or make one of assignments alone, or raise every fault."""
    reading = Reading.of_keys(kind, path, assignments)
    return reading.read(kind), reading


def read_file(kind: type[S], file: str, assignments: Sequence[str] = ()) -> tuple[S, Reading]:
    """Read a file of a kind, or raise every fault of every file."""
    reading = Reading.of(file, assignments)
    return reading.read(kind), reading


def path_of(node: Node, project: str) -> str:
    """Return the path of the file that a value names, as the user could type it.

    Values that stand in no file are relative to the project file.
    """
    owner = project if node.place.file in NO_FILES else node.place.file
    return str(FilePath(owner).parent / node.text)  # `..` stays: behind a link it does not cancel the folder before it


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
    findings.absorb(inner, lambda fault: where_named(fault, child, ("extends",)))
    return parent


def where_named(fault: Fault, owner: Node, key: Path) -> Fault:
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


def _assigned(root: Node, path: Path, value: Node, name: str, findings: Findings) -> Node:
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
        findings.add(*_once(dict.fromkeys(_fault(kind, root, each) for each in problems[:MOST_EXPLAINED])))
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


def _fault(kind: type[Section], root: Node, problem: Any) -> Fault:  # noqa: ANN401 (a mapping of pydantic)
    """Say what is wrong in the words of the user, with its place in the file."""
    path, owner = _followed(kind, root, problem["loc"])
    if get_origin(owner) is tuple and problem["type"] == "missing":  # one of its values; it has too few
        path = path[:-1]
    error = _explained(problem, str(path[-1]) if path else "", owner)
    at, fix = (*path, error.at) if error.at else path, error.fix
    place = root.place_of(at)
    if error.code == "unknown-key":
        name, node = str(path[-1]), root.find(*path[:-1])
        place = node.keys.get(name, place) if node is not None else place
        if not fix and name in homes(kind):
            fix = f"`{name}` belongs in `{homes(kind)[name]}`"
    expected = "" if error.code == "unknown-key" and fix else error.expected
    return place.fault(error.message, error.code, key=key_path(at), expected=expected, fix=fix)


def _followed(kind: type[Section], root: Node, steps: Path) -> tuple[Path, Any]:
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
        field = owner.model_fields.get(str(step)) if is_section(owner) else None
        inner = field.annotation if field is not None else next(reversed(get_args(owner)), None)
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
    found: dict[str, str] = {}

    def walk(section: type[Section], above: str) -> None:
        for name, field in section.model_fields.items():
            if above:
                found.setdefault(name, above)
            if is_section(inner := bare(field.annotation)):
                walk(inner, f"{above}.{name}" if above else name)

    walk(schema, "")
    return found


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
