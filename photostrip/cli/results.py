"""Saved results: reported again, stated by the norms, compared with a baseline or with the truth."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from photostrip.cli.failures import failures_as
from photostrip.cli.options import (
    FORMAT,
    CompareFormat,
    Format,
    Plots,
    Quiet,
    Saved,
    Sections,
    StatementFormat,
    Strict,
    Target,
    Verbose,
    Width,
    form_of,
    refuse,
    refuse_sections,
)
from photostrip.cli.output import Messages, print_json, print_result, print_sections
from photostrip.errors import EXIT_DONE, EXIT_INPUT, EXIT_TOLERANCE, InputError

if TYPE_CHECKING:
    from photostrip.comparison import Tolerances


def _saved(result: Path) -> str:
    return str(result / "result.json" if result.is_dir() else result)


def report(
    result: Saved,
    output: Target = None,
    form: Annotated[Format | None, FORMAT] = None,
    width: Width = None,
    plots: Plots = None,
    strict: Strict = False,
    section: Sections = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Print the accuracy report of a saved result again.

    It is the report that `photostrip run` printed. FILE may end in .txt, .md, .html or .json. The exit code is 0
    whatever the verdict, as the report of a failed result is a report; with --strict it is 1 unless the verdict is
    GOOD.
    """
    from photostrip.formats.files import write_files, write_text
    from photostrip.formats.result_json import read_result
    from photostrip.library.result import report_of
    from photostrip.report.sections.accuracy_report import sections_of
    from photostrip.result.certificate import as_reported, faults_of_edited
    from photostrip.result.verdict import exit_code

    wanted = form or form_of(output or Path(), "--output")
    refuse_sections(section, wanted)
    file = _saved(result)
    saved = read_result(file)
    with faults_of_edited("reported", (saved, file)):
        document = as_reported(saved, file)
        sections_of(document)  # what is incomplete is refused, whatever is printed
        if plots is not None:
            from photostrip.report.pictures.result import picture_files

            write_files(plots, picture_files(document))
        parts: dict[str, Any] = {"quiet": quiet, "everything": verbose, "names": section or ()}
        if output is None:
            print_result(document, form or "text", width, **parts)
        else:
            write_text(output, report_of(document, wanted, width=width, **parts))
    return exit_code(document["status"], strict=True) if strict else EXIT_DONE


def statement(
    result: Saved,
    class_plan: Annotated[
        float | None, typer.Option(metavar="CM", min=0.1, max=1e6, help="Class in plan that is asked for, cm.")
    ] = None,
    class_height: Annotated[
        float | None, typer.Option(metavar="CM", min=0.1, max=1e6, help="Class in height that is asked for, cm.")
    ] = None,
    output: Target = None,
    form: Annotated[StatementFormat | None, FORMAT] = None,
    width: Width = None,
    quiet: Quiet = False,
) -> int:
    """State the accuracy of a result by the norms, to be signed.

    The ASPRS standard (edition 2, 2024) tests with 30 check points and counts their own error; beside it stand the
    measures of ISO 19157, CE90 and LE90, and the NSSDA. The exit code is 1
    when a class that is asked for is not met or the check points are fewer than the standard asks for. Nothing is
    stated, with exit code 2, where the evidence does not carry it: no check points, check points that stand out or are
    not known well enough, a result that FAILED or is UNVERIFIED, a local frame. FILE may end in .txt, .md, .html or
    .json.
    """
    from photostrip.formats.result_json import read_result
    from photostrip.result.statement import exit_code, statement_document

    wanted = form or form_of(output or Path(), "--output")
    file = _saved(result)
    with failures_as(wanted):
        asked = {"plan": class_plan, "height": class_height}
        found = statement_document(
            read_result(file), file, {part: size for part, size in asked.items() if size is not None}
        )
        if output is None and wanted == "json":
            print_json(found)
            return exit_code(found["status"])
        from photostrip.formats.files import write_text
        from photostrip.report.sections.statement import statement_report
        from photostrip.sheets.sheet import rendered

        title, sections = statement_report(found, quiet=quiet)
        if output is None:
            print_sections(title, sections, width, markdown=wanted == "md")
        else:
            write_text(output, rendered(wanted, title, sections, found, width))
    return exit_code(found["status"])


