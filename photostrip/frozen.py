"""Frozen dataclasses, made without compiling code.

The decorator of the standard library writes and compiles four functions for each class, 0.5 ms; a run loads 150. Here
all classes share theirs, and the standard library sees a class when it is asked for its fields. For type checkers,
``fields``, ``replace`` and ``asdict`` they are dataclasses.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Never, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["dataclass"]

T = TypeVar("T")
FIELDS = "__dataclass_fields__"  # where the standard library keeps them


def _dataclass(*, frozen: bool, eq: bool = True) -> Callable[[type[T]], type[T]]:
    """Make a class a frozen dataclass; with `eq` its values are equal when all their fields are."""
    if not frozen:
        raise TypeError("values that change are dataclasses of the standard library")
    shared: dict[str, Any] = {"__repr__": _text, "__setattr__": _refuse, "__delattr__": _refuse}
    if eq:
        shared |= {"__eq__": _same, "__hash__": _hash}

    def made(cls: type[T]) -> type[T]:
        for name, function in {"__init__": _builder(cls), **shared, FIELDS: _Fields(cls)}.items():
            setattr(cls, name, function)
        return cls

    return made


class _Fields:
    """Stands for the fields of a class until somebody asks for them."""

    def __init__(self, cls: type) -> None:
        self.cls = cls

    def __get__(self, value: object, owner: type) -> object:
        dataclasses.dataclass(init=False, repr=False, eq=False)(self.cls)  # puts the fields in the place of this
        return vars(self.cls)[FIELDS]


def _declared(cls: type) -> dict[str, Any]:
    """Fields of a class and those above it: default, or ``Field``, or nothing."""
    found: dict[str, Any] = {}
    for each in reversed(cls.__mro__):
        own = vars(each)
        if isinstance(own.get(FIELDS), _Fields):
            kinds = own.get("__annotations__", {}).items()
            names = (name for name, kind in kinds if not str(kind).startswith("ClassVar"))
            found.update((name, own.get(name, dataclasses.MISSING)) for name in names)
        else:
            found.update(own.get(FIELDS, {}))
    return found


def _values_left_out(cls: type) -> tuple[dict[str, None], dict[str, Any], dict[str, Callable[[], object]]]:
    """Names of all fields, defaults, and functions that make one."""
    names: dict[str, None] = {}
    defaults: dict[str, Any] = {}
    factories: dict[str, Callable[[], object]] = {}
    for name, declared in _declared(cls).items():
        names[name] = None
        default = declared.default if isinstance(declared, dataclasses.Field) else declared
        if default is not dataclasses.MISSING:
            defaults[name] = default
        elif callable(factory := getattr(declared, "default_factory", None)):
            factories[name] = factory
    return names, defaults, factories


def _builder(cls: type) -> Callable[..., None]:
    """Make the ``__init__`` of a class."""
    known: list[tuple[dict[str, None], dict[str, Any], dict[str, Callable[[], object]]]] = []
    finish = getattr(cls, "__post_init__", None)

    def build(self: object, *values: object, **named: object) -> None:
        if not known:
            known.append(_values_left_out(cls))
        names, defaults, factories = known[0]
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
