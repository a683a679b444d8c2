"""``photostrip run``: the main job, from a project file to adjusted points and their accuracy."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.options import (
    Assignments,
    Plots,
    Quiet,
    Rule,
    Sections,
    Shape,
    Strict,
    Verbose,
    Width,
    refuse_sections,
    require_target,
)
from photostrip.cli.stdout import Parts, form_of, print_result


def run(  # noqa: PLR0913, PLR0917 (an argument for each option)
    project: Annotated[Path, typer.Argument(metavar="PROJECT", help="Project file (YAML).")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder to write the result into.")
    ] = None,
    assignments: Assignments = None,
    form: Shape = "text",
    width: Width = None,
    depfile: Rule = None,
    trace: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write every iteration with the symbols of the formulas: .txt, .md or .json."
        ),
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
    from photostrip.cli.failures import failures_as
    from photostrip.cli.stderr import Messages
    from photostrip.formats.text.writing import make_rule, write_files, write_text
    from photostrip.library.project import loaded_from
    from photostrip.library.result import RESULT
    from photostrip.notes import counted
    from photostrip.report.page.progress import progress
    from photostrip.result.verdict import exit_code

    alone = {"--depfile": depfile, "--trace": trace, "--plots": plots}  # not for a comparison of methods
    _refuse_contradictions(output, alone, methods=methods, html=html, strict=strict)
    refuse_sections(section, "a comparison of methods" if methods else form)
    messages = Messages(quiet=quiet, verbose=verbose)
    assignments = [*(["processing.cross_validation=true"] if cross_validate else []), *(assignments or [])]
    if methods:
        from photostrip.cli.jobs.method_comparison import compare_methods

        return compare_methods(project, assignments, output, form, width, messages, html=html)
    with failures_as(form), progress(sys.stderr, quiet=quiet) as waiting:
        waiting.at(f"reading {project}")
        read = loaded_from(project, assignments)
        inputs = read.loaded.inputs
        messages.step(
            f"read {counted(len(read.loaded.files), 'file')}, {counted(len(inputs.observations), 'image point')}"
        )
        waiting.at(f"adjusting {counted(len(read.photos), 'photo')}")
        result = read.run()
        if result.computed is not None:
            messages.step(f"adjusted {counted(len(result.computed.points.number), 'point')}")
        waiting.at("writing the result")
        files_read = read.files_read(result)
        if trace is not None:
            write_text(trace, result.trace(form_of(trace, "--trace")), files_read)
        if depfile is not None and output is not None:  # before the result: it must not be the newer of the two
            write_text(depfile, make_rule(output / RESULT, files_read), files_read)
        if output is not None:
            messages.say(f"wrote {len(result.write(output, html=html))} files to {output}")
        if plots is not None:
            pictures = result.pictures()
            write_files(plots, {f"{name}.svg": picture.file() for name, picture in pictures.items()})
            messages.say(f"wrote {len(pictures)} pictures to {plots}")
    print_result(result.document, form, width, Parts(quiet, verbose, section or ()))
    return exit_code(result.status, strict=strict)


def _refuse_contradictions(
    output: Path | None, alone: dict[str, Path | None], *, methods: bool, html: bool, strict: bool
) -> None:
    """Refuse options that make no sense together, before anything is computed."""
    trace = alone["--trace"]
    require_target(alone["--depfile"], output)
    if output is None and html:
        raise typer.BadParameter("report.html needs a folder: give --output as well", param_hint="--html")
    if trace is not None:
        form_of(trace, "--trace")
    if methods and any(alone.values()):
        message = "a comparison of methods has no --depfile, no --trace and no --plots"
        raise typer.BadParameter(message, param_hint="--compare-methods")
    if methods and strict:
        raise typer.BadParameter("a comparison of methods has no verdict: --strict asks for one", param_hint="--strict")
