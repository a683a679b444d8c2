"""Texts, paths and words of options become values without the library that typer asks for it.

Since 0.29 typer reads every value through pydantic, whose import takes half as long as those of numpy, pyproj and yaml
together. What is not given, a text, a path and a word from a list need none of it; numbers are left to typer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, get_origin

import typer

if TYPE_CHECKING:
    from typer._click.core import Command

READER = "get_runtime_param"  # method of an option that gives typer what reads its values


def read_plainly(command: Command, above: typer.Context | None = None) -> None:
    """Read the values of a command, and of its subcommands, without pydantic where that is possible."""
    context = typer.Context(command, above, **command.context_settings)
    for each in command.get_params(context):  # --help among them, which is made when it is asked for
        vars(each)[READER] = _Plain
    for below in getattr(command, "commands", {}).values():
        read_plainly(below, context)


class _Plain:
    """Reads the values of an option in place of typer."""

    def coerce(self, value: Any, param: Any, ctx: object) -> Any:  # noqa: ANN401 (typer's own manner)
        """Return a value as what the function of the command takes."""
        annotation, info = param.type_descriptor.annotation, param.type_descriptor.parameter_info
        several = get_origin(annotation) is list
        if value is None:
            return [] if several else None
        texts = value if several else [value]
        read = _reader(get_args(annotation)[0] if several else annotation, texts)
        if read is None or info.parser or info.exists or info.resolve_path:
            del vars(param)[READER]
            return param.get_runtime_param().coerce(value, param=param, ctx=ctx)
        found = [read(text) for text in texts]
        return found if several else found[0]


def _reader(kind: object, values: Sequence[object]) -> Callable[[Any], object] | None:
    """Return what reads all values as being of a kind; None where typer has to say what is wrong or what they are."""
    if kind in {str, Path}:
        return (str if kind is str else Path) if all(isinstance(each, str | Path) for each in values) else None
    if isinstance(kind, type) and issubclass(kind, Enum):
        known = {each.value for each in kind}
        return kind if all(isinstance(each, kind) or each in known for each in values) else None
    return None
