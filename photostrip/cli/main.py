"""The command line: find the command, run it, turn every failure into a message and an exit code.

``photostrip --version`` and ``--help`` answer from this file alone; a command, and the libraries below it, are
imported when it is called.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple, cast

from photostrip import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import TextIO

EXIT_USAGE = 2
EXIT_INTERRUPTED = 130  # 128 + SIGINT, as a shell reports it
EXIT_BROKEN_PIPE = 141  # 128 + SIGPIPE


class Entry(NamedTuple):
    """Where a command stands and what ``--help`` says of it.

    ``module`` holds a function, or a ``typer.Typer`` with subcommands, of the command's own name.
    """

    module: str
    help: str
    example: str


COMMANDS = {
    "init": Entry(
        "photostrip.cli.commands.init",
        "Write a commented project file and the headers of its tables.",
        "photostrip init strip-a",
    ),
    "check": Entry(
        "photostrip.cli.commands.check",
        "Check projects without adjusting them, and name all faults.",
        "photostrip check project.yaml",
    ),
    "run": Entry(
        "photostrip.cli.commands.run",
        "Adjust the strips of a project and report the accuracy.",
        "photostrip run project.yaml -o result",
    ),
    "batch": Entry(
        "photostrip.cli.commands.batch",
        "Adjust many projects, on all cores or many machines.",
        "photostrip batch strips/* -o results -j 4",
    ),
    "report": Entry(
        "photostrip.cli.commands.report",
        "Print the accuracy report of a saved result again.",
        "photostrip report result/result.json",
    ),
    "compare": Entry(
        "photostrip.cli.commands.compare",
        "Compare a result with a baseline, within tolerances.",
        "photostrip compare result baseline.json --tol exact.yaml",
    ),
    "simulate": Entry(
        "photostrip.cli.commands.simulate",
        "Write a synthetic project with known truth, ready to run.",
        "photostrip simulate strip.yaml -o simulated",
    ),
    "plan": Entry(
        "photostrip.cli.commands.plan",
        "Expected accuracy and design, before any photo is taken.",
        "photostrip plan model --overlap 60 --control corners",
    ),
    "terrestrial": Entry(
        "photostrip.cli.commands.terrestrial",
        "Directions of a phototheodolite, displacements between epochs.",
        "photostrip terrestrial displacement survey.yaml -o result",
    ),
    "schema": Entry(
        "photostrip.cli.commands.schema",
        "Print the JSON Schema of the project file, for editors.",
        "photostrip schema -o photostrip.schema.json",
    ),
    "completion": Entry(
        "photostrip.cli.commands.completion",
        "Print the script that makes a shell complete commands.",
        "photostrip completion bash >> ~/.bashrc",
    ),
    "man": Entry(
        "photostrip.cli.commands.man",
        "Print a manual page, or write all of them.",
        "photostrip man -o ~/.local/share/man/man1",
    ),
    "info": Entry(
        "photostrip.cli.commands.info",
        "Print versions and formats, and how to get what is missing.",
        "photostrip info --format json",
    ),
}


def usage() -> str:
    """Return the text of ``photostrip --help``."""
    width = max(map(len, COMMANDS))
    commands = "\n".join(f"  {name:<{width}}  {entry.help}" for name, entry in COMMANDS.items())
    return f"""\
Usage: photostrip [--debug] COMMAND [ARGUMENTS]...

Analytical strip phototriangulation: from measured image coordinates to
adjusted ground coordinates.

Commands:
{commands}

Options:
  --version   Print the version and exit.
  --debug     Print the traceback of an error.
  -h, --help  Print this text and exit; after a command, its help.

Environment: PHOTOSTRIP_FORMAT, PHOTOSTRIP_WIDTH, PHOTOSTRIP_QUIET,
PHOTOSTRIP_VERBOSE and PHOTOSTRIP_DEBUG stand in for the options of these names;
NO_COLOR forbids colours.

Example:
  {COMMANDS["run"].example}

