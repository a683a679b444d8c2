"""One project from several sources: what ``extends`` brings, what the file says, what overrides set."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as FilePath

from photostrip.errors import Fault
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.numbers import shown
from photostrip.project.yaml.parsing import parse, read_document
from photostrip.project.yaml.tree import NO_FILES, OVERRIDE, Node, Path, Place, at_key, fault_at, place_of, steps

LONGEST_CHAIN = 8


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
