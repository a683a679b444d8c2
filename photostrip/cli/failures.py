"""What happens when something goes wrong: every failure becomes a message and an exit code.

``exit_code_of`` decides the code; ``failures_as`` prints the failure as JSON or annotations where these were asked for.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import typer

from photostrip.cli.output import ascii_only
from photostrip.errors import EXIT_INPUT, EXIT_INTERNAL, Fault, GeometryError, InputError
from photostrip.visible import visible, visible_json

EXIT_INTERRUPTED = 130  # 128 + SIGINT, as a shell reports it
EXIT_BROKEN_PIPE = 141  # 128 + SIGPIPE


DEBUG: ContextVar[bool] = ContextVar("DEBUG", default=False)  # whether tracebacks are wanted


def exit_code_of(error: BaseException, *, debug: bool) -> int:
    """Say on stderr what went wrong, and return the exit code for it."""
    hidden = error  # an interrupt that another error hides: what was being imported then is there in part
    while hidden.__context__ is not None and not isinstance(error, KeyboardInterrupt):
        hidden = hidden.__context__
        error = hidden if isinstance(hidden, KeyboardInterrupt) else error
    if isinstance(error, OSError):
        _drop_unwritten()
    if isinstance(error, BrokenPipeError):
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
            messages, code = [f"{place}{error.strerror or error}"], EXIT_INPUT
        case _:
            hint = "" if debug else "; photostrip --debug COMMAND shows where"
            sys.stderr.write(f"internal error (a bug): {type(error).__name__}: {visible(str(error))}{hint}\n")
            return EXIT_INTERNAL
    lines = [f"error: {visible(message)}" for message in messages]
    if isinstance(error, InputError | GeometryError) and error.findings:
        from photostrip.report.page.messages import findings_of, lines_of

        lines = lines_of(findings_of(error))
    sys.stderr.writelines(f"{line}\n" for line in lines)
    return code


def _drop_unwritten() -> None:
    """Forget what stdout cannot take (no reader, no room): else the interpreter ends with a complaint and code 120."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def as_fault(error: OSError) -> InputError:
    """Return what the system refused (a full disk, a folder that must not be written to) as a fault like all others."""
    fix = "make room, or choose another place with -o"
    return InputError(Fault(str(error.strerror or error).lower(), "system", str(error.filename or ""), fix=fix))


@contextmanager
def failures_as(form: str) -> Iterator[None]:
    """Print failures in the form that was asked for: as JSON or annotations on stdout, else as lines on stderr.

    The exit code is the same whatever the form.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except (InputError, GeometryError, OSError) as error:
        if form not in {"json", "github"}:
            raise
        from photostrip.report.page import messages

        failure = as_fault(error) if isinstance(error, OSError) else error
        findings = messages.findings_of(failure)
        if form == "github":
            sys.stdout.write(messages.annotated(findings))
        else:
            document = messages.as_document(findings, failure.exit_code)
            text = json.dumps(document, ensure_ascii=ascii_only(), indent=1)
            sys.stdout.write(f"{visible_json(text)}\n")
        raise typer.Exit(failure.exit_code) from error
