"""``photostrip plan``: how good it would be, before any photo is taken or measured."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from photostrip.cli.options import Silent
from photostrip.cli.terrestrial_output import Form, hand_out, told

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from photostrip.errors import Fault

Document = dict[str, Any]
Command = TypeVar("Command", bound="Callable[..., None]")

HELP_NAMES = {"help_option_names": ["--help", "-h"]}
FORMS: dict[str, Form] = {".json": "json", ".csv": "csv", ".md": "md", ".txt": "text"}
FINE = 41  # points along and across of a picture

plan = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    context_settings=HELP_NAMES,
    help="Expected accuracy of a model or of a strip with its control, and which camera is the better one.",
)

PlanFile = Annotated[
    Path | None,
    typer.Argument(metavar="[FILE]", help="Plan (YAML); without one the options say all.", show_default=False),
]
Assignments = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Set a key of the plan, as in end_lap_percent=70; may be repeated."
    ),
]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FILE", help="Write .svg or .png (a picture), .json, .csv, .md or .txt."),
]
Depfile = Annotated[Path | None, typer.Option(metavar="FILE", help="Write a rule for make; needs -o.")]
Shape = Annotated[Form, typer.Option("--format", help="How to print it.")]
Preset = Annotated[str | None, typer.Option("--camera", metavar="NAME", help="Preset: film or digital.")]
Distance = Annotated[str | None, typer.Option("--principal-distance", metavar="MM", help="Principal distance.")]
PhotoFormat = Annotated[
    str | None, typer.Option("--photo-format", metavar="L,W", help="Length and width of a photo, mm.")
]
Overlap = Annotated[str | None, typer.Option("--overlap", metavar="PERCENT", help="Overlap along the flight.")]
Scale = Annotated[str | None, typer.Option("--scale", metavar="M", help="Denominator of the photo scale.")]
Height = Annotated[str | None, typer.Option("--flying-height", metavar="M", help="Instead of the scale, metres.")]
SigmaUm = Annotated[
    str | None, typer.Option("--sigma-um", metavar="UM", help="Standard deviation of an image coordinate.")
]
ControlSigma = Annotated[
    str | None,
    typer.Option("--control-sigma", metavar="X,Y,Z", help="Standard deviations of given coordinates, metres."),
]


def _command(name: str, *examples: str) -> Callable[[Command], Command]:
    text = "\b\nExamples:\n" + "\n".join(f"  photostrip plan {name} {example}" for example in examples)
    return plan.command(name, context_settings=HELP_NAMES, epilog=text)


# ------------------------------------------------------------------------------------------------------- options

Options = dict[str, tuple[str, str | None]]  # by the key that it sets: name of an option, and its value


def listed(value: str | None) -> str | None:
    """Turn ``a,b`` into a list of YAML."""
    return None if value is None else f"[{value}]"


def _flown(*values: str | None) -> Options:
    """Return the options that every plan of something flown has."""
    camera, distance, photo_format, overlap, scale, height, sigma = values
    return {
        "camera.preset": ("--camera", camera),
        "camera.principal_distance": ("--principal-distance", distance),
        "camera.format": ("--photo-format", listed(photo_format)),
        "end_lap_percent": ("--overlap", overlap),
        "scale": ("--scale", scale),
        "flying_height": ("--flying-height", height),
        "image_sigma_um": ("--sigma-um", sigma),
    }


def as_assignments(options: Options, assignments: list[str] | None) -> list[str]:
    """Turn options into assignments to keys; those of ``--set`` come last and win."""
    return [f"{key}={value}" for key, (_, value) in options.items() if value is not None] + (assignments or [])


@contextmanager
def told_by_option(options: Options, assignments: list[str] | None) -> Iterator[None]:
    """Tell faults of the command line by the option that they came from; ``--set`` wins over an option."""
    from photostrip.errors import InputError

    overruled = {each.partition("=")[0] for each in assignments or []}
    names = {
        key.replace('"', ""): name
        for key, (name, value) in options.items()
        if value is not None and key not in overruled
    }
    try:
        yield
    except InputError as error:
        raise InputError(_by_option(fault, names) for fault in error.faults) from None


def _by_option(fault: Fault, names: dict[str, str]) -> Fault:
    """Name the option in place of ``--set`` and the key that it stands for."""
    from photostrip.project.yaml.document import COMMAND_LINE

    key = fault.key.replace('"', "")
    found = [name for each, name in names.items() if key and (key.startswith(each) or each.startswith(f"{key}."))]
    return replace(fault, file=found[-1], key="") if fault.file == COMMAND_LINE and found else fault


# ------------------------------------------------------------------------------------------------------ commands


@_command("model", "--camera film --overlap 60 --scale 10000 --control corners", "model.yaml -o model.svg")
def model(  # noqa: PLR0913, PLR0917 (an argument for each option)
    file: PlanFile = None,
    camera: Preset = None,
    principal_distance: Distance = None,
    photo_format: PhotoFormat = None,
    overlap: Overlap = None,
    scale: Scale = None,
    flying_height: Height = None,
    sigma_um: SigmaUm = None,
    control: Annotated[
        str | None, typer.Option("--control", metavar="LAYOUT", help="corners, corners+centre or six.")
    ] = None,
    control_sigma: ControlSigma = None,
    assignments: Assignments = None,
    form: Shape = "text",
    output: Output = None,
    depfile: Depfile = None,
    quiet: Silent = False,
) -> None:
    """Compute the expected errors all over one model, and what each source of errors does alone."""
    with told(form):
        from photostrip.formats.output.plans import model_document
        from photostrip.planning.model_plan import plan_model
        from photostrip.project.plans.plan_model_file import load_model_plan

        options = {
            **_flown(camera, principal_distance, photo_format, overlap, scale, flying_height, sigma_um),
            "control.layout": ("--control", control),
            "control.sigma": ("--control-sigma", listed(control_sigma)),
        }
        drawn = _require_output(depfile, output)
        with told_by_option(options, assignments):
            given = load_model_plan(file, as_assignments(options, assignments))
        document = fine = model_document(given.name, given.camera, plan_model(given.spec))
        if drawn:
            fine = model_document(given.name, given.camera, plan_model(replace(given.spec, grid=(FINE, FINE))))
        deliver(document, form, output, fine, quiet=quiet)
        _tell_make(depfile, output, given.files)


@_command("strip", "--models 15 --control bands=3 --control every=5", "strip.yaml -o strip.svg")
def strip(  # noqa: PLR0913, PLR0917 (an argument for each option)
    file: PlanFile = None,
    camera: Preset = None,
    principal_distance: Distance = None,
    photo_format: PhotoFormat = None,
    models: Annotated[str | None, typer.Option("--models", metavar="N", help="Models, one less than photos.")] = None,
    overlap: Overlap = None,
    scale: Scale = None,
    flying_height: Height = None,
    sigma_um: SigmaUm = None,
    control: Annotated[
        list[str] | None,
        typer.Option("--control", metavar="LAYOUT", help="corners, corners+centre, bands=N, every=N; may be repeated."),
    ] = None,
    control_sigma: ControlSigma = None,
    gnss: Annotated[
        str | None,
        typer.Option(
            "--gnss", metavar="X,Y,Z", help="Compare with measured perspective centres, too; their sigmas, metres."
        ),
    ] = None,
    methods: Annotated[
        str | None, typer.Option("--methods", metavar="A,B", help="Methods of adjustment; default: all.")
    ] = None,
    required: Annotated[
        str | None,
        typer.Option("--required", metavar="PLAN,HEIGHT", help="Accuracy needed everywhere, metres: how many bands?"),
    ] = None,
    place: Annotated[
        str | None, typer.Option("--place", metavar="N", help="Find the best places for N further control points.")
    ] = None,
    into: Annotated[
        str | None, typer.Option("--into", metavar="LAYOUT", help="With --place: layout they are added to.")
    ] = None,
    assignments: Assignments = None,
    form: Shape = "text",
    output: Output = None,
    depfile: Depfile = None,
    quiet: Silent = False,
) -> None:
    """Compute the expected accuracy along a strip, for layouts of control and methods of adjustment."""
    with told(form):
        from photostrip.formats.output.plan_strip import strip_document
        from photostrip.project.plans.plan_strip_file import layout_option, load_strip_plan

        options = {
            **_flown(camera, principal_distance, photo_format, overlap, scale, flying_height, sigma_um),
            "models": ("--models", models),
            "control_sigma": ("--control-sigma", listed(control_sigma)),
            "gnss": ("--gnss", listed(gnss)),
            "methods": ("--methods", listed(methods)),
            "place.points": ("--place", place),
            "place.into": ("--into", into),
            **{key: ("--control", value) for key, value in map(layout_option, control or [])},
            **_required(required),
        }
        if into is not None and place is None and file is None:
            raise typer.BadParameter("nothing is to be placed: give --place as well", param_hint="--into")
        _require_output(depfile, output)
        with told_by_option(options, assignments):
            given = load_strip_plan(file, as_assignments(options, assignments))
            document = strip_document(given.name, given.worked_out())
        deliver(document, form, output, document, quiet=quiet)
        _tell_make(depfile, output, given.files)


def _required(text: str | None) -> Options:
    """Split ``PLAN,HEIGHT``; either may be empty."""
    in_plan, _, in_height = (text or "").partition(",")
    return {
        "required.plan": ("--required", in_plan.strip() or None),
        "required.height": ("--required", in_height.strip() or None),
    }


@_command("camera", "cameras.yaml", "--source-table")
def camera(
    file: PlanFile = None,
    source_table: Annotated[
        bool, typer.Option("--source-table", help="The table of the source, with what is misprinted in it.")
    ] = False,
    assignments: Assignments = None,
    form: Shape = "text",
    output: Output = None,
    depfile: Depfile = None,
    quiet: Silent = False,
) -> None:
    """Compare cameras by their efficiency coefficient K = f m_p: the smaller, the fewer photos."""
    with told(form):
        from photostrip.errors import Fault, InputError
        from photostrip.formats.output.plans import camera_document, source_document
        from photostrip.project.plans.plan_camera_file import load_camera_plan

        if source_table == (file is not None):
            message = "a list of cameras and --source-table exclude each other" if file else "no cameras are given"
            raise InputError(Fault(message, "plan-cameras", fix="name a YAML file, or use --source-table"))
        _require_output(depfile, output)
        files: tuple[str, ...] = ()
        if file is None:
            document = source_document()
        else:
            given = load_camera_plan(file, assignments or [])
            document, files = camera_document(given.name, given.cameras, given.reference), given.files
        deliver(document, form, output, document, quiet=quiet)
        _tell_make(depfile, output, files)


# -------------------------------------------------------------------------------------------------------- output


def _is_picture(output: Path | None) -> bool:
    from photostrip.report.pictures.plans import check_picture, is_picture

    if output is None:
        return False
    if is_picture(output):
        check_picture(output)
        return True
    if output.suffix.lower() not in FORMS:
        message = f"no plan is written as '{output.suffix}': the name may end in .svg, .png, {', '.join(FORMS)}"
        raise typer.BadParameter(message, param_hint="--output")
    return False


def _require_output(depfile: Path | None, output: Path | None) -> bool:
    """Refuse what cannot be written before anything is computed; tell whether a picture is wanted."""
    if depfile is not None and output is None:
        message = "a rule for make needs a target: give --output as well"
        raise typer.BadParameter(message, param_hint="--depfile")
    return _is_picture(output)


def _tell_make(depfile: Path | None, output: Path | None, files: tuple[str, ...]) -> None:
    """Write the rule for make."""
    if depfile is not None and output is not None:
        from photostrip.formats.text.writing import make_rule, write_text

        write_text(depfile, make_rule(str(output), files))


def deliver(document: Document, form: Form, output: Path | None, drawn: Document, *, quiet: bool) -> None:
    """Print a plan, and write it when a file is named.

    Parameters
    ----------
    output : Path, optional
        File to write; its ending says what.
    drawn : dict
        The plan for a picture, on a fine grid.
    """
    from photostrip.formats.output.plans import plan_csv
    from photostrip.report.commands.plans import plan_report

    picture = _is_picture(output)
    if output is not None:
        from photostrip.formats.text.writing import write_text
        from photostrip.report.pictures.plans import plan_picture

        write_text(output, plan_picture(drawn, output.suffix) if picture else _rendered(document, output))
    if output is None or not quiet:
        hand_out(document, form, plan_report, plan_csv)


def _rendered(document: Document, output: Path) -> str:
    """Return a plan in the form that the ending of a file asks for."""
    from photostrip.formats.output.plans import plan_csv
    from photostrip.formats.output.result_json import to_json
    from photostrip.report.commands.plans import plan_report
    from photostrip.report.page import text

    form = FORMS[output.suffix.lower()]
    if form == "json":
        return to_json(document)
    if form == "csv":
        return plan_csv(document)
    return (text.to_markdown if form == "md" else text.to_text)(*plan_report(document))
