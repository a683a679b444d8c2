"""``photostrip convert``: other programs' files as a project, and a result as other programs' files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from photostrip.cli.options import Folder, Silent, refuse
from photostrip.errors import Fault, InputError

if TYPE_CHECKING:
    from photostrip.foreign.tables import ForeignBlock, Wanted

RESULT = "result.json"
OR_FORCE = "choose another folder, or use --force"


def convert(
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
    output: Folder = None,
    to: Annotated[str, typer.Option(metavar="NAME", help="Form of FILE, where its ending does not say it.")] = "",
    sigma: Annotated[
        float | None, typer.Option(metavar="PX", help="Standard deviation of an image coordinate in pixels; needed.")
    ] = None,
    pixel_size: Annotated[
        float | None, typer.Option(metavar="MM", help="Size of a pixel; else micrometres in reports stand for pixels.")
    ] = None,
    image_size: Annotated[
        str | None, typer.Option(metavar="W,H", help="Size of the photos in pixels; HISTORIX does not have it.")
    ] = None,
    control: Annotated[
        Path | None,
        typer.Option(
            "--control",
            metavar="FILE",
            help="Control with its marks: CSV, gcp_list.txt, ground_control_points.json, markers of Metashape, .xml.",
        ),
    ] = None,
    crs: Annotated[str, typer.Option(metavar="CRS", help="Frame of the control, as EPSG:32633.")] = "",
    control_sigma: Annotated[
        str | None, typer.Option(metavar="M", help="Its standard deviation in metres: one, or EAST,NORTH,UP.")
    ] = None,
    mark_sigma: Annotated[
        float | None, typer.Option(metavar="PX", help="That of a mark in pixels; else --sigma.")
    ] = None,
    mark_width: Annotated[
        float | None, typer.Option(metavar="PX", help="Width of the photos that were marked, where it is another.")
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
        str | None, typer.Option(metavar="M", help="Standard deviation of HISTORIX's positions: one, or EAST,NORTH,UP.")
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
    options = {
        "--sigma": sigma,
        "--pixel-size": pixel_size,
        "--image-size": image_size,
        "--control": control,
        "--crs": crs,
        "--control-sigma": control_sigma,
        "--mark-sigma": mark_sigma,
        "--mark-width": mark_width,
        "--positions": positions,
        "--positions-sigma": positions_sigma,
    }
    if source.suffix == ".json" or (source / RESULT).is_file():
        if target is None or output is not None or any(each not in {None, ""} for each in options.values()):
            message = f"{source} is a result, which is written into a file: no -o, and none of the options of a project"
            refuse("FILE", f"{message}; write photostrip convert {source} points.gpkg")
        lines, written = _written_for_others(source, target, to, force=force), f"wrote {target}"
    elif output is None or target is not None or to:
        message = f"{source} is no result, and becomes a project in a folder"
        refuse("--output", f"{message}; write photostrip convert {source} -o DIR")
    else:
        lines, written = _converted(source, output, options, force=force)
    if not quiet:
        typer.echo("\n".join(lines))
        typer.echo(written, err=True)


def _written_for_others(source: Path, target: str, form: str, *, force: bool) -> list[str]:
    """Write a result in the form of another program, all of its files or none; say what is in them."""
    from photostrip.foreign.exports import exported
    from photostrip.formats.files import write_files
    from photostrip.formats.result_json import read_result
    from photostrip.project.keys import TABLES, form_of
    from photostrip.project.template import refuse_existing
    from photostrip.result.certificate import EDITED, FIX, OF_WORDS, faults_of_edited, is_edited

    file = source / RESULT if source.is_dir() else source
    place = Path(target)
    if place.name in {"", ".."}:  # `./`, whose own name is needed
        place = place.resolve()
    form = form_of(target, form)
    saved = read_result(str(file))
    try:
        with faults_of_edited("exported", (saved, str(file))):
            found = exported(saved, [place.name + ("/" if target.endswith("/") else "")], form)
    except InputError as error:
        raise InputError(replace(each, file=each.file or str(file)) for each in error.faults) from None
    except OF_WORDS as error:  # orientations are not among the numbers that the certificate vouches for
        message = f"cannot be exported: a value is of another kind ({error})"
        fault = Fault(message, "result-incomplete", str(file), expected="a whole result.json", fix=FIX)
        raise InputError(fault) from error
    if not force and (form == "opensfm" or any("/" in name for name in found.files)):  # measurements may stand there
        refuse_existing(place.parent, list(found.files), OR_FORCE)
    write_files(place.parent, found.files, [file, *(file.parent / f"{name}.csv" for name in TABLES)])
    return [*([f"{file}: {EDITED}"] if is_edited(saved) else []), *found.said]


def _converted(source: Path, output: Path, options: Mapping[str, Any], *, force: bool) -> tuple[list[str], str]:
    """Write a project, all of its files or none; say what was understood, and what was written.

    Raises InputError with everything that is wrong with the options, or with the files.
    """
    from photostrip.foreign.gathering import measured_alone
    from photostrip.foreign.project import project_files, understood
    from photostrip.foreign.sources import own_control
    from photostrip.foreign.tables import Wanted
    from photostrip.formats.files import write_files
    from photostrip.project.template import refuse_existing

    control = options["--control"] or own_control(source)
    faults = list(_faults(options, control))
    if faults:
        raise InputError(faults)
    wanted = Wanted(
        sigma=options["--sigma"],
        pixel_size=options["--pixel-size"],
        image_size=_numbers(options["--image-size"], 2),
        positions_sigma=_numbers(options["--positions-sigma"], 3),
    )
    block = measured_alone(_read(source, wanted, options, control))
    if not len(block.xy):
        message, fix = "nothing is measured on these photos", "give --control FILE, a table with its marks"
        if block.beside:
            message += ": tie points are in none of the files"
            fix = f"its markers are taken with {' or '.join(f'--control {file}' for file in block.beside)}; or {fix}"
        raise InputError(Fault(message, "no-points", str(source), key="--control", fix=fix))
    files = project_files(output.resolve().name or "project", block, wanted)
    if not force:
        refuse_existing(output, list(files), OR_FORCE)
    write_files(output, files, block.files)
    said = understood(block, wanted)
    width = max(map(len, said))
    lines = [f"{name:<{width}}  {text}" for name, text in said.items()]
    return lines, f"wrote {', '.join(files)} to {output}; next: photostrip check {output / 'project.yaml'}"


def _read(source: Path, wanted: Wanted, options: Mapping[str, Any], control: Path | None) -> ForeignBlock:
    """Read photos and points, then the control with its marks, then measured positions."""
    from photostrip.foreign.control import Asked, with_control
    from photostrip.foreign.events import with_events
    from photostrip.foreign.metashape import ENDING
    from photostrip.foreign.metashape_markers import with_markers, with_references
    from photostrip.foreign.opensfm_control import with_ground_control
    from photostrip.foreign.sources import read_source

    block, positions = read_source(source, wanted), options["--positions"]
    if control is not None:
        asked = Asked(
            file=str(control),
            crs=options["--crs"],
            sigma=_numbers(options["--control-sigma"], 3),
            mark_sigma=options["--mark-sigma"],
            width=options["--mark-width"],
        )
        name = asked.file.casefold()
        reader = with_markers if name.endswith(ENDING) else with_control
        block = (with_ground_control if name.endswith((".json", ".json.gz")) else reader)(block, asked)
    if positions is not None:
        block = (with_references if positions.suffix.casefold() == ENDING else with_events)(block, str(positions))
    return block


def _faults(options: Mapping[str, Any], control: Path | None) -> Iterator[Fault]:
    from photostrip.formats.faults import LARGEST_NUMBER, SMALLEST_LENGTH

    if options["--sigma"] is None:
        message = "the files do not say how precise an image coordinate is"
        fix = "give --sigma PX: features of SIFT scatter by 0.5 to 1 px"
        yield Fault(message, "option", key="--sigma", fix=fix)
    for option, unit in {"--sigma": "px", "--pixel-size": "mm", "--mark-sigma": "px", "--mark-width": "px"}.items():
        value = options[option]
        if value is not None and not SMALLEST_LENGTH < value < LARGEST_NUMBER:
            yield Fault(f"{value:g} {unit} is no length", "option", key=option, expected="a number larger than 0")
    metres = "one number in metres, or three with commas between them"
    size = "width and height in pixels with a comma between them, as 9000,9200"
    for option, what, count, expected in (
        ("--control-sigma", "precision", 3, metres),
        ("--positions-sigma", "precision", 3, metres),
        ("--image-size", "size", 2, size),
    ):
        if options[option] is not None and _numbers(options[option], count) is None:
            yield Fault(f"`{options[option]}` is no {what}", "option", key=option, expected=expected)
    for option in ("--crs", "--control-sigma", "--mark-sigma", "--mark-width"):
        if control is None and options[option]:
            yield Fault("there is no control that it is about", "option", key=option, fix="give --control FILE, too")


def _numbers(text: str | None, count: int) -> Any:  # noqa: ANN401 (a tuple so long)
    """Read lengths with commas between them, one for all of three; None for anything else."""
    from photostrip.formats.faults import LARGEST_NUMBER, SMALLEST_LENGTH, NotANumber
    from photostrip.formats.faults import number as read_number

    words = (text or "").split(",")
    try:
        values = tuple(map(read_number, words * count if count == 3 and len(words) == 1 else words))
    except (NotANumber, ValueError):
        return None
    return values if len(values) == count and SMALLEST_LENGTH < min(values) <= max(values) < LARGEST_NUMBER else None
