"""typer, where a command declares its options: loaded only where it has to read them, or print.

Importing typer and letting it make the parser of a command takes an eighth of a run of 20 photos. Modules of commands
import `typer` from here; what they declare is handed over when typer is needed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, update_wrapper
from types import FunctionType
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_origin, get_type_hints

if TYPE_CHECKING:
    import typer

__all__ = ["Declared", "for_typer", "option_for_typer", "typer"]


class Declared:
    """An option or an argument: what typer will be told of it."""

    def __init__(self, kind: str, *names: str, **told: Any) -> None:  # noqa: ANN401 (whatever typer takes)
        self.kind, self.names, self.told = kind, names, told


class _Typer:
    def __getattr__(self, name: str) -> object:
        if name in {"Option", "Argument"}:
            return partial(Declared, name)
        import typer

        return getattr(typer, name)


if not TYPE_CHECKING:
    typer = _Typer()


def for_typer(command: Callable[..., object]) -> Callable[..., object]:
    """Return a command whose options are typer's."""
    code, defaults, cells = command.__code__, command.__defaults__, command.__closure__
    copy = FunctionType(code, command.__globals__, argdefs=defaults, closure=cells)
    copy.__kwdefaults__ = command.__kwdefaults__
    given = update_wrapper(copy, command)
    del given.__wrapped__  # typer would look there
    hints = get_type_hints(command, include_extras=True)
    given.__annotations__ = {name: option_for_typer(hint) for name, hint in hints.items()}
    return given


def option_for_typer(annotation: Any) -> Any:  # noqa: ANN401
    """Return the annotation of a parameter with typer's option in place of what was declared."""
    if get_origin(annotation) is not Annotated:
        return annotation
    import typer

    kind, *told = get_args(annotation)
    known = [
        getattr(typer, each.kind)(*each.names, **each.told) if isinstance(each, Declared) else each for each in told
    ]
    form: Any = Annotated
    return form[(kind, *known)]
