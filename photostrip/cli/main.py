"""The command line: all commands as one program of typer, its exit code, and what it prints on.

A command returns its exit code, or None for 0; what it raises becomes a message and a code in ``failures``. The
libraries below a command are imported when it is called.
"""

from __future__ import annotations

import atexit
import gc
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from typing import Annotated, Any, TextIO

import typer
import typer.core

from photostrip import __version__
from photostrip.cli.about import info, schema
from photostrip.cli.batch import batch
from photostrip.cli.convert import convert
from photostrip.cli.failures import DEBUG, exit_code_of
from photostrip.cli.projects import check, init, run, simulate
from photostrip.cli.results import compare, report, statement
from photostrip.cli.sheets import plan, sources, step, terrestrial
from photostrip.errors import EXIT_INPUT

Command = Callable[..., int | None]
HELP_NAMES = {"help_option_names": ["--help", "-h"]}
NEW_OBJECTS = 1_000_000  # between two looks of the garbage collector
COMMANDS: dict[str, tuple[Command, str]] = {
    "init": (init, "photostrip init strip-a"),
    "check": (check, "photostrip check project.yaml"),
    "run": (run, "photostrip run project.yaml -o result"),
    "batch": (batch, "photostrip batch strips/* -o results -j 4"),
    "report": (report, "photostrip report result/result.json"),
    "statement": (statement, "photostrip statement result --class-plan 15 --class-height 20"),
    "compare": (compare, "photostrip compare result baseline.json --tol exact.yaml"),
    "plan": (plan, "photostrip plan model --set end_lap_percent=60 --set control.layout=corners"),
    "simulate": (simulate, "photostrip simulate strip.yaml -o simulated"),
    "step": (step, "photostrip step relative pair.csv --set principal_distance=153 --set base=920 --set unit=m"),
    "terrestrial": (terrestrial, "photostrip terrestrial displacement survey.yaml -o survey.svg"),
    "sources": (sources, "photostrip sources --format md"),
    "convert": (convert, "photostrip convert sparse/0 -o block --sigma 0.7"),
    "schema": (schema, "photostrip schema -o photostrip.schema.json"),
    "info": (info, "photostrip info --format json"),
}  # with an example of each
PURPOSES = {
    "Daily": "init",
    "Planning": "plan",
    "Teaching": "step",
    "Files": "convert",
}  # the first command
ENVIRONMENT = """\
PHOTOSTRIP_FORMAT, PHOTOSTRIP_WIDTH, PHOTOSTRIP_QUIET, PHOTOSTRIP_VERBOSE and PHOTOSTRIP_DEBUG stand in for the options
of these names; NO_COLOR forbids colours.

Exit codes: 0 done; 1 done, but a tolerance or a comparison failed; 2 wrong usage, project file or data; 3 the geometry
is too weak; 70 an internal error (a bug).
"""


def _version(asked: bool) -> None:
    if asked:
        sys.stdout.write(f"photostrip {__version__}\n")
        raise typer.Exit


def photostrip(
    _version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", envvar="PHOTOSTRIP_DEBUG", help="Print the traceback of an error.")
    ] = False,
) -> None:
    """Analytical strip phototriangulation: from measured image coordinates to adjusted ground coordinates."""
    DEBUG.set(debug)


class Grouped(typer.core.TyperGroup):
    """A program whose help lists its commands by what they are for."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401, ARG002 (no public types)
        """Write the commands, those of one purpose below each other."""
        purposes = {first: purpose for purpose, first in PURPOSES.items()}
        widest, groups = max(map(len, self.commands)), dict[str, list[tuple[str, str]]]()
        for name, command in self.commands.items():
            purpose = purposes.get(name, next(reversed(groups), "Commands"))
            told = command.get_short_help_str(formatter.width - 6 - widest)  # with the margins
            groups.setdefault(purpose, []).append((name.ljust(widest), told))
        for purpose, rows in groups.items():
            with formatter.section(purpose):
                formatter.write_dl(rows)


def program(commands: Iterable[tuple[str, Command, str]]) -> typer.Typer:
    """Return a program of commands, each with an example."""
    whole = typer.Typer(
        cls=Grouped,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        no_args_is_help=True,
        context_settings=HELP_NAMES,
        epilog=ENVIRONMENT,
    )
    whole.callback()(photostrip)
    for name, command, example in commands:
        epilog = f"\b\nExample:\n  {example}"  # \b: typer keeps the line breaks
        whole.command(name, context_settings=HELP_NAMES, epilog=epilog)(_ended(command))
    return whole


def _ended(command: Command) -> Callable[..., None]:
    """Let what a command returns or raises become an exit code."""

    @wraps(command)
    def ended(*values: object, **options: object) -> None:
        try:
            code = command(*values, **options)
            sys.stdout.flush()  # a closed pipe shows here, not at the end of the interpreter
        except (typer.Exit, typer.BadParameter):
            raise
        except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 (the one place where failures become exit codes)
            code = exit_code_of(error, debug=DEBUG.get())
        raise typer.Exit(code or 0)

    return ended


PROGRAM = program((name, command, example) for name, (command, example) in COMMANDS.items())


def main(arguments: Sequence[str] | None = None, whole: typer.Typer = PROGRAM) -> int:
    """Run what the user typed after ``photostrip`` and return the exit code; no failure is raised."""
    # a command makes hundreds of thousands of small objects and hardly a cycle; looking at them takes a tenth of a run
    gc.set_threshold(NEW_OBJECTS)
    atexit.register(gc.freeze)
    sys.stdout, sys.stderr = map(_prepared, (sys.stdout, sys.stderr))
    for place, each in enumerate(sys.argv[1:] if arguments is None else arguments, 1):
        if re.fullmatch(r"(--[\w-]+=)?", each):  # `-o $OUT` without OUT would write into this folder
            sys.stderr.write(f"error: argument {place} is empty: is a variable of the shell not set?\n")
            return EXIT_INPUT
    try:
        whole(arguments, prog_name="photostrip")
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 0
    return 0


def _prepared(stream: TextIO | None) -> TextIO:
    """Let a stream that the caller closed take everything, and one that lacks a character show a question mark."""
    if stream is None:
        return os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8")
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="replace")
    return stream


if __name__ == "__main__":
    sys.exit(main())
