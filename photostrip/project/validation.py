"""The tree against the schema, and pydantic's errors in the words of the user."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from photostrip.errors import Fault
from photostrip.formats.findings import counted, suggestion
from photostrip.formats.numbers import shown
from photostrip.project.document import Node, fault_at, key_path, type_names
from photostrip.project.schema import NOT_YET, ProjectFile, Section

if TYPE_CHECKING:
    from photostrip.formats.findings import Findings

    Path = tuple[str | int, ...]

T = TypeVar("T", bound=Section)
EXPECTED = {
    "model_type": type_names[dict],
    "dict_type": type_names[dict],
    "list_type": "a list ([a, b] or lines `- a`)",
    "tuple_type": "a list of values in brackets",
}


def validate(root: Node, findings: Findings) -> ProjectFile | None:
    """Check the project against the schema.

    Parameters
    ----------
    root : Node
        The project.
    findings : Findings
        Where faults go.

    Returns
    -------
    ProjectFile or None
        The project with types and defaults; None when there are faults.
    """
    waiting = [name for name in NOT_YET if name in root.entries]
    for name in waiting:
        place = root.keys[name]
        message = f"`{name}` is not available yet: it {NOT_YET[name]}"
        findings.add(Fault(message, "not-available", place.file, place.line, place.column, name, fix="remove it"))
    plain = {name: node.plain for name, node in root.entries.items() if name not in NOT_YET}
    try:
        project = ProjectFile.model_validate(plain)
    except ValidationError as error:
        findings.add(*dict.fromkeys(_fault(root, each) for each in error.errors(include_url=False)))
        return None
    return None if waiting else project


def valid_section(kind: type[T], node: Node | None) -> T | None:
    """Give one section of a project of which other parts may be at fault.

    Parameters
    ----------
    kind : type
        What the section is.
    node : Node or None
        Where it stands; None gives the section of all defaults.

    Returns
    -------
    Section or None
        The section; None when it is at fault itself, which :func:`validate` reports.
    """
    try:
        return kind.model_validate({} if node is None else node.plain)
    except ValidationError:
        return None


def _fault(root: Node, error: Any) -> Fault:  # noqa: ANN401 (pydantic's dictionary of an error)
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
        return _unknown(root, path)
    if kind == "missing" and isinstance(path[-1], str):
        expected = describe(path)
        return fault_at(root, path, f"`{path[-1]}` is missing", "missing-key", expected=expected)
    if kind in EXPECTED:
        return _wrong_type(root, path, EXPECTED[kind])
    if kind in {"missing", "too_long", "too_short"}:
        return _wrong_length(root, path[:-1] if kind == "missing" else path)
    return fault_at(root, path, f"the value is not understood ({error['msg']})", "value")


def _unknown(root: Node, path: Path) -> Fault:
    """Refuse a key that the schema does not have."""
    name = str(path[-1])
    owner = root.find(*path[:-1])
    place = owner.keys[name] if owner is not None and name in owner.keys else root.place_of(path)
    known = _keys_at(path[:-1])
    fix = suggestion(name, known)
    if not fix and name in homes():
        fix = f"`{name}` belongs into `{homes()[name]}`"
    message = f"the key `{shown(name)}` is not known"
    expected = "" if fix else f"one of {', '.join(known)}"
    return Fault(message, "unknown-key", place.file, place.line, place.column, key_path(path), expected, fix)


def _wrong_type(root: Node, path: Path, expected: str) -> Fault:
    node = root.find(*path)
    value = node.value if node is not None else ""
    message = "no value is given" if value == "" else f"{type_names[type(value)]} stands here"
    return fault_at(root, path, message, "type", expected=expected)


def _wrong_length(root: Node, path: Path) -> Fault:
    node = root.find(*path)
    number = len(node.value) if node is not None else 0
    wanted = [each for each in get_args(_annotation(path)) if each is not Ellipsis]
    if get_origin(_annotation(path)) is tuple:
        return fault_at(
            root, path, f"{counted(number, 'value')} in the list", "length", expected=f"{len(wanted)} values"
        )
    least = 2 if path and path[-1] == "photos" else 1
    what = {"photos": "photo", "cameras": "camera", "strips": "strip", "control": "control list"}.get(
        str(path[-1]), "entry"
    )
    message = f"there is {'no' if not number else 'only one'} {what}"
    return fault_at(root, path, message, "length", expected=f"at least {counted(least, what)}")


# ---------------------------------------------------------------------------------- looking into the schema


def _annotation(path: Path) -> Any:  # noqa: ANN401 (a type)
    """Type that the schema wants at a path; None where the schema ends."""
    current: Any = ProjectFile
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


def _keys_at(path: Path) -> list[str]:
    """Keys that the schema has at a path."""
    annotation = _annotation(path)
    return list(annotation.model_fields) if isinstance(annotation, type) and issubclass(annotation, Section) else []


def describe(path: Path) -> str:
    """Say what the schema wants at a path.

    Parameters
    ----------
    path : tuple of str or int
        Keys and numbers.

    Returns
    -------
    str
        The description of the key, which ends with its unit.
    """
    owner = _annotation(path[:-1])
    field = owner.model_fields.get(str(path[-1])) if isinstance(owner, type) and issubclass(owner, Section) else None
    description = (field.description or "") if field is not None else ""
    return description[:1].lower() + description[1:] if description[1:2].islower() else description


@cache
def homes() -> dict[str, str]:
    """Where keys belong that stand below another one: name of the key to the path above it.

    Returns
    -------
    dict of str to str
        For example ``grubbs_alpha`` to ``processing.relative``.
    """
    found: dict[str, str] = {}

    def walk(model: type[BaseModel], above: str) -> None:
        for name, field in model.model_fields.items():
            if above:
                found.setdefault(name, above)
            inner = _bare(field.annotation)
            if isinstance(inner, type) and issubclass(inner, BaseModel):
                walk(inner, f"{above}.{name}" if above else name)

    walk(ProjectFile, "")
    return found
