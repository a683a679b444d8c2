"""Plans of a strip and its control: the YAML file and its keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from photostrip.formats.text.findings import suggestion
from photostrip.planning.ideal_strip import (
    BUNDLE,
    LAYOUTS,
    LEAST_PHOTOS,
    METHODS,
    USES,
    ControlLayout,
    Spot,
    StripGeometry,
)
from photostrip.planning.strip_design import Demand, DesignReport, DesignTask, Placement, plan_strip
from photostrip.project.plans.flown import Flown, Sigmas
from photostrip.project.schema.sections import (
    After,
    Before,
    FirstSchema,
    Flag,
    Id,
    Positive,
    Range,
    Section,
    Whole,
    Words,
    bounded,
    key,
    length,
    one_of,
    rule,
    wrong,
)
from photostrip.project.simulation import camera_of
from photostrip.project.yaml.reading import Reading, read_keys, valid_section
from photostrip.simulation import Points

MODELS = Range(LEAST_PHOTOS - 1, 400, "models")
ROWS = Range(2, 20, "rows")
EXTRA = Range(0, 200, "points")
PLACED = Range(1, 40, "points")
REACH = Range(5.0, 95.0, "%")
USUAL, USUAL_LAYOUT = StripGeometry.points, ControlLayout("")
# Keys of a simulation by which the strip is refused, and those of the plan.
SIMULATED = {"flight.end_lap_percent": "end_lap_percent", "flight.photos": "models", "flight": "end_lap_percent"}
DEFAULT_LAYOUTS = {"3 bands": "bands=3", "4 bands": "bands=4", "corners": "corners"}


class StripPoints(Section):
    """Pass points."""

    rows: Annotated[Whole, After(bounded(ROWS))] = key("Points across the flight at each nadir", USUAL.rows)
    reach_percent: Annotated[Positive, After(bounded(REACH))] = key(
        "Outermost rows, of half the width of the photo", USUAL.reach_percent, unit="%"
    )
    extra_per_model: Annotated[Whole, After(bounded(EXTRA))] = key(
        "Further points in each model", USUAL.extra_per_model
    )


class StripSpot(Section):
    """One control point."""

    at: tuple[Whole, Whole] = key("Photo at whose nadir it lies, and row from left to right, both counted from 1")
    use: Annotated[Words, After(one_of(*USES))] = key("`xyz`, `xy` or `z`", "xyz")


def _spot(value: object) -> object:
    """Let photo and row stand for a point that is given in full."""
    return {"at": value} if isinstance(value, list) else value


def _layout(value: object) -> object:
    """Let a word stand for a layout: ``corners``, ``bands=3``, ``every=4``."""
    if not isinstance(value, str) or not value:
        return value
    name, equals, number = value.partition("=")
    return {name.strip(): number.strip()} if equals else {"layout": value}


def _layouts(value: object) -> object:
    """Let a list of words stand for layouts, each by a name of its own: ``3 bands``, ``every 5``, ``corners``."""
    if not isinstance(value, list):
        return value
    return {_layout_name(str(word)): word for word in value}


def _layout_name(word: str) -> str:
    kind, equals, number = word.partition("=")
    if not equals:
        return word
    return f"{number} band{'' if number == '1' else 's'}" if kind == "bands" else f"{kind} {number}"


def _required(value: object) -> object:
    """Let a pair stand for plan and height."""
    return dict(zip(("plan", "height"), value, strict=False)) if isinstance(value, list) else value


class StripLayout(Section):
    """One layout of control."""

    layout: Annotated[Words, After(one_of(*LAYOUTS))] = key(
        "`bands`, `corners`, `corners+centre`, or `points` alone", USUAL_LAYOUT.kind
    )
    bands: Whole = key("Bands across the strip, from the first to the last photo", USUAL_LAYOUT.bands)
    every: Annotated[Whole, After(bounded(Range(1, 400, "models")))] | None = key(
        "Models from band to band, instead of `bands`", None
    )
    per_band: Whole = key("Points of a band", USUAL_LAYOUT.per_band)
    use: Annotated[Words, After(one_of(*USES))] = key("`xyz`, `xy` or `z`", USUAL_LAYOUT.use)
    points: list[Annotated[StripSpot, Before(_spot)]] = key(
        "Single points, further ones or instead of a band's: [photo, row], or {at: [photo, row], use: z}", []
    )
    sigma: Sigmas | None = key("Standard deviations along, across, in height; default: `control_sigma`", None, unit="m")
    gnss: Sigmas | None = key(
        "Standard deviations of measured perspective centres; default: none are measured", None, unit="m"
    )
    gnss_offset: Flag = key("Whether these have a constant offset to be determined", USUAL_LAYOUT.gnss_offset)

    @rule
    def _one_way_to_space_bands(self) -> None:
        if self.every is not None and "bands" in self.model_fields_set:
            raise wrong("the number of bands and their distance are both given", at="every", fix="remove one")


class StripRequired(Section):
    """The accuracy that every point must reach."""

    plan: Positive | None = key("Standard deviation in plan, both coordinates together", None, unit="m")
    height: Positive | None = key("Standard deviation in height", None, unit="m")


class StripPlacement(Section):
    """Further control points to be placed as well as possible."""

    points: Annotated[Whole, After(bounded(PLACED))] = key("How many")
    into: Id | None = key("Layout that they are added to; default: the first", None)
    method: Annotated[Words, After(one_of(*METHODS))] = key("Method of adjustment", METHODS[-1])
    use: Annotated[Words, After(one_of(*USES))] = key("`xyz`, `xy` or `z`", "xyz")


class StripPlanFile(Flown):
    """A strip and layouts of its control. Every key but the first has a default."""

    photostrip_plan_strip: FirstSchema = key("Number of this schema: 1")
    name: Words = key("Name of the plan", "strip")
    models: Annotated[Whole, After(bounded(MODELS))] = key("Models of the strip, one less than photos", 10)
    points: StripPoints = key("Pass points", StripPoints())
    control_sigma: Sigmas = key("Standard deviations along, across and in height", USUAL_LAYOUT.sigma, unit="m")
    gnss: Sigmas | None = key(
        "Standard deviations of measured perspective centres: each layout is compared with and without them",
        None,
        unit="m",
    )
    layouts: Annotated[dict[Id, Annotated[StripLayout, Before(_layout)]], Before(_layouts), length(1)] | None = key(
        "Layouts by name, where a word may stand for one, or a list of words: `[bands=3, every=5, corners]`."
        f" Default: {', '.join(DEFAULT_LAYOUTS)}",
        None,
    )
    methods: Annotated[list[Annotated[Words, After(one_of(*METHODS))]], length(1)] = key(
        f"Methods of adjustment: {', '.join(METHODS)}", list(METHODS)
    )
    required: Annotated[StripRequired, Before(_required)] = key(
        "Accuracy that every point must reach, or [plan, height]", StripRequired()
    )
    place: StripPlacement | None = key("Further points to be placed as well as possible", None)

    @rule
    def _names_and_methods_fit(self) -> None:
        into = self.place.into if self.place is not None else None
        names = list(self.layouts or DEFAULT_LAYOUTS)
        if into is not None and into not in names:
            message = f"there is no layout `{into}` that points could be added to"
            fix = suggestion(into, names)
            raise wrong(message, code="unknown-layout", at="place", expected=f"one of {', '.join(names)}", fix=fix)
        measured = self.gnss is not None or any(each.gnss is not None for each in (self.layouts or {}).values())
        if measured and BUNDLE not in self.methods:
            message = "measured perspective centres are of use to the bundle alone, which is not among the methods"
            raise wrong(message, at="methods", fix="add `bundle`, or leave `gnss` out")


@dataclass(frozen=True, eq=False)
class StripPlan:
    name: str
    design: DesignTask
    reading: Reading

    def computed(self) -> DesignReport:
        """Compute what the plan asks for, or raise all that cannot be planned, each fault at its place in the file."""
        with self.reading.places(SIMULATED):
            return plan_strip(self.design)


def load_strip_plan(path: Path | None, assignments: Sequence[str]) -> StripPlan:
    """Read the plan of a strip, or raise all its faults; without a file the assignments and defaults are the plan."""
    given, reading = read_keys(StripPlanFile, path, assignments)
    camera = camera_of(given.camera)
    geometry = StripGeometry(
        camera=camera,
        photos=given.models + 1,
        end_lap_percent=given.end_lap_percent,
        scale=given.scale_of(camera),
        points=Points(
            rows=given.points.rows,
            reach_percent=given.points.reach_percent,
            scatter_percent=0.0,
            extra_per_model=given.points.extra_per_model,
        ),
        image_sigma=given.image_sigma_um / 1000.0,
    )
    usual = {name: valid_section(StripLayout, _layout(word)) for name, word in DEFAULT_LAYOUTS.items()}
    chosen = [(name, each) for name, each in (given.layouts or usual).items() if each is not None]
    layouts = tuple(_of_layout(str(name), each, given.control_sigma) for name, each in chosen)
    if given.gnss is not None:
        plain = [layout for layout in layouts if layout.gnss is None]
        layouts += tuple(replace(each, name=f"{each.name} + GNSS", gnss=given.gnss) for each in plain)
    placement = None
    if given.place is not None:
        into = str(given.place.into) if given.place.into is not None else layouts[0].name
        placement = Placement(
            points=given.place.points, into=into, method=str(given.place.method), use=str(given.place.use)
        )
    methods = tuple(dict.fromkeys(str(method) for method in given.methods))
    required = Demand(given.required.plan, given.required.height)
    return StripPlan(
        str(given.name),
        DesignTask(geometry=geometry, layouts=layouts, methods=methods, required=required, placement=placement),
        reading,
    )


def _of_layout(name: str, given: StripLayout, sigma: tuple[float, float, float]) -> ControlLayout:
    return ControlLayout(
        name=name,
        kind=str(given.layout),
        bands=given.bands,
        every=given.every,
        per_band=given.per_band,
        use=str(given.use),
        spots=tuple(Spot(spot.at[0], spot.at[1], str(spot.use)) for spot in given.points),
        sigma=given.sigma or sigma,
        gnss=given.gnss,
        gnss_offset=given.gnss_offset,
    )
