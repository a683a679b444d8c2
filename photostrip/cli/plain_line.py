"""Command lines that are plain, read without typer, which takes an eighth of a run of 20 photos.

Plain is a line of known options, each with a value that is a path, a text or a word from a list, and of as many
arguments as the command has. All else is left to typer: help, mistakes, numbers, what stands in the environment, short
options in one word.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from inspect import Parameter, signature
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin, get_type_hints

from photostrip.cli.declared import Declared

TEXTS = {"metavar", "help", "envvar", "autocompletion", "show_default"}  # told to typer, of no effect on a value


class _NotPlainError(ValueError):
    """Typer has to read the line."""


@dataclass(frozen=True)
class _Parameter:
    """A parameter of a command."""

    name: str
    declared: Declared
    kind: Any  # str, Path, a list of words, or bool
    several: bool
    default: Any

    @property
    def options(self) -> Sequence[str]:
        """Options that give it a value; none of an argument."""
        if self.declared.kind == "Argument":
            return ()
        return self.declared.names or (f"--{self.name.replace('_', '-')}",)

    def value(self, texts: Sequence[str]) -> Any:  # noqa: ANN401
        if not texts and self.default is not Parameter.empty:
            return self.default
        if self.declared.told.keys() - TEXTS or (len(texts) != 1 and not (texts and self.several)):
            raise _NotPlainError
        found = [self._value(text) for text in texts]
        return found if self.several else found[0]

    def _value(self, text: str) -> object:
        if self.kind is bool:
            return True
        if self.kind in {str, Path}:
            return self.kind(text)
        if isinstance(self.kind, type) and issubclass(self.kind, Enum):
            words = {each.value: each for each in self.kind}
            if text in words:
                return words[text]
        raise _NotPlainError


def plain_arguments(command: Callable[..., object], line: Sequence[str]) -> dict[str, Any] | None:
    """Return what a command is called with; None where typer has to read the line."""
    try:
        parameters = list(_parameters(command))
        given, words = _split({option: each for each in parameters for option in each.options}, line)
        arguments = [each.name for each in parameters if not each.options]
        if len(arguments) == 1:
            given[arguments[0]] = words
        elif len(arguments) == len(words):
            given |= {name: [word] for name, word in zip(arguments, words, strict=True)}
        else:
            return None
        return {each.name: each.value(given.get(each.name, ())) for each in parameters}
    except _NotPlainError:
        return None


def _parameters(command: Callable[..., object]) -> Iterator[_Parameter]:
    hints = get_type_hints(command, include_extras=True)
    for name, parameter in signature(command).parameters.items():
        kind, *told = get_args(hints[name]) or (None, None)
        if not isinstance(told[0], Declared) or told[0].told.get("envvar", "") in os.environ:
            raise _NotPlainError
        kinds = [each for each in get_args(kind) if each is not NoneType] if NoneType in get_args(kind) else [kind]
        several = get_origin(kinds[0]) is list
        yield _Parameter(
            name=name,
            declared=told[0],
            kind=get_args(kinds[0])[0] if several else kinds[0],
            several=several,
            default=parameter.default,
        )


def _split(options: Mapping[str, _Parameter], line: Sequence[str]) -> tuple[dict[str, list[str]], list[str]]:
    """Return the texts that are given to each parameter, and the words that stand alone."""
    given: dict[str, list[str]] = {}
    alone = []
    rest = iter(line)
    for word in rest:
        if not word.startswith("-"):
            alone.append(word)
            continue
        option, sign, text = word.partition("=")
        if option not in options or (sign and (options[option].kind is bool or not option.startswith("--"))):
            raise _NotPlainError
        if not sign and options[option].kind is not bool:
            text = next(rest, "-")
            if text.startswith("-"):
                raise _NotPlainError
        given.setdefault(options[option].name, []).append(text)
    return given, alone
