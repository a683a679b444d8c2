"""``photostrip batch`` at work: who computes, what is said on stderr meanwhile, the summary, the exit code."""

from __future__ import annotations

import os
import sys
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from pathlib import Path

from photostrip import __version__
from photostrip.batch.pool import Executor, LocalPool
from photostrip.batch.result_folder import ResultFolder, opened
from photostrip.batch.run import Run, Stop, on_signals
from photostrip.batch.selection import choose
from photostrip.batch.tasks import Answer, Limits
from photostrip.cli.failures import as_fault, failures_as
from photostrip.cli.stdout import BatchFormat, Document, ascii_only, print_sections
from photostrip.errors import InputError, PhotostripError
from photostrip.formats.output import batch as formats
from photostrip.formats.text.writing import make_rule, write_files, write_text
from photostrip.notes import counted
from photostrip.report.commands.batch import batch_junit, batch_sections, outcome_line
from photostrip.report.page import layout, messages
from photostrip.report.page.progress import BatchProgress, batch_progress
from photostrip.visible import visible, visible_json

EXIT_SIGNAL = 128  # plus its number, as a shell reports it


@dataclass(frozen=True)
class BatchOptions:
    projects: list[str]
    output: Path | None
    jobs: int | None
    executor: str
    overrides: tuple[str, ...]
    limits: Limits
    force: bool
    depfile: Path | None
    strict: bool
    html: bool = False


def cores() -> int:
    """Count the cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def run_batch(options: BatchOptions, form: BatchFormat, width: int | None, *, quiet: bool, verbose: bool) -> int:
    stop, folder = Stop(), None
    with ExitStack() as stack:
        stack.enter_context(on_signals(stop))
        with failures_as(form):
            projects = choose(options.projects)
            if options.output is not None:
                folder = stack.enter_context(opened(options.output, options.overrides))
        progress = stack.enter_context(batch_progress(sys.stderr, len(projects), quiet=quiet))
        run = Run(projects, options.overrides, folder, force=options.force, strict=options.strict, html=options.html)
        trouble: list[PhotostripError] = []
        try:
            with executor_of(options, len(projects), progress) as executor:
                said = BatchMessages(progress, len(projects), quiet=quiet, verbose=verbose)
                run.go(executor, said.finished, stop, lambda task: progress.begun(task.project))
        except PhotostripError as error:  # nobody computes: the cluster is gone, or no process starts
            trouble.append(error)
        finally:
            progress.stop()
            code = max((run.exit_code, *(each.exit_code for each in trouble)))
            code = EXIT_SIGNAL + stop.signal if stop.signal else code
            if folder is not None:
                trouble += write_summaries(run, code, folder, html=options.html)
    print_summary(run.outcomes, code, form, width, quiet=quiet, verbose=verbose)
    if options.depfile is not None and options.output is not None:
        write_text(options.depfile, make_rule(options.output / "summary.json", run.files_read()))
    _say_end(run, stop, quiet=quiet)
    for each in trouble:
        raise each
    return code


def executor_of(options: BatchOptions, number: int, progress: BatchProgress) -> AbstractContextManager[Executor]:
    """Start the pool of this machine, or connect to the cluster that the user named."""
    if options.executor == "local":
        return LocalPool(min(options.jobs or cores(), number), options.limits)
    from photostrip.batch.cluster import cluster

    return cluster(options.executor.removeprefix("dask:"), options.limits, progress.say)


class BatchMessages:
    """What is said on stderr while a batch runs: a line for each project, or on a terminal for each failure.

    Verbose messages say also where internal errors happened.
    """

    def __init__(self, progress: BatchProgress, total: int, *, quiet: bool, verbose: bool) -> None:
        self.progress, self.total, self.quiet, self.verbose, self.done = progress, total, quiet, verbose, 0

    def finished(self, outcome: Document, answer: Answer | None) -> None:
        """Say what became of a project."""
        self.done += 1
        self.progress.finished(outcome["project"])
        if self.quiet or (self.progress.live and not outcome["exit_code"]):
            return
        how = ", unchanged" if answer is None and not outcome["exit_code"] else ""
        trace = answer.trace if answer is not None and self.verbose else ""
        count = f"{self.done:>{len(str(self.total))}} of {self.total}"
        self.progress.say(f"{count}  {outcome_line(outcome)}{how}\n{trace}".rstrip("\n"))


def write_summaries(run: Run, code: int, folder: ResultFolder, *, html: bool = False) -> list[InputError]:
    """Write the files of the summary; give what went wrong, which must not hide what became of the projects."""
    pages = {}
    if html:
        from photostrip.report.html import batch_html

        pages["summary.html"] = batch_html(run.outcomes, __version__)
    try:
        write_files(
            folder.path,
            {
                "summary.txt": layout.to_text("", batch_sections(run.outcomes, everything=True)),
                "summary.csv": formats.summary_csv(run.outcomes),
                **pages,
                "junit.xml": batch_junit(run.outcomes),
                "summary.json": formats.summary_json(run.outcomes, code),
            },
        )
    except InputError as error:
        return [error]
    except OSError as error:
        return [as_fault(error)]
    return []


def print_summary(
    outcomes: list[Document], code: int, form: BatchFormat, width: int | None, *, quiet: bool, verbose: bool
) -> None:
    match form:
        case "csv":
            sys.stdout.write(visible(formats.summary_csv(outcomes)))
        case "json":
            sys.stdout.write(visible_json(formats.summary_json(outcomes, code, ascii_only=ascii_only())))
        case "junit":
            sys.stdout.write(batch_junit(outcomes))
        case "github":
            sys.stdout.write(messages.annotated(finding for each in outcomes for finding in each["findings"]))
        case "text" | "md":
            sections = batch_sections(outcomes, quiet=quiet, everything=verbose)
            markdown = form == "md"
            print_sections("Summary of the batch" if markdown else "", sections, width, markdown=markdown)


def _say_end(run: Run, stop: Stop, *, quiet: bool) -> None:
    """Say on stderr what was computed, and why the batch ended before its end."""
    waiting = sum(each["status"] == "not run" for each in run.outcomes)
    if stop.signal:
        sys.stderr.write(f"interrupted: {counted(waiting, 'project')} not run; the same command goes on from here\n")
    elif stop():
        sys.stderr.write(
            f"error: {stop.refusals} results in a row could not be written; {counted(waiting, 'project')} not run\n"
        )
    elif not quiet and run.unchanged:
        computed = len(run.outcomes) - run.unchanged
        sys.stderr.write(f"{computed} computed, {run.unchanged} unchanged since the last time\n")
