"""Sections of files that users write: pydantic models whose annotations say what their keys hold.

All values arrive as texts, lists and mappings. Texts get their type from readers of our own, which tell the user what
is wrong; pydantic walks through sections, lists and mappings and collects everything that they raise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import UnionType
from typing import Annotated, Any, ClassVar, NamedTuple, Self, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, Tag, model_validator
from pydantic_core import core_schema

from photostrip.formats.faults import SMALLEST_LENGTH, NotANumber, shown, suggestion
from photostrip.formats.faults import number as read_number
from photostrip.formats.tables import CONTROL_CHARACTER
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES

Before = BeforeValidator
After = AfterValidator
FALSE, TRUE = ("false", "no", "off"), ("true", "yes", "on")
REPLACED = {"covariance": "bundle"}  # words that were taken once
_ANY = {"type": ["string", "number", "boolean", "null"]}  # whatever an id looks like, it is read as text
_NUMBER = {"type": "number"}
_POSITIVE = {"type": "number", "exclusiveMinimum": 0}
_FRACTION = {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1}
AUTO = {"const": "auto"}
_AXES = {"type": "array", "items": {"enum": [*GROUND_AXES, *CARTESIAN_AXES]}, "minItems": 3, "maxItems": 3}


class WrongValueError(ValueError):
    """What is wrong with one value; `at` is the key inside a mapping that is at fault."""

    def __init__(self, message: str, *, code: str, expected: str, fix: str, at: str) -> None:
        super().__init__(message)
        self.message, self.code, self.expected, self.fix, self.at = message, code, expected, fix, at


class WrongValuesError(ValueError):
    """All that is wrong with the values of one section together."""

    def __init__(self, told: tuple[WrongValueError, ...]) -> None:
        super().__init__(told[0].message)
        self.told = told


Refusals = Iterator[WrongValueError]


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


class Section(BaseModel):
    """A mapping of a file: unknown keys are faults. Its values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    gone: ClassVar[dict[str, str]] = {}  # keys that were taken once, and what to do instead

    @classmethod
    def described(cls, above: str = "") -> Iterator[tuple[str, str, Any]]:
        """Give every key, those of sections below it too: the path above it, its name and its type."""
        for name, field in cls.model_fields.items():
            yield above, name, field.annotation
            if is_section(inner := bare(field.annotation)):
                yield from inner.described(f"{above}.{name}".removeprefix("."))

    def changed(self, **values: Any) -> Self:  # noqa: ANN401 (values of any type)
        return self.model_copy(update=values)

    _all_commented_out: ClassVar[Any] = model_validator(mode="before")(lambda value: {} if value == "" else value)

    @model_validator(mode="after")
    def _by_the_rules(self) -> Self:
        """Refuse what is wrong with its values together: what ``rules(self)`` of its class and those above give."""
        rules = [vars(kind)["rules"] for kind in reversed(type(self).__mro__) if "rules" in vars(kind)]
        if told := tuple(each for given in rules for each in given(self)):
            raise WrongValuesError(told)
        return self


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


class Text(str):
    """A text that the user chose: an id, a name, a path."""

    __slots__ = ()


def single(value: object, expected: str) -> str:
    if not isinstance(value, str):
        what = "a list" if isinstance(value, list) else "a mapping"
        raise wrong(f"{what} is given here", code="type", expected=expected)
    if not value:
        raise wrong("no value is given", code="no-value", expected=expected, fix="write one or remove the key")
    return value


def text(value: object) -> Text:
    """Read a text on one line."""
    word = single(value, "a text")
    if CONTROL_CHARACTER.search(word):
        raise wrong(f"`{shown(word)}` has a control character or a line break in it", expected="a text on one line")
    return Text(word)


def number_between(
    expected: str, least: float = -float("inf"), most: float = float("inf")
) -> Callable[[object], float]:
    """Reader of a number strictly between two limits."""

    def read(value: object) -> float:
        word = single(value, expected)
        try:
            result = read_number(word)
        except NotANumber as why:
            raise wrong(why.message, code="number", expected=expected, fix=why.fix) from None
        if not least < result < most:
            raise wrong(f"{shown(word)} is out of range", code="range", expected=expected)
        return result

    return read


def whole(value: object) -> int:
    """Read a whole number."""
    result = number_between("a whole number")(value)
    if result != int(result):
        raise wrong(f"{value} is not a whole number", code="number", expected="a whole number")
    return int(result)


def or_auto(read: Callable[[object], float]) -> Callable[[object], float | None]:
    """Reader of a number that may also be ``auto`` (None)."""
    return lambda value: None if value == "auto" else read(value)


