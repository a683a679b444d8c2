"""``photostrip terrestrial directions``: what a phototheodolite has to do with directions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer

from photostrip.cli.options import Silent
from photostrip.cli.terrestrial_output import Form, hand_out, say, told

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from photostrip.project.terrestrial.terrestrial_options import CameraOptions
    from photostrip.terrestrial.directions import Phototheodolite

    Net = tuple[NDArray[np.float64], NDArray[np.float64]]

HELP_NAMES = {"help_option_names": ["--help", "-h"]}
MOST_POINTS = 20_000  # of a table over the photo
COMMAND = "photostrip terrestrial directions"
Command = TypeVar("Command", bound="Callable[..., None]")

directions = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    help="Directions of a phototheodolite: from photos and back, their accuracy, the orientation of a photo by them.",
)

CameraName = Annotated[str | None, typer.Option("--camera", metavar="NAME", help="Camera of a list; see `cameras`.")]
Presets = Annotated[str | None, typer.Option("--presets", metavar="FILE", help="Your own list of cameras (YAML).")]
Distance = Annotated[
    float | None, typer.Option("--principal-distance", metavar="MM", help="Principal distance, instead of the list's.")
]
PrincipalPoint = Annotated[
    str | None, typer.Option("--principal-point", metavar="X0,Z0", help="Principal point in mm, likewise.")
]
PhotoFormat = Annotated[
    str | None, typer.Option("--photo-format", metavar="W,H", help="Width and height of the photo in mm, likewise.")
]
Alpha = Annotated[float, typer.Option("--alpha", help="Azimuth of the optical axis, clockwise from north.")]
Omega = Annotated[float, typer.Option("--omega", help="Elevation of the optical axis, upwards.")]
Kappa = Annotated[float, typer.Option("--kappa", help="Roll, counter-clockwise for the photographer.")]
AngleUnit = Annotated[Literal["deg", "gon"], typer.Option("--angles", help="Unit of angles and directions.")]
Unit = Annotated[Literal["mm", "um"], typer.Option("--unit", help="Unit of image coordinates.")]
Format = Annotated[Form, typer.Option("--format", help="How to print it.")]
Plot = Annotated[Path | None, typer.Option("--plot", metavar="FILE.svg", help="Draw it, too.")]
ImageTable = Annotated[str | None, typer.Argument(metavar="TABLE", help="Table `point,x,z` (CSV).", show_default=False)]
DirectionTable = Annotated[
    str | None, typer.Argument(metavar="TABLE", help="Table `point,lambda,beta` (CSV).", show_default=False)
]


def _command(name: str, example: str) -> Callable[[Command], Command]:
    arguments = f" \\\n      {example}" if example else ""  # a page is 80 characters wide
    epilog = f"\b\nExample:\n  {COMMAND} {name}{arguments}"
    return directions.command(name, context_settings=HELP_NAMES, epilog=epilog)


@_command("from-photo", '--camera "Photheo 19/1318" --at 80,60')
def from_photo(  # noqa: PLR0913, PLR0917 (an argument for each option)
    table: ImageTable = None,
    at: Annotated[list[str] | None, typer.Option("--at", metavar="X,Z", help="One point, instead of a table.")] = None,
    camera: CameraName = None,
    presets: Presets = None,
    principal_distance: Distance = None,
    principal_point: PrincipalPoint = None,
    alpha: Alpha = 0.0,
    omega: Omega = 0.0,
    kappa: Kappa = 0.0,
    angles: AngleUnit = "deg",
    unit: Unit = "mm",
    sigma_um: Annotated[
        float | None, typer.Option("--sigma-um", metavar="UM", help="Standard error of x, z and f: that of directions.")
    ] = None,
    form: Format = "text",
    quiet: Silent = False,
) -> None:
    """Compute horizontal and vertical directions of image points.

    x grows to the right, z upwards; lambda is an azimuth clockwise from north, beta an elevation.
    """
    with told(form):
        from photostrip.formats.output.terrestrial_directions import conversion
        from photostrip.project.terrestrial import terrestrial_ranges as ranges
        from photostrip.project.terrestrial.terrestrial_options import (
            CameraOptions,
            chosen_camera,
            image_points,
            looking,
        )

        chosen = chosen_camera(CameraOptions(camera, presets, principal_distance, principal_point))
        radians, rotation = looking(alpha, omega, kappa, angles)
        sigma = None if sigma_um is None else ranges.within("--sigma-um", sigma_um, ranges.IMAGE_SIGMA_UM) / 1000
        ids, xz, notes = image_points(table, at or [], unit)
        say(notes, quiet=quiet)
        _print(conversion(chosen, radians, rotation, (ids, xz), (angles, sigma)), form)


@_command("to-photo", '--camera "Photheo 19/1318" --alpha 15 --at 27.5,6.25')
def to_photo(  # noqa: PLR0913, PLR0917 (an argument for each option)
    table: DirectionTable = None,
    at: Annotated[
        list[str] | None, typer.Option("--at", metavar="LAMBDA,BETA", help="One direction, instead of a table.")
    ] = None,
    camera: CameraName = None,
    presets: Presets = None,
    principal_distance: Distance = None,
    principal_point: PrincipalPoint = None,
    alpha: Alpha = 0.0,
    omega: Omega = 0.0,
    kappa: Kappa = 0.0,
    angles: AngleUnit = "deg",
    form: Format = "text",
    quiet: Silent = False,
) -> None:
    """Compute where directions meet the photo, in millimetres."""
    with told(form):
        from photostrip.formats.output.terrestrial_directions import conversion
        from photostrip.project.terrestrial.terrestrial_options import (
            CameraOptions,
            chosen_camera,
            direction_points,
            looking,
        )

        chosen = chosen_camera(CameraOptions(camera, presets, principal_distance, principal_point))
        radians, rotation = looking(alpha, omega, kappa, angles)
        ids, given, notes = direction_points(table, at or [], angles, chosen, rotation)
        say(notes, quiet=quiet)
        _print(conversion(chosen, radians, rotation, (ids, given), (angles, None), to_photo=True), form)


@_command("accuracy", '--camera "UMK 10/1318" --sigma-um 5')
def accuracy(  # noqa: PLR0913, PLR0917 (an argument for each option)
    camera: CameraName = None,
    presets: Presets = None,
    principal_distance: Distance = None,
    photo_format: PhotoFormat = None,
    sigma_um: Annotated[
        float, typer.Option("--sigma-um", metavar="UM", help="Standard error of x, z and the principal distance.")
    ] = 5.0,
    alpha: Alpha = 0.0,
    omega: Omega = 0.0,
    kappa: Kappa = 0.0,
    angles: AngleUnit = "deg",
    step: Annotated[float, typer.Option("--step", metavar="MM", help="Distance of the points of the table.")] = 20.0,
    as_printed: Annotated[
        bool, typer.Option("--as-printed", help="Use the formulas as the source prints them; for a level camera.")
    ] = False,
    form: Format = "text",
    plot: Plot = None,
) -> None:
    """Tell how accurately correction directions must be measured, all over the photo."""
    with told(form):
        from photostrip.formats.output.terrestrial_directions import required_accuracy
        from photostrip.project.terrestrial import terrestrial_ranges as ranges
        from photostrip.project.terrestrial.terrestrial_options import CameraOptions, looking

        radians, rotation = looking(alpha, omega, kappa, angles)
        level = omega == 0 and kappa == 0
        if as_printed and not level:
            from photostrip.errors import Fault, InputError

            message = "the printed formulas hold for a level camera"
            raise InputError(Fault(message, "as-printed", key="--as-printed", fix="leave out --omega and --kappa"))
        sigma = ranges.within("--sigma-um", sigma_um, ranges.IMAGE_SIGMA_UM) / 1000
        options = CameraOptions(camera, presets, principal_distance, None, photo_format)

        def document(chosen: Phototheodolite, net: Net) -> dict[str, Any]:
            return required_accuracy(chosen, (radians, rotation, angles), sigma, net, as_printed=as_printed)

        from photostrip.report.pictures.terrestrial import accuracy_plot

        _over_the_photo(options, (step, level), document, (plot, accuracy_plot), form)


@_command("theodolite", '--camera "UMK 10/1318" --sigma-arcsec 2 --rounds 4')
def theodolite(  # noqa: PLR0913, PLR0917 (an argument for each option)
    sigma_arcsec: Annotated[
        float,
        typer.Option("--sigma-arcsec", metavar="SEC", help="Standard error of a direction in one round, both faces."),
    ],
    rounds: Annotated[int, typer.Option("--rounds", min=1, help="Rounds measured.")] = 1,
    vertical_arcsec: Annotated[
        float | None,
        typer.Option("--vertical-arcsec", metavar="SEC", help="The same of a vertical one; default: as horizontal."),
    ] = None,
    camera: CameraName = None,
    presets: Presets = None,
    principal_distance: Distance = None,
    photo_format: PhotoFormat = None,
    sigma_um: Annotated[
        float | None,
        typer.Option("--sigma-um", metavar="UM", help="Image accuracy wanted: tell the rounds it needs."),
    ] = None,
    alpha: Alpha = 0.0,
    omega: Omega = 0.0,
    kappa: Kappa = 0.0,
    angles: AngleUnit = "deg",
    step: Annotated[float, typer.Option("--step", metavar="MM", help="Distance of the points of the table.")] = 20.0,
    form: Format = "text",
    plot: Plot = None,
) -> None:
    """Tell which image accuracy a theodolite can vouch for, all over the photo."""
    with told(form):
        from photostrip.formats.output.terrestrial_directions import theodolite_accuracy
        from photostrip.project.terrestrial import terrestrial_ranges as ranges
        from photostrip.project.terrestrial.terrestrial_options import CameraOptions, looking

        radians, rotation = looking(alpha, omega, kappa, angles)
        horizontal = ranges.within("--sigma-arcsec", sigma_arcsec, ranges.DIRECTION_SIGMA)
        vertical = (
            horizontal
            if vertical_arcsec is None
            else ranges.within("--vertical-arcsec", vertical_arcsec, ranges.DIRECTION_SIGMA)
        )
        wanted = None if sigma_um is None else ranges.within("--sigma-um", sigma_um, ranges.IMAGE_SIGMA_UM) / 1000
        options = CameraOptions(camera, presets, principal_distance, None, photo_format)
        measured = (horizontal, vertical, rounds)

        def document(chosen: Phototheodolite, net: Net) -> dict[str, Any]:
            return theodolite_accuracy(chosen, (radians, rotation, angles), measured, wanted, net)

        from photostrip.report.pictures.terrestrial import theodolite_plot

        _over_the_photo(options, (step, omega == 0 and kappa == 0), document, (plot, theodolite_plot), form)


def _over_the_photo(
    options: CameraOptions,
    spacing: tuple[float, bool],
    document: Callable[[Phototheodolite, Net], dict[str, Any]],
    picture: tuple[Path | None, Callable[[dict[str, Any], dict[str, Any]], str]],
    form: Form,
) -> None:
    """Compute a table over the photo and print it; draw it on a finer one."""
    from photostrip.project.terrestrial import terrestrial_ranges as ranges
    from photostrip.project.terrestrial.terrestrial_options import chosen_camera
    from photostrip.report.pictures.terrestrial import FINE, check_plot
    from photostrip.terrestrial.accuracy import grid

    plot, draw = picture
    if plot is not None:
        check_plot(str(plot))
    chosen = chosen_camera(options, with_format=True)
    width, height = chosen.format or (0.0, 0.0)
    step = ranges.within("--step", spacing[0], ranges.STEP)
    _limit_rows(step, width, height)
    found = document(chosen, grid((width, height), step, level=spacing[1]))
    if plot is not None:
        import numpy as np

        from photostrip.formats.text.writing import write_text

        across, upwards = np.linspace(-width / 2, width / 2, FINE), np.linspace(-height / 2, height / 2, FINE)
        write_text(plot, draw(found, document(chosen, (across, upwards))))
    _print(found, form)


def _limit_rows(step: float, width: float, height: float) -> None:
    """Refuse a step that would print forever."""
    if width * height / step**2 > MOST_POINTS:
        from photostrip.errors import Fault, InputError

        message = f"a step of {step:g} mm gives more than {MOST_POINTS} points"
        raise InputError(Fault(message, "range", key="--step", expected="a larger step"))


@_command("orient", 'sightings.csv --camera "Photheo 19/1318"')
def orient(  # noqa: PLR0913, PLR0917 (an argument for each option)
    table: Annotated[
        str,
        typer.Argument(metavar="TABLE", help="Table `point,x,z,lambda,beta[,sx,sz][,s_lambda,s_beta]` (CSV)."),
    ],
    camera: CameraName = None,
    presets: Presets = None,
    principal_distance: Distance = None,
    principal_point: PrincipalPoint = None,
    free: Annotated[
        str | None,
        typer.Option(metavar="NAMES", help="Determine principal-distance, principal-point or both, too (A,B)."),
    ] = None,
    unit: Unit = "mm",
    angles: AngleUnit = "deg",
    sigma_um: Annotated[float, typer.Option("--sigma-um", metavar="UM", help="Standard error of x and z.")] = 5.0,
    sigma_arcsec: Annotated[
        float,
        typer.Option("--sigma-arcsec", metavar="SEC", help="Standard error of a direction in one round, both faces."),
    ] = 2.0,
    vertical_arcsec: Annotated[
        float | None,
        typer.Option("--vertical-arcsec", metavar="SEC", help="The same of a vertical one; default: as horizontal."),
    ] = None,
    rounds: Annotated[int, typer.Option("--rounds", min=1, help="Rounds measured.")] = 1,
    screening: Annotated[
        Literal["deletion", "stated", "none"],
        typer.Option(help="Test points against the scatter of the others, against the stated standard errors, or not."),
    ] = "deletion",
    significance: Annotated[float, typer.Option(help="Probability of rejecting a point of a clean photo.")] = 0.05,
    form: Format = "text",
    quiet: Silent = False,
) -> None:
    """Orient a photo by measured directions to points in it, by least squares.

    The directions are measured with a theodolite where the camera stood. alpha comes out in the zero of its circle.
    """
    with told(form):
        from photostrip.formats.output.terrestrial_directions import oriented
        from photostrip.project.terrestrial import terrestrial_options as given
        from photostrip.project.terrestrial import terrestrial_ranges as ranges
        from photostrip.terrestrial import orientation

        chosen = given.chosen_camera(given.CameraOptions(camera, presets, principal_distance, principal_point))
        settings = orientation.Settings(
            given.free_elements(free), screening, ranges.within("--significance", significance, ranges.SIGNIFICANCE)
        )
        horizontal = ranges.within("--sigma-arcsec", sigma_arcsec, ranges.DIRECTION_SIGMA)
        vertical = (
            horizontal
            if vertical_arcsec is None
            else ranges.within("--vertical-arcsec", vertical_arcsec, ranges.DIRECTION_SIGMA)
        )
        root = rounds**0.5
        sigma = ranges.within("--sigma-um", sigma_um, ranges.IMAGE_SIGMA_UM) / 1000
        options = given.SightingOptions(unit, angles, sigma, horizontal / root, vertical / root)
        sightings, notes = given.read_sightings(table, options)
        say(notes, quiet=quiet)
        found = orientation.orient(sightings, chosen.principal_distance, chosen.principal_point, settings)
        _print(oriented(chosen, sightings, found, settings, angles), form)


@_command("examples", "")
def examples(form: Format = "text") -> None:
    """Compute the worked examples of the source again, and explain what is misprinted."""
    with told(form):
        from photostrip.formats.output.terrestrial_directions import worked_examples

        _print(worked_examples(), form)


@_command("cameras", "--presets my-cameras.yaml")
def cameras(presets: Presets = None, form: Format = "text") -> None:
    """List the cameras that can be named."""
    with told(form):
        from photostrip.formats.output.terrestrial_directions import camera_list
        from photostrip.project.terrestrial.terrestrial_presets import read_presets

        _print(camera_list(read_presets(presets)), form)


def _print(document: dict[str, Any], form: Form) -> None:
    from photostrip.formats.output.terrestrial_displacements import points_csv
    from photostrip.report.commands.terrestrial import direction_report

    hand_out(document, form, direction_report, points_csv)
