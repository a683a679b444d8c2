"""The tree against the schema, and pydantic's errors in the words of the user."""

from __future__ import annotations

import os
import re
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from photostrip.errors import InputError
from photostrip.formats.text.findings import Findings, suggestion
from photostrip.formats.text.numbers import shown
from photostrip.notes import counted
from photostrip.project.schema.values import Section
from photostrip.project.yaml.document import Node, Path, fault_at, key_path, type_names

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from pydantic.fields import FieldInfo

    from photostrip.errors import Fault

    Model = type[Section]

os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # it would look for some in every installed package
T = TypeVar("T", bound=Section)
MEANT = re.compile(r"did you mean `(.+)`\?")  # a suggestion
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
EXPECTED = {
    "model_type": type_names[dict],
    "dict_type": type_names[dict],
    "list_type": "a list ([a, b] or lines `- a`)",
    "tuple_type": "a list of values in brackets",
}


def checked(kind: type[T], root: Node, findings: Findings) -> T | None:
    """Return a file with types and defaults; None when there are faults. A file of another kind is refused at once."""
    given = [name for name in KINDS if name in root.entries]
    if given and not any(name in kind.model_fields for name in given):
        raise InputError(fault_at(root, (given[0],), f"this is {KINDS[given[0]]}", "other-file"))
    try:
        return kind.model_validate(root.plain)
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False)
        faults = dict.fromkeys(_fault(kind, root, each) for each in found[:MOST_EXPLAINED])
        findings.add(*_once(faults))
        findings.count(root.place.file, len(found[MOST_EXPLAINED:]))
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


def valid_section(kind: type[T], node: Node | None) -> T | None:
    """Return one section of a project of which other parts may be at fault; that of all defaults without a node.

    None when it is at fault itself, which ``checked`` reports.
    """
    try:
        return kind.model_validate({} if node is None else node.plain)
    except ValidationError:
        return None


def _fault(schema: Model, root: Node, error: Any) -> Fault:  # noqa: ANN401 (pydantic's dictionary of an error)
    """Turn one of pydantic's errors into a fault."""
    path: Path = error["loc"]
    kind: str = error["type"]
    if kind == "photostrip":
        context = error["ctx"]
        if context["at"]:
            path = (*path, context["at"])
        words = {"expected": context["expected"], "fix": context["fix"]}
        return fault_at(root, path, context["message"], context["code"], **words)
    if kind == "extra_forbidden":
        return _unknown(schema, root, path)
    if kind == "missing" and isinstance(path[-1], str):
        expected = _described(schema, path)
        return fault_at(root, path, f"`{path[-1]}` is missing", "missing-key", expected=expected)
    if kind in EXPECTED:
        return _wrong_type(root, path, EXPECTED[kind])
    if kind in {"missing", "too_long", "too_short"}:
        return _wrong_length(schema, root, path[:-1] if kind == "missing" else path)
    return fault_at(root, path, f"the value is not understood ({error['msg']})", "value")


def _unknown(schema: Model, root: Node, path: Path) -> Fault:
    """Refuse a key that the schema does not have."""
    name = str(path[-1])
    owner = root.find(*path[:-1])
    place = owner.keys[name] if owner is not None and name in owner.keys else root.place_of(path)
    known = list(_fields_at(schema, path[:-1]))
    fix = suggestion(name, known)
    if not fix and name in homes(schema):
        fix = f"`{name}` belongs in `{homes(schema)[name]}`"
    message = f"the key `{shown(name)}` is not known"
    expected = "" if fix else f"one of {', '.join(known)}"
    return place.fault(message, "unknown-key", key=key_path(path), expected=expected, fix=fix)


def _wrong_type(root: Node, path: Path, expected: str) -> Fault:
    node = root.find(*path)
    value = node.value if node is not None else ""
    message = "no value is given" if value == "" else f"{type_names[type(value)]} is given here"
    return fault_at(root, path, message, "type", expected=expected)


def _wrong_length(schema: Model, root: Node, path: Path) -> Fault:
    node = root.find(*path)
    number = len(node.value) if node is not None else 0
    wanted = [each for each in get_args(_annotation(schema, path)) if each is not Ellipsis]
    if get_origin(_annotation(schema, path)) is tuple:
        return fault_at(
            root, path, f"{counted(number, 'value')} in the list", "length", expected=f"{len(wanted)} values"
        )
    what = {"photos": "photo", "cameras": "camera", "strips": "strip"}.get(str(path[-1]), "entry")
    return fault_at(root, path, f"there is no {what}", "length", expected=f"at least {counted(1, what)}")


def _annotation(schema: Model, path: Path) -> Any:  # noqa: ANN401 (a type)
    """Type that the schema wants at a path; None where the schema ends."""
    current: Any = schema
    for step in path:
        current = _bare(current)
        if isinstance(current, type) and issubclass(current, BaseModel):
            field = current.model_fields.get(str(step))
            current = field.annotation if field is not None else None
        else:
            current = (get_args(current) or (None,))[-1]
    return _bare(current)


def _bare(annotation: Any) -> Any:  # noqa: ANN401 (a type)
    """Take ``Annotated`` and ``| None`` off a type."""
    while True:
        arguments = get_args(annotation)
        if hasattr(annotation, "__metadata__"):
            annotation = arguments[0]
        elif type(None) in arguments:
            annotation = next(each for each in arguments if each is not type(None))
        else:
            return annotation


def _fields_at(schema: Model, path: Path) -> dict[str, FieldInfo]:
    """Keys that the schema has at a path."""
    annotation = _annotation(schema, path)
    return annotation.model_fields if isinstance(annotation, type) and issubclass(annotation, Section) else {}


def _described(schema: Model, path: Path) -> str:
    """Say what the schema wants at a path: the description of the key, which ends with its unit."""
    field = _fields_at(schema, path[:-1]).get(str(path[-1]))
    description = (field.description or "") if field is not None else ""
    return description[:1].lower() + description[1:] if description[1:2].islower() else description


@cache
def homes(schema: Model) -> dict[str, str]:
    """Return the path above each key that stands below another one: ``processing.relative`` for ``grubbs_alpha``."""
    found: dict[str, str] = {}

    def walk(model: type[BaseModel], above: str) -> None:
        for name, field in model.model_fields.items():
            if above:
                found.setdefault(name, above)
            inner = _bare(field.annotation)
            if isinstance(inner, type) and issubclass(inner, BaseModel):
                walk(inner, f"{above}.{name}" if above else name)

    walk(schema, "")
    return found
