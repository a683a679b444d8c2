"""Values made by ``photostrip.frozen`` behave as frozen dataclasses of the standard library do."""

from __future__ import annotations

import dataclasses
import pickle
from copy import copy
from typing import Any

import pytest

from photostrip import frozen

DECORATORS = [frozen.dataclass, dataclasses.dataclass]


@frozen.dataclass(frozen=True)
class Plain:
    """At the top of a module, where pickle finds it."""

    name: str
    size: float = 1.0


def classes(decorator: Any) -> tuple[Any, ...]:  # noqa: ANN401 (the real one, or that of the house)
    """Give a class, one that is derived from it and one without equality, made by a decorator."""

    @decorator(frozen=True)
    class Base:
        name: str
        many: list[int] = dataclasses.field(default_factory=list)
        hidden: int = dataclasses.field(default=3, repr=False)

    @decorator(frozen=True, eq=False)
    class Derived(Base):
        last: str = "end"

        def __post_init__(self) -> None:
            if self.last == "bad":
                raise ValueError(self.last)

    @decorator(frozen=True, eq=False)
    class Alone:
        name: str = ""

    return Base, Derived, Alone


@pytest.mark.parametrize("decorator", DECORATORS)
def test_values_are_built_compared_shown_and_replaced(decorator: Any) -> None:  # noqa: ANN401
    base, derived, alone = classes(decorator)
    first, second = base("a", [1]), base(name="a", many=[1])
    assert first == second
    assert first != base("a")
    assert first != derived("a", [1])
    assert repr(first).endswith("Base(name='a', many=[1])")
    assert base("a").many is not base("a").many
    assert dataclasses.asdict(derived("b")) == {"name": "b", "many": [], "hidden": 3, "last": "end"}
    assert dataclasses.replace(derived("b"), hidden=4).hidden == 4
    assert alone() != alone()
    assert len({alone(), alone()}) == 2
    assert hash(base("a", (1,))) == hash(base("a", (1,)))  # type: ignore[arg-type, unused-ignore]
    assert copy(first) == first
    assert dataclasses.is_dataclass(base)
    with pytest.raises(ValueError, match="bad"):
        derived("b", last="bad")


@pytest.mark.parametrize("decorator", DECORATORS)
def test_a_value_does_not_change(decorator: Any) -> None:  # noqa: ANN401
    value = classes(decorator)[0]("a")
    with pytest.raises(dataclasses.FrozenInstanceError):
        value.name = "b"
    with pytest.raises(dataclasses.FrozenInstanceError):
        del value.name
    with pytest.raises(dataclasses.FrozenInstanceError):
        value.other = 1
    assert value.name == "a"


@pytest.mark.parametrize("decorator", DECORATORS)
@pytest.mark.parametrize(
    ("values", "named"),
    [((), {}), (("a", [], 1, 2), {}), (("a",), {"name": "b"}), (("a",), {"other": 1}), ((), {"many": []})],
)
def test_wrong_arguments_are_refused(decorator: Any, values: tuple[Any, ...], named: dict[str, Any]) -> None:  # noqa: ANN401
    with pytest.raises(TypeError):
        classes(decorator)[0](*values, **named)


def test_values_travel_between_processes() -> None:
    assert pickle.loads(pickle.dumps(Plain("a", 2.0))) == Plain("a", 2.0)  # noqa: S301 (our own)


def test_what_may_change_is_not_made_here() -> None:
    with pytest.raises(TypeError, match="standard library"):
        frozen.dataclass(frozen=False)


def test_fields_are_named_and_given_without_the_standard_library() -> None:
    @frozen.dataclass(frozen=True)
    class Outer:
        inner: Plain
        others: list[str] = dataclasses.field(default_factory=list)

    value = Outer(Plain("a"))
    assert frozen.names_of(Outer) == ("inner", "others")
    assert frozen.names_of(str) == frozen.names_of(dict) == ()
    assert frozen.as_dict(value) == {"inner": {"name": "a", "size": 1.0}, "others": []} == dataclasses.asdict(value)
    for each in DECORATORS:
        _, derived, _ = classes(each)
        assert frozen.names_of(derived) == ("name", "many", "hidden", "last")
