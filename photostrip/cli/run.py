"""``photostrip run``: the main job, from a project file to adjusted points and their accuracy."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.showing import Format, show


def run(
    project: Annotated[Path, typer.Argument(metavar="PROJECT", help="Project file (YAML).")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder to write the result into.")
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the project file; may be repeated."),
    ] = None,
    form: Annotated[Format, typer.Option("--format", help="How the report is printed.")] = Format.TEXT,
    width: Annotated[
        int | None, typer.Option(metavar="N", help="Width of the report, 60 to 200; default: that of the terminal.")
    ] = None,
    depfile: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a rule for make.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print the verdict only.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print long tables whole, and what is done.")
    ] = False,
) -> int:
    """Adjust the strips of a project and report the accuracy.

    The report goes to stdout. With -o, DIR gets result.json with everything, the tables points.csv, photos.csv,
    residuals.csv, parallaxes.csv and rejected.csv, and project.resolved.yaml. The exit code is 1 when a tolerance of
    the project is not kept.
    """
    from photostrip.cli.talking import Talk, no_collector
    from photostrip.errors import EXIT_DONE, EXIT_TOLERANCE
    from photostrip.formats.result.document import document_of
    from photostrip.formats.result.files import result_files
    from photostrip.formats.writing import make_rule, write_files, write_text
    from photostrip.pipeline import triangulate
    from photostrip.project.loading import load_project

    if depfile is not None and output is None:
        raise typer.BadParameter("a rule for make needs a target: give --output as well", param_hint="--depfile")
    talk = Talk(quiet=quiet, verbose=verbose)
    with no_collector():
        loaded = load_project(project, assignments or [])
        talk.step(f"read {len(loaded.files)} files, {len(loaded.inputs.observations)} image points")
        result = triangulate(loaded.inputs, loaded.settings, directory=loaded.directory)
        talk.step(f"adjusted {len(result.points.number)} points")
        document = document_of(result, loaded.hints)
        if output is not None:
            files = result_files(document, loaded.resolved)
            write_files(output, files)
            talk.say(f"wrote {len(files)} files to {output}")
        if depfile is not None and output is not None:
            write_text(depfile, make_rule(output / "result.json", loaded.files))
    show(document, form, width, quiet=quiet, verbose=verbose)
    return EXIT_TOLERANCE if document["status"] == "failed" else EXIT_DONE
