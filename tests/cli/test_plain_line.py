"""Plain command lines call a command with what typer would call it with."""

from __future__ import annotations

from functools import wraps
from importlib import import_module
from random import Random
from types import FunctionType
from typing import TYPE_CHECKING, Any

import pytest
import typer

from photostrip.cli.command_table import COMMANDS, HELP_NAMES
from photostrip.cli.declared import for_typer
from photostrip.cli.main import EXIT_USAGE, main
from photostrip.cli.plain_line import _parameters, plain_arguments
from photostrip.cli.typed_values import read_plainly
from tests.loops import nonempty

if TYPE_CHECKING:
    from collections.abc import Callable

FUNCTIONS: dict[str, Callable[..., object]] = {
    name: target
    for name, entry in COMMANDS.items()
    if isinstance(target := getattr(import_module(entry.module), name), FunctionType)
}
PLAIN = ("run", "check", "batch", "report", "compare", "statement", "verify", "simulate", "init", "info", "schema")
LINES = 60  # for each command
VALUES = (
    "a.yaml",
    "b/c",
    "",
    "text",
    "md",
    "json",
    "precision",
    "all",
    "x=1",
    "0",
    "7",
    "80",
    "Text",
    "-",
    "--",
    "-1",
    "ä",
)
ODD = ("--nothing", "-qv", "--quie", "-", "--", "--quiet=yes", "-oDIR", "--help")


def by_typer(name: str, line: list[str]) -> dict[str, Any] | None:
    """Return what typer calls a command with; None where it refuses the line, or answers it itself."""
    given: list[dict[str, Any]] = []

    @wraps(for_typer(FUNCTIONS[name]))
    def command(**arguments: Any) -> None:  # noqa: ANN401
        given.append(arguments)

    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(name, context_settings=HELP_NAMES)(command)
    parser = typer.main.get_command(app)
    read_plainly(parser)
    try:
        with parser.make_context(name, list(line)) as context:
            parser.invoke(context)
    except (typer.Exit, typer.BadParameter.__base__):  # type: ignore[misc]
        return None
    return given[0]


def lines(name: str) -> list[list[str]]:
    """Draw command lines: most of them plain, some not."""
    random, found = Random(name), []
    parameters = list(_parameters(FUNCTIONS[name]))
    options = [(each, option) for each in parameters for option in each.options]
    arguments = sum(not each.options for each in parameters)
    for _ in range(LINES):
        line = [[random.choice(VALUES[:2])] for _ in range(arguments + (random.random() < 0.1))]
        for each, option in random.sample(options, random.randrange(min(4, len(options) + 1))):
            words = [each.value for each in each.kind] if hasattr(each.kind, "__members__") else VALUES
            value = random.choice(words if random.random() < 0.8 else VALUES)
            form = (
                [option]
                if each.kind is bool
                else random.choice(([option, value], [option, value], [f"{option}={value}"]))
            )
            line.append(form)
        if random.random() < 0.1:
            line.append([random.choice(ODD)])
        random.shuffle(line)
        found.append([word for part in line for word in part])
    return found


@pytest.mark.parametrize("name", PLAIN)
def test_plain_lines_are_read_as_typer_reads_them(name: str) -> None:
    plain = 0
    for line in nonempty(lines(name)):
        found = plain_arguments(FUNCTIONS[name], line)
        if found is not None:
            plain += 1
            expected = by_typer(name, line)
            assert expected is not None, line
            # typer gives no list where none is asked for, or an empty one
            assert {key: value or None for key, value in found.items()} == {
                key: value or None for key, value in expected.items()
            }, line
            assert list(map(type, filter(None, found.values()))) == list(map(type, filter(None, expected.values())))
    assert plain > LINES / 8


def test_what_users_type_is_plain() -> None:
    for name, line in (
        ("run", ["project.yaml", "-o", "result", "--set", "a=1", "--set=b=2", "--html", "--quiet"]),
        ("run", ["project.yaml", "--section", "control", "-v", "--format", "md"]),
        ("check", ["a.yaml", "b.yaml", "--format=json"]),
        ("report", ["result/result.json"]),
        ("compare", ["result", "baseline.json", "--tol", "tolerances.yaml"]),
    ):
        assert plain_arguments(FUNCTIONS[name], line) is not None, line


@pytest.mark.parametrize(
    "line",
    [
        [],
        ["a", "b"],
        ["a", "--help"],
        ["a", "-qv"],
        ["a", "--quie"],
        ["a", "--quiet=1"],
        ["a", "-o"],
        ["a", "-o", "--html"],
        ["a", "-o=b"],
        ["a", "-o", "b", "-o", "c"],
        ["a", "--width", "70"],
        ["a", "--format", "xml"],
        ["--", "a"],
    ],
)
def test_other_lines_are_left_to_typer(line: list[str]) -> None:
    assert plain_arguments(FUNCTIONS["run"], line) is None


def test_what_stands_in_the_environment_is_left_to_typer(monkeypatch: pytest.MonkeyPatch) -> None:
    assert plain_arguments(FUNCTIONS["run"], ["a"]) is not None
    monkeypatch.setenv("PHOTOSTRIP_QUIET", "1")
    assert plain_arguments(FUNCTIONS["run"], ["a"]) is None


def test_a_command_refuses_a_plain_line_in_the_words_of_typer(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "project.yaml", "--html"]) == EXIT_USAGE
    assert capsys.readouterr().err == (
        "error: Invalid value for --html: report.html needs a folder: give --output as well."
        " 'photostrip run --help' shows how it is called.\n"
    )
