"""The tree against the schema, and what is wrong with it in its place."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import TypeVar

from photostrip.errors import Fault, InputError
from photostrip.formats.text.findings import Findings
from photostrip.project.schema.sections import Problem, Section, WrongValueError, bare, read_section, types
from photostrip.project.yaml.tree import Node, Path, fault_at, key_path

Model = type[Section]

T = TypeVar("T", bound=Section)
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
    "photostrip_terrestrial": "a project for `photostrip terrestrial displacement`",
    "photostrip_cameras": "a list of cameras for `photostrip terrestrial`",
    "photostrip_tolerances": "a tolerance profile for `photostrip compare --tol`",
    "photostrip_result": "a result for `photostrip report` and `photostrip compare`",
}


def checked(kind: type[T], root: Node, findings: Findings) -> T | None:
    """Return a file with types and defaults; None when there are faults. A file of another kind is refused at once."""
    given = [name for name in KINDS if name in root.entries]
    if given and not any(name in kind.keys for name in given):
        raise InputError(fault_at(root, (given[0],), f"this is {KINDS[given[0]]}", "other-file"))
    problems: list[Problem] = []
    found = read_section(kind, root.plain, problems)
    faults = dict.fromkeys(_fault(kind, root, *each) for each in problems[:MOST_EXPLAINED])
    findings.add(*_once(faults))
    findings.count(root.place.file, len(problems[MOST_EXPLAINED:]))
    return found


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


def valid_section(kind: type[T], node: Node | None) -> T | None:
    """Return one section of a project of which other parts may be at fault; that of all defaults without a node.

    None when it is at fault itself, which ``checked`` reports.
    """
    return read_section(kind, {} if node is None else node.plain, [])


def _fault(schema: Model, root: Node, path: Path, wrong: WrongValueError) -> Fault:
    """Give what is wrong its place in the file."""
    place, fix, expected = root.place_of((*path, wrong.at) if wrong.at else path), wrong.fix, wrong.expected
    if wrong.code == "unknown-key":
        name, owner = str(path[-1]), root.find(*path[:-1])
        place = owner.keys.get(name, place) if owner is not None else place
        if not fix and name in homes(schema):
            fix = f"`{name}` belongs in `{homes(schema)[name]}`"
        expected = "" if fix else expected
    key = key_path((*path, wrong.at) if wrong.at else path)
    return place.fault(wrong.message, wrong.code, key=key, expected=expected, fix=fix)


def homes(schema: Model) -> dict[str, str]:
    """Return the path above each key that stands below another one: ``processing.relative`` for ``grubbs_alpha``."""
    found: dict[str, str] = {}

    def walk(model: Model, above: str) -> None:
        for name, annotation in types(model).items():
            if above:
                found.setdefault(name, above)
            inner = bare(annotation)
            if isinstance(inner, type) and issubclass(inner, Section):
                walk(inner, f"{above}.{name}" if above else name)

    walk(schema, "")
    return found
