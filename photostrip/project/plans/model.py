"""The plan of a single model: the YAML file and its keys."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

from photostrip.planning.model_plan import LAYOUTS, NO_ERROR, ControlPoint, ModelSpec, NamedPoint, control_layout
from photostrip.project.plans.flown import Flown, Sigmas
from photostrip.project.schema.sections import (
    After,
    Before,
    FirstSchema,
    Id,
    Number,
    Pair,
    Positive,
    Range,
    Section,
    Triple,
    Whole,
    Words,
    bounded,
    key,
    one_of,
    rule,
    wrong,
)
from photostrip.project.simulation import camera_of
from photostrip.project.yaml.reading import read_keys
from photostrip.units import ARCSECONDS, MICROMETRES, MILLIMETRES

USES = ("xyz", "xy", "z")
REACH = Range(5.0, 100.0, "%")
GRID = Range(2, 101, "points")
ZONE_POINTS = Range(1, 1000, "points")
RELIEF = 0.9  # of the flying height: what stands higher is no ground
PLACE = "x along the base and y to the left on the ground, from the left nadir, at photo scale"


class ModelPoint(Section):
    """A point whose errors are wanted."""

    name: Id = key("Name")
    at: Pair = key(PLACE, unit="mm")
    height: Number = key("Height above the level to which the photo scale belongs", 0.0, unit="m")
    measured_error: Triple = key("Error of the measured model coordinates", NO_ERROR, unit="m")


class ModelControlPoint(ModelPoint):
    """One control point."""

    name: Id = key("Name; default: C and its number", "")
    use: Annotated[Words, After(one_of(*USES))] = key("`xyz`, `xy` or `z`", "xyz")
    misclosure: Triple | None = key("Model minus given, where it has been measured", None, unit="m")
    given_error: Triple = key("Error of the given coordinates", NO_ERROR, unit="m")


class ElementErrors(Section):
    """Given errors of the elements of the right photo, the left one held."""

    dby_um: Number = key("Perspective centre to the left, at photo scale", 0.0, unit="um")
    dbz_um: Number = key("Perspective centre upwards, at photo scale", 0.0, unit="um")
    dkappa_arcsec: Number = key("Turn, counter-clockwise", 0.0, unit="arcsec")
    dalpha_arcsec: Number = key("Turn, to look forward", 0.0, unit="arcsec")
    domega_arcsec: Number = key("Turn, to look to the left", 0.0, unit="arcsec")


def _control_point(value: object) -> object:
    """Let a pair of numbers stand for a point that is given in full."""
    return {"at": value} if isinstance(value, list) else value


class ModelControl(Section):
    """The control of the model."""

    layout: Annotated[Words, After(one_of(*LAYOUTS))] = key(
        "`corners`, `corners+centre`, or `six` standard points", "corners"
    )
    points: list[Annotated[ModelControlPoint, Before(_control_point)]] = key(
        "Points instead of a layout: [x, y], or {at: [x, y], use: z}", []
    )
    sigma: Sigmas = key("Standard deviations along, across and in height", ModelSpec.control_sigma, unit="m")


class ModelOrientation(Section):
    """The points that orient the pair."""

    zone_points: Annotated[Whole, After(bounded(ZONE_POINTS))] = key("Points in each of six zones", 1)
    points: list[Pair] = key("Points instead of zones: [x, y], from the left nadir", [], unit="mm")


class Grid(Section):
    """Where errors are computed."""

    columns: Annotated[Whole, After(bounded(GRID))] = key("Points along the base", ModelSpec.grid[0])
    rows: Annotated[Whole, After(bounded(GRID))] = key("Points across the flight", ModelSpec.grid[1])


def _listed(value: object) -> object:
    """Let a list stand for the five elements."""
    if not isinstance(value, list):
        return value
    names = list(ElementErrors.model_fields)
    if len(value) != len(names):
        expected = "five: dby, dbz (um), dkappa, dalpha, domega (seconds of arc)"
        raise wrong(f"{len(value)} values are given", code="number", expected=expected)
    return dict(zip(names, value, strict=True))


class ModelPlanFile(Flown):
    """Expected errors over one model. Every key but the first has a default."""

    photostrip_plan_model: FirstSchema = key("Number of this schema: 1")
    name: Words = key("Name of the plan", "model")
    base: Positive | None = key("Photo base, instead of the overlap", None, unit="mm")
    reach_percent: Annotated[Positive, After(bounded(REACH))] = key(
        "Outermost points, of half the width of the photo", 80.0, unit="%"
    )
    orientation: ModelOrientation = key("Points that orient the pair", ModelOrientation())
    control: ModelControl = key("Control", ModelControl())
    grid: Grid = key("Where errors are computed", Grid())
    points: list[ModelPoint] = key("Further points, with names and heights", [])
    element_errors: Annotated[ElementErrors, Before(_listed)] = key(
        "Given errors of the elements: by name, or [dby, dbz, dkappa, dalpha, domega]", ElementErrors()
    )
    closed_form: Annotated[Words, After(one_of("no", "yes", "printed"))] = key(
        "Operators and closed form side by side, with c1 to c15; `printed`: as the source prints it, misprints and all",
        "no",
    )

    @rule
    def _errors_or_misclosures(self) -> None:
        measured = [point for point in self.control.points if point.misclosure is not None]
        if not measured:
            return
        if len(measured) < len(self.control.points):
            message = "some control points have a misclosure, and others have none"
            raise wrong(message, code="missing-key", at="control", fix="give it for all control points, or for none")
        every: list[ModelPoint] = [*self.control.points, *self.points]
        made = [point for point in every if any(point.measured_error)]
        if made or any(any(point.given_error) for point in measured) or any(dict(self.element_errors).values()):
            message = "misclosures that were found, and errors that would make some, are both given"
            raise wrong(message, code="two-keys", at="control", fix="remove the one or the other")

    @rule
    def _points_are_seen(self) -> None:
        camera = camera_of(self.camera)
        flying_height = self.scale_of(camera) * camera.principal_distance / MILLIMETRES
        for name, points in (("control", self.control.points), ("points", self.points)):
            highest = max((point.height for point in points), default=0.0)
            if highest > RELIEF * flying_height:
                message = f"a point {highest:g} m high is not seen from {flying_height:g} m"
                raise wrong(message, code="range", at=name, expected=f"at most {RELIEF * flying_height:.0f} m")


class ModelPlan(NamedTuple):
    name: str
    camera: str
    spec: ModelSpec
    closed_form: str  # ``no``, ``yes`` or ``printed``
    files: Sequence[str]


def load_model_plan(path: Path | None, assignments: Sequence[str]) -> ModelPlan:
    """Read the plan of a model, or raise all its faults; without a file the assignments and defaults are the plan."""
    given, reading = read_keys(ModelPlanFile, path, assignments)
    camera = camera_of(given.camera)
    along, across = camera.format or (230.0, 230.0)
    base = given.base or along * (1.0 - given.end_lap_percent / 100.0)
    width = across / 2.0 * given.reach_percent / 100.0
    points = tuple(_control_of(point, number) for number, point in enumerate(given.control.points, 1))
    scale = given.scale_of(camera)
    spec = ModelSpec(
        focal=camera.principal_distance,
        base=base,
        width=width,
        scale=scale,
        image_sigma=given.image_sigma_um / MICROMETRES,
        zone_points=given.orientation.zone_points,
        orientation_points=tuple(given.orientation.points),
        control=points or control_layout(str(given.control.layout), base, width),
        control_sigma=given.control.sigma,
        grid=(given.grid.columns, given.grid.rows),
        points=tuple(
            NamedPoint(point.at, name=str(point.name), height=point.height, measured_error=point.measured_error)
            for point in given.points
        ),
        element_errors=_elements(given.element_errors),
    )
    return ModelPlan(
        name=str(given.name), camera=camera.name, spec=spec, closed_form=str(given.closed_form), files=reading.files
    )


def _control_of(point: ModelControlPoint, number: int) -> ControlPoint:
    return ControlPoint(
        at=point.at,
        use=str(point.use),
        name=str(point.name or f"C{number}"),
        height=point.height,
        misclosure=point.misclosure,
        measured_error=point.measured_error,
        given_error=point.given_error,
    )


def _elements(given: ElementErrors) -> tuple[float, ...]:
    lengths = (given.dby_um / MICROMETRES, given.dbz_um / MICROMETRES)
    angles = (given.dkappa_arcsec, given.dalpha_arcsec, given.domega_arcsec)
    return (*lengths, *(angle / ARCSECONDS for angle in angles))
