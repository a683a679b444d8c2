"""The tree against the schema, and what is wrong with it in its place."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any, TypeVar, get_args, get_origin

from pydantic import ValidationError

from photostrip.errors import Fault, InputError
from photostrip.formats.text.findings import Findings, suggestion
from photostrip.formats.text.numbers import shown
from photostrip.notes import counted
from photostrip.project.schema.sections import Section, WrongValueError, bare, is_section, kinds_of, wrong
from photostrip.project.yaml.tree import Node, Path, fault_at, key_path, type_names

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


def checked(kind: type[T], root: Node, findings: Findings) -> T | None:
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


def valid_section(kind: type[T], value: object) -> T | None:
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
