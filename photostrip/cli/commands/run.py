"""``photostrip run``: the main job, from a project file to adjusted points and their accuracy."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from photostrip.cli.options import Assignments, Quiet, Shape, Verbose, Width
from photostrip.cli.showing import Format, form_of, show, traced


def run(  # noqa: PLR0913, PLR0917 (an argument for each option)
    project: Annotated[Path, typer.Argument(metavar="PROJECT", help="Project file (YAML).")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder to write the result into.")
    ] = None,
    assignments: Assignments = None,
    form: Shape = Format.TEXT,
    width: Width = None,
    depfile: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a rule for make.")] = None,
    trace: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write every iteration with the symbols of the formulas: .txt, .md or .json."
        ),
    ] = None,
    methods: Annotated[
        bool, typer.Option("--compare-methods", help="Adjust in every way there is, side by side at check points.")
    ] = False,
    html: Annotated[bool, typer.Option("--html", help="Write report.html into DIR, too.")] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> int:
    """Adjust the strips of a project and report the accuracy.

    The report goes to stdout. With -o, DIR gets result.json with everything, the tables points.csv, photos.csv,
    residuals.csv, parallaxes.csv and rejected.csv, and project.resolved.yaml. The exit code is 1 when a tolerance of
    the project is not kept. A bundle adjustment adds reliability.csv. With --compare-methods and -o, each method gets a
    folder of its own in DIR.
    """
    from photostrip.cli.talking import Talk, failures_as, no_collector
    from photostrip.errors import EXIT_DONE, EXIT_TOLERANCE
    from photostrip.formats.output.result_files import result_files
    from photostrip.formats.text.writing import make_rule, write_files, write_text
    from photostrip.pipeline import triangulate
    from photostrip.project.loading import load_project
    from photostrip.report.page.progress import progress
    from photostrip.result.document import document_of

    _require_folder(output, depfile=depfile, html=html)
    if trace is not None:
        form_of(trace, "--trace")  # before anything is computed
    talk = Talk(quiet=quiet, verbose=verbose)
    if methods:
        from photostrip.cli.methods import compare_methods

        if depfile is not None or trace is not None or html:
            message = "a comparison of methods has no --depfile, no --trace and no --html"
            raise typer.BadParameter(message, param_hint="--compare-methods")
        return compare_methods(project, assignments or [], output, form, width, talk, quiet=quiet)
    with failures_as(form), no_collector(), progress(sys.stderr, quiet=quiet) as waiting:
        if html:
            from photostrip.report.html import check_html

            check_html()
        waiting.at(f"reading {project}")
        loaded = load_project(project, assignments or [])
        talk.step(f"read {len(loaded.files)} files, {len(loaded.inputs.observations)} image points")
        waiting.at(f"adjusting {sum(len(strip.photos) for strip in loaded.inputs.strips)} photos")
        with loaded.places():
            result = loaded.result(triangulate(loaded.inputs, loaded.settings, directory=loaded.directory))
        talk.step(f"adjusted {len(result.points.number)} points")
        document = document_of(result, loaded.remarks)
        waiting.at("writing the result")
        if trace is not None:
            write_text(trace, traced(result, form_of(trace, "--trace")))
        if output is not None:
            if depfile is not None:  # before the result: it must not be the newer of the two
                write_text(depfile, make_rule(output / "result.json", loaded.files_read(result)))
            files = _page(document, everything=verbose) if html else {}
            files |= result_files(document, loaded.resolved)
            write_files(output, files)
            talk.say(f"wrote {len(files)} files to {output}")
    show(document, form, width, quiet=quiet, verbose=verbose)
    return EXIT_TOLERANCE if document["status"] == "failed" else EXIT_DONE


def _require_folder(output: Path | None, *, depfile: Path | None, html: bool) -> None:
    """Refuse what makes no sense without a folder, and HTML that cannot be written."""
    if output is None and depfile is not None:
        raise typer.BadParameter("a rule for make needs a target: give --output as well", param_hint="--depfile")
    if output is None and html:
        raise typer.BadParameter("report.html needs a folder: give --output as well", param_hint="--html")


def _page(document: dict[str, Any], *, everything: bool) -> dict[str, str]:
    """Give report.html."""
    from photostrip.report.html import to_html

    return {"report.html": to_html(document, everything=everything)}
