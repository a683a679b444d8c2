"""``photostrip terrestrial directions``: what a phototheodolite has to do with directions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from photostrip.cli.documents import Form, Rendering, say
from photostrip.cli.option_groups import command_group, subcommand
from photostrip.cli.options import Silent

if TYPE_CHECKING:
    from photostrip.formats.output.terrestrial_directions import Attitude, Grid, Theodolite
    from photostrip.terrestrial.frame import Phototheodolite

MOST_POINTS = 20_000  # of a table over the photo
COMMAND = "photostrip terrestrial directions"

directions = command_group(
    "Directions of a phototheodolite: from photos and back, their accuracy, the orientation of a photo by them."
)


def _command(name: str, example: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    arguments = f" \\\n      {example}" if example else ""  # a page is 80 characters wide
    return subcommand(directions, name, f"\b\nExample:\n  {COMMAND} {name}{arguments}")


CameraName = Annotated[str | None, typer.Option("--camera", metavar="NAME", help="Camera of a list; see `cameras`.")]
Presets = Annotated[str | None, typer.Option("--presets", metavar="FILE", help="Your own list of cameras (YAML).")]
Distance = Annotated[
    float | None, typer.Option("--principal-distance", metavar="MM", help="Principal distance, instead of the list's.")
]
AngleUnit = Annotated[Literal["deg", "gon"], typer.Option("--angles", help="Unit of angles and directions.")]
Unit = Annotated[Literal["mm", "um"], typer.Option("--unit", help="Unit of image coordinates.")]
Format = Annotated[Form, typer.Option("--format", help="How the answer is printed.")]
Step = Annotated[float, typer.Option("--step", metavar="MM", help="Distance of the points of the table.")]
ImageTable = Annotated[str | None, typer.Argument(metavar="TABLE", help="Table `point,x,z` (CSV).", show_default=False)]
DirectionTable = Annotated[
    str | None, typer.Argument(metavar="TABLE", help="Table `point,lambda,beta` (CSV).", show_default=False)
]


@dataclass(frozen=True)
class CameraOptions:
    """Options that say which camera it is."""

    camera: CameraName = None
    presets: Presets = None
    principal_distance: Distance = None

    def chosen(self) -> Phototheodolite:
        """Return the camera."""
        from photostrip.project.terrestrial.options import chosen_camera

        return chosen_camera(**vars(self))


@dataclass(frozen=True)
class CameraByPoint(CameraOptions):
    """The same for computations that need no format."""

    principal_point: Annotated[
        str | None, typer.Option("--principal-point", metavar="X0,Z0", help="Principal point in mm, likewise.")
    ] = None


@dataclass(frozen=True)
class CameraByFormat(CameraOptions):
    """The same for computations over the whole photo."""

    photo_format: Annotated[
        str | None, typer.Option("--photo-format", metavar="W,H", help="Width and height of the photo in mm, likewise.")
    ] = None


@dataclass(frozen=True)
class DirectionOptions:
    """Options that say how well directions are measured."""

    theodolite: Annotated[
        str | None,
        typer.Option("--theodolite", metavar="NAME", help="Theo 010, 020 or 080 of Jena, instead of --sigma-arcsec."),
    ] = None
    sigma_arcsec: Annotated[
        float | None,
        typer.Option(
            "--sigma-arcsec", metavar="SEC", help="Standard deviation of a direction in one round, both faces."
        ),
    ] = None
    vertical_arcsec: Annotated[
        float | None,
        typer.Option("--vertical-arcsec", metavar="SEC", help="The same of a vertical one; default: as horizontal."),
    ] = None
    rounds: Annotated[int, typer.Option("--rounds", min=1, help="Rounds measured.")] = 1

    def sigmas(self, usual: float | None = None) -> Theodolite:
        """Return the standard deviations in one round, and the rounds; `usual` stands where nothing is given."""
        from photostrip.project.terrestrial.options import direction_sigma, theodolite_sigmas

        horizontal = direction_sigma(self.theodolite, self.sigma_arcsec, usual)
        return theodolite_sigmas(horizontal, self.vertical_arcsec, self.rounds)


@dataclass(frozen=True)
class Looking:
    """Options that say where the camera looks."""

    alpha: Annotated[float, typer.Option("--alpha", help="Azimuth of the optical axis, clockwise from north.")] = 0.0
    omega: Annotated[float, typer.Option("--omega", help="Elevation of the optical axis, upwards.")] = 0.0
    kappa: Annotated[float, typer.Option("--kappa", help="Roll, counter-clockwise for the photographer.")] = 0.0
    angles: AngleUnit = "deg"

    @property
    def level(self) -> bool:
        """Whether the optical axis and the photo's x axis are horizontal."""
        return self.omega == 0 and self.kappa == 0

    def attitude(self) -> Attitude:
        """Return the angles and the rotation of the camera."""
        from photostrip.project.terrestrial.options import attitude

        return attitude(self.alpha, self.omega, self.kappa, self.angles)