def known_word(word: str, allowed: tuple[str, ...]) -> str:
    """Require a word from a list."""
    if word not in allowed:
        replaced = REPLACED.get(word)
        fix = f"write `{replaced}`, which took its place" if replaced in allowed else suggestion(word, allowed)
        raise wrong(f"`{shown(word)}` is not known", code="word", expected=_one_of(allowed), fix=fix)
    return word


def _one_of(allowed: tuple[str, ...]) -> str:
    return allowed[0] if len(allowed) == 1 else f"one of {', '.join(allowed)}"


def choice(*allowed: str) -> Read:
    """In an annotation: one of some words."""
    values = [int(each) if each.isdecimal() else each for each in allowed]
    return Read(lambda value: known_word(single(value, _one_of(allowed)), allowed), {"enum": values})


def _flag(value: object) -> bool:
    word = single(value, "true or false").casefold()
    if word not in FALSE + TRUE:
        raise wrong(f"`{shown(word)}` is neither true nor false", code="word", expected="true or false")
    return word in TRUE


def _schema_number(value: object) -> int:
    if single(value, "1") != "1":
        message = f"this version of photostrip does not read schema {shown(str(value))}"
        raise wrong(message, code="schema-number", expected="1")
    return 1


def _axes(value: object) -> tuple[str, str, str]:
    allowed = (GROUND_AXES, CARTESIAN_AXES)
    expected = "a permutation of [east, north, up]; for geocentric coordinates [x, y, z]"
    names = [single(name, expected) for name in (value if isinstance(value, list) else [value])]
    if not any(sorted(names) == sorted(each) for each in allowed):
        written = shown(", ".join(names))
        raise wrong(f"[{written}] does not say which column is which", code="axes", expected=expected)
    first, second, third = names
    return first, second, third


class Range(NamedTuple):
    """Limits of a quantity: wide ones, that catch a wrong unit or a slip of the pen; in an annotation they are kept."""

    least: float
    most: float
    unit: str = ""

    def __str__(self) -> str:
        return f"{self.least:g} to {self.most:g} {self.unit}".rstrip()

    def holds(self, value: float) -> bool:
        """Whether a value lies within the limits; never for NaN."""
        return self.least <= value <= self.most

    def scaled(self, scale: float, unit: str) -> Range:
        """Return the limits in another unit, which is `scale` of this one."""
        return Range(self.least / scale, self.most / scale, unit or self.unit)

    def kept(self, value: float) -> float:
        """Return a value within the limits."""
        if not self.holds(value):
            raise wrong(f"{value:g} is out of range", code="range", expected=str(self))
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> core_schema.CoreSchema:  # noqa: ANN401 (a type)
        return core_schema.no_info_after_validator_function(self.kept, handler(source))

    def __get_pydantic_json_schema__(self, core: Any, handler: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:  # noqa: ANN401 (any schema)
        return {**handler(core), "minimum": self.least, "maximum": self.most}


def if_empty(value: object) -> object:
    """Read a key whose entries are all commented out as an empty mapping."""
    return {} if value == "" else value


def quoted(words: tuple[str, ...]) -> str:
    """List words as a sentence does."""
    quoted = [f"`{word}`" for word in words]
    return f"{', '.join(quoted[:-1])} or {quoted[-1]}"


_read_number = number_between("a number")
_read_not_negative = number_between("a number from 0 on", least=-SMALLEST_LENGTH)
read_positive = number_between("a number larger than 0", least=SMALLEST_LENGTH)
_read_fraction = number_between("a number between 0 and 1", least=0.0, most=1.0)
Id = Annotated[str, Read(text, _ANY)]
Words = Annotated[str, Read(text, {"type": "string", "minLength": 1})]
Number = Annotated[float, Read(_read_number, _NUMBER)]
NotNegative = Annotated[float, Read(_read_not_negative, {"type": "number", "minimum": 0})]
Positive = Annotated[float, Read(read_positive, _POSITIVE)]
Fraction = Annotated[float, Read(_read_fraction, _FRACTION)]
PositiveOrAuto = Annotated[float | None, Read(or_auto(read_positive), {"anyOf": [AUTO, _POSITIVE]})]
NumberOrAuto = Annotated[float | None, Read(or_auto(_read_number), {"anyOf": [AUTO, _NUMBER]})]
Flag = Annotated[bool, Read(_flag, {"type": "boolean"})]
Whole = Annotated[int, Read(whole, {"type": "integer"})]
Pair = tuple[Number, Number]
Triple = tuple[Number, Number, Number]
Sigma3 = tuple[Positive, Positive, Positive]
Axes = Annotated[tuple[str, str, str], Read(_axes, _AXES)]
YAxis = Annotated[str, choice("up", "down")]
Height = Annotated[str, choice("ellipsoidal", "orthometric")]
SchemaNumber = Annotated[int, Read(_schema_number, {"const": 1})]
