"""Frozen dataclasses, made without compiling code.

The decorator of the standard library writes and compiles four functions for each class, 0.5 ms; a run loads 150. Here
all classes share theirs. For type checkers, ``fields``, ``replace`` and ``asdict`` they are dataclasses.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Never, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["dataclass"]

T = TypeVar("T")


def _dataclass(*, frozen: bool, eq: bool = True) -> Callable[[type[T]], type[T]]:
    """Make a class a frozen dataclass; with `eq` its values are equal when all their fields are."""
    if not frozen:
        raise TypeError("values that change are dataclasses of the standard library")
    shared: dict[str, Any] = {"__repr__": _text, "__setattr__": _refuse, "__delattr__": _refuse}
    if eq:
        shared |= {"__eq__": _same, "__hash__": _hash}

    def made(cls: type[T]) -> type[T]:
        dataclasses.dataclass(init=False, repr=False, eq=False)(cls)
        for name, function in {"__init__": _builder(cls), **shared}.items():
            setattr(cls, name, function)
        return cls

    return made


def _builder(cls: type) -> Callable[..., None]:
    """Make the ``__init__`` of a class."""
    fields = dataclasses.fields(cls)
    names = {each.name: None for each in fields}
    defaults = {each.name: each.default for each in fields if each.default is not dataclasses.MISSING}
    factories = {each.name: each.default_factory for each in fields if callable(each.default_factory)}
    finish = getattr(cls, "__post_init__", None)

    def build(self: object, *values: object, **named: object) -> None:
        given = dict(zip(names, values, strict=False))
        state = {**defaults, **given, **named}
        for name, factory in factories.items():
            if name not in state:
                state[name] = factory()
        if len(values) > len(given) or given.keys() & named or state.keys() != names.keys():
            message = f"{cls.__qualname__} has {', '.join(names)}, not {len(values)} values and {', '.join(named)}"
            raise TypeError(message)
        self.__dict__.update(state)
        if finish is not None:
            finish(self)

    return build


def _values(value: Any) -> tuple[object, ...]:  # noqa: ANN401 (any dataclass)
    return tuple(getattr(value, each.name) for each in dataclasses.fields(value))


def _text(self: Any) -> str:  # noqa: ANN401 (any dataclass)
    shown = (f"{each.name}={getattr(self, each.name)!r}" for each in dataclasses.fields(self) if each.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _same(self: object, other: object) -> bool:
    return _values(self) == _values(other) if type(other) is type(self) else NotImplemented


def _hash(self: object) -> int:
    return hash(_values(self))


def _refuse(self: object, name: str, *_: object) -> Never:
    message = f"{name} of a frozen {type(self).__qualname__}"
    raise dataclasses.FrozenInstanceError(message)


if TYPE_CHECKING:
    from dataclasses import dataclass
else:
    dataclass = _dataclass
