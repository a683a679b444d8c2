"""Commands of commands, and groups of options: declared once as a dataclass, one parameter of each command."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import MISSING, fields, is_dataclass
from functools import wraps
from inspect import Parameter
from typing import Any, get_type_hints

import typer

from photostrip.cli.failures import failures_as

HELP_NAMES = {"help_option_names": ["--help", "-h"]}
Command = Callable[..., None]


def command_group(text: str) -> typer.Typer:
    return typer.Typer(add_completion=False, rich_markup_mode=None, context_settings=HELP_NAMES, help=text)


def subcommand(of: typer.Typer, name: str, epilog: str) -> Callable[[Command], Command]:
    """Register a command of a command, whose groups of options are its own; the epilog stands below its help."""
    return lambda command: of.command(name, context_settings=HELP_NAMES, epilog=epilog)(_with_groups(command))


def _with_groups(command: Command) -> Command:
    """Let a command that takes groups of options show typer every option of its own, and fail in its form.

    A parameter whose type is a dataclass stands for the fields of it, in their order and with their defaults.
    """
    hints = get_type_hints(command, include_extras=True)
    groups = {name: kind for name, kind in hints.items() if is_dataclass(kind) and isinstance(kind, type)}
    options: list[Parameter] = []
    for name, parameter in inspect.signature(command).parameters.items():
        options += _options_of(groups[name]) if name in groups else [_option(name, parameter.default, hints[name])]

    @wraps(command)
    def run(**given: Any) -> None:  # noqa: ANN401 (what typer read)
        with failures_as(given["form"]):
            for name, kind in groups.items():
                given[name] = kind(**{each.name: given.pop(each.name) for each in fields(kind)})
            command(**given)

    run.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in options}
    del run.__wrapped__
    return run


def _options_of(group: type) -> list[Parameter]:
    hints = get_type_hints(group, include_extras=True)
    return [
        _option(each.name, Parameter.empty if each.default is MISSING else each.default, hints[each.name])
        for each in fields(group)
    ]


def _option(name: str, default: object, annotation: object) -> Parameter:
    return Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
