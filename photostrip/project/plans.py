"""The files of ``photostrip plan`` and the keys of single steps; the specifications of ``planning`` made of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np

from photostrip.camera import Camera
from photostrip.errors import InputError
from photostrip.formats.faults import LARGEST_NUMBER, suggestion
from photostrip.geodesy.ground_frame import WGS84
from photostrip.geodesy.local_frame import EARTH_RADIUS, radius_in_azimuth
from photostrip.planning import camera_efficiency
from photostrip.planning.camera_efficiency import ComparedCamera, FlownSurvey, HighGround
from photostrip.planning.ideal_strip import BUNDLE, LEAST_PHOTOS, METHODS, USES, ControlLayout, Spot, StripGeometry
from photostrip.planning.ideal_strip import LAYOUTS as STRIP_LAYOUTS
from photostrip.planning.model_plan import LAYOUTS, NO_ERROR, ControlPoint, ModelSpec, NamedPoint, control_layout
from photostrip.planning.screening import ZONES, PairLayout, ScreeningSpec
from photostrip.planning.strip_design import Demand, DesignTask, Placement
from photostrip.project.conversion import distortion_of
from photostrip.project.keys import Distortion, Ellipsoid
from photostrip.project.reading import Reading
from photostrip.project.sections import (
    After,
    Before,
    Flag,
    Fraction,
    Id,
    NotNegative,
    Number,
    Pair,
    Positive,
    Range,
    Refusals,
    SchemaNumber,
    Section,
    Triple,
    Whole,
    Words,
    choice,
    key,
    length,
    wrong,
)
from photostrip.project.simulation import SimulatedCamera, camera_of
from photostrip.project.terrestrial import BASE, DISTANCE, IMAGE_SIGMA_UM, SIGNIFICANCE, CameraOrName, only_camera
from photostrip.project.terrestrial import Camera as Phototheodolite
from photostrip.strip.polynomial import POWERS
from photostrip.strip.relative_orientation import SCREENINGS
from photostrip.terrestrial.accuracy import DisplacementSpec
from photostrip.units import ARCSECONDS, MICROMETRES, MILLIMETRES

Percent = Annotated[Positive, Range(1.0, 99.0, "%")]
SigmaUm = Annotated[Positive, IMAGE_SIGMA_UM]
USUAL_POINTS, USUAL_LAYOUT, USUAL_SCREENING = StripGeometry.points, ControlLayout(""), ScreeningSpec()
USUAL_PAIR = USUAL_SCREENING.layout
RELIEF = 0.9  # of the flying height: what stands higher is no ground
PLACE = "x along the base and y to the left on the ground, from the left nadir, at photo scale"
# Keys of a simulation by which the strip is refused, and those of the plan.
SIMULATED = {"flight.end_lap_percent": "end_lap_percent", "flight.photos": "models", "flight": "end_lap_percent"}
DEFAULT_LAYOUTS = {"3 bands": "bands=3", "4 bands": "bands=4", "corners": "corners"}
FLIGHTS = ("scale", "flying_height", "height_sigma")
STEP_ANGLES = ("omega-phi-kappa", "alpha-omega-kappa")
PRESET = "UMK 10/1318"


def all_positive(value: tuple[float, float, float]) -> tuple[float, float, float]:
    """Require three standard deviations that are not negative, at least one of them positive."""
    if min(value) < 0 or max(value) == 0:
        raise wrong("standard deviations are negative or all zero", code="range", expected="metres, 0 or more")
    return value


Sigmas = Annotated[Triple, After(all_positive)]


def at(value: object) -> object:
    """Let a place stand for a point that is given in full."""
    return {"at": value} if isinstance(value, list) else value


class PlanFile(Section):
    """What all plans have."""

    extends: Words | None = key("Another file whose keys are taken where this one has none", None)


class Flown(PlanFile):
    """A plan of something that is flown: camera, overlap, scale, measuring."""

    camera: SimulatedCamera = key("Camera; its lens counts as ideal", SimulatedCamera())
    end_lap_percent: Percent = key("Overlap of neighbouring photos", StripGeometry.end_lap_percent, unit="%")
    scale: Positive | None = key("Denominator of the photo scale; default: 10000", None)
    flying_height: Positive | None = key("Height above the ground, instead of `scale`", None, unit="m")
    image_sigma_um: SigmaUm = key("Standard deviation of an image coordinate", 5.0, unit="um")

    def rules(self) -> Refusals:
        if self.scale is not None and self.flying_height is not None:
            yield wrong("photo scale and flying height are both given", at="flying_height", fix="remove one")

    def scale_of(self, camera: Camera) -> float:
        """Denominator of the photo scale, given itself or by the flying height."""
        by_height = (self.flying_height or 0.0) / camera.principal_distance * 1000.0
        return self.scale or by_height or StripGeometry.scale


Use = Annotated[str, choice(*USES)]


class ModelPoint(Section):
    """A point whose errors are wanted."""

    name: Id = key("Name")
    at: Pair = key(PLACE, unit="mm")
    height: Number = key("Height above the level to which the photo scale belongs", 0.0, unit="m")
    measured_error: Triple = key("Error of the measured model coordinates", NO_ERROR, unit="m")


class ModelControlPoint(ModelPoint):
    """One control point."""

    name: Id = key("Name; default: C and its number", "")
    use: Use = key("`xyz`, `xy` or `z`", "xyz")
    misclosure: Triple | None = key("Model minus given, where it has been measured", None, unit="m")
    given_error: Triple = key("Error of the given coordinates", NO_ERROR, unit="m")


class ElementErrors(Section):
    """Given errors of the elements of the right photo, the left one held."""

    dby_um: Number = key("Perspective centre to the left, at photo scale", 0.0, unit="um")
    dbz_um: Number = key("Perspective centre upwards, at photo scale", 0.0, unit="um")
    dkappa_arcsec: Number = key("Turn, counter-clockwise", 0.0, unit="arcsec")
    dalpha_arcsec: Number = key("Turn, to look forward", 0.0, unit="arcsec")
    domega_arcsec: Number = key("Turn, to look to the left", 0.0, unit="arcsec")


class ModelControl(Section):
    """The control of the model."""

    layout: Annotated[str, choice(*LAYOUTS)] = key("`corners`, `corners+centre`, or `six` standard points", "corners")
    points: list[Annotated[ModelControlPoint, Before(at)]] = key(
        "Points instead of a layout: [x, y], or {at: [x, y], use: z}", []
    )
    sigma: Sigmas = key("Standard deviations along, across and in height", ModelSpec.control_sigma, unit="m")


class ModelOrientation(Section):
    """The points that orient the pair."""

    zone_points: Annotated[Whole, Range(1, 1000, "points")] = key("Points in each of six zones", 1)
    points: list[Pair] = key("Points instead of zones: [x, y], from the left nadir", [], unit="mm")


class Grid(Section):
    """Where errors are computed."""

    columns: Annotated[Whole, Range(2, 101, "points")] = key("Points along the base", ModelSpec.grid[0])
    rows: Annotated[Whole, Range(2, 101, "points")] = key("Points across the flight", ModelSpec.grid[1])


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

    photostrip_plan_model: SchemaNumber = key("Number of this schema: 1")
    name: Words = key("Name of the plan", "model")
    base: Positive | None = key("Photo base, instead of the overlap", None, unit="mm")
    reach_percent: Annotated[Positive, Range(5.0, 100.0, "%")] = key(
        "Outermost points, of half the width of the photo", 80.0, unit="%"
    )
    orientation: ModelOrientation = key("Points that orient the pair", ModelOrientation())
    control: ModelControl = key("Control", ModelControl())
    grid: Grid = key("Where errors are computed", Grid())
    points: list[ModelPoint] = key("Further points, with names and heights", [])
    element_errors: Annotated[ElementErrors, Before(_listed)] = key(
        "Given errors of the elements: by name, or [dby, dbz, dkappa, dalpha, domega]", ElementErrors()
    )
    closed_form: Annotated[str, choice("no", "yes", "printed")] = key(
        "Operators and closed form side by side, with c1 to c15; `printed`: as the source prints it, misprints and all",
        "no",
    )

    def rules(self) -> Refusals:
        measured = [point for point in self.control.points if point.misclosure is not None]
        if measured and len(measured) < len(self.control.points):
            message = "some control points have a misclosure, and others have none"
            yield wrong(message, code="missing-key", at="control", fix="give it for all control points, or for none")
        every: list[ModelPoint] = [*self.control.points, *self.points]
        made = [point for point in every if any(point.measured_error)]
        made += [point for point in measured if any(point.given_error)]
        if measured and (made or any(dict(self.element_errors).values())):
            message = "misclosures that were found, and errors that would make some, are both given"
            yield wrong(message, code="two-keys", at="control", fix="remove the one or the other")
        camera = camera_of(self.camera)
        flying_height = self.scale_of(camera) * camera.principal_distance / MILLIMETRES
        for name, points in (("control", self.control.points), ("points", self.points)):
            highest = max((point.height for point in points), default=0.0)
            if highest > RELIEF * flying_height:
                message = f"a point {highest:g} m high is not seen from {flying_height:g} m"
                yield wrong(message, code="range", at=name, expected=f"at most {RELIEF * flying_height:.0f} m")

    @property
    def spec(self) -> ModelSpec:
        camera, errors = camera_of(self.camera), self.element_errors
        along, across = camera.format or (230.0, 230.0)
        base = self.base or along * (1.0 - self.end_lap_percent / 100.0)
        width = across / 2.0 * self.reach_percent / 100.0
        named = ((point, point.name or f"C{number}") for number, point in enumerate(self.control.points, 1))
        points = tuple(ControlPoint(**{**dict(point), "name": name}) for point, name in named)
        angles = (errors.dkappa_arcsec, errors.dalpha_arcsec, errors.domega_arcsec)
        return ModelSpec(
            focal=camera.principal_distance,
            base=base,
            width=width,
            scale=self.scale_of(camera),
            image_sigma=self.image_sigma_um / MICROMETRES,
            zone_points=self.orientation.zone_points,
            orientation_points=tuple(self.orientation.points),
            control=points or control_layout(self.control.layout, base, width),
            control_sigma=self.control.sigma,
            grid=(self.grid.columns, self.grid.rows),
            points=tuple(NamedPoint(**dict(point)) for point in self.points),
            element_errors=(
                errors.dby_um / MICROMETRES,
                errors.dbz_um / MICROMETRES,
                *(each / ARCSECONDS for each in angles),
            ),
        )


class StripPoints(Section):
    """Pass points."""

    rows: Annotated[Whole, Range(2, 20, "rows")] = key("Points across the flight at each nadir", USUAL_POINTS.rows)
    reach_percent: Annotated[Positive, Range(5.0, 95.0, "%")] = key(
        "Outermost rows, of half the width of the photo", USUAL_POINTS.reach_percent, unit="%"
    )
    extra_per_model: Annotated[Whole, Range(0, 200, "points")] = key(
        "Further points in each model", USUAL_POINTS.extra_per_model
    )


class StripSpot(Section):
    """One control point."""

    at: tuple[Whole, Whole] = key("Photo at whose nadir it lies, and row from left to right, both counted from 1")
    use: Use = key("`xyz`, `xy` or `z`", "xyz")


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

    layout: Annotated[str, choice(*STRIP_LAYOUTS)] = key(
        "`bands`, `corners`, `corners+centre`, or `points` alone", USUAL_LAYOUT.kind
    )
    bands: Whole = key("Bands across the strip, from the first to the last photo", USUAL_LAYOUT.bands)
    every: Annotated[Whole, Range(1, 400, "models")] | None = key("Models from band to band, instead of `bands`", None)
    per_band: Whole = key("Points of a band", USUAL_LAYOUT.per_band)
    use: Use = key("`xyz`, `xy` or `z`", USUAL_LAYOUT.use)
    points: list[Annotated[StripSpot, Before(at)]] = key(
        "Single points, further ones or instead of a band's: [photo, row], or {at: [photo, row], use: z}", []
    )
    sigma: Sigmas | None = key("Standard deviations along, across, in height; default: `control_sigma`", None, unit="m")
    gnss: Sigmas | None = key(
        "Standard deviations of measured perspective centres; default: none are measured", None, unit="m"
    )
    gnss_offset: Flag = key("Whether these have a constant offset to be determined", USUAL_LAYOUT.gnss_offset)

    def rules(self) -> Refusals:
        if self.every is not None and "bands" in self.model_fields_set:
            yield wrong("the number of bands and their distance are both given", at="every", fix="remove one")

    def named(self, name: str, sigma: tuple[float, float, float]) -> ControlLayout:
        given = dict(self)
        kind, spots = given.pop("layout"), tuple(Spot(spot.at[0], spot.at[1], spot.use) for spot in given.pop("points"))
        return ControlLayout(**{**given, "name": name, "kind": kind, "spots": spots, "sigma": self.sigma or sigma})


class StripRequired(Section):
    """The accuracy that every point must reach."""

    plan: Positive | None = key("Standard deviation in plan, both coordinates together", None, unit="m")
    height: Positive | None = key("Standard deviation in height", None, unit="m")


class StripPlacement(Section):
    """Further control points to be placed as well as possible."""

    points: Annotated[Whole, Range(1, 40, "points")] = key("How many")
    into: Id | None = key("Layout that they are added to; default: the first", None)
    method: Annotated[str, choice(*METHODS)] = key("Method of adjustment", METHODS[-1])
    use: Use = key("`xyz`, `xy` or `z`", "xyz")


class StripPlanFile(Flown):
    """A strip and layouts of its control. Every key but the first has a default."""

    photostrip_plan_strip: SchemaNumber = key("Number of this schema: 1")
    name: Words = key("Name of the plan", "strip")
    models: Annotated[Whole, Range(LEAST_PHOTOS - 1, 400, "models")] = key(
        "Models of the strip, one less than photos", 10
    )
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
    methods: Annotated[list[Annotated[str, choice(*METHODS)]], length(1)] = key(
        f"Methods of adjustment: {', '.join(METHODS)}", list(METHODS)
    )
    required: Annotated[StripRequired, Before(_required)] = key(
        "Accuracy that every point must reach, or [plan, height]", StripRequired()
    )
    place: StripPlacement | None = key("Further points to be placed as well as possible", None)

    def rules(self) -> Refusals:
        into = self.place.into if self.place is not None else None
        names = list(self.layouts or DEFAULT_LAYOUTS)
        if into is not None and into not in names:
            message = f"there is no layout `{into}` that points could be added to"
            fix = suggestion(into, names)
            yield wrong(message, code="unknown-layout", at="place", expected=f"one of {', '.join(names)}", fix=fix)
        measured = self.gnss is not None or any(each.gnss is not None for each in (self.layouts or {}).values())
        if measured and BUNDLE not in self.methods:
            message = "measured perspective centres are of use to the bundle alone, which is not among the methods"
            yield wrong(message, at="methods", fix="add `bundle`, or leave `gnss` out")

    @property
    def design(self) -> DesignTask:
        camera = camera_of(self.camera)
        geometry = StripGeometry(
            camera=camera,
            photos=self.models + 1,
            end_lap_percent=self.end_lap_percent,
            scale=self.scale_of(camera),
            points=replace(USUAL_POINTS, scatter_percent=0.0, **dict(self.points)),
            image_sigma=self.image_sigma_um / MICROMETRES,
        )
        usual = {name: StripLayout.model_validate(_layout(word)) for name, word in DEFAULT_LAYOUTS.items()}
        layouts = tuple(each.named(name, self.control_sigma) for name, each in (self.layouts or usual).items())
        if self.gnss is not None:
            plain = [layout for layout in layouts if layout.gnss is None]
            layouts += tuple(replace(each, name=f"{each.name} + GNSS", gnss=self.gnss) for each in plain)
        placement = None
        if self.place is not None:
            placement = Placement(**{**dict(self.place), "into": self.place.into or layouts[0].name})
        methods, required = tuple(dict.fromkeys(self.methods)), Demand(**dict(self.required))
        return DesignTask(geometry, layouts, methods, required, placement)


Lap = Annotated[Number, Range(0.0, 90.0, "%")]
Relief = Annotated[Number, Range(0.0, 9000.0, "m")]
Slope = Annotated[Number, Range(0.0, 89.0, "deg")]


class PlanCamera(Section):
    """One camera to compare."""

    principal_distance: Positive = key("Principal distance", unit="mm")
    sigma_um: SigmaUm | None = key("Standard deviation of an x parallax in the photo", None, unit="um")
    image_sigma_um: SigmaUm | None = key(
        "Standard deviation of an image coordinate, instead of that of a parallax", None, unit="um"
    )
    mean_distortion_um: Positive | None = key("Mean size of the radial distortion that is left", None, unit="um")
    distortion: Distortion | None = key("The distortion that is left, instead of its mean size", None)
    base: Positive | None = key("Photo base; default: from `format` and the overlap", None, unit="mm")
    format: tuple[Positive, Positive] | None = key("Length along and width across the flight", None, unit="mm")

    def rules(self) -> Refusals:
        if self.base is None and self.format is None:
            yield wrong("nothing says how long the photo base is", code="missing-key", expected="`base` or `format`")
        if (self.sigma_um is None) == (self.image_sigma_um is None):
            what = "nothing says" if self.sigma_um is None else "two keys say"
            message = f"{what} how well an x parallax is known"
            yield wrong(message, code="missing-key", expected="`sigma_um` or `image_sigma_um`")
        left = [name for name in ("mean_distortion_um", "distortion") if getattr(self, name) is not None]
        if left and self.sigma_um is not None:
            message = f"`{left[0]}` adds to the errors of measuring, and `sigma_um` has all errors in it"
            yield wrong(message, code="two-keys", at=left[0], fix="give `image_sigma_um` instead of `sigma_um`")
        if len(left) > 1:
            message = "the distortion that is left and its mean size are both given"
            yield wrong(message, code="two-keys", at=left[0], fix="remove one")
        if self.distortion is not None and self.format is None:
            message = "where the distortion lies in a model follows from the format, which is not given"
            yield wrong(message, code="missing-key", at="distortion", expected="`format`")


class CameraPlanFile(PlanFile):
    """Cameras to compare."""

    photostrip_plan_cameras: SchemaNumber = key("Number of this schema: 1")
    name: Words = key("Name of the comparison", "cameras")
    end_lap_percent: Percent = key("Overlap, for cameras without `base`", 60.0, unit="%")
    side_lap_percent: Lap = key("Overlap of neighbouring strips: what is left of the width is useful", 0.0, unit="%")
    scale: Positive | None = key("Denominator of the photo scale that all are flown at", None)
    flying_height: Positive | None = key("Height above the ground that all are flown at, instead", None, unit="m")
    height_sigma: Positive | None = key("Standard deviation that heights shall have, instead", None, unit="m")
    relief: Relief = key("Difference between the highest and the lowest ground", 0.0, unit="m")
    slope_deg: Slope = key("Steepest slope that is to be seen", 0.0, unit="deg")
    reference: Id | None = key("Camera that the others stand beside; default: the last", None)
    cameras: Annotated[dict[Id, PlanCamera], length(1)] = key("Cameras by name")

    def rules(self) -> Refusals:
        if self.reference is not None and self.reference not in self.cameras:
            expected = f"one of {', '.join(self.cameras)}"
            yield wrong(
                f"there is no camera `{self.reference}`", code="unknown-camera", at="reference", expected=expected
            )
        wide = [name for name, camera in self.cameras.items() if camera.format is not None]
        if wide and len(wide) < len(self.cameras):
            lacking = next(name for name in self.cameras if name not in wide)
            message = f"camera `{lacking}` has no format, and others have: areas cannot be compared"
            yield wrong(message, code="missing-key", at="cameras", fix="give `format` for all cameras, or for none")
        given = [name for name in FLIGHTS if getattr(self, name) is not None]
        if len(given) > 1:
            yield wrong(f"`{given[0]}` and `{given[1]}` are both given", code="two-keys", at=given[1], fix="remove one")
        ground = [name for name in ("relief", "slope_deg") if getattr(self, name)]
        if ground and not given:
            message = "what a camera takes of a terrain depends on how it is flown"
            yield wrong(
                message, code="missing-key", at=ground[0], expected="`scale`, `flying_height` or `height_sigma`"
            )
        if self.relief and any(camera.format is None for camera in self.cameras.values()):
            message = "how far photos overlap on high ground follows from their format, which is not given"
            yield wrong(message, code="missing-key", at="relief", fix="give `format` for all cameras")

    @property
    def compared(self) -> tuple[ComparedCamera, ...]:
        return tuple(self._compared(name, each) for name, each in self.cameras.items())

    @property
    def survey(self) -> FlownSurvey | None:
        """What is flown; nothing where only the cameras are compared."""
        if all(getattr(self, name) is None for name in FLIGHTS):
            return None
        terrain = HighGround(self.relief, float(np.radians(self.slope_deg)))
        return FlownSurvey(self.scale, self.flying_height, self.height_sigma, terrain)

    def _compared(self, name: str, given: PlanCamera) -> ComparedCamera:
        # without a format all cameras count as equally wide
        length, width = given.format or (None, camera_efficiency.PRINTED_BASE)
        base = given.base
        if base is None and length is not None:
            base = length * (1.0 - self.end_lap_percent / 100.0)
        useful, known = width * (1.0 - self.side_lap_percent / 100.0), base or np.nan
        return ComparedCamera(name, given.principal_distance, _sigma(name, given, known, useful), known, useful, length)


def _sigma(name: str, given: PlanCamera, base: float, width: float) -> float:
    """Return m_p, mm."""
    if given.sigma_um is not None:
        return given.sigma_um / MICROMETRES
    measuring = (given.image_sigma_um or 0.0) / MICROMETRES
    if given.distortion is None or given.format is None:
        mean = (given.mean_distortion_um or 0.0) / MICROMETRES
        return camera_efficiency.sigma_from_mean_distortion(measuring, mean)
    try:
        return camera_efficiency.sigma_from_distortion(
            measuring, distortion_of(given.distortion), base=base, length=given.format[0], width=width
        )
    except InputError as error:
        raise InputError(replace(fault, key=f"cameras.{name}.distortion") for fault in error.faults) from None


class DisplacementPlanFile(PlanFile):
    """Expected accuracy of displacements. Every key but the first has a default."""

    photostrip_plan_displacement: SchemaNumber = key("Number of this schema: 1")
    name: Words = key("Name of the plan", "displacements")
    camera: CameraOrName = key(
        "Camera: its name in a list, or preset, principal_distance, format", Phototheodolite(preset=PRESET)
    )
    presets: Words | None = key("A list of cameras of your own", None)
    stations: Annotated[str, choice("2", "1")] = key("2, at the ends of a base, or 1, with known distances", "2")
    base: Annotated[Number, BASE] = key("Length of the base", 20.0, unit="m")
    convergence_deg: Annotated[Number, Range(-45.0, 45.0, "deg")] = key(
        "Turn of each camera towards the other", 0.0, unit="deg"
    )
    distances: Annotated[list[Annotated[Number, DISTANCE]], length(1, 50)] = key(
        "Distances of the object from the base", [50.0, 100.0, 200.0], unit="m"
    )
    sigma_um: SigmaUm | None = key("Standard deviation of an image coordinate of each epoch", None, unit="um")
    sigma_d_um: SigmaUm | None = key("That of a pseudo-parallax, instead; default: 5", None, unit="um")
    significance: Annotated[Fraction, SIGNIFICANCE] = key(
        "Probability of calling a point moved that did not move", DisplacementSpec.significance
    )
    power: Annotated[Fraction, Range(0.5, 0.9999)] = key(
        "Probability with which the displacements stated are found", DisplacementSpec.power
    )

    def rules(self) -> Refusals:
        if self.sigma_um is not None and self.sigma_d_um is not None:
            message = "the standard deviation of a coordinate and that of a pseudo-parallax are both given"
            yield wrong(message, code="two-keys", at="sigma_d_um", fix="remove one")
        if self.stations == "1" and self.convergence_deg:
            yield wrong("one camera has no other to be turned towards", at="convergence_deg", fix="remove it")

    def spec(self, reading: Reading) -> DisplacementSpec:
        """Return what is planned with a camera of a list, or raise why there is none."""
        camera = only_camera(self.camera, reading, whole=True)
        change = self.sigma_d_um or 5.0
        if self.sigma_um is not None:
            change = float(np.sqrt(2.0)) * self.sigma_um  # of a coordinate in two epochs
        return DisplacementSpec(
            camera,
            distances=tuple(self.distances),
            sigma=change / MICROMETRES,
            base=self.base if self.stations == "2" else None,
            convergence=float(np.radians(self.convergence_deg)),
            significance=self.significance,
            power=self.power,
        )


Size = Annotated[Number, Range(1.0, 500.0, "mm")]


class ScreeningPlanFile(PlanFile):
    """An experiment with gross errors in pairs; the defaults are the published one."""

    photostrip_plan_screening: SchemaNumber = key("Number of this schema: 1")
    name: Words = key("Name of the plan", "screening")
    principal_distance: Annotated[Number, Range(10.0, 1000.0, "mm")] = key(
        "Principal distance", USUAL_PAIR.focal, unit="mm"
    )
    base: Size = key("Photo base", USUAL_PAIR.base, unit="mm")
    width: Size = key("Distance of the side zones from the base", USUAL_PAIR.width, unit="mm")
    zone_points: Annotated[list[Annotated[Whole, Range(0, 100)]], length(ZONES, ZONES)] = key(
        "Points in each of the standard zones 1 to 6", list(USUAL_PAIR.counts)
    )
    zone_reach: NotNegative = key(
        "How far points lie from the middle of their zone, in x and y, at most",
        USUAL_PAIR.scatter,
        unit="mm",
    )
    tilt: Annotated[Number, Range(0.0, 10.0, "deg")] = key("Largest tilt", USUAL_PAIR.tilt, unit="deg")
    relief_percent: Annotated[Number, Range(0.0, 50.0, "%")] = key(
        "Largest relief, up and down, of the flying height", 100 * USUAL_PAIR.relief, unit="%"
    )
    parallax_sigma_um: SigmaUm = key(
        "Standard deviation of a y parallax", MICROMETRES * USUAL_PAIR.parallax_sigma, unit="um"
    )
    models: Annotated[Whole, Range(1, 1000)] = key("Pairs, each with an error", USUAL_SCREENING.models)
    second_errors: Annotated[Whole, Range(0, 1000)] = key(
        "Pairs of them that have a second one", USUAL_SCREENING.second
    )
    error_sizes_um: Annotated[list[Positive], length(1, 20)] = key(
        "Sizes of the errors, each as often as any other",
        [MICROMETRES * size for size in USUAL_SCREENING.sizes],
        unit="um",
    )
    methods: Annotated[list[Annotated[str, choice(*SCREENINGS)]], length(1)] = key(
        "Methods, of `processing.relative.screening`", list(USUAL_SCREENING.methods)
    )
    grubbs_alpha: Fraction = key("Probability of rejecting a good point of a pair", USUAL_SCREENING.grubbs_alpha)
    parallax_limit: Positive = key("Limit of `parallax+grubbs`", USUAL_SCREENING.parallax_limit, unit="mm")
    repetitions: Annotated[Whole, Range(1, 1000)] = key("How often the experiment is made", USUAL_SCREENING.repetitions)
    seed: Annotated[Whole, Range(0, LARGEST_NUMBER)] = key(
        "Number that makes the drawn pairs and errors the same again", USUAL_SCREENING.seed
    )

    def rules(self) -> Refusals:
        if self.second_errors > self.models:
            message = f"{self.second_errors} second errors do not go into {self.models} pairs"
            yield wrong(message, code="range", at="second_errors", expected=f"0 to {self.models}")

    @property
    def spec(self) -> ScreeningSpec:
        layout = PairLayout(
            focal=self.principal_distance,
            base=self.base,
            width=self.width,
            counts=tuple(self.zone_points),
            scatter=self.zone_reach,
            tilt=self.tilt,
            relief=self.relief_percent / 100,
            parallax_sigma=self.parallax_sigma_um / MICROMETRES,
        )
        return ScreeningSpec(
            layout=layout,
            models=self.models,
            second=self.second_errors,
            sizes=tuple(size / MICROMETRES for size in self.error_sizes_um),
            methods=tuple(dict.fromkeys(self.methods)),
            grubbs_alpha=self.grubbs_alpha,
            parallax_limit=self.parallax_limit,
            repetitions=self.repetitions,
            seed=self.seed,
        )


class StepKeys(Section):
    """A step that needs nothing but its table."""

    photostrip_step: SchemaNumber = key("Number of this schema: 1")


class InteriorKeys(StepKeys):
    """The transformation of measured fiducial marks to calibrated ones, mm."""

    transform: Annotated[str, choice("conformal", "affine", "bilinear", "projective")] = key(
        "From measured to photo coordinates: conformal, affine, bilinear, projective", "affine"
    )


class TurnedKeys(StepKeys):
    """A step with rotations."""

    angles: Annotated[str, choice(*STEP_ANGLES)] = key("System of the angles, given and found", STEP_ANGLES[0])


class ChainKeys(TurnedKeys):
    """Elements of pairs handed on along a strip."""


class ScaleKeys(StepKeys):
    """Distances of points in two models."""


class FocalKeys(StepKeys):
    """A step with photos of one camera."""

    principal_distance: Positive = key("Principal distance", unit="mm")


class RefineKeys(FocalKeys):
    """Photo coordinates reduced to the principal point, lens distortion and refraction corrected."""

    principal_point: Pair = key("Principal point", (0.0, 0.0), unit="mm")
    k: Triple = key("Radial distortion k1, k2, k3, from image to ideal coordinates", (0.0, 0.0, 0.0))
    flying_height: Number | None = key("Above sea level; corrects refraction", None, unit="m")
    ground_height: Number = key("Of the terrain, above sea level", 0.0, unit="m")


class RelativeKeys(FocalKeys, TurnedKeys):
    """Two photos oriented relative to each other, and their model."""

    base: Positive = key("Length of the first base", 100.0, unit="unit")
    unit: Words = key("What model coordinates are in", "mm")


class IntersectionKeys(FocalKeys, TurnedKeys):
    """The rays of two photos of known orientation."""

    base: Triple = key("From the left to the right perspective centre", unit="unit")
    left: Triple = key("Angles of the left photo", (0.0, 0.0, 0.0), unit="deg")
    right: Triple = key("Angles of the right photo", (0.0, 0.0, 0.0), unit="deg")
    unit: Words = key("What coordinates are in", "m")
    left_ray: Flag = key("Y of the left ray, as printed, instead of the mean of both", False)  # noqa: FBT003


class StripKeys(RelativeKeys):
    """A strip formed from photos alone."""

    scale_transfer: Annotated[str, choice("least_squares", "distances")] = key(
        "Weights of the pass points: least_squares or distances", "least_squares"
    )


class AbsoluteKeys(TurnedKeys):
    """A model fitted to known points."""

    unit: Words = key("What ground coordinates are in", "m")


class PolynomialKeys(StepKeys):
    """The deformation of a strip along one axis."""

    unit: Words = key("What ground coordinates are in", "m")
    terms: list[Annotated[str, choice(*POWERS)]] = key(f"Of {', '.join(POWERS)}", ["1", "X", "Y"])


class ResectionKeys(FocalKeys, TurnedKeys):
    """One photo oriented on known points."""

    sigma_um: Positive = key("Standard deviation of an image coordinate", 5.0, unit="um")
    unit: Words = key("What ground coordinates are in", "m")


class BundleKeys(ResectionKeys):
    """All photos and points adjusted at once."""

    base: Positive = key("Length of the first base, without control", 100.0, unit="unit")
    control: Words | None = key("Table of given points: point, x_ground, y_ground, z_ground", None)
    control_sigma: Positive = key("Standard deviation of a given coordinate", 0.05, unit="unit")


class PairScalesKeys(StepKeys):
    """Distances of points in two systems."""

    unit: Words = key("What ground coordinates are in", "m")


class FrameKeys(StepKeys):
    """Geodetic coordinates taken into an intermediate frame at their middle."""

    azimuth: Annotated[Number, Range(-360.0, 360.0, "deg")] = key(
        "Of the X axis, clockwise from north", 0.0, unit="deg"
    )
    ellipsoid: Ellipsoid | None = key("Ellipsoid, its semi-axes; default: WGS 84", None)


class CurvatureKeys(StepKeys):
    """The Earth's curvature below plane coordinates, from their middle."""

    radius: Positive = key("Of the Earth, without a latitude", EARTH_RADIUS, unit="m")
    latitude: Annotated[Number, Range(-90.0, 90.0, "deg")] | None = key(
        "Of the strip: the radius of WGS 84 in its azimuth counts", None, unit="deg"
    )
    azimuth: Annotated[Number, Range(-360.0, 360.0, "deg")] = key("Of the strip, clockwise from north", 0.0, unit="deg")

    @property
    def radius_of_strip(self) -> float:
        if self.latitude is None:
            return self.radius
        return float(radius_in_azimuth(np.radians(self.latitude), np.radians(self.azimuth), WGS84))


class ClosedFormKeys(FocalKeys):
    """Errors of points of an oriented model per error of each element, in closed form."""

    control: Words = key("Table of control, given in full: point, x, y from the left nadir, mm at photo scale")
    base: Positive = key("Photo base", unit="mm")
    as_printed: Flag = key("With the misprints of the source", default=False)


class DeformationKeys(StepKeys):
    """The surface that twist and bending of a model make of its heights: x, y in mm at photo scale, dz in metres."""

    sigma: Positive = key("Standard deviation of dz", 0.1, unit="m")
    scale: Positive = key("Denominator of the photo scale")
    base: Positive = key("Photo base", unit="mm")
