"""The plan of a single model: the YAML file and its keys."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, NamedTuple

from pydantic import AfterValidator, BeforeValidator

from photostrip.planning.model_plan import LAYOUTS, ControlPoint, ModelSpec, control_layout
from photostrip.project.plans.flown import SCHEMA_NUMBER, Flown, Sigmas, read_plan
from photostrip.project.schema.values import Pair, Positive, Range, Section, Whole, Words, bounded, key, one_of
from photostrip.project.simulation import camera_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

USES = ("xyz", "xy", "z")
REACH = Range(5.0, 100.0, "%")
GRID = Range(2, 101, "points")
ZONE_POINTS = Range(1, 1000, "points")


class ModelControlPoint(Section):
    """One control point."""

    at: Pair = key("x along the base and y to the left, from the left nadir, at photo scale", unit="mm")
    use: Annotated[Words, AfterValidator(one_of(*USES))] = key("`xyz`, `xy` or `z`", "xyz")


def _control_point(value: object) -> object:
    """Let a pair of numbers stand for a point that is given in full."""
    return {"at": value} if isinstance(value, list) else value


class ModelControl(Section):
    """The control of the model."""

    layout: Annotated[Words, AfterValidator(one_of(*LAYOUTS))] = key(
        "`corners`, `corners+centre`, or `six` standard points", "corners"
    )
    points: list[Annotated[ModelControlPoint, BeforeValidator(_control_point)]] = key(
        "Points instead of a layout: [x, y], or {at: [x, y], use: z}", []
    )
    sigma: Sigmas = key("Standard deviations along, across and in height", ModelSpec.control_sigma, unit="m")


class ModelOrientation(Section):
    """The points that orient the pair."""

    zone_points: Annotated[Whole, AfterValidator(bounded(ZONE_POINTS))] = key("Points in each of six zones", 1)
    points: list[Pair] = key("Points instead of zones: [x, y], from the left nadir", [], unit="mm")


class Grid(Section):
    """Where errors are computed."""

    columns: Annotated[Whole, AfterValidator(bounded(GRID))] = key("Points along the base", ModelSpec.grid[0])
    rows: Annotated[Whole, AfterValidator(bounded(GRID))] = key("Points across the flight", ModelSpec.grid[1])


class ModelPlanFile(Flown):
    """Expected errors over one model. Every key but the first has a default."""

    photostrip_plan_model: Annotated[Words, AfterValidator(one_of(SCHEMA_NUMBER))] = key("Number of this schema: 1")
    name: Words = key("Name of the plan", "model")
    base: Positive | None = key("Photo base, instead of the overlap", None, unit="mm")
    reach_percent: Annotated[Positive, AfterValidator(bounded(REACH))] = key(
        "Outermost points, of half the width of the photo", 80.0, unit="%"
    )
    orientation: ModelOrientation = key("Points that orient the pair", ModelOrientation.model_construct())
    control: ModelControl = key("Control", ModelControl.model_construct())
    grid: Grid = key("Where errors are computed", Grid.model_construct())


class ModelPlan(NamedTuple):
    """A plan of one model."""

    name: str
    camera: str
    spec: ModelSpec
    files: Sequence[str]


def load_model_plan(path: Path | None, assignments: Sequence[str]) -> ModelPlan:
    """Read the plan of a model, or raise all its faults; without a file the assignments and defaults are the plan."""
    given, reading = read_plan(ModelPlanFile, path, assignments)
    camera = camera_of(given.camera)
    along, across = camera.format or (230.0, 230.0)
    base = given.base or along * (1.0 - given.end_lap_percent / 100.0)
    width = across / 2.0 * given.reach_percent / 100.0
    points = tuple(ControlPoint(point.at, str(point.use)) for point in given.control.points)
    spec = ModelSpec(
        focal=camera.principal_distance,
        base=base,
        width=width,
        scale=given.scale_of(camera),
        image_sigma=given.image_sigma_um / 1000.0,
        zone_points=given.orientation.zone_points,
        orientation_points=tuple(given.orientation.points),
        control=points or control_layout(str(given.control.layout), base, width),
        control_sigma=given.control.sigma,
        grid=(given.grid.columns, given.grid.rows),
    )
    return ModelPlan(name=str(given.name), camera=camera.name, spec=spec, files=reading.files)
