"""Projects: the first files of one, made up with known truth, checked, and adjusted: the main job."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from photostrip.cli.failures import failures_as
from photostrip.cli.options import (
    SHEET_FORMS,
    Assigned,
    Assignments,
    Folder,
    Format,
    Plots,
    Quiet,
    Rule,
    Sections,
    Shape,
    Silent,
    Strict,
    Verbose,
    Width,
    form_of,
    refuse,
    refuse_sections,
    require_target,
)
from photostrip.cli.output import Messages, ascii_only, deliver, print_result, print_sections, write_rule
from photostrip.errors import EXIT_DONE, EXIT_INPUT
from photostrip.visible import visible

if TYPE_CHECKING:
    from photostrip.errors import PhotostripError
    from photostrip.notes import Document
    from photostrip.project.check import Checked


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the new project; made when it is missing.")],
    quiet: Silent = False,
) -> None:
    """Write a commented project file and the headers of its tables.

    DIR gets project.yaml, observations.csv, control.csv and fiducials.csv. Nothing is overwritten: when one of the
    files exists, none is written. `photostrip check` then names what is still to be filled in.
    """
    from photostrip.formats.files import write_files
    from photostrip.project.template import refuse_existing, template_files

    files = template_files(folder.resolve().name or "project")
    refuse_existing(folder, list(files))
    write_files(folder, files)
    Messages(quiet=quiet).say(f"wrote {', '.join(files)} to {folder}; next: photostrip check {folder / 'project.yaml'}")


def simulate(
    spec: Annotated[Path, typer.Argument(metavar="SPEC", help="Specification of the simulation (YAML).")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder to write the project into.")],
    assignments: Assigned = None,
    depfile: Rule = None,
    quiet: Silent = False,
) -> None:
    """Write a synthetic project with known truth, ready to run.

    DIR gets project.yaml with its tables, and truth.json: the true coordinates, perspective centres and rotations,
    and the gross errors that were put in. The same SPEC gives the same files on every machine.
    """
    from photostrip.library.project import simulated

    simulation = simulated(spec, assignments or [])
    simulation.write(output)
    target = str(output / "project.yaml")
    write_rule(depfile, target, simulation.files_read)
    Messages(quiet=quiet).say(f"{target}: {simulation.summary}")


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
    from photostrip.project.check import check_project
    from photostrip.report.page.progress import progress

    found = []
    with progress(sys.stderr, len(projects), quiet=quiet) as waiting:
        for project in projects:
            waiting.at(f"checking {project}")
            found.append(check_project(project, assignments or []))
    _print_checked(found, form, width, quiet=quiet, verbose=verbose)
    return EXIT_INPUT if any(each.wrong for each in found) else EXIT_DONE


def _print_checked(found: Sequence[Checked], form: Format, width: int | None, *, quiet: bool, verbose: bool) -> None:
    """Print what was found in some projects, in the order in which the user named them."""
    import json

    from photostrip import __version__
    from photostrip.report.page.messages import annotated, finding_of
    from photostrip.visible import visible_json

    findings = [[finding_of(each) for each in checked.everything] for checked in found]
    if form == "json":
        projects = [
            {"project": each.path, "status": "faulty" if each.wrong else "ok", "findings": listed, **each.document}
            for each, listed in zip(found, findings, strict=True)
        ]
        document = {"photostrip_check": 1, "version": __version__, "projects": projects}
        sys.stdout.write(f"{visible_json(json.dumps(document, ensure_ascii=ascii_only(), indent=1))}\n")
    elif form == "github":
        sys.stdout.write(annotated(finding for listed in findings for finding in listed))
    else:
        for number, each in enumerate(found):
            sys.stdout.write("\n" if number and not quiet else "")
            _print_one(each, findings[number], form, width, quiet=quiet, verbose=verbose)
        if len(found) > 1:
            faulty = sum(bool(each.wrong) for each in found)
            sys.stdout.write(f"\n{len(found)} projects: {len(found) - faulty} OK, {faulty} faulty\n")


def _print_one(
    checked: Checked, findings: list[Document], form: Format, width: int | None, *, quiet: bool, verbose: bool
) -> None:
    from photostrip.report.commands.check import check_sections, verdict
    from photostrip.report.page.messages import lines_of

    head, lines = verdict(checked.path, checked.wrong, checked.remarks), lines_of(findings)
    sections = () if quiet or not checked.document else check_sections(checked.document, everything=verbose)
    if form == "md":
        sys.stdout.write(visible("\n".join([f"# {head}\n", *(f"- {line}" for line in lines), "\n"])))
    else:  # not wrapped: an editor or grep finds `file:line:column:` at the beginning of a line
        sys.stdout.write(visible("".join(f"{line}\n" for line in (head, *lines))))
        sys.stdout.write("\n" if sections else "")
    if sections:
        print_sections("", sections, width, markdown=form == "md")


def run(
    project: Annotated[Path, typer.Argument(metavar="PROJECT", help="Project file (YAML).")],
    output: Folder = None,
    assignments: Assignments = None,
    form: Shape = "text",
    width: Width = None,
    depfile: Rule = None,
    trace: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write every iteration with the formulas: .txt, .md, .html, .json."),
    ] = None,
    cross_validate: Annotated[
        bool, typer.Option("--cross-validate", help="Leave control out in turn, and compare the result there.")
    ] = False,
    methods: Annotated[
        bool, typer.Option("--compare-methods", help="Adjust by every method, and compare them at the check points.")
    ] = False,
    html: Annotated[bool, typer.Option("--html", help="Write report.html into DIR, too.")] = False,
    plots: Plots = None,
    strict: Strict = False,
    section: Sections = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Adjust the strips of a project and report the accuracy.

    The report goes to stdout, in at most 120 lines; --verbose prints all of it, --section a part. With -o, DIR gets
    result.json with everything, its tables as CSV (points.csv, photos.csv, given_points.csv, residuals.csv ...),
    refined.csv and project.resolved.yaml. The exit code is 1 when the verdict is FAILED, with --strict also when it is
    LOOK or UNVERIFIED. With --compare-methods and -o, each method gets a folder of its own in DIR.
    """
    from photostrip.formats.files import write_files, write_text
    from photostrip.library.project import loaded_from
    from photostrip.library.result import RESULT
    from photostrip.notes import counted
    from photostrip.report.page.progress import progress
    from photostrip.result.verdict import exit_code

    require_target(depfile, output)
    if output is None and html:
        refuse("--html", "report.html needs a folder: give --output as well")
    form_of(trace or Path(), "--trace", SHEET_FORMS)
    if methods and (depfile or trace or plots):
        refuse("--compare-methods", "a comparison of methods has no --depfile, no --trace and no --plots")
    if methods and strict:
        refuse("--strict", "a comparison of methods has no verdict: --strict asks for one")
    refuse_sections(section, "a comparison of methods" if methods else form)
    messages = Messages(quiet=quiet, verbose=verbose)
    assignments = [*(["processing.cross_validation=true"] if cross_validate else []), *(assignments or [])]
    if methods:
        return _compare_methods(project, assignments, output, form, width, messages, html=html)
    with failures_as(form), progress(sys.stderr, quiet=quiet) as waiting:
        waiting.at(f"reading {project}")
        read = loaded_from(project, assignments)
        measured = counted(len(read.loaded.inputs.observations), "image point")
        messages.step(f"read {counted(len(read.loaded.files), 'file')}, {measured}")
        waiting.at(f"adjusting {counted(len(read.photos), 'photo')}")
        result = read.run()
        if result.computed is not None:
            messages.step(f"adjusted {counted(len(result.computed.points.number), 'point')}")
        waiting.at("writing the result")
        files_read = read.files_read(result)
        if trace is not None:
            write_text(trace, result.trace(form_of(trace, "--trace", SHEET_FORMS)), files_read)
        if output is not None:
            write_rule(depfile, output / RESULT, files_read)  # before the result: it must not be the newer of the two
            messages.say(f"wrote {len(result.write(output, html=html))} files to {output}")
        if plots is not None:
            from photostrip.report.pictures.result import picture_files

            pictures = picture_files(result.document)
            write_files(plots, pictures)
            messages.say(f"wrote {len(pictures)} pictures to {plots}")
    print_result(result.document, form, width, quiet=quiet, everything=verbose, names=section or ())
    return exit_code(result.status, strict=strict)


