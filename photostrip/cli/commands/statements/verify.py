"""``photostrip verify``: a result made again from its certificate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.options import Quiet, Saved, Width
from photostrip.cli.stdout import Format, StatementFormat, print_json, print_sections


def verify(
    result: Saved,
    project: Annotated[
        Path | None,
        typer.Option("--project", metavar="FILE", help="Its project file; default: found beside it by its hash."),
    ] = None,
    form: Annotated[
        StatementFormat, typer.Option("--format", envvar="PHOTOSTRIP_FORMAT", help="How the answer is printed.")
    ] = StatementFormat.TEXT,
    width: Width = None,
    quiet: Quiet = False,
) -> int:
    """Make a result again from its certificate, and say what differs.

    The hashes of all files that went in are compared, the project is adjusted again with the same overrides, and the
    numbers are compared within the last digits, as by `photostrip compare`. The exit code is 0 when all is the same,
    1 when files have changed, numbers differ or the result was edited, 2 when the result cannot be read or its project
    is not found. Other versions of photostrip and its libraries are named.
    """
    from photostrip.cli.failures import failures_as
    from photostrip.errors import EXIT_DONE, EXIT_TOLERANCE
    from photostrip.library.verification import SAME
    from photostrip.library.verification import verify as verified
    from photostrip.report.commands.verification import verification_report

    with failures_as(Format(form.value)):
        found = verified(result, project)
        if form is StatementFormat.JSON:
            print_json(found)
        else:
            print_sections(*verification_report(found, quiet=quiet), width, markdown=form is StatementFormat.MD)
    return EXIT_DONE if found["status"] == SAME else EXIT_TOLERANCE
