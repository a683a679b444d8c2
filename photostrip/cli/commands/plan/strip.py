"""``photostrip plan strip``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from photostrip.cli.commands.plan.delivery import Delivery
from photostrip.cli.commands.plan.options import CONTROL_SIGMA, Flight, Options, PlanCamera, PlanFile, PlanOptions, Sets


@dataclass(frozen=True)
class Length(PlanOptions):
    """How long the strip is."""

    models: Annotated[str | None, Sets("--models", "N", "Models, one less than photos.", "models")] = None


@dataclass(frozen=True)
class StripControl(PlanOptions):
    """Options that say what controls the strip, and what is wanted."""

    control: Annotated[
        list[str] | None,
        typer.Option("--control", metavar="LAYOUT", help="corners, corners+centre, bands=N, every=N; may be repeated."),
    ] = None
    control_sigma: Annotated[str | None, Sets(*CONTROL_SIGMA, "control_sigma", several=True)] = None
    gnss: Annotated[
        str | None,
        Sets(
            "--gnss",
            "X,Y,Z",
            "Compare with measured perspective centres, too; their sigmas, metres.",
            "gnss",
            several=True,
        ),
    ] = None
    methods: Annotated[
        str | None, Sets("--methods", "A,B", "Methods of adjustment; default: all.", "methods", several=True)
    ] = None
    required: Annotated[
        str | None,
        typer.Option("--required", metavar="PLAN,HEIGHT", help="Accuracy needed everywhere, metres: how many bands?"),
    ] = None
    place: Annotated[
        str | None, Sets("--place", "N", "Find the best places for N more control points.", "place.points")
    ] = None
    into: Annotated[
        str | None, Sets("--into", "LAYOUT", "With --place: the layout that they are added to.", "place.into")
    ] = None

    def keys(self) -> Options:
        """Return the keys that they set; a layout has one of its own, and of PLAN,HEIGHT either may be empty."""
        from photostrip.project.plans.strip import layout_option

        in_plan, _, in_height = (self.required or "").partition(",")
        layouts = {key: ("--control", value) for key, value in map(layout_option, self.control or [])}
        return {
            **super().keys(),
            **layouts,
            "required.plan": ("--required", in_plan.strip() or None),
            "required.height": ("--required", in_height.strip() or None),
        }


def strip(
    *,
    file: PlanFile = None,
    camera: PlanCamera,
    length: Length,
    flight: Flight,
    control: StripControl,
    delivery: Delivery,
) -> None:
    """Compute the expected accuracy along a strip, for layouts of control and methods of adjustment."""
    options = {**camera.keys(), **flight.keys(), **length.keys(), **control.keys()}
    if control.into is not None and control.place is None and file is None:
        raise typer.BadParameter("there is nothing to be placed: give --place as well", param_hint="--into")
    delivery.plan("strip", file, options)
