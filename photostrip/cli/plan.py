"""``photostrip plan``: how good it would be, before any photo is taken or measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from photostrip.cli.options import Silent
from photostrip.cli.terrestrial_output import Form, hand_out, told

if TYPE_CHECKING:
    from collections.abc import Callable

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
        "--set", metavar="KEY=VALUE", help="Set a key of the plan, as in control.layout=six; may be repeated."
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


def listed(value: str | None) -> str | None:
    """Turn ``a,b`` into a list of YAML."""
    return None if value is None else f"[{value}]"


def as_assignments(options: dict[str, str | None], assignments: list[str] | None) -> list[str]:
    """Turn options into assignments to keys; those of ``--set`` come last and win."""
    return [f"{key}={value}" for key, value in options.items() if value is not None] + (assignments or [])


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
        from dataclasses import replace

        from photostrip.formats.plans import model_document
        from photostrip.planning.model_plan import plan_model
        from photostrip.project.plan_files import load_model_plan

        options = {
            "camera.preset": camera, "camera.principal_distance": principal_distance,
            "camera.format": listed(photo_format), "end_lap_percent": overlap, "scale": scale,
            "flying_height": flying_height, "image_sigma_um": sigma_um, "control.layout": control,
            "control.sigma": listed(control_sigma),
        }  # fmt: skip
        _require_output(depfile, output)
        given = load_model_plan(file, as_assignments(options, assignments))
        document = model_document(given.name, given.camera, plan_model(given.spec))
        fine = document
        if _is_picture(output):
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
        from photostrip.formats.plan_strip import strip_document
        from photostrip.project.plan_strip_file import layout_assignment, load_strip_plan

        options = {
            "camera.preset": camera, "camera.principal_distance": principal_distance,
            "camera.format": listed(photo_format), "models": models, "end_lap_percent": overlap, "scale": scale,
            "flying_height": flying_height, "image_sigma_um": sigma_um, "control_sigma": listed(control_sigma),
            "gnss": listed(gnss), "methods": listed(methods), "place.points": place, "place.into": into,
            **_required(required),
        }  # fmt: skip
        _is_picture(output)  # refused before anything is computed
        _require_output(depfile, output)
        layouts = [layout_assignment(word) for word in control or []]
        given = load_strip_plan(file, [*layouts, *as_assignments(options, assignments)])
        document = strip_document(given.name, given.worked_out())
        deliver(document, form, output, document, quiet=quiet)
        _tell_make(depfile, output, given.files)


def _required(text: str | None) -> dict[str, str | None]:
    """Split ``PLAN,HEIGHT``; either may be empty."""
    in_plan, _, in_height = (text or "").partition(",")
    return {"required.plan": in_plan.strip() or None, "required.height": in_height.strip() or None}


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
        from photostrip.formats.plans import camera_document, source_document
        from photostrip.project.plan_files import load_camera_plan

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
    from photostrip.report.plots_plans import check_picture, is_picture

    if output is None:
        return False
    if is_picture(output):
        check_picture(output)
        return True
    if output.suffix.lower() not in FORMS:
        message = f"no plan is written as '{output.suffix}': the name may end in .svg, .png, {', '.join(FORMS)}"
        raise typer.BadParameter(message, param_hint="--output")
    return False


def _require_output(depfile: Path | None, output: Path | None) -> None:
    if depfile is not None and output is None:
        message = "a rule for make needs a target: give --output as well"
        raise typer.BadParameter(message, param_hint="--depfile")


def _tell_make(depfile: Path | None, output: Path | None, files: tuple[str, ...]) -> None:
    """Write the rule for make."""
    if depfile is not None and output is not None:
        from photostrip.formats.writing import make_rule, write_text

        write_text(depfile, make_rule(str(output), files))


def deliver(document: Document, form: Form, output: Path | None, drawn: Document, *, quiet: bool) -> None:
    """Print a plan, and write it when a file is named.

    Parameters
    ----------
    document : dict
        The plan.
    form : str
        How it is printed.
    output : Path, optional
        File to write; its ending says what.
    drawn : dict
        The plan for a picture, on a fine grid.
    quiet : bool
        Print nothing where a file is written.
    """
    from photostrip.formats.plans import plan_csv
    from photostrip.report.plans import plan_report

    picture = _is_picture(output)
    if output is not None:
        from photostrip.formats.writing import write_text
        from photostrip.report.plots_plans import plan_picture

        write_text(output, plan_picture(drawn, output.suffix) if picture else _rendered(document, output))
    if output is None or not quiet:
        hand_out(document, form, plan_report, plan_csv)


def _rendered(document: Document, output: Path) -> str:
    """Give a plan in the form that the ending of a file asks for."""
    from photostrip.formats.plans import plan_csv
    from photostrip.formats.result.files import to_json
    from photostrip.report import text
    from photostrip.report.plans import plan_report

    form = FORMS[output.suffix.lower()]
    if form == "json":
        return to_json(document)
    if form == "csv":
        return plan_csv(document)
    return (text.to_markdown if form == "md" else text.to_text)(*plan_report(document))