def _compare_methods(
    project: Path,
    assignments: Sequence[str],
    output: Path | None,
    form: Format,
    width: int | None,
    messages: Messages,
    *,
    html: bool,
) -> int:
    """Adjust a project in every way there is and print what is left at its check points.

    In the output folder each adjustment gets a folder of its name, with `html` each its report and all of them
    ``methods.html``. An adjustment that refuses the project, or its key in the project file, is named with its reason;
    when none succeeds, the first failure is raised.
    """
    from photostrip.errors import GeometryError, InputError
    from photostrip.formats.files import write_text
    from photostrip.library.project import loaded_from
    from photostrip.pipeline.inputs import METHODS
    from photostrip.report.page.progress import progress
    from photostrip.sheets.methods import methods_sheet

    found: dict[str, Any] = {}
    refused: list[PhotostripError] = []
    name = ""
    with failures_as(form), progress(sys.stderr, quiet=messages.quiet) as waiting:
        for adjustment in METHODS:
            waiting.at(f"adjusting: {adjustment}")
            try:
                result = loaded_from(project, [*assignments, f"processing.adjustment={adjustment}"]).run()
            except (GeometryError, InputError) as error:
                found[adjustment] = error
                refused.append(error)
                continue
            name, found[adjustment] = result.name, result.document
            if output is not None:
                result.write(output / adjustment, html=html)
                messages.say(f"wrote the result of {adjustment} to {output / adjustment}")
        if len(refused) == len(found):
            raise refused[0]
        sheet = methods_sheet(name, found)
        if html and output is not None:
            write_text(output / "methods.html", sheet.rendered("html"))
    deliver(sheet, "md" if form == "github" else form, width=width)
    return EXIT_DONE
