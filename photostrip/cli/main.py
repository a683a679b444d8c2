"""The command line: find the command, run it, give its exit code; ``failures`` has the codes of what goes wrong.

``photostrip --version`` and ``--help`` answer from the table of commands alone; a command, and the libraries below it,
are imported when it is called.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Callable, Sequence
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, TextIO, cast

from photostrip import __version__
from photostrip.cli.command_table import COMMANDS, COMPLETION, HELP_NAMES, usage
from photostrip.visible import visible

if TYPE_CHECKING:
    from typer._click.core import Command

EXIT_USAGE = 2
NEW_OBJECTS = 1_000_000  # between two looks of the garbage collector


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the user typed after ``photostrip`` and return the exit code; no failure is raised."""
    _seldom_collect_garbage()
    rest = list(sys.argv[1:] if arguments is None else arguments)
    debug = _take_flag(rest, "--debug") or os.environ.get("PHOTOSTRIP_DEBUG", "") not in {"", "0"}
    sys.stdout, sys.stderr = map(_prepared, (sys.stdout, sys.stderr))
    try:
        code = _dispatch(rest)
        sys.stdout.flush()  # a closed pipe shows here, not at the end of the interpreter
    except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 (the one place where failures become exit codes)
        from photostrip.cli.failures import exit_code_of

        return exit_code_of(_cause(error), debug=debug)
    return code


def _cause(error: BaseException) -> BaseException:
    """Give an interrupt that another error hides: what was being imported then is there in part."""
    before = error
    while before.__context__ is not None and not isinstance(before, KeyboardInterrupt):
        before = before.__context__
    return before if isinstance(before, KeyboardInterrupt) else error


def _seldom_collect_garbage() -> None:
    """Let the cyclic garbage collector look seldom, and not at all at the end.

    A command loads and makes hundreds of thousands of small objects and hardly a cycle; looking at them again and again
    takes a tenth of a run.
    """
    gc.set_threshold(NEW_OBJECTS)
    atexit.register(gc.freeze)


def _take_flag(arguments: list[str], flag: str) -> bool:
    """Remove `flag` wherever it stands before ``--`` and say whether it was there."""
    end = arguments.index("--") if "--" in arguments else len(arguments)
    kept = [argument for argument in arguments[:end] if argument != flag]
    arguments[:end] = kept
    return len(kept) < end


def _prepared(stream: TextIO | None) -> TextIO:
    """Let a stream that the caller closed take everything, and one that lacks a character show a question mark."""
    if stream is None:
        return os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8")
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="replace")
    return stream


def _dispatch(arguments: list[str]) -> int:
    """Answer the options that come before a command, or call the command."""
    if COMPLETION in os.environ:  # the shell asks what can stand at the cursor
        from photostrip.cli.jobs.completion import answer

        return answer(os.environ[COMPLETION])
    first, rest = (arguments[0], arguments[1:]) if arguments else ("", [])
    if first == "--version":
        sys.stdout.write(f"photostrip {__version__}\n")
        return 0
    if first in {"--help", "-h"}:
        sys.stdout.write(usage())
        return 0
    if not first:
        sys.stderr.write(usage())
        return EXIT_USAGE
    if first not in COMMANDS:
        return _refuse(first)
    return _call(first, rest)


def _refuse(first: str) -> int:
    """Say that there is no such command or option, and what may have been meant."""
    from difflib import get_close_matches

    kind = "option" if first.startswith("-") else "command"
    known = ["--version", "--help", "--debug"] if kind == "option" else list(COMMANDS)
    meant = get_close_matches(first, known, n=1)
    hint = f"did you mean '{meant[0]}'? " if meant else ""
    _complain(f"no such {kind}: '{first}'; {hint}'photostrip --help' lists what there is")
    return EXIT_USAGE


def _call(name: str, arguments: list[str]) -> int:
    """Import one command, read its arguments, and run it.

    The function returns its exit code, or None for 0.
    """
    for place, each in enumerate(arguments, 1):
        if not each or (each.startswith("--") and each.find("=") == len(each) - 1):
            _complain(f"argument {place} of '{name}' is empty: is a variable of the shell not set?")
            return EXIT_USAGE
    command = _parser(name, getattr(import_module(COMMANDS[name].module), name))
    try:  # not command.main(), which has exit codes of its own for interrupts and closed pipes
        with command.make_context(f"photostrip {name}", arguments) as context:
            code = command.invoke(context)
    except Exception as error:  # noqa: BLE001 (what is not typer's is raised again)
        return _told_by_typer(error, name)
    return code if isinstance(code, int) else 0


def _told_by_typer(error: Exception, name: str) -> int:
    """Return the exit code of what typer raises, or is raised for it; say what is wrong with the usage."""
    import typer

    if isinstance(error, typer.Exit):
        return error.exit_code
    # the class of every usage error; typer does not export it, but derives BadParameter from it
    if not isinstance(error, cast("type[Exception]", typer.BadParameter.__base__)):
        raise error
    text: str = getattr(error, "format_message", error.__str__)().replace(": Value error, ", ": ")
    end = "" if text.endswith((".", "?", "!")) else "."
    _complain(f"{text}{end} 'photostrip {name} --help' shows how it is called.")
    return EXIT_USAGE


@cache  # for a program that calls many commands: typer takes 7 ms for one
def _parser(name: str, target: Callable[..., object]) -> Command:
    """Let typer make what reads the arguments of a command."""
    import typer

    from photostrip.cli.typed_values import read_plainly

    app = target
    if not isinstance(app, typer.Typer):
        app = typer.Typer(add_completion=False, rich_markup_mode=None)
        app.command(name, context_settings=HELP_NAMES)(target)
    command = typer.main.get_command(app)
    read_plainly(command)
    command.epilog = f"\b\nExample:\n  {COMMANDS[name].example}"  # \b: typer keeps the line breaks
    return command


def _complain(message: str) -> None:
    sys.stderr.write(f"error: {visible(message)}\n")


if __name__ == "__main__":
    sys.exit(main())
