"""Options that several plans have, and how an option sets a key of a plan."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, get_args, get_type_hints

import typer
from typer.models import OptionInfo

Options = dict[str, tuple[str, str | None]]  # by the key that it sets: name of an option, and its value


class Sets(OptionInfo):
    """An option that sets a key of a plan; of several values there are commas between them."""

    def __init__(self, option: str, metavar: str, text: str, key: str, *, several: bool = False) -> None:
        super().__init__(default=option, metavar=metavar, help=text)  # where typer looks for the name of an annotation
        self.option, self.key, self.several = option, key, several


PlanFile = Annotated[
    Path | None,
    typer.Argument(metavar="[FILE]", help="Plan (YAML); without one the options say all.", show_default=False),
]
CONTROL_SIGMA = ("--control-sigma", "X,Y,Z", "Standard deviations of given coordinates, metres.")
SIGMA_UM = ("--sigma-um", "UM", "Standard deviation of an image coordinate.")


@dataclass(frozen=True)
class PlanOptions:
    """A group of options that set keys of a plan."""

    def keys(self) -> Options:
        """Return the keys that they set."""
        found: Options = {}
        hints = get_type_hints(type(self), include_extras=True)
        for each in fields(self):
            option, value = get_args(hints[each.name])[1], getattr(self, each.name)
            if isinstance(option, Sets):
                found[option.key] = (option.option, f"[{value}]" if option.several and value is not None else value)
        return found


@dataclass(frozen=True)
class PlanCamera(PlanOptions):
    """Options that say which camera is flown."""

    camera: Annotated[str | None, Sets("--camera", "NAME", "Preset: film or digital.", "camera.preset")] = None
    principal_distance: Annotated[
        str | None, Sets("--principal-distance", "MM", "Principal distance.", "camera.principal_distance")
    ] = None
    photo_format: Annotated[
        str | None, Sets("--photo-format", "L,W", "Length and width of a photo, mm.", "camera.format", several=True)
    ] = None


@dataclass(frozen=True)
class Flight(PlanOptions):
    """Options that say how it is flown, and measured."""

    overlap: Annotated[str | None, Sets("--overlap", "PERCENT", "Overlap along the flight.", "end_lap_percent")] = None
    scale: Annotated[str | None, Sets("--scale", "M", "Denominator of the photo scale.", "scale")] = None
    flying_height: Annotated[
        str | None, Sets("--flying-height", "M", "Flying height in metres, instead of the scale.", "flying_height")
    ] = None
    sigma_um: Annotated[str | None, Sets(*SIGMA_UM, "image_sigma_um")] = None
