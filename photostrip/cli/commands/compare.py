"""``photostrip compare``: a result against a baseline."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from photostrip.cli.options import Quiet, Verbose, Width
from photostrip.cli.stdout import CompareFormat, Format, print_json, print_sections

if TYPE_CHECKING:
    from photostrip.compare import Tolerances

BASELINE = "baseline.json"


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
    from photostrip.compare import Tolerances, compare_results
    from photostrip.errors import EXIT_DONE, EXIT_TOLERANCE
    from photostrip.project.tolerance_profile import load_tolerances

    file = str(result / "result.json" if result.is_dir() else result)
    place = _place_of(baseline, update=update)
    with failures_as(Format.TEXT if form is CompareFormat.JUNIT else Format(form.value)):
        allowed = Tolerances() if tolerances is None else load_tolerances(tolerances)[0]
        document = _read(file)
        if update:
            _refuse_itself(result, place)
            _update(document, file, place, allowed, quiet=quiet)
            return EXIT_DONE
        found = compare_results(document, _read_baseline(place), allowed, (file, str(place)))
    _print(found, place, form, width, quiet=quiet, verbose=verbose)
    return EXIT_TOLERANCE if found["status"] == "different" else EXIT_DONE


def _place_of(baseline: Path, *, update: bool) -> Path:
    """Return the file of a baseline; in a folder it is baseline.json, or else, to be read, result.json."""
    if not baseline.is_dir():
        return baseline
    whole = baseline / "result.json"
    return whole if whole.exists() and not update and not (baseline / BASELINE).exists() else baseline / BASELINE


def _refuse_itself(result: Path, place: Path) -> None:
    """Keep a result from being cut short to a baseline of itself."""
    file = result / "result.json" if result.is_dir() else result
    if place.exists() and file.samefile(place):
        message = f"{place} is the result itself: the baseline would take its place"
        raise typer.BadParameter(message, param_hint="--update")


def _read(file: str) -> dict[str, Any]:
    from photostrip.formats.output.result_json import read_result

    return read_result(file)


def _read_baseline(place: Path) -> dict[str, Any]:
    """Read the baseline; where there is none, the fault says how it comes to be."""
    from dataclasses import replace

    from photostrip.errors import InputError

    try:
        return _read(str(place))
    except InputError as error:
        faults = [
            replace(fault, fix=f"{fault.fix + '; ' if fault.fix else ''}--update writes it")
            if fault.code == "file-missing"
            else fault
            for fault in error.faults
        ]
        raise InputError(faults) from None


def _update(document: dict[str, Any], file: str, place: Path, allowed: Tolerances, *, quiet: bool) -> None:
    """Write the baseline, and say what changes by it."""
    from photostrip.compare import baseline_of, compare_results
    from photostrip.errors import InputError
    from photostrip.formats.output.result_json import to_json
    from photostrip.formats.text.writing import write_text
    from photostrip.report.commands.compare import headline

    compare_results(document, document, allowed, (file, file))  # refuses one that could never be compared
    text = f"wrote {place}"
    if place.exists():
        try:
            text += (
                f"; {headline(compare_results(document, _read(str(place)), allowed, (file, 'the baseline before')))}"
            )
        except InputError:
            text += "; what stood there could not be compared with it"
    write_text(place, to_json(baseline_of(document)))
    if not quiet:
        sys.stderr.write(f"{text}\n")


def _print(
    found: dict[str, Any], place: Path, form: CompareFormat, width: int | None, *, quiet: bool, verbose: bool
) -> None:
    """Print a comparison on stdout."""
    from photostrip.formats.output.result_lines import line_finder
    from photostrip.report.commands.compare import compare_sections, compare_title
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
            title = "" if quiet else compare_title(found)
            print_sections(title, sections, width, markdown=form is CompareFormat.MD)