@_command("from-photo", '--camera "Photheo 19/1318" --at 80,60')
def from_photo(
    *,
    table: ImageTable = None,
    at: Annotated[list[str] | None, typer.Option("--at", metavar="X,Z", help="One point, instead of a table.")] = None,
    camera: CameraByPoint,
    looking: Looking,
    unit: Unit = "mm",
    sigma_um: Annotated[
        float | None,
        typer.Option("--sigma-um", metavar="UM", help="Standard deviation of x, z and f: that of directions."),
    ] = None,
    form: Format = "text",
    quiet: Silent = False,
) -> None:
    """Compute horizontal and vertical directions of image points.

    x grows to the right, z upwards; lambda is an azimuth clockwise from north, beta an elevation.
    """
    from photostrip.formats.output.terrestrial_directions import directions_document
    from photostrip.project.terrestrial.options import image_points, image_sigma

    chosen, attitude = camera.chosen(), looking.attitude()
    sigma = None if sigma_um is None else image_sigma(sigma_um)
    points = image_points(table, at or [], unit)
    say(points.notes, quiet=quiet)
    _print(directions_document(chosen, attitude, points.ids, points.values, sigma), form)


@_command("to-photo", '--camera "Photheo 19/1318" --alpha 15 --at 27.5,6.25')
def to_photo(
    *,
    table: DirectionTable = None,
    at: Annotated[
        list[str] | None, typer.Option("--at", metavar="LAMBDA,BETA", help="One direction, instead of a table.")
    ] = None,
    camera: CameraByPoint,
    looking: Looking,
    form: Format = "text",
    quiet: Silent = False,
) -> None:
    """Compute where directions meet the photo, in millimetres."""
    from photostrip.formats.output.terrestrial_directions import photo_document
    from photostrip.project.terrestrial.options import direction_points

    chosen, attitude = camera.chosen(), looking.attitude()
    points = direction_points(table, at or [], chosen, attitude)
    say(points.notes, quiet=quiet)
    _print(photo_document(chosen, attitude, points.ids, points.values), form)


@_command("accuracy", '--camera "UMK 10/1318" --sigma-um 5')
def accuracy(
    *,
    camera: CameraByFormat,
    sigma_um: Annotated[
        float, typer.Option("--sigma-um", metavar="UM", help="Standard deviation of x, z and the principal distance.")
    ] = 5.0,
    looking: Looking,
    step: Step = 20.0,
    as_printed: Annotated[
        bool, typer.Option("--as-printed", help="Use the formulas as the source prints them; for a level camera.")
    ] = False,
    form: Format = "text",
) -> None:
    """Tell how accurately correction directions must be measured, all over the photo."""
    from photostrip.errors import Fault, InputError
    from photostrip.formats.output.terrestrial_directions import required_accuracy
    from photostrip.project.terrestrial.options import image_sigma

    attitude = looking.attitude()
    if as_printed and not looking.level:
        message = "the printed formulas hold for a level camera"
        raise InputError(Fault(message, "as-printed", key="--as-printed", fix="leave out --omega and --kappa"))
    sigma = image_sigma(sigma_um)

    def document(chosen: Phototheodolite, grid: Grid) -> dict[str, Any]:
        return required_accuracy(chosen, attitude, sigma, grid, as_printed=as_printed)

    _over_the_photo(camera, document, step, level=looking.level, form=form)


@_command("theodolite", '--camera "UMK 10/1318" --theodolite "Theo 010" --rounds 4')
def theodolite(
    *,
    measuring: DirectionOptions,
    camera: CameraByFormat,
    sigma_um: Annotated[
        float | None,
        typer.Option("--sigma-um", metavar="UM", help="Image accuracy wanted: say how many rounds it needs."),
    ] = None,
    looking: Looking,
    step: Step = 20.0,
    form: Format = "text",
) -> None:
    """Tell which image accuracy a theodolite can vouch for, all over the photo."""
    from photostrip.formats.output.terrestrial_directions import theodolite_accuracy
    from photostrip.project.terrestrial.options import image_sigma

    attitude = looking.attitude()
    measured = measuring.sigmas()
    wanted = None if sigma_um is None else image_sigma(sigma_um)

    def document(chosen: Phototheodolite, grid: Grid) -> dict[str, Any]:
        return theodolite_accuracy(chosen, attitude, measured, wanted, grid)

    _over_the_photo(camera, document, step, level=looking.level, form=form)


