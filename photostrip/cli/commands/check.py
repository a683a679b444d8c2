"""``photostrip check``: everything that can be said about projects before anything is adjusted."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.options import Assignments, Quiet, Shape, Verbose, Width


def check(
    projects: Annotated[list[Path], typer.Argument(metavar="PROJECT...", help="Project files (YAML).")],
    assignments: Assignments = None,
    form: Shape = "text",
    width: Width = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Check projects without adjusting them, and name all faults.

    For each project: every fault of every file, what was passed over and why, the ground frames decoded at one point
    and back, the standard deviation of every control coordinate and where it stands, and what became of every row of
    every table; and mistakes that the data themselves show. The exit code is 2 when any project has a fault.
    """
    from photostrip.cli.jobs.check import print_checked
    from photostrip.errors import EXIT_DONE, EXIT_INPUT
    from photostrip.project.check import check_project
    from photostrip.report.page.progress import progress

    found = []
    with progress(sys.stderr, len(projects), quiet=quiet) as waiting:
        for project in projects:
            waiting.at(f"checking {project}")
            found.append(check_project(project, assignments or []))
    print_checked(found, form, width, quiet=quiet, verbose=verbose)
    return EXIT_INPUT if any(each.wrong for each in found) else EXIT_DONE
