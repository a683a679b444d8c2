"""``photostrip convert``: other programs' files as a project, and a result as other programs' files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from photostrip.cli.options import Silent


def convert(  # noqa: PLR0913, PLR0917 (an argument for each option)
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="Folder of a COLMAP model, of OpenSfM, of HISTORIX; cameras of Metashape, .xml; or a result.json.",
        ),
    ],
    target: Annotated[
        str | None,
        typer.Argument(
            metavar="FILE", help="What to write a result into: .gpkg, .csv, .geojson, .yaml, or a folder, MODEL/."
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder to write the project into.")
    ] = None,
    to: Annotated[
        str, typer.Option("--to", metavar="NAME", help="Form of FILE, where its ending does not say it.")
    ] = "",
    sigma: Annotated[
        float | None,
        typer.Option("--sigma", metavar="PX", help="Standard deviation of an image coordinate in pixels; needed."),
    ] = None,
    pixel_size: Annotated[
        float | None,
        typer.Option(
            "--pixel-size", metavar="MM", help="Size of a pixel; else micrometres in reports stand for pixels."
        ),
    ] = None,
    image_size: Annotated[
        str | None,
        typer.Option("--image-size", metavar="W,H", help="Size of the photos in pixels; HISTORIX does not have it."),
    ] = None,
    control: Annotated[
        Path | None,
        typer.Option(
            "--control",
            metavar="FILE",
            help="Control with its marks: CSV, gcp_list.txt, ground_control_points.json, markers of Metashape, .xml.",
        ),
    ] = None,
    crs: Annotated[str, typer.Option("--crs", metavar="CRS", help="Frame of the control, as EPSG:32633.")] = "",
    control_sigma: Annotated[
        str | None,
        typer.Option("--control-sigma", metavar="M", help="Its standard deviation in metres: one, or EAST,NORTH,UP."),
    ] = None,
    mark_sigma: Annotated[
        float | None, typer.Option("--mark-sigma", metavar="PX", help="That of a mark in pixels; else --sigma.")
    ] = None,
    mark_width: Annotated[
        float | None,
        typer.Option("--mark-width", metavar="PX", help="Width of the photos that were marked, where it is another."),
    ] = None,
    positions: Annotated[
        Path | None,
        typer.Option(
            "--positions",
            metavar="FILE",
            help="GNSS events: Timestamp.MRK of DJI, events.pos of RTKLIB; references of Metashape, .xml.",
        ),
    ] = None,
    positions_sigma: Annotated[
        str | None,
        typer.Option(
            "--positions-sigma", metavar="M", help="Standard deviation of HISTORIX's positions: one, or EAST,NORTH,UP."
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite the files of a project in DIR, or of a model.")
    ] = False,
    quiet: Silent = False,
) -> None:
    """Write a project from other programs' files, or a result for them.

    DIR gets project.yaml, observations.csv, orientations.csv and, where they are given, control.csv and positions.csv.
    Printed is what was understood: counts, cameras, one photo, frame, units. What the files do not carry is asked for
    by the name of an option, and never guessed.

    Where SOURCE is a result, it is written into FILE: GeoPackage, tables of orthority (CSV, GeoJSON), of omega, phi,
    kappa (.txt), a submission to HISTORIX (NAME_extrinsics.csv), cameras (.yaml; .opencv.yaml and its kin in pixels),
    a COLMAP model, reconstruction.json of OpenSfM.
    """
    from photostrip.cli.jobs.convert import Options, converted, is_result, written_for_others

    given = (
        *(sigma, pixel_size, image_size, control, crs, control_sigma, mark_sigma, mark_width),
        *(positions, positions_sigma),
    )
    if is_result(source):
        if target is None or output is not None or any(each not in {None, ""} for each in given):
            message = f"{source} is a result, which is written into a file: no -o, and none of the options of a project"
            raise typer.BadParameter(f"{message}; write photostrip convert {source} points.gpkg", param_hint="FILE")
        said = written_for_others(source, target, to, force=force)
        if not quiet:
            typer.echo("\n".join(said))
            typer.echo(f"wrote {target}", err=True)
        return
    if output is None or target is not None or to:
        message = f"{source} is no result, and becomes a project in a folder"
        raise typer.BadParameter(f"{message}; write photostrip convert {source} -o DIR", param_hint="--output")
    asked = Options(
        sigma=sigma,
        pixel_size=pixel_size,
        image_size=image_size,
        control=control,
        crs=crs,
        control_sigma=control_sigma,
        mark_sigma=mark_sigma,
        mark_width=mark_width,
        positions=positions,
        positions_sigma=positions_sigma,
    )
    lines, written = converted(source, output, asked, force=force)
    if not quiet:
        typer.echo("\n".join(lines))
        typer.echo(written, err=True)
