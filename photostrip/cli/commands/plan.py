"""``photostrip plan``: how good it would be, before any photo is taken or measured."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from photostrip.cli.documents import FORMS, Form, Rendering, require_target, write_rule
from photostrip.cli.failures import failures_as
from photostrip.cli.option_groups import with_groups
from photostrip.cli.options import Silent

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from photostrip.errors import Fault
    from photostrip.planning.model_plan import ModelSpec
    from photostrip.report.page.parts import Document

Options = dict[str, tuple[str, str | None]]  # by the key that it sets: name of an option, and its value

HELP_NAMES = {"help_option_names": ["--help", "-h"]}
FINE = 41  # points along and across of a picture

plan = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    context_settings=HELP_NAMES,
    help="Expected accuracy of a model, of a strip with its control, of displacements; which camera is the better one.",
)


def _command(name: str, *examples: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    text = "\b\nExamples:\n" + "\n".join(f"  photostrip plan {name} {example}" for example in examples)

    def register(command: Callable[..., None]) -> Callable[..., None]:
        return plan.command(name, context_settings=HELP_NAMES, epilog=text)(with_groups(command))

    return register


PlanFile = Annotated[
    Path | None,
    typer.Argument(metavar="[FILE]", help="Plan (YAML); without one the options say all.", show_default=False),
]
ControlSigma = Annotated[
    str | None,
    typer.Option("--control-sigma", metavar="X,Y,Z", help="Standard deviations of given coordinates, metres."),
]


@dataclass(frozen=True)
class PlanCamera:
    """Options that say which camera is flown."""

    camera: Annotated[str | None, typer.Option("--camera", metavar="NAME", help="Preset: film or digital.")] = None
    principal_distance: Annotated[
        str | None, typer.Option("--principal-distance", metavar="MM", help="Principal distance.")
    ] = None
    photo_format: Annotated[
        str | None, typer.Option("--photo-format", metavar="L,W", help="Length and width of a photo, mm.")
    ] = None

    @property
    def keys(self) -> Options:
        """The keys of a plan that they set."""
        return {
            "camera.preset": ("--camera", self.camera),
            "camera.principal_distance": ("--principal-distance", self.principal_distance),
            "camera.format": ("--photo-format", _listed(self.photo_format)),
        }


@dataclass(frozen=True)
class Flight:
    """Options that say how it is flown, and measured."""

    overlap: Annotated[str | None, typer.Option("--overlap", metavar="PERCENT", help="Overlap along the flight.")] = (
        None
    )
    scale: Annotated[str | None, typer.Option("--scale", metavar="M", help="Denominator of the photo scale.")] = None
    flying_height: Annotated[
        str | None, typer.Option("--flying-height", metavar="M", help="Flying height in metres, instead of the scale.")
    ] = None
    sigma_um: Annotated[
        str | None, typer.Option("--sigma-um", metavar="UM", help="Standard deviation of an image coordinate.")
    ] = None

    @property
    def keys(self) -> Options:
        """The keys of a plan that they set."""
        return {
            "end_lap_percent": ("--overlap", self.overlap),
            "scale": ("--scale", self.scale),
            "flying_height": ("--flying-height", self.flying_height),
            "image_sigma_um": ("--sigma-um", self.sigma_um),
        }


@dataclass(frozen=True)
class Delivery:
    """Options of every plan: what it overrides, how it is printed, where it is written."""

    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Set a key of the plan, as in end_lap_percent=70; may be repeated."
        ),
    ] = None
    form: Annotated[Form, typer.Option("--format", help="How the answer is printed.")] = "text"
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Write .svg or .png (a picture), .json, .csv, .md or .txt."
        ),
    ] = None
    depfile: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a rule for make; needs -o.")] = None
    quiet: Silent = False

    def require_output(self) -> bool:
        """Refuse what cannot be written before anything is computed; return whether a picture is wanted."""
        require_target(self.depfile, self.output)
        return self._is_picture()

    def _is_picture(self) -> bool:
        from photostrip.report.pictures.plans import check_picture, is_picture

        if self.output is None:
            return False
        if is_picture(self.output):
            check_picture(self.output)
            return True
        if self.output.suffix.lower() not in FORMS:
            known = ", ".join(FORMS)
            message = f"no plan is written as '{self.output.suffix}': the name may end in .svg, .png, {known}"
            raise typer.BadParameter(message, param_hint="--output")
        return False

    def deliver(self, document: Document, files: Sequence[str], fine: Document | None = None) -> None:
        """Print a plan; write it, and the rule for make, when a file is named.

        fine: the plan on a fine grid, for a picture.
        """
        from photostrip.formats.output.plans import plan_csv
        from photostrip.report.commands.plans import plan_report

        rendering = Rendering(plan_report, plan_csv)
        if self.output is not None:
            from photostrip.formats.text.writing import write_text
            from photostrip.report.pictures.plans import plan_picture

            ending = self.output.suffix
            if self._is_picture():
                write_text(self.output, plan_picture(fine or document, ending))
            else:
                write_text(self.output, rendering.rendered(document, FORMS[ending.lower()]))
        if self.output is None or not self.quiet:
            rendering.show(document, self.form)
        write_rule(self.depfile, self.output, files)

    @contextmanager
    def assigned(self, options: Options) -> Iterator[list[str]]:
        """Turn options into assignments to keys; those of ``--set`` come last and win.

        Faults of the command line are reported at the option that they came from.
        """
        from photostrip.errors import InputError

        given = self.assignments or []
        overruled = {each.partition("=")[0] for each in given}
        names = {
            key.replace('"', ""): name
            for key, (name, value) in options.items()
            if value is not None and key not in overruled
        }
        try:
            yield [f"{key}={value}" for key, (_, value) in options.items() if value is not None] + given
        except InputError as error:
            raise InputError(_by_option(fault, names) for fault in error.faults) from None


def _by_option(fault: Fault, names: dict[str, str]) -> Fault:
    """Name the option in place of ``--set`` and the key that it stands for."""
    from photostrip.project.yaml.document import COMMAND_LINE

    key = fault.key.replace('"', "")
    found = [name for each, name in names.items() if key and (key.startswith(each) or each.startswith(f"{key}."))]
    return replace(fault, file=found[-1], key="") if fault.file == COMMAND_LINE and found else fault


def _listed(value: str | None) -> str | None:
    """Turn ``a,b`` into a list of YAML."""
    return None if value is None else f"[{value}]"


@_command(
    "model",
    "--camera film --overlap 60 --scale 10000 --control corners",
    "model.yaml -o model.svg",
    "--elements 5,-3,10,-8,12 -o bent.svg",
    "--closed-form --as-printed",
)
def model(  # noqa: PLR0913 (an argument for each option)
    *,
    file: PlanFile = None,
    camera: PlanCamera,
    flight: Flight,
    control: Annotated[
        str | None, typer.Option("--control", metavar="LAYOUT", help="corners, corners+centre or six.")
    ] = None,
    control_sigma: ControlSigma = None,
    elements: Annotated[
        str | None,
        typer.Option(
            "--elements",
            metavar="DBY,DBZ,DK,DA,DO",
            help="Given errors of the elements dby, dbz (um), dkappa, dalpha, domega (seconds of arc).",
        ),
    ] = None,
    closed_form: Annotated[
        bool, typer.Option("--closed-form", help="Operators and closed form side by side, with c1 to c15.")
    ] = False,
    as_printed: Annotated[
        bool, typer.Option("--as-printed", help="With --closed-form: what the source prints, misprints and all.")
    ] = False,
    source_table: Annotated[
        bool, typer.Option("--source-table", help="The worked example of the source, with what is misprinted in it.")
    ] = False,
    delivery: Delivery,
) -> None:
    """Compute the expected errors all over one model, and what each source of errors does alone."""
    with failures_as(delivery.form):
        from photostrip.formats.output.plan_model import model_document, source_example_document
        from photostrip.planning.model_plan import both_forms, given_errors, plan_model
        from photostrip.project.plans.model import elements_option, load_model_plan

        if as_printed and not closed_form:
            message = "the printed form stands beside the closed form: give --closed-form as well"
            raise typer.BadParameter(message, param_hint="--as-printed")
        options = {
            **camera.keys,
            **flight.keys,
            "control.layout": ("--control", control),
            "control.sigma": ("--control-sigma", _listed(control_sigma)),
            **{key: ("--elements", value) for key, value in elements_option(elements).items()},
        }
        drawn = delivery.require_output()
        if source_table:
            if file is not None or any(value is not None for _, value in options.values()):
                message = "the worked example of the source has its own numbers: nothing else goes with it"
                raise typer.BadParameter(message, param_hint="--source-table")
            delivery.deliver(source_example_document(), ())
            return
        with delivery.assigned(options) as assignments:
            given = load_model_plan(file, assignments)
        forms = both_forms(given.spec) if closed_form else None

        def planned(spec: ModelSpec) -> Document:
            forecast = plan_model(spec)
            return model_document(given.name, given.camera, forecast, given_errors(spec), forms, printed=as_printed)

        document = planned(given.spec)
        fine = planned(replace(given.spec, grid=(FINE, FINE))) if drawn else None
        delivery.deliver(document, given.files, fine)


@_command("strip", "--models 15 --control bands=3 --control every=5", "strip.yaml -o strip.svg")
def strip(  # noqa: PLR0913 (an argument for each option)
    *,
    file: PlanFile = None,
    camera: PlanCamera,
    models: Annotated[str | None, typer.Option("--models", metavar="N", help="Models, one less than photos.")] = None,
    flight: Flight,
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
        str | None, typer.Option("--place", metavar="N", help="Find the best places for N more control points.")
    ] = None,
    into: Annotated[
        str | None, typer.Option("--into", metavar="LAYOUT", help="With --place: the layout that they are added to.")
    ] = None,
    delivery: Delivery,
) -> None:
    """Compute the expected accuracy along a strip, for layouts of control and methods of adjustment."""
    with failures_as(delivery.form):
        from photostrip.formats.output.plan_strip import strip_document
        from photostrip.project.plans.strip import layout_option, load_strip_plan

        options = {
            **camera.keys,
            **flight.keys,
            "models": ("--models", models),
            "control_sigma": ("--control-sigma", _listed(control_sigma)),
            "gnss": ("--gnss", _listed(gnss)),
            "methods": ("--methods", _listed(methods)),
            "place.points": ("--place", place),
            "place.into": ("--into", into),
            **{key: ("--control", value) for key, value in map(layout_option, control or [])},
            **_required(required),
        }
        if into is not None and place is None and file is None:
            raise typer.BadParameter("there is nothing to be placed: give --place as well", param_hint="--into")
        delivery.require_output()
        with delivery.assigned(options) as assignments:
            given = load_strip_plan(file, assignments)
            document = strip_document(given.name, given.computed())
        delivery.deliver(document, given.reading.files)


def _required(text: str | None) -> Options:
    """Split ``PLAN,HEIGHT``; either may be empty."""
    in_plan, _, in_height = (text or "").partition(",")
    return {
        "required.plan": ("--required", in_plan.strip() or None),
        "required.height": ("--required", in_height.strip() or None),
    }


@_command("camera", "cameras.yaml", "cameras.yaml --set height_sigma=0.2 --set relief=400", "--source-table")
def camera(
    *,
    file: PlanFile = None,
    source_table: Annotated[
        bool, typer.Option("--source-table", help="The table of the source, with what is misprinted in it.")
    ] = False,
    delivery: Delivery,
) -> None:
    """Compare cameras by their efficiency coefficient K = f m_p: the smaller, the fewer photos."""
    with failures_as(delivery.form):
        from photostrip.errors import Fault, InputError
        from photostrip.formats.output.plans import camera_document, source_document
        from photostrip.project.plans.cameras import load_camera_plan

        if source_table == (file is not None):
            message = "a list of cameras and --source-table exclude each other" if file else "no cameras are given"
            raise InputError(Fault(message, "plan-cameras", fix="name a YAML file, or use --source-table"))
        delivery.require_output()
        if file is None:
            delivery.deliver(source_document(), ())
        else:
            given = load_camera_plan(file, delivery.assignments or [])
            delivery.deliver(camera_document(given.name, given.cameras, given.reference, given.survey), given.files)


@_command("displacement", "--camera 'UMK 10/1318' --base 30 --distances 50,100,200", "--stations 1 --distances 80")
def displacement(
    *,
    file: PlanFile = None,
    camera: Annotated[str | None, typer.Option("--camera", metavar="NAME", help="Phototheodolite of the list.")] = None,
    stations: Annotated[
        str | None, typer.Option("--stations", metavar="N", help="2, or 1 with known distances of the points.")
    ] = None,
    base: Annotated[str | None, typer.Option("--base", metavar="M", help="Length of the base.")] = None,
    distances: Annotated[
        str | None, typer.Option("--distances", metavar="M,M", help="Distances of the object from the base.")
    ] = None,
    sigma_um: Annotated[
        str | None, typer.Option("--sigma-um", metavar="UM", help="Standard deviation of an image coordinate.")
    ] = None,
    delivery: Delivery,
) -> None:
    """Compute how well displacements will be known, and the smallest that will be found."""
    with failures_as(delivery.form):
        from photostrip.formats.output.plans import displacement_document
        from photostrip.project.plans.displacement import load_displacement_plan

        options: Options = {
            "camera": ("--camera", camera),
            "stations": ("--stations", stations),
            "base": ("--base", base),
            "distances": ("--distances", _listed(distances)),
            "sigma_um": ("--sigma-um", sigma_um),
        }
        delivery.require_output()
        with delivery.assigned(options) as assignments:
            given = load_displacement_plan(file, assignments)
        delivery.deliver(displacement_document(given.name, given.spec), given.files)
