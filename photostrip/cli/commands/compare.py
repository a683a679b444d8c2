"""``photostrip compare``: a result against a baseline."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from photostrip.cli.options import Quiet, Verbose, Width
from photostrip.cli.stdout import CompareFormat, print_json, print_sections


def compare(  # noqa: PLR0913, PLR0917 (an argument for each option)
    result: Annotated[
        Path,
        typer.Argument(metavar="RESULT", help="A result.json, the folder that holds it, or a folder of such folders."),
    ],
    baseline: Annotated[
        Path | None,
        typer.Argument(metavar="BASELINE", help="A baseline, a result.json or a truth.json, or a folder of baselines."),
    ] = None,
    tolerances: Annotated[
        Path | None, typer.Option("--tol", metavar="FILE", help="Tolerance profile (YAML); default: last digits only.")
    ] = None,
    update: Annotated[bool, typer.Option("--update", help="Write the result as the new baseline.")] = False,
    again: Annotated[
        bool, typer.Option("--again", help="Adjust its project again and compare with what comes out.")
    ] = False,
    project: Annotated[
        Path | None,
        typer.Option(
            "--project", metavar="FILE", help="The project for --again; default: found beside it by its hash."
        ),
    ] = None,
    form: Annotated[
        CompareFormat, typer.Option("--format", envvar="PHOTOSTRIP_FORMAT", help="How the answer is printed.")
    ] = "text",
    width: Width = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Compare a result with a baseline, or with the truth it came from.

    Plan, height, rotations, sigma0, scale factors, precision, statistics and counts are compared as numbers; ids,
    choices, rejected measurements and findings as sets. The exit code is 1 when they differ, 2 when they cannot be
    compared: other frames, another format, no result. With --update it is 0. Of two folders, every result is compared
    with the baseline in the folder of the same name. With the truth.json of a simulation the true errors are shown,
    beside the standard deviations, and the gross errors that were not found. With --again, in place of a baseline, the
    project is adjusted again as the certificate of the result says; files that have changed since are a difference.
    """
    from photostrip.cli.failures import failures_as
    from photostrip.cli.jobs import baseline as baseline_job
    from photostrip.errors import EXIT_DONE, EXIT_INPUT, EXIT_TOLERANCE
    from photostrip.library.again import compare_again
    from photostrip.library.comparison import compare as compared
    from photostrip.project.tolerances import load_tolerances
    from photostrip.report.commands.compare import TRUTH
    from photostrip.visible import visible

    if (baseline is None) is not again or (update and again) or (project is not None and not again):
        message = "give a BASELINE, or --again without one (and with it alone --project)"
        raise typer.BadParameter(message, param_hint="BASELINE")
    with failures_as(form):
        allowed = None if tolerances is None else load_tolerances(tolerances)[0]
        if baseline is None:
            found = compare_again(result, project, allowed)
        elif update:
            for changes in baseline_job.updates(result, baseline, allowed):
                sys.stderr.write("" if quiet else f"{visible(changes)}\n")
            return EXIT_DONE
        else:
            with baseline_job.told_how_to_write(baseline):
                found = compared(result, baseline, tolerances=allowed).document
        if TRUTH in found and form in {"junit", "github"}:
            message = "true errors have no tolerances that a test could keep: text, md or json"
            raise typer.BadParameter(message, param_hint="--format")
        _print(found, form, width, quiet=quiet, verbose=verbose)
    return {"refused": EXIT_INPUT, "different": EXIT_TOLERANCE}.get(found.get("status", ""), EXIT_DONE)


def _print(found: dict[str, Any], form: CompareFormat, width: int | None, *, quiet: bool, verbose: bool) -> None:
    from photostrip.formats.output.result_json import text_of
    from photostrip.formats.output.result_lines import line_finder
    from photostrip.report.commands.compare import compare_cases, compare_findings, comparison_report
    from photostrip.report.page.messages import annotated, to_junit

    match form:
        case "json":
            print_json(found)
        case "junit":
            sys.stdout.write(
                to_junit(f"photostrip compare {found.get('name') or found['result']}", compare_cases(found))
            )
        case "github":
            sys.stdout.write(annotated(compare_findings(found, lambda file: line_finder(text_of(file)))))
        case "text" | "md":
            title, sections = comparison_report(found, quiet=quiet, everything=verbose)
            print_sections(title, sections, width, markdown=form == "md")
