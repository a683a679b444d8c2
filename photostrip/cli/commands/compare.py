"""``photostrip compare``: a result against a baseline."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from photostrip.cli.options import Quiet, Verbose, Width
from photostrip.cli.stdout import CompareFormat, Format, print_json, print_sections


def compare(
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="A result.json, or the folder that holds it.")],
    baseline: Annotated[
        Path, typer.Argument(metavar="BASELINE", help="A baseline or a result.json, or a folder that holds one.")
    ],
    tolerances: Annotated[
        Path | None, typer.Option("--tol", metavar="FILE", help="Tolerance profile (YAML); default: last digits only.")
    ] = None,
    update: Annotated[bool, typer.Option("--update", help="Write the result as the new baseline.")] = False,
    form: Annotated[
        CompareFormat, typer.Option("--format", envvar="PHOTOSTRIP_FORMAT", help="How the answer is printed.")
    ] = CompareFormat.TEXT,
    width: Width = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Compare a result with a baseline, within tolerances for each kind of quantity.

    Plan, height, rotations, sigma0, scale factors, precision, statistics and counts are compared as numbers; ids,
    choices, rejected measurements and findings as sets. The exit code is 1 when they differ, 2 when they cannot be
    compared: other frames, another format, no result. With --update it is 0.
    """
    from photostrip.cli.failures import failures_as
    from photostrip.cli.jobs import baseline as baseline_job
    from photostrip.comparison import Tolerances, compare_results
    from photostrip.errors import EXIT_DONE, EXIT_TOLERANCE, faults_instead
    from photostrip.formats.output.result_json import read_result
    from photostrip.project.tolerance_profile import load_tolerances
    from photostrip.visible import visible

    file = result / "result.json" if result.is_dir() else result
    place = baseline_job.place_of(baseline, update=update)
    with failures_as(Format.TEXT if form is CompareFormat.JUNIT else Format(form.value)):
        allowed = Tolerances() if tolerances is None else load_tolerances(tolerances)[0]
        document = read_result(str(file))
        if update:
            changes = visible(baseline_job.update(document, file, place, allowed))
            sys.stderr.write("" if quiet else f"{changes}\n")
            return EXIT_DONE
        found = compare_results(document, baseline_job.read(place), allowed, (str(file), str(place)))
        with faults_instead(str(file), "compared"):
            _print(found, place, form, width, quiet=quiet, verbose=verbose)
    return EXIT_TOLERANCE if found["status"] == "different" else EXIT_DONE


def _print(
    found: dict[str, Any], place: Path, form: CompareFormat, width: int | None, *, quiet: bool, verbose: bool
) -> None:
    from photostrip.formats.output.result_lines import line_finder
    from photostrip.report.commands.compare import compare_sections
    from photostrip.report.commands.compare_findings import compare_cases, compare_findings
    from photostrip.report.page.junit import to_junit
    from photostrip.report.page.messages import annotated

    match form:
        case CompareFormat.JSON:
            print_json(found)
        case CompareFormat.JUNIT:
            sys.stdout.write(to_junit(f"photostrip compare {found['name']}", compare_cases(found)))
        case CompareFormat.GITHUB:
            lines = line_finder(place.read_text(encoding="utf-8"))
            sys.stdout.write(annotated(compare_findings(found, lines)))
        case CompareFormat.TEXT | CompareFormat.MD:
            sections = compare_sections(found, quiet=quiet, everything=verbose)
            title = "" if quiet else f"Comparison: {found['name']}"
            print_sections(title, sections, width, markdown=form is CompareFormat.MD)
