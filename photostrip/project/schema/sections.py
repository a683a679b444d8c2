"""Sections of files that users write: pydantic models whose annotations say what their keys hold.

All values arrive as texts, lists and mappings. Texts get their type from readers of our own, which tell the user what
is wrong; pydantic walks through sections, lists and mappings and collects everything that they raise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import UnionType
from typing import Annotated, Any, ClassVar, Self, TypeVar, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, Tag, model_validator
from pydantic_core import core_schema

T = TypeVar("T", bound="Section")
Before = BeforeValidator
After = AfterValidator


class WrongValueError(ValueError):
    """What is wrong with one value; `at` is the key inside a mapping that is at fault."""

    def __init__(self, message: str, *, code: str, expected: str, fix: str, at: str) -> None:
        super().__init__(message)
        self.message, self.code, self.expected, self.fix, self.at = message, code, expected, fix, at


def wrong(message: str, *, code: str = "value", expected: str = "", fix: str = "", at: str = "") -> WrongValueError:
    return WrongValueError(message, code=code, expected=expected, fix=fix, at=at)


@dataclass(frozen=True, eq=False)
class Read:
    """In an annotation: the function that reads the value."""

    function: Callable[[Any], Any]
    schema: dict[str, Any]  # what editors are shown of it

    def __get_pydantic_core_schema__(self, _source: object, _handler: object) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.function)

    def __get_pydantic_json_schema__(self, _core: object, _handler: object) -> dict[str, Any]:
        return dict(self.schema)


class OneOrMany:
    """In an annotation of a list of sections: a single one may stand without the list."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> core_schema.CoreSchema:  # noqa: ANN401 (a type)
        return core_schema.no_info_before_validator_function(
            lambda value: [value] if isinstance(value, dict) else value, handler(source)
        )

    def __get_pydantic_json_schema__(self, core: Any, handler: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:  # noqa: ANN401 (any schema)
        many = handler(core)
        return {"anyOf": [many["items"], many]}


def length(least: int, most: int | None = None) -> Any:  # noqa: ANN401 (a field of pydantic)
    """In an annotation: how many entries a list or a mapping has."""
    return Field(min_length=least, max_length=most)


def key(description: str, default: Any = ..., *, unit: str = "") -> Any:  # noqa: ANN401 (stands for a value)
    """Describe one key; without a default it is required."""
    told = f"{description} [{unit}]" if unit else description
    return Field(default, description=told, json_schema_extra={"unit": unit} if unit else None)


def rule(check: Callable[[Any], None]) -> Any:  # noqa: ANN401 (what pydantic makes of it)
    """Make a method of a section, which raises what is wrong with its values together, part of its reading."""

    def kept(section: T) -> T:
        check(section)
        return section

    return model_validator(mode="after")(kept)


class Section(BaseModel):
    """A mapping of a file: unknown keys are faults. Its values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    gone: ClassVar[dict[str, str]] = {}  # keys that were taken once, and what to do instead

    def changed(self, **values: Any) -> Self:  # noqa: ANN401 (values of any type)
        return self.model_copy(update=values)

    _all_commented_out: ClassVar[Any] = model_validator(mode="before")(lambda value: {} if value == "" else value)


def bare(annotation: Any) -> Any:  # noqa: ANN401 (a type)
    """Take ``| None`` and what reads it off a type; of several kinds of a section give the first."""
    while get_origin(annotation) in {Annotated, Union, UnionType}:
        annotation = get_args(annotation)[0]
    return annotation


def kinds_of(annotation: Any) -> dict[str, Any]:  # noqa: ANN401 (a type)
    """Return the kinds of a section that a discriminator tells apart, by their tags; none of another type."""
    union = get_args(annotation)[0] if get_origin(annotation) is Annotated else None
    return {
        tag.tag: kind
        for arm in get_args(union)
        for kind, *told in [get_args(arm) or (arm,)]
        for tag in told
        if isinstance(tag, Tag)
    }


def is_section(annotation: Any) -> bool:  # noqa: ANN401 (a type)
    return isinstance(annotation, type) and issubclass(annotation, Section)
