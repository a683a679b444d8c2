"""The command line itself: what answers at once, what is loaded when, and how failures end."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
import typer

import photostrip
from photostrip.cli import main as cli
from photostrip.errors import Fault, GeometryError, InputError
from photostrip.threads import THREAD_VARIABLES

if TYPE_CHECKING:
    from collections.abc import Callable

HEAVY = ("numpy", "scipy", "pyproj", "pydantic", "yaml", "rich")


def python(code: str, **environment: str) -> str:
    """Run `code` in an interpreter of its own and give what it prints."""
    bare = {name: value for name, value in os.environ.items() if name not in THREAD_VARIABLES}
    done = subprocess.run(
        [sys.executable, "-c", code], env=bare | environment, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def loaded_after(code: str, names: tuple[str, ...]) -> set[str]:
    """Give which of the packages `names` are in memory after `code`."""
    printed = python(f"import sys\n{code}\nprint(*sorted({{name.partition('.')[0] for name in sys.modules}}))")
    return set(printed.splitlines()[-1].split()) & set(names)


def probe(*arguments: str, calling: Callable[..., int | None]) -> int:
    """Run a program with one command, ``probe``."""
    return cli.main(["probe", *arguments], cli.program([("probe", calling, "photostrip probe")]))


def failing(error: BaseException) -> Callable[[], None]:
    def command() -> None:
        raise error

    return command


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"photostrip {photostrip.__version__}\n"
    assert [part.isdecimal() for part in photostrip.__version__.split(".")] == [True, True, True]


@pytest.mark.parametrize(("arguments", "code"), [(["--help"], 0), (["-h"], 0), (["--debug", "--help"], 0), ([], 2)])
def test_help_lists_every_command(arguments: list[str], code: int, capsys: pytest.CaptureFixture[str]) -> None:
    """No command is wrong usage."""
    assert cli.main(arguments) == code
    said, other = capsys.readouterr()[:: -1 if code else 1]
    assert sorted(re.findall(r"(?m)^  ([a-z]+)  +[A-Z]", said)) == sorted(cli.COMMANDS)
    assert ("Exit codes: 0 done" in said, other) == (True, "")


DROP = "--set=processing.relative.drop=[1007/1007-1, 1015/1015-7]"  # the gross errors of the sample


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "most"),
    [(("run", DROP, "--quiet"), 150), (("check",), 125), (("run", "--help"), 40)],
)
def test_modules_are_a_budget(arguments: tuple[str, ...], most: int) -> None:
    """A module takes about a millisecond, a two-hundredth of what numpy, pyproj and yaml take together."""
    command, *options = arguments
    names = python(
        "import sys\nfrom photostrip.cli.main import main\n"
        f"assert main([{command!r}, 'sample_data/simulated-20/project.yaml', *{options!r}]) == 0\nprint(*sys.modules)"
    ).splitlines()[-1]
    loaded = names.split()
    assert sum(name.startswith("photostrip") for name in loaded) <= most
    libraries = {name.partition(".")[0] for name in loaded}
    assert not {"rich", "jinja2", "gzip"} & libraries


def test_every_command_explains_itself_without_loading_the_mathematics() -> None:
    """In one process: what the help of one command loads stays, and none loads any of it."""
    code = "from photostrip.cli.main import COMMANDS, main\nfor name in COMMANDS: assert main([name, '--help']) == 0"
    assert loaded_after(code, HEAVY) <= {"pydantic"}  # typer itself reads the words of options with it


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_the_help_of_every_command_is_plain_and_has_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([name, "--help"]) == 0
    out, example = capsys.readouterr().out, cli.COMMANDS[name][1]
    assert f"Example:\n    {example}\n" in out
    assert example.startswith(f"photostrip {name} ")
    assert "\x1b" not in out


@pytest.mark.parametrize(("answer", "code"), [(None, 0), (0, 0), (1, 1), (3, 3)])
def test_a_command_gives_its_exit_code(answer: int | None, code: int) -> None:
    def command(project: str, scale: float = 1.0) -> int | None:
        assert (project, scale) == ("strip.yaml", 2.5)
        return answer

    assert probe("strip.yaml", "--scale", "2.5", calling=command) == code


FAULTS = InputError([Fault("no such photo", file="a.csv", line=3, column=7), Fault("empty", key="cameras")])
HIDDEN = AttributeError("partially initialized module 'pyproj' has no attribute 'network'")
HIDDEN.__context__ = KeyboardInterrupt()  # that a half import hides


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (FAULTS, 2, "error: a.csv:3:7: no such photo\nerror: cameras: empty\n"),
        (GeometryError("pair 1-2: fewer than 5 points"), 3, "error: pair 1-2: fewer than 5 points\n"),
        (KeyboardInterrupt(), 130, "error: interrupted\n"),
        (FileNotFoundError(2, "No such file", "b.csv"), 2, "error: b.csv: No such file\n"),
        (OSError(28, "No space left on device"), 2, "error: No space left on device\n"),
        (KeyError("x"), 70, "internal error (a bug): KeyError: 'x'; photostrip --debug COMMAND shows where\n"),
        (typer.Exit(1), 1, ""),
        (HIDDEN, 130, "error: interrupted\n"),
    ],
)
def test_failures_become_messages_and_codes(
    capsys: pytest.CaptureFixture[str], error: BaseException, code: int, message: str
) -> None:
    assert probe(calling=failing(error)) == code
    assert tuple(capsys.readouterr()) == ("", message)


@pytest.mark.parametrize(
    ("arguments", "place"), [(["run", "-o", ""], 3), (["run", "", "x"], 2), (["run", "--output="], 2)]
)
def test_an_empty_argument_is_refused(capsys: pytest.CaptureFixture[str], arguments: list[str], place: int) -> None:
    assert cli.main(arguments) == 2
    assert capsys.readouterr().err == f"error: argument {place} is empty: is a variable of the shell not set?\n"


def test_debug_shows_the_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    whole = cli.program([("probe", failing(ValueError("odd")), "photostrip probe")])
    assert cli.main(["--debug", "probe"], whole) == 70
    err = capsys.readouterr().err
    assert err.startswith("Traceback (most recent call last)")
    assert err.endswith("internal error (a bug): ValueError: odd\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rnu"], "No such command 'rnu'. Did you mean 'run'?"),
        (["--versoin"], "--version"),
        (["run"], "Missing argument 'PROJECT'"),
        (["run", "a.yaml", "--wdth", "80"], "--width"),
        (["run", "a.yaml", "--width", "four"], "Invalid value for '--width'"),
    ],
)
def test_wrong_usage_ends_with_2(capsys: pytest.CaptureFixture[str], arguments: list[str], message: str) -> None:
    assert cli.main(arguments) == 2
    err = capsys.readouterr().err
    assert message in err
    assert "--help' for help." in err


def test_a_closed_pipe_is_no_drama() -> None:
    code = "import sys; from photostrip.cli.main import main; sys.stdin.readline(); sys.exit(main(['schema']))"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin
        assert process.stdout
        assert process.stderr
        process.stdout.close()
        process.stdin.write("go\n")
        process.stdin.close()
        assert process.stderr.read() == ""
        assert process.wait() == 141


def test_a_terminal_without_the_characters_gets_question_marks() -> None:
    code = "import sys\nfrom photostrip.cli.main import main\nmain(['--version'])\nprint('σ0')"
    assert python(code, PYTHONIOENCODING="ascii", PYTHONUTF8="0").endswith("?0")


def test_one_thread_unless_the_user_says_otherwise() -> None:
    code = "import os, photostrip; print(os.environ['OPENBLAS_NUM_THREADS'], os.environ['OMP_NUM_THREADS'])"
    assert python(code) == "1 1"
    assert python(code, OPENBLAS_NUM_THREADS="2") == "2 1"
