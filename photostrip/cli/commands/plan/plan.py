"""``photostrip plan``: how good it would be, before any photo is taken or measured."""

from __future__ import annotations

from collections.abc import Callable

from photostrip.cli.commands.plan.camera import camera
from photostrip.cli.commands.plan.displacement import displacement
from photostrip.cli.commands.plan.model import model
from photostrip.cli.commands.plan.screening import screening
from photostrip.cli.commands.plan.strip import strip
from photostrip.cli.option_groups import command_group, subcommand

COMMANDS: dict[Callable[..., None], tuple[str, ...]] = {  # examples
    model: (
        "--camera film --overlap 60 --scale 10000 --control corners",
        "model.yaml -o model.svg",
        "--elements 5,-3,10,-8,12 -o bent.svg",
        "--closed-form --as-printed",
    ),
    strip: ("--models 15 --control bands=3 --control every=5", "strip.yaml -o strip.svg"),
    camera: ("cameras.yaml", "cameras.yaml --set height_sigma=0.2 --set relief=400", "--source-table"),
    screening: ("--repetitions 50", "--zone-points 3,3,3,3,3,3 --sizes-um 20,40,80 --methods auto"),
    displacement: ("--camera 'UMK 10/1318' --base 30 --distances 50,100,200", "--stations 1 --distances 80"),
}

plan = command_group(
    "Expected accuracy of a model, of a strip with its control, of displacements; which camera is the better one."
)
for command, examples in COMMANDS.items():
    name = command.__name__
    text = "\b\nExamples:\n" + "\n".join(f"  photostrip plan {name} {example}" for example in examples)
    subcommand(plan, name, text)(command)