def _over_the_photo(
    camera: CameraByFormat,
    document: Callable[[Phototheodolite, Grid], dict[str, Any]],
    step: float,
    *,
    level: bool,
    form: Form,
) -> None:
    """Compute a table over the photo and print it."""
    from photostrip.errors import Fault, InputError
    from photostrip.project.terrestrial.options import required_format
    from photostrip.project.terrestrial.ranges import STEP, within
    from photostrip.terrestrial.accuracy import grid

    chosen = camera.chosen()
    width, height = required_format(chosen)
    step = within("--step", step, STEP)
    if width * height / step**2 > MOST_POINTS:
        message = f"a step of {step:g} mm gives more than {MOST_POINTS} points"
        raise InputError(Fault(message, "range", key="--step", expected="a larger step"))
    _print(document(chosen, grid((width, height), step, level=level)), form)


@_command("orient", 'sightings.csv --camera "Photheo 19/1318"')
def orient(  # noqa: PLR0913 (an argument for each option)
    *,
    table: Annotated[
        str,
        typer.Argument(
            metavar="TABLE", help="Table `point,x,z,lambda,beta[,sx,sz][,s_lambda,s_beta][,distance]` (CSV)."
        ),
    ],
    camera: CameraByPoint,
    free: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES", help="Determine these as well: principal-distance, principal-point, refraction (A,B)."
        ),
    ] = None,
    eccentricity: Annotated[
        float,
        typer.Option(metavar="M", help="Front nodal point ahead of the theodolite's axes; needs a column `distance`."),
    ] = 0.0,
    refraction: Annotated[
        float,
        typer.Option(metavar="K", help="Coefficient that computed directions lack; needs a column `distance`."),
    ] = 0.0,
    unit: Unit = "mm",
    angles: AngleUnit = "deg",
    sigma_um: Annotated[float, typer.Option("--sigma-um", metavar="UM", help="Standard deviation of x and z.")] = 5.0,
    measuring: DirectionOptions,
    screening: Annotated[
        Literal["deletion", "stated", "none"],
        typer.Option(
            help="Test points against the scatter of the others, against the stated standard deviations, or not at all."
        ),
    ] = "deletion",
    significance: Annotated[float, typer.Option(help="Probability of rejecting a point of a clean photo.")] = 0.05,
    form: Format = "text",
    quiet: Silent = False,
) -> None:
    """Orient a photo by measured directions to points in it, by least squares.

    The directions are measured with a theodolite where the camera stood. alpha comes out in the zero of its circle.
    """
    from photostrip.formats.output.terrestrial_directions import oriented
    from photostrip.project.terrestrial import options
    from photostrip.project.terrestrial.ranges import ECCENTRICITY, REFRACTION, SIGNIFICANCE, within
    from photostrip.terrestrial import orientation

    chosen = camera.chosen()
    settings = orientation.OrientationSettings(
        options.free_elements(free),
        eccentricity=within("--eccentricity", eccentricity, ECCENTRICITY),
        refraction=within("--refraction", refraction, REFRACTION),
        screening=screening,
        significance=within("--significance", significance, SIGNIFICANCE),
    )
    measured = measuring.sigmas(usual=2.0)
    given = options.SightingOptions(unit=unit, angles=angles, sigma=options.image_sigma(sigma_um), theodolite=measured)
    sightings, notes = options.read_sightings(table, given)
    say(notes, quiet=quiet)
    found = orientation.orient(sightings, chosen.principal_distance, chosen.principal_point, settings)
    _print(oriented(chosen, sightings, found, settings, angles), form)


@_command("examples", "")
def examples(form: Format = "text") -> None:
    """Compute the worked examples of the source again, and explain what is misprinted."""
    from photostrip.formats.output.terrestrial_directions import worked_examples

    _print(worked_examples(), form)


@_command("cameras", "--presets my-cameras.yaml")
def cameras(presets: Presets = None, form: Format = "text") -> None:
    """List the cameras that can be named."""
    from photostrip.formats.output.terrestrial_directions import camera_list
    from photostrip.project.terrestrial.cameras import read_presets

    _print(camera_list(read_presets(presets)), form)


def _print(document: dict[str, Any], form: Form) -> None:
    from photostrip.formats.output.terrestrial_directions import points_csv
    from photostrip.report.commands.terrestrial import direction_report

    Rendering(direction_report, points_csv).show(document, form)
