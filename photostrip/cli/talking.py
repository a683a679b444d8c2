"""What the commands say on stderr while they work."""

from __future__ import annotations

import gc
import json
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import typer

from photostrip.cli.showing import Format
from photostrip.errors import Fault, GeometryError, InputError

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass
class Talk:
    """Talk on stderr."""

    quiet: bool = False
    verbose: bool = False
    _begin: float = field(default_factory=time.perf_counter)

    def say(self, text: str) -> None:
        """Say something that everybody should know."""
        if not self.quiet:
            sys.stderr.write(f"{text}\n")

    def step(self, text: str) -> None:
        """Say what was done, and the seconds since the step before."""
        now = time.perf_counter()
        if self.verbose:
            self.say(f"{text} ({now - self._begin:.2f} s)")
        self._begin = now


def as_fault(error: OSError) -> InputError:
    """Return what the system refused (a full disk, a folder that must not be written to) the form of all faults."""
    fix = "make room, or choose another place with -o"
    return InputError(Fault(str(error.strerror or error).lower(), "system", str(error.filename or ""), fix=fix))


@contextmanager
def failures_as(form: Format) -> Iterator[None]:
    """Tell failures in the form that was asked for: as JSON or annotations on stdout, else as lines on stderr.

    Parameters
    ----------
    form : Format
        What the user asked for. The exit code is the same whatever it is.

    Raises
    ------
    typer.Exit
        With the exit code, after the failure was told.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except (InputError, GeometryError, OSError) as error:
        if form not in {Format.JSON, Format.GITHUB}:
            raise
        from photostrip.report.page import console, messages

        told = as_fault(error) if isinstance(error, OSError) else error
        findings = messages.findings_of(told)
        if form is Format.GITHUB:
            sys.stdout.write(messages.annotated(findings))
        else:
            document = messages.as_document(findings, told.exit_code)
            text = json.dumps(document, ensure_ascii=not console.speaks_unicode(sys.stdout), indent=1)
            sys.stdout.write(f"{text}\n")
        raise typer.Exit(told.exit_code) from error


@contextmanager
def no_collector() -> Iterator[None]:
    """Keep the cyclic garbage collector quiet for a while.

    A big project makes hundreds of thousands of small objects and hardly a cycle; looking at them again and again
    takes a tenth of the run.
    """
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()