Exit codes: 0 done; 1 done, but a tolerance or a comparison failed; 2 wrong
usage, project file or data; 3 the geometry is too weak; 70 an internal error
(a bug).
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        What the user typed after ``photostrip``; default: the arguments of the process.

    Returns
    -------
    int
        The exit code. Every failure becomes one; none is raised.
    """
    rest = list(sys.argv[1:] if arguments is None else arguments)
    debug = _take_flag(rest, "--debug") or os.environ.get("PHOTOSTRIP_DEBUG", "") not in {"", "0"}
    for stream in (sys.stdout, sys.stderr):
        _never_fail_on_characters(stream)
    try:
        code = _dispatch(rest)
        sys.stdout.flush()  # a closed pipe shows here, not at the end of the interpreter
    except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 (the one place where failures become exit codes)
        return _exit_code(error, debug=debug)
    return code


def _take_flag(arguments: list[str], flag: str) -> bool:
    """Remove `flag` wherever it stands before ``--`` and tell whether it was there."""
    end = arguments.index("--") if "--" in arguments else len(arguments)
    kept = [argument for argument in arguments[:end] if argument != flag]
    arguments[:end] = kept
    return len(kept) < end


def _never_fail_on_characters(stream: TextIO) -> None:
    """Let a terminal that lacks a character (sigma, a frame line) show a question mark instead."""
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="replace")


def _dispatch(arguments: list[str]) -> int:
    """Answer the options that come before a command, or call the command."""
    if "_PHOTOSTRIP_COMPLETE" in os.environ:  # the shell asks what can stand at the cursor
        completion = import_module(COMMANDS["completion"].module)
        return int(completion.answer(os.environ["_PHOTOSTRIP_COMPLETE"]))
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
    hint = f"; did you mean '{meant[0]}'?" if meant else ""
    _complain(f"no such {kind}: '{first}'{hint}; 'photostrip --help' lists what there is")
    return EXIT_USAGE


def _call(name: str, arguments: list[str]) -> int:
    """Import one command, let typer read its arguments, and run it.

    The function returns its exit code, or None for 0.
    """
    import typer

    entry = COMMANDS[name]
    target = getattr(import_module(entry.module), name)
    app = target
    if not isinstance(target, typer.Typer):
        app = typer.Typer(add_completion=False, rich_markup_mode=None)
        app.command(name, context_settings={"help_option_names": ["--help", "-h"]})(target)
    command = typer.main.get_command(app)
    command.epilog = f"\b\nExample:\n  {entry.example}"  # \b: typer keeps the line breaks
    # the class of every usage error; typer does not export it, but derives BadParameter from it
    usage_error = cast("type[Exception]", typer.BadParameter.__base__)
    try:
        # not command.main(), which has exit codes of its own for interrupts and closed pipes
        with command.make_context(f"photostrip {name}", arguments) as context:
            code = command.invoke(context)
    except typer.Exit as stop:
        return stop.exit_code
    except usage_error as error:
        _complain(f"{_message(error)} 'photostrip {name} --help' shows how it is called.")
        return EXIT_USAGE
    return code if isinstance(code, int) else 0


def _message(error: BaseException) -> str:
    """Return the sentence of a usage error."""
    text: str = getattr(error, "format_message", error.__str__)()
    return text if text.endswith((".", "?", "!")) else f"{text}."


def _exit_code(error: BaseException, *, debug: bool) -> int:
    """Tell the user what went wrong and give the exit code for it."""
    from photostrip.errors import EXIT_INTERNAL, GeometryError, InputError

    if isinstance(error, BrokenPipeError):
        # what is still in the buffer has no reader; without this the interpreter complains when it ends
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_BROKEN_PIPE
    if debug:
        import traceback

        traceback.print_exception(error)
    match error:
        case KeyboardInterrupt():
            messages, code = ["interrupted"], EXIT_INTERRUPTED
        case InputError():
            messages, code = [str(fault) for fault in error.faults], error.exit_code
        case GeometryError():
            messages, code = [str(error)], error.exit_code
        case OSError():
            place = f"{error.filename}: " if error.filename else ""
            messages, code = [f"{place}{error.strerror or error}"], EXIT_USAGE
        case _:
            hint = "" if debug else "; --debug shows where"
            sys.stderr.write(f"internal error (a bug): {type(error).__name__}: {error}{hint}\n")
            return EXIT_INTERNAL
    for message in messages:
        _complain(message)
    if isinstance(error, InputError | GeometryError) and error.findings:
        from photostrip.report.page.messages import finding_of, line_of

        sys.stderr.writelines(f"{line_of(finding_of(each))}\n" for each in error.findings)
    return code


def _complain(message: str) -> None:
    """Write one fault on stderr."""
    sys.stderr.write(f"error: {message}\n")


if __name__ == "__main__":
    sys.exit(main())
