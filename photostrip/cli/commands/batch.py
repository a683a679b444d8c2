"""``photostrip batch``: many projects, on all cores or many machines."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.options import Assignments, Quiet, Rule, Strict, Verbose, Width, require_target
from photostrip.cli.stdout import BatchFormat


def batch(  # noqa: PLR0913, PLR0917 (an argument for each option)
    projects: Annotated[
        list[str],
        typer.Argument(
            metavar="PROJECT...", help="Project files, folders with projects, patterns, or @FILE: a list of these."
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder to write the results into.")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", "-j", min=1, metavar="N", help="Number of processes; default: one per core.")
    ] = None,
    executor: Annotated[
        str, typer.Option(metavar="WHERE", help="local, or dask:tcp://HOST:PORT, a running cluster.")
    ] = "local",
    assignments: Assignments = None,
    force: Annotated[bool, typer.Option("--force", help="Compute again what has not changed, too.")] = False,
    timeout: Annotated[
        float | None,
        typer.Option(min=0.001, metavar="SECONDS", help="Longest time for one project; default: no limit."),
    ] = None,
    memory: Annotated[
        float | None,
        typer.Option(min=1, metavar="MB", help="Largest memory of one process; default: an even share of all."),
    ] = None,
    form: Annotated[
        BatchFormat, typer.Option("--format", envvar="PHOTOSTRIP_FORMAT", help="How the summary is printed.")
    ] = "text",
    width: Width = None,
    depfile: Rule = None,
    html: Annotated[
        bool, typer.Option("--html", help="Write summary.html into DIR, and report.html for each project.")
    ] = False,
    strict: Strict = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Adjust many projects, on all cores or many machines.

    With -o, the result of each project goes into a folder of its own below DIR, and DIR gets summary.txt, summary.csv,
    summary.json and junit.xml; with --html also summary.html, with a map and links to a report.html for each
    project. A failure does not stop the other projects. What has not changed since it was last
    computed is not computed again; a batch that was interrupted or killed goes on where it was. The exit code is that
    of the worst project, the highest: 0, 1, 2, 3 or 70.
    """
    from photostrip.batch.tasks import Limits
    from photostrip.cli.jobs.batch import BatchOptions, run_batch
    from photostrip.errors import Fault, InputError

    require_target(depfile, output)
    if html and output is None:
        raise typer.BadParameter("summary.html needs a folder: give --output as well", param_hint="--html")
    if executor != "local" and not executor.startswith("dask:"):
        raise typer.BadParameter(f"'{executor}' is not 'local' and does not begin with 'dask:'", param_hint="executor")
    try:
        import fcntl  # noqa: F401
    except ImportError:
        message = "photostrip batch needs a POSIX system (Linux, macOS, WSL)"
        raise InputError(Fault(message, "not-available", fix="call photostrip run for each project")) from None
    limits = Limits(timeout, memory)
    options = BatchOptions(
        projects=projects,
        output=output,
        jobs=jobs,
        executor=executor,
        overrides=tuple(assignments or ()),
        limits=limits,
        force=force,
        depfile=depfile,
        strict=strict,
        html=html,
    )
    return run_batch(options, form, width, quiet=quiet, verbose=verbose)
