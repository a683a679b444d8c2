"""``photostrip terrestrial``: the computations of a phototheodolite."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from photostrip.cli.commands.terrestrial_directions import (
    HELP_NAMES,
    CameraName,
    Distance,
    Format,
    Presets,
    PrincipalPoint,
    directions,
)
from photostrip.cli.options import Silent
from photostrip.cli.terrestrial_output import hand_out, say, told

if TYPE_CHECKING:
    from photostrip.project.terrestrial.terrestrial_loading import Survey

terrestrial = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    context_settings=HELP_NAMES,
    help="Computations of a phototheodolite: directions of photo points, displacements between epochs.",
)
terrestrial.add_typer(directions, name="directions")

EXAMPLE = "\b\nExamples:\n  photostrip terrestrial displacement survey.yaml --plot survey.svg"
EXAMPLE += "\n  photostrip terrestrial displacement pseudo.csv --base 50 --sigma 0.005 \\"
EXAMPLE += "\n      --principal-distance 1000"
TABLE_ENDS = (".csv", ".csv.gz")


@terrestrial.command("displacement", epilog=EXAMPLE)
def displacement(  # noqa: PLR0913, PLR0917 (an argument for each option)
    source: Annotated[
        Path, typer.Argument(metavar="PROJECT", help="Project file (YAML), or a table (CSV) of the normal case.")
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder to write JSON and CSV files into.")
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key, as in processing.significance=0.01."),
    ] = None,
    form: Format = "text",
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE.svg", help="Draw the displacements, too.")
    ] = None,
    depfile: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a rule for make; needs -o.")] = None,
    quiet: Silent = False,
    base: Annotated[float | None, typer.Option("--base", metavar="M", help="Table only: length of the base.")] = None,
    camera: CameraName = None,
    presets: Presets = None,
    principal_distance: Distance = None,
    principal_point: PrincipalPoint = None,
    kind: Annotated[
        Literal["pseudo-parallaxes", "coordinates"] | None,
        typer.Option("--kind", help="Table only: what it holds; default: pseudo-parallaxes."),
    ] = None,
    unit: Annotated[Literal["mm", "um"], typer.Option("--unit", help="Table only: unit of the table.")] = "mm",
    sigma: Annotated[
        float | None,
        typer.Option("--sigma", metavar="S", help="Table only: standard deviation of a coordinate, in the unit."),
    ] = None,
    sigma_d: Annotated[
        float | None,
        typer.Option("--sigma-d", metavar="S", help="Table only: that of a pseudo-parallax; default: as --sigma."),
    ] = None,
    stable: Annotated[
        str | None, typer.Option("--stable", metavar="IDS", help="Table only: points that did not move, as in A,B,C.")
    ] = None,
) -> None:
    """Compute displacements of points between epochs from photos taken at the same two stations.

    PROJECT describes stations, cameras, epochs and measurements. A table alone is enough where the cameras stand in
    the normal case: axes parallel and at right angles to the base.
    """
    with told(form):
        from photostrip.formats.output.terrestrial_displacements import displacement_document, displacements_csv
        from photostrip.report.commands.terrestrial_displacements import displacement_report
        from photostrip.report.pictures.terrestrial import check_plot
        from photostrip.terrestrial.epochs import monitor

        if plot is not None:
            check_plot(str(plot))
        if depfile is not None and output is None:
            message = "a rule for make needs a target: give --output as well"
            raise typer.BadParameter(message, param_hint="--depfile")
        if str(source).casefold().endswith(TABLE_ENDS):
            options = (camera, presets, principal_distance, principal_point)
            survey = _from_table(source, base, options, (kind, unit, sigma, sigma_d), stable, assignments)
        else:
            only = {
                "--base": base, "--camera": camera, "--presets": presets, "--principal-distance": principal_distance,
                "--principal-point": principal_point, "--kind": kind, "--sigma": sigma, "--sigma-d": sigma_d,
                "--stable": stable,
            }  # fmt: skip
            survey = _from_project(
                source, assignments or [], [name for name, value in only.items() if value is not None]
            )
        result = monitor(survey.series, survey.pair, survey.settings)
        frame = (survey.axes, survey.order, survey.time_unit)
        document = displacement_document(survey.name, result, survey.cameras, frame, survey.notes)
        _write(document, survey, output, plot, depfile)
        say((*survey.notes, *result.notes), quiet=quiet or form != "csv")  # the other forms have them inside
        hand_out(document, form, displacement_report, displacements_csv)


def _from_table(
    table: Path,
    base: float | None,
    camera: tuple[str | None, str | None, float | None, str | None],
    numbers: tuple[str | None, str, float | None, float | None],
    stable: str | None,
    assignments: list[str] | None,
) -> Survey:
    """Read a table of the normal case, which the options describe."""
    from photostrip.errors import Fault, InputError
    from photostrip.project.terrestrial.terrestrial_file import MILLIMETRES
    from photostrip.project.terrestrial.terrestrial_loading import load_normal_case
    from photostrip.project.terrestrial.terrestrial_options import CameraOptions, chosen_camera
    from photostrip.project.terrestrial.terrestrial_ranges import BASE, IMAGE_SIGMA, Range, within
    from photostrip.project.terrestrial.terrestrial_series import Table
    from photostrip.terrestrial.monitoring import Settings

    if assignments:
        raise InputError(Fault("a table has no keys that could be set", "set", key="--set", fix="use the options"))
    if base is None:
        message = "a table of the normal case needs its base"
        raise InputError(Fault(message, "no-base", key="--base", expected="metres", fix="or name a project file"))
    chosen = chosen_camera(CameraOptions(*camera))
    kind, unit, sigma, sigma_d = numbers
    for option, value in (("--sigma", sigma), ("--sigma-d", sigma_d)):
        if value is not None:
            scale = MILLIMETRES[unit]
            within(option, value, Range(IMAGE_SIGMA.least / scale, IMAGE_SIGMA.most / scale, unit))
    meaning = Table((kind or "pseudo-parallaxes").replace("-", "_"), unit, "up", sigma, sigma_d)
    names = [part.strip() for part in (stable or "").split(",") if part.strip()]
    return load_normal_case(str(table), chosen, within("--base", base, BASE), meaning, names, Settings())


def _from_project(project: Path, assignments: list[str], only_for_tables: list[str]) -> Survey:
    """Read a project; options that describe a table have no meaning for it."""
    from photostrip.errors import Fault, InputError
    from photostrip.project.terrestrial.terrestrial_loading import load_survey

    if only_for_tables:
        message = f"{only_for_tables[0]} describes a table (.csv), and {project} is a project"
        fix = "write it into the project, or override a key with --set"
        raise InputError(Fault(message, "option", key=only_for_tables[0], fix=fix))
    return load_survey(project, assignments)


def _write(
    document: dict[str, Any], survey: Survey, output: Path | None, plot: Path | None, depfile: Path | None
) -> None:
    """Write files of a result, the picture and the rule for make."""
    from photostrip.formats.output.result_json import to_json
    from photostrip.formats.output.terrestrial_displacements import cameras_csv, displacements_csv
    from photostrip.formats.text.writing import make_rule, write_files, write_text
    from photostrip.report.pictures.terrestrial import displacement_plot

    if output is not None:
        files = {"displacements.csv": displacements_csv(document), "cameras.csv": cameras_csv(document)}
        write_files(output, files | {"displacements.json": to_json(document)})
        if depfile is not None:
            write_text(depfile, make_rule(str(output / "displacements.json"), survey.files))
    if plot is not None:
        write_text(plot, displacement_plot(document))
