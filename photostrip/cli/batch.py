"""``photostrip batch``: who computes, what is said on stderr meanwhile, the summary, the exit code."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated

import typer

from photostrip import __version__
from photostrip.cli.failures import as_fault, failures_as
from photostrip.cli.options import (
    FORMAT,
    Assignments,
    BatchFormat,
    Folder,
    Quiet,
    Rule,
    Strict,
    Verbose,
    Width,
    refuse,
    require_target,
)
from photostrip.cli.output import ascii_only, print_sections, write_rule
from photostrip.errors import Fault, InputError, PhotostripError
from photostrip.visible import visible, visible_json

if TYPE_CHECKING:
    from photostrip.batch.evaluation import Answer
    from photostrip.batch.run import Run
    from photostrip.notes import Document
    from photostrip.report.page.progress import Progress

EXIT_SIGNAL = 128  # plus its number, as a shell reports it


def batch(
    projects: Annotated[
        list[str],
        typer.Argument(
            metavar="PROJECT...", help="Project files, folders with projects, patterns, or @FILE: a list of these."
        ),
    ],
    output: Folder = None,
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
    form: Annotated[BatchFormat, FORMAT] = "text",
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
    require_target(depfile, output)
    if html and output is None:
        refuse("--html", "summary.html needs a folder: give --output as well")
    if executor != "local" and not executor.startswith("dask:"):
        refuse("executor", f"'{executor}' is not 'local' and does not begin with 'dask:'")
    try:
        import fcntl  # noqa: F401
    except ImportError:
        message = "photostrip batch needs a POSIX system (Linux, macOS, WSL)"
        raise InputError(Fault(message, "not-available", fix="call photostrip run for each project")) from None
    from photostrip.batch.cluster import cluster
    from photostrip.batch.evaluation import Limits
    from photostrip.batch.folder import opened
    from photostrip.batch.pool import LocalPool, cores
    from photostrip.batch.run import Run, Stop, on_signals
    from photostrip.batch.selection import choose
    from photostrip.report.page.progress import progress as shown_progress

    limits, overrides, stop, folder = Limits(timeout, memory), tuple(assignments or ()), Stop(), None
    trouble: list[PhotostripError] = []
    with ExitStack() as stack:
        stack.enter_context(on_signals(stop))
        with failures_as(form):
            chosen = choose(projects)
            if output is not None:
                folder = stack.enter_context(opened(output, overrides))
        progress = stack.enter_context(shown_progress(sys.stderr, len(chosen), quiet=quiet, patience=0.0))
        work = Run(chosen, overrides, folder, force=force, strict=strict, html=html)
        try:
            with (
                LocalPool(min(jobs or cores(), len(chosen)), limits)
                if executor == "local"
                else cluster(executor.removeprefix("dask:"), limits, progress.say)
            ) as computing:
                say = _said(progress, len(chosen), quiet=quiet, verbose=verbose)
                work.go(computing, say, stop, lambda task: progress.begun(task.project))
        except PhotostripError as error:  # nobody computes: the cluster is gone, or no process starts
            trouble.append(error)
        finally:
            progress.stop()
            code = max((work.exit_code, *(each.exit_code for each in trouble)))
            code = EXIT_SIGNAL + stop.signal if stop.signal else code
            if folder is not None:
                trouble += _write_summaries(work, code, html=html)
    _print_summary(work.outcomes, code, form, width, quiet=quiet, verbose=verbose)
    if output is not None:
        write_rule(depfile, output / "summary.json", work.files_read())
    _say_end(work, stop.signal, stop.refusals if stop() else 0, quiet=quiet)
    for each in trouble:
        raise each
    return code


def _said(progress: Progress, total: int, *, quiet: bool, verbose: bool) -> Callable[[Document, Answer | None], None]:
    """Return who says on stderr what became of a project: a line for each, or on a terminal for each failure.

    Verbose messages say also where internal errors happened.
    """
    from photostrip.report.commands.batch import outcome_line

    done = 0

    def finished(outcome: Document, answer: Answer | None) -> None:
        nonlocal done
        done += 1
        progress.finished(outcome["project"])
        if quiet or (progress.live and not outcome["exit_code"]):
            return
        how = ", unchanged" if answer is None and not outcome["exit_code"] else ""
        trace = answer.trace if answer is not None and verbose else ""
        count = f"{done:>{len(str(total))}} of {total}"
        progress.say(f"{count}  {outcome_line(outcome)}{how}\n{trace}".rstrip("\n"))

    return finished


def _write_summaries(run: Run, code: int, *, html: bool) -> list[InputError]:
    """Write the files of the summary; give what went wrong, which must not hide what became of the projects."""
    from photostrip.formats.batch import summary_csv, summary_json
    from photostrip.formats.files import write_files
    from photostrip.report.commands.batch import batch_junit, batch_sections
    from photostrip.report.html import batch_html
    from photostrip.report.page.layout import to_text

    files = {
        "summary.txt": to_text("", batch_sections(run.outcomes, everything=True)),
        "summary.csv": summary_csv(run.outcomes),
        **({"summary.html": batch_html(run.outcomes, __version__)} if html else {}),
        "junit.xml": batch_junit(run.outcomes),
        "summary.json": summary_json(run.outcomes, code),
    }
    try:
        if run.folder is not None:
            write_files(run.folder.path, files)
    except InputError as error:
        return [error]
    except OSError as error:
        return [as_fault(error)]
    return []


def _print_summary(
    outcomes: list[Document], code: int, form: BatchFormat, width: int | None, *, quiet: bool, verbose: bool
) -> None:
    from photostrip.formats.batch import summary_csv, summary_json
    from photostrip.report.commands.batch import batch_junit, batch_sections
    from photostrip.report.page.messages import annotated

    match form:
        case "csv":
            sys.stdout.write(visible(summary_csv(outcomes)))
        case "json":
            sys.stdout.write(visible_json(summary_json(outcomes, code, ascii_only=ascii_only())))
        case "junit":
            sys.stdout.write(batch_junit(outcomes))
        case "github":
            sys.stdout.write(annotated(finding for each in outcomes for finding in each["findings"]))
        case "text" | "md":
            sections = batch_sections(outcomes, quiet=quiet, everything=verbose)
            markdown = form == "md"
            print_sections("Summary of the batch" if markdown else "", sections, width, markdown=markdown)


def _say_end(run: Run, signal: int, refusals: int, *, quiet: bool) -> None:
    """Say on stderr what was computed, and why the batch ended before its end."""
    from photostrip.notes import counted

    waiting = counted(sum(each["status"] == "not run" for each in run.outcomes), "project")
    if signal:
        sys.stderr.write(f"interrupted: {waiting} not run; the same command goes on from here\n")
    elif refusals:
        sys.stderr.write(f"error: {refusals} results in a row could not be written; {waiting} not run\n")
    elif not quiet and run.unchanged:
        computed = len(run.outcomes) - run.unchanged
        sys.stderr.write(f"{computed} computed, {run.unchanged} unchanged since the last time\n")
