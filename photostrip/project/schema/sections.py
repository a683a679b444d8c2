"""Sections of files that users write: classes whose annotations say what their keys hold.

A section is read from texts, lists and mappings in one walk, which finds all that is wrong. What the annotations of a
section mean is looked up when a file has it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    NamedTuple,
    Never,
    Self,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
)
from typing import get_type_hints as annotations_of

from photostrip.formats.text.findings import suggestion
from photostrip.formats.text.numbers import shown
from photostrip.notes import counted

Path = tuple[str | int, ...]  # keys and numbers that lead to a value
Reader = Callable[[object, Path, list["Problem"]], Any]

MAPPING, LIST, VALUES = (
    "a mapping (lines `key: value`)",
    "a list ([a, b] or lines `- a`)",
    "a list of values in brackets",
)
NAMES: dict[type, str] = {list: "a list", dict: MAPPING}  # of what is given where something else is expected
ENTRIES = {"photos": "photo", "cameras": "camera", "strips": "strip"}
T = TypeVar("T", bound="Section")


class WrongValueError(ValueError):
    """What is wrong with one value; `at` is the key inside a mapping that is at fault."""

    def __init__(self, message: str, *, code: str, expected: str, fix: str, at: str) -> None:
        super().__init__(message)
        self.message, self.code, self.expected, self.fix, self.at = message, code, expected, fix, at


def wrong(message: str, *, code: str = "value", expected: str = "", fix: str = "", at: str = "") -> WrongValueError:
    return WrongValueError(message, code=code, expected=expected, fix=fix, at=at)


class Problem(NamedTuple):
    """Something wrong at a place of a file."""

    path: Path
    wrong: WrongValueError


@dataclass(frozen=True, eq=False)
class Read:
    """In an annotation: the function that reads the value."""

    function: Callable[[Any], Any]
    schema: dict[str, Any]  # what editors are shown of it


@dataclass(frozen=True, eq=False)
class Before:
    """In an annotation: what is done to the value before it is read."""

    function: Callable[[Any], Any]


@dataclass(frozen=True, eq=False)
class After:
    """In an annotation: what checks the value that was read, and gives it."""

    function: Callable[[Any], Any]


@dataclass(frozen=True, eq=False)
class Length:
    """In an annotation: how many entries a list or a mapping has."""

    least: int
    most: int | None = None


@dataclass(frozen=True)
class OneOrMany:
    """In an annotation of a list of sections: a single one may stand without the list."""


class Rule(NamedTuple):
    """A method of a section that raises what is wrong with its values together."""

    check: Callable[[Any], None]


class Key(NamedTuple):
    description: str = ""
    default: Any = ...  # none: the key is required
    unit: str = ""


def key(description: str, default: Any = ..., *, unit: str = "") -> Any:  # noqa: ANN401 (stands for a value)
    """Describe one key; without a default it is required."""
    return Key(f"{description} [{unit}]" if unit else description, default, unit)


class Section:
    """A mapping of a file: unknown keys are faults. Its values do not change."""

    keys: ClassVar[dict[str, Key]] = {}
    rules: ClassVar[tuple[Rule, ...]] = ()
    gone: ClassVar[dict[str, str]] = {}  # keys that were taken once, and what to do instead
    kinds: ClassVar[tuple[str, dict[str, type[Section]]]] = "", {}  # a key, and other sections by its value
    types: ClassVar[dict[str, Any]]  # once they are asked for: the annotation of each key, and what reads it
    readers: ClassVar[dict[str, Reader]]
    given: frozenset[str]  # keys that are not left to their defaults

    def __init_subclass__(cls) -> None:
        own = vars(cls)
        entries = {name: own.get(name, Key()) for name in own.get("__annotations__", ())}
        cls.keys = {**cls.keys, **entries}
        cls.rules = (*cls.rules, *(each for each in own.values() if isinstance(each, Rule)))

    def __init__(self, **values: Any) -> None:  # noqa: ANN401 (values of any type)
        usual = {name: entry.default for name, entry in self.keys.items() if entry.default is not ...}
        self.__dict__.update({**usual, **values}, given=frozenset(values))

    def __setattr__(self, name: str, value: object) -> Never:
        message = f"{name} of a section does not change"
        raise AttributeError(message)

    def values(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.keys}

    def changed(self, **values: Any) -> Self:  # noqa: ANN401 (values of any type)
        return type(self)(**{**self.values(), **values})


def read_section(kind: type[T], value: object, problems: list[Problem], path: Path = ()) -> T | None:
    """Read a section, or None where something is wrong with it."""
    if value == "":  # all its keys are commented out
        value = {}
    if not isinstance(value, dict):
        problems.append(Problem(path, _other_type(value, MAPPING)))
        return None
    word, others = kind.kinds
    if word in value and (other := others.get(str(value[word]))):
        return cast("T | None", read_section(other, value, problems, path))
    before, readers = len(problems), _readers(kind)
    found = {name: readers[name](value[name], (*path, name), problems) for name in kind.keys if name in value}
    missing = [name for name, entry in kind.keys.items() if entry.default is ... and name not in value]
    problems += [Problem((*path, name), _missing(name, kind.keys[name])) for name in missing]
    problems += [Problem((*path, name), _unknown(name, kind)) for name in value if name not in kind.keys]
    if len(problems) > before:
        return None
    section = kind(**found)
    try:
        for rule in kind.rules:
            rule.check(section)
    except WrongValueError as error:
        problems.append(Problem(path, error))
        return None
    return section


def _missing(name: str, entry: Key) -> WrongValueError:
    expected = entry.description
    expected = expected[:1].lower() + expected[1:] if expected[1:2].islower() else expected
    return wrong(f"`{name}` is missing", code="missing-key", expected=expected)


def _unknown(name: str, kind: type[Section]) -> WrongValueError:
    known = list(kind.keys)
    expected = f"one of {', '.join(known)}"
    fix = kind.gone.get(name) or suggestion(name, known)
    return wrong(f"the key `{shown(name)}` is not known", code="unknown-key", expected=expected, fix=fix)


def types(kind: type[Section]) -> dict[str, Any]:
    """Return the annotation of each key of a section.

    The modules of this room have no ``from __future__ import annotations``: reading 141 texts takes 4 ms.
    """
    if "types" not in vars(kind):
        found = annotations_of(kind, include_extras=True)
        kind.types = {name: found[name] for name in kind.keys}
    return kind.types


def _readers(kind: type[Section]) -> dict[str, Reader]:
    """Return what reads each key of a section."""
    if "readers" not in vars(kind):
        kind.readers = {name: _reader(each) for name, each in types(kind).items()}
    return kind.readers


def bare(annotation: Any) -> Any:  # noqa: ANN401 (a type)
    """Take ``| None`` off a type, and the kinds of a section that one of its keys tells apart."""
    parts = get_args(annotation) if get_origin(annotation) in {Union, UnionType} else ()
    return next((each for each in parts if each is not NoneType), annotation)


def _reader(annotation: Any) -> Reader:  # noqa: ANN401 (a type)
    """Return what reads a value of a type."""
    inner = bare(annotation)
    if inner is not annotation:
        return _reader(inner)
    if get_origin(inner) is Annotated:
        reader: Reader | None = None
        for each in inner.__metadata__:
            if isinstance(each, Read):
                reader = _guarded(each.function)
            elif isinstance(each, OneOrMany):
                reader = _one_or_many(inner.__origin__)
            elif isinstance(each, Before | After | Length):
                reader = _changed(each, reader or _reader(inner.__origin__))
        return reader or _reader(inner.__origin__)
    if isinstance(inner, type) and issubclass(inner, Section):
        return lambda value, path, problems: read_section(inner, value, problems, path)
    if get_origin(inner) is None:  # names of a mapping are texts
        return _guarded(lambda value: value)
    many: dict[Any, Callable[..., Reader]] = {list: _list, tuple: _tuple, dict: _dict}
    return many[get_origin(inner)](*map(_reader, get_args(inner)))


def _guarded(function: Callable[[Any], Any]) -> Reader:
    """Reader that keeps what a function raises."""

    def read(value: object, path: Path, problems: list[Problem]) -> Any:  # noqa: ANN401 (any value)
        try:
            return function(value)
        except WrongValueError as error:
            problems.append(Problem(path, error))

    return read


def _changed(step: Before | After | Length, reader: Reader) -> Reader:
    """Reader with a step before it or after it."""
    if isinstance(step, Before):
        before = step.function
        return lambda value, path, problems: reader(before(value), path, problems)

    def read(value: object, path: Path, problems: list[Problem]) -> Any:  # noqa: ANN401 (any value)
        known = len(problems)
        found = reader(value, path, problems)
        if len(problems) > known:
            return None
        if isinstance(step, After):
            return _guarded(step.function)(found, path, problems)
        if not step.least <= len(found) <= (step.most or len(found)):
            problems.append(Problem(path, _wrong_length(len(found), step, path)))
        return found

    return read


def _wrong_length(count: int, step: Length, path: Path) -> WrongValueError:
    what = ENTRIES.get(str(path[-1]), "entry")
    message = f"there is no {what}" if not count else f"there are {count} entries"
    bound = f"at least {counted(step.least, what)}" if count < step.least else f"at most {step.most}"
    return wrong(message, code="length", expected=bound)


def _list(entry: Reader) -> Reader:
    def read(value: object, path: Path, problems: list[Problem]) -> Any:  # noqa: ANN401 (any value)
        if not isinstance(value, list):
            problems.append(Problem(path, _other_type(value, LIST)))
            return None
        return [entry(each, (*path, number), problems) for number, each in enumerate(value)]

    return read


def _one_or_many(annotation: Any) -> Reader:  # noqa: ANN401 (a type)
    many, one = _reader(annotation), _reader(get_args(annotation)[0])
    return lambda value, path, problems: (
        [one(value, path, problems)] if isinstance(value, dict) else many(value, path, problems)
    )


def _tuple(*entries: Reader) -> Reader:
    def read(value: object, path: Path, problems: list[Problem]) -> Any:  # noqa: ANN401 (any value)
        if not isinstance(value, list):
            problems.append(Problem(path, _other_type(value, VALUES)))
            return None
        if len(value) != len(entries):
            message = f"{counted(len(value), 'value')} in the list"
            problems.append(Problem(path, wrong(message, code="length", expected=f"{len(entries)} values")))
        pairs = enumerate(zip(entries, value, strict=False))
        return tuple(entry(each, (*path, number), problems) for number, (entry, each) in pairs)

    return read


def _dict(name: Reader, entry: Reader) -> Reader:
    def read(value: object, path: Path, problems: list[Problem]) -> Any:  # noqa: ANN401 (any value)
        if not isinstance(value, dict):
            problems.append(Problem(path, _other_type(value, MAPPING)))
            return None
        return {
            name(each, (*path, each), problems): entry(found, (*path, each), problems) for each, found in value.items()
        }

    return read


def _other_type(value: object, expected: str) -> WrongValueError:
    message = "no value is given" if value == "" else f"{NAMES.get(type(value), 'a single value')} is given here"
    return wrong(message, code="type", expected=expected)
