"""``photostrip terrestrial``: the computations of a phototheodolite."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from photostrip.cli.commands.terrestrial_directions import (
    CameraByPoint,
    Format,
    Looking,
    Unit,
    directions,
)
from photostrip.cli.documents import Rendering, say, write_rule
from photostrip.cli.option_groups import command_group, subcommand
from photostrip.cli.options import RuleOfOutput, Silent, require_target

if TYPE_CHECKING:
    from photostrip.project.terrestrial.survey import Survey

terrestrial = command_group(
    "Computations of a phototheodolite: directions of photo points, displacements between epochs."
)
terrestrial.add_typer(directions, name="directions")

EXAMPLE = "\b\nExamples:\n  photostrip terrestrial displacement survey.yaml --plot survey.svg"
EXAMPLE += "\n  photostrip terrestrial displacement pseudo.csv --base 50 --sigma 0.005 \\"
EXAMPLE += "\n      --principal-distance 1000"
ONE_STATION = "\b\nExample:\n  photostrip terrestrial one-station changes.csv \\"
ONE_STATION += "\n      --camera 'UMK 10/1318' --stable A,B,C"
TABLE_ENDS = (".csv", ".csv.gz")
Base = Annotated[float | None, typer.Option("--base", metavar="M", help="Table only: length of the base.")]


@dataclass(frozen=True)
class TableOptions:
    """What the numbers of a table of the normal case mean."""

    kind: Annotated[
        Literal["pseudo-parallaxes", "coordinates"] | None,
        typer.Option("--kind", help="Table only: what it holds; default: pseudo-parallaxes."),
    ] = None
    unit: Annotated[Literal["mm", "um"], typer.Option("--unit", help="Table only: unit of the table.")] = "mm"
    sigma: Annotated[
        float | None,
        typer.Option("--sigma", metavar="S", help="Table only: standard deviation of a coordinate, in the unit."),
    ] = None
    sigma_d: Annotated[
        float | None,
        typer.Option("--sigma-d", metavar="S", help="Table only: that of a pseudo-parallax; default: as --sigma."),
    ] = None
    stable: Annotated[
        str | None, typer.Option("--stable", metavar="IDS", help="Table only: points that did not move, as in A,B,C.")
    ] = None


@subcommand(terrestrial, "displacement", EXAMPLE)
def displacement(  # noqa: PLR0913 (an argument for each option)
    *,
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
    depfile: RuleOfOutput = None,
    quiet: Silent = False,
    base: Base = None,
    camera: CameraByPoint,
    table: TableOptions,
) -> None:
    """Compute displacements of points between epochs from photos taken at the same two stations.

    PROJECT describes stations, cameras, epochs and measurements. A table alone is enough where the cameras stand in
    the normal case: axes parallel and at right angles to the base.
    """
    from photostrip.errors import Fault, InputError
    from photostrip.formats.output.terrestrial_displacements import displacement_document, displacements_csv
    from photostrip.report.commands.terrestrial_displacements import displacement_report
    from photostrip.terrestrial.monitoring import monitor

    if plot is not None and plot.suffix.lower() != ".svg":
        message, expected = "pictures are written as SVG", "a name that ends in .svg"
        raise InputError(Fault(message, "plot-format", str(plot), key="--plot", expected=expected))
    require_target(depfile, output)
    if str(source).casefold().endswith(TABLE_ENDS):
        survey = _from_table(source, base, camera, table, assignments)
    else:
        survey = _from_project(source, assignments or [], base, camera, table)
    result = monitor(survey.series, survey.pair, survey.settings)
    document = displacement_document(survey.name, result, survey.cameras, survey.frame, survey.notes)
    _write(document, output, plot)
    write_rule(depfile, None if output is None else output / "displacements.json", survey.files)
    say((*survey.notes, *result.notes), quiet=quiet or form != "csv")  # the other forms have them inside
    Rendering(displacement_report, displacements_csv).show(document, form)


@subcommand(terrestrial, "one-station", ONE_STATION)
def one_station(  # noqa: PLR0913 (an argument for each option)
    *,
    table: Annotated[
        str,
        typer.Argument(
            metavar="TABLE",
            help="Table `point,x,z,dx,dz,distance[,distance_later][,sigma][,sigma_d][,sigma_distance]` (CSV).",
        ),
    ],
    camera: CameraByPoint,
    looking: Looking,
    unit: Unit = "mm",
    sigma_um: Annotated[float, typer.Option("--sigma-um", metavar="UM", help="Standard deviation of x and z.")] = 5.0,
    sigma_d_um: Annotated[
        float | None, typer.Option("--sigma-d-um", metavar="UM", help="That of dx and dz; default: as of x and z.")
    ] = None,
    sigma_distance: Annotated[
        float, typer.Option("--sigma-distance", metavar="M", help="Standard deviation of a distance, metres.")
    ] = 0.01,
    stable: Annotated[
        str | None, typer.Option("--stable", metavar="IDS", help="Points that did not move, as in A,B,C.")
    ] = None,
    significance: Annotated[float, typer.Option(help="Probability of calling a still point moved.")] = 0.05,
    form: Format = "text",
    quiet: Silent = False,
) -> None:
    """Compute displacements from photos of one station, with known distances of the points.

    With the distance of the first epoch alone it is the displacement across the ray; with both it is complete.
    """
    from photostrip.formats.output.terrestrial_directions import points_csv
    from photostrip.formats.output.terrestrial_displacements import one_station_document
    from photostrip.project.terrestrial import options
    from photostrip.project.terrestrial.ranges import DISTANCE, SIGNIFICANCE, within
    from photostrip.report.commands.terrestrial_displacements import one_station_report
    from photostrip.terrestrial import one_station as computed

    chosen, attitude = camera.chosen(), looking.attitude()
    level = within("--significance", significance, SIGNIFICANCE)
    sigma = options.image_sigma(sigma_um)
    change = sigma if sigma_d_um is None else options.image_sigma(sigma_d_um)
    if sigma_distance != 0:
        within("--sigma-distance", sigma_distance, DISTANCE._replace(least=1e-6))
    names = [part.strip() for part in (stable or "").split(",") if part.strip()]
    measured, notes = options.read_one_station(table, unit, (sigma, change, sigma_distance), names, chosen)
    say(notes, quiet=quiet)
    found = computed.one_station(measured, chosen.principal_distance, attitude.rotation, level)
    document = one_station_document(measured, found, chosen, attitude, level)
    Rendering(one_station_report, points_csv).show(document, form)


def _from_table(
    file: Path, base: float | None, camera: CameraByPoint, table: TableOptions, assignments: list[str] | None
) -> Survey:
    """Read a table of the normal case, which the options describe."""
    from photostrip.errors import Fault, InputError
    from photostrip.project.terrestrial.ranges import BASE, IMAGE_SIGMA, MILLIMETRES, within
    from photostrip.project.terrestrial.series import Table
    from photostrip.project.terrestrial.survey import load_normal_case
    from photostrip.terrestrial.monitoring import MonitoringSettings

    if assignments:
        raise InputError(Fault("a table has no keys that could be set", "set", key="--set", fix="use the options"))
    if base is None:
        message = "a table of the normal case needs its base"
        raise InputError(Fault(message, "no-base", key="--base", expected="metres", fix="or name a project file"))
    chosen = camera.chosen()
    for option, value in (("--sigma", table.sigma), ("--sigma-d", table.sigma_d)):
        if value is not None:
            within(option, value, IMAGE_SIGMA.scaled(MILLIMETRES[table.unit], table.unit))
    kind = (table.kind or "pseudo-parallaxes").replace("-", "_")
    meaning = Table(kind=kind, unit=table.unit, z_axis="up", sigma=table.sigma, sigma_d=table.sigma_d)
    names = [part.strip() for part in (table.stable or "").split(",") if part.strip()]
    return load_normal_case(str(file), chosen, within("--base", base, BASE), meaning, names, MonitoringSettings())


def _from_project(
    project: Path, assignments: list[str], base: float | None, camera: CameraByPoint, table: TableOptions
) -> Survey:
    """Read a project; options that describe a table have no meaning for it."""
    from photostrip.errors import Fault, InputError
    from photostrip.project.terrestrial.survey import load_survey

    given = {"base": base, **vars(camera), **vars(table)}
    only = [f"--{name.replace('_', '-')}" for name, value in given.items() if value is not None and name != "unit"]
    if only:
        message = f"{only[0]} describes a table (.csv), and {project} is a project"
        fix = "write it into the project, or override a key with --set"
        raise InputError(Fault(message, "option", key=only[0], fix=fix))
    return load_survey(project, assignments)


def _write(document: dict[str, Any], output: Path | None, plot: Path | None) -> None:
    """Write files of a result, and the picture."""
    from photostrip.formats.output.result_json import to_json
    from photostrip.formats.output.terrestrial_displacements import cameras_csv, displacements_csv
    from photostrip.formats.text.writing import write_files, write_text
    from photostrip.report.pictures.displacements import displacement_picture

    if output is not None:
        files = {"displacements.csv": displacements_csv(document), "cameras.csv": cameras_csv(document)}
        write_files(output, files | {"displacements.json": to_json(document)})
    if plot is not None:
        write_text(plot, displacement_picture(document).file())
