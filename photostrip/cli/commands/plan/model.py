"""``photostrip plan model``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from photostrip.cli.commands.plan.delivery import Delivery
from photostrip.cli.commands.plan.options import CONTROL_SIGMA, Flight, Options, PlanCamera, PlanFile, PlanOptions, Sets


@dataclass(frozen=True)
class ControlOptions(PlanOptions):
    """Options that say what orients the model, and what is wrong with it."""

    control: Annotated[str | None, Sets("--control", "LAYOUT", "corners, corners+centre or six.", "control.layout")] = (
        None
    )
    control_sigma: Annotated[str | None, Sets(*CONTROL_SIGMA, "control.sigma", several=True)] = None
    elements: Annotated[
        str | None,
        typer.Option(
            "--elements",
            metavar="DBY,DBZ,DK,DA,DO",
            help="Given errors of the elements dby, dbz (um), dkappa, dalpha, domega (seconds of arc).",
        ),
    ] = None

    def keys(self) -> Options:
        """Return the keys that they set; the errors of the elements are five."""
        from photostrip.project.plans.model import elements_option

        return super().keys() | {key: ("--elements", value) for key, value in elements_option(self.elements).items()}


def model(
    *,
    file: PlanFile = None,
    camera: PlanCamera,
    flight: Flight,
    control: ControlOptions,
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
    from photostrip.formats.output.plans.model import model_document, source_example_document
    from photostrip.planning.model.plan import both_forms, given_errors, plan_model
    from photostrip.project.plans.model import load_model_plan

    if as_printed and not closed_form:
        message = "the printed form stands beside the closed form: give --closed-form as well"
        raise typer.BadParameter(message, param_hint="--as-printed")
    options = {**camera.keys(), **flight.keys(), **control.keys()}
    delivery.require_output("model")
    if source_table:
        if file is not None or any(value is not None for _, value in options.values()):
            message = "the worked example of the source has its own numbers: nothing else goes with it"
            raise typer.BadParameter(message, param_hint="--source-table")
        delivery.deliver(source_example_document(), ())
        return
    with delivery.assigned(options) as assignments:
        given = load_model_plan(file, assignments)
    forms = both_forms(given.spec) if closed_form else None
    forecast, errors = plan_model(given.spec), given_errors(given.spec)
    document = model_document(given.name, given.camera, forecast, errors, forms, printed=as_printed)
    delivery.deliver(document, given.files)
