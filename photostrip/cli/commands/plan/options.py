"""Options that several plans have, and how an option sets a key of a plan."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated, NamedTuple, get_args, get_type_hints

import typer

from photostrip.frozen import dataclass

Options = dict[str, tuple[str, str | None]]  # by the key that it sets: name of an option, and its value


class Sets(NamedTuple):
    """The key of a plan that an option sets."""

    key: str
    several: bool = False  # values with commas between them


PlanFile = Annotated[
    Path | None,
    typer.Argument(metavar="[FILE]", help="Plan (YAML); without one the options say all.", show_default=False),
]
CONTROL_SIGMA = typer.Option(
    "--control-sigma", metavar="X,Y,Z", help="Standard deviations of given coordinates, metres."
)
SIGMA_UM = typer.Option("--sigma-um", metavar="UM", help="Standard deviation of an image coordinate.")


@dataclass(frozen=True)
class PlanOptions:
    """A group of options that set keys of a plan."""

    def keys(self) -> Options:
        """Return the keys that they set."""
        found: Options = {}
        hints = get_type_hints(type(self), include_extras=True)
        for each in fields(self):
            _, option, *sets = get_args(hints[each.name])
            value = getattr(self, each.name)
            name = option.default  # where typer keeps the first argument until it reads the annotation
            for key, several in sets:
                found[key] = (name, f"[{value}]" if several and value is not None else value)
        return found


@dataclass(frozen=True)
class PlanCamera(PlanOptions):
    """Options that say which camera is flown."""

    camera: Annotated[
        str | None, typer.Option("--camera", metavar="NAME", help="Preset: film or digital."), Sets("camera.preset")
    ] = None
    principal_distance: Annotated[
        str | None,
        typer.Option("--principal-distance", metavar="MM", help="Principal distance."),
        Sets("camera.principal_distance"),
    ] = None
    photo_format: Annotated[
        str | None,
        typer.Option("--photo-format", metavar="L,W", help="Length and width of a photo, mm."),
        Sets("camera.format", several=True),
    ] = None


@dataclass(frozen=True)
class Flight(PlanOptions):
    """Options that say how it is flown, and measured."""

    overlap: Annotated[
        str | None,
        typer.Option("--overlap", metavar="PERCENT", help="Overlap along the flight."),
        Sets("end_lap_percent"),
    ] = None
    scale: Annotated[
        str | None, typer.Option("--scale", metavar="M", help="Denominator of the photo scale."), Sets("scale")
    ] = None
    flying_height: Annotated[
        str | None,
        typer.Option("--flying-height", metavar="M", help="Flying height in metres, instead of the scale."),
        Sets("flying_height"),
    ] = None
    sigma_um: Annotated[str | None, SIGMA_UM, Sets("image_sigma_um")] = None