def compare(
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
        Path | None, typer.Option(metavar="FILE", help="The project for --again; default: found beside it by its hash.")
    ] = None,
    form: Annotated[CompareFormat, FORMAT] = "text",
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
    from photostrip.formats.result_json import line_finder, text_of
    from photostrip.library.comparison import compare as compared
    from photostrip.library.comparison import compare_again, place_of
    from photostrip.project.tolerances import load_tolerances
    from photostrip.report.commands.compare import TRUTH, compare_cases, compare_findings, comparison_report
    from photostrip.report.page.messages import annotated, to_junit

    if (baseline is None) is not again or (update and again) or (project is not None and not again):
        refuse("BASELINE", "give a BASELINE, or --again without one (and with it alone --project)")
    with failures_as(form):
        allowed = None if tolerances is None else load_tolerances(tolerances)[0]
        if baseline is None:
            found = compare_again(result, project, allowed)
        elif update:
            _update_all(result, baseline, allowed, Messages(quiet=quiet))
            return EXIT_DONE
        else:
            try:
                found = compared(result, baseline, tolerances=allowed).document
            except InputError as error:
                raise _told_how_to_write(error, str(place_of(baseline))) from None
        if TRUTH in found and form in {"junit", "github"}:
            refuse("--format", "true errors have no tolerances that a test could keep: text, md or json")
        match form:
            case "json":
                print_json(found)
            case "junit":
                suite = f"photostrip compare {found.get('name') or found['result']}"
                sys.stdout.write(to_junit(suite, compare_cases(found)))
            case "github":
                sys.stdout.write(annotated(compare_findings(found, lambda file: line_finder(text_of(file)))))
            case "text" | "md":
                title, sections = comparison_report(found, quiet=quiet, everything=verbose)
                print_sections(title, sections, width, markdown=form == "md")
    return {"refused": EXIT_INPUT, "different": EXIT_TOLERANCE}.get(found.get("status", ""), EXIT_DONE)


def _told_how_to_write(error: InputError, place: str) -> InputError:
    """Where there is no baseline, or none that is whole, let the fault say how it comes to be."""
    missing = {"file-missing", "result-incomplete"}
    return InputError(
        replace(fault, fix=f"{fault.fix + '; ' if fault.fix else ''}--update writes it")
        if fault.code in missing and fault.file == place
        else fault
        for fault in error.faults
    )


def _update_all(result: Path, baseline: Path, allowed: Tolerances | None, messages: Messages) -> None:
    """Write a result, or all of a folder, as baselines; say what changes by each."""
    from photostrip.library.comparison import BASELINE, results_below

    for name, file in (results_below(result) or {"": result}).items():
        messages.say(_update(file, baseline / name / BASELINE if name else baseline, allowed))


def _update(result: Path, baseline: Path, allowed: Tolerances | None) -> str:
    """Write a result as the baseline; return what changes by it."""
    from photostrip.comparison import baseline_of, compare_results
    from photostrip.formats.files import write_text
    from photostrip.formats.result_json import read_baseline, read_result, to_json
    from photostrip.library.comparison import place_of
    from photostrip.report.commands.compare import headline

    file, place = place_of(result), place_of(baseline, update=True)
    document = read_result(str(file))
    if place.exists() and file.samefile(place):
        refuse("--update", f"{place} is the result itself: the baseline would take its place")
    compare_results(document, document, allowed, (str(file), str(file)))  # refuses one that could never be compared
    text = f"wrote {place}"
    if place.exists():
        try:
            found = compare_results(document, read_baseline(str(place)), allowed, (str(file), "the baseline before"))
            text += f"; {headline(found)}"
        except InputError:
            text += "; what stood there could not be compared with it"
    write_text(place, to_json(baseline_of(document)))
    return text
