"""One reader of every YAML file: what it extends, what the command line sets, its schema, its faults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import TypeVar

from photostrip.errors import Fault, InputError
from photostrip.formats.text.findings import Findings
from photostrip.project.schema.sections import Section
from photostrip.project.yaml.merging import override, path_of, read_tree, where_named
from photostrip.project.yaml.tree import COMMAND_LINE, Node, Path, Place, at_own_key, fault_at
from photostrip.project.yaml.validation import checked

S = TypeVar("S", bound=Section)
T = TypeVar("T")


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
