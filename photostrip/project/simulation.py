"""Specifications of simulations: the YAML file, its keys, and the places of what is wrong with it.

The keys are the fields of the classes of ``simulation``, whose defaults hold here too. Types are checked
here, values there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from photostrip import camera, simulation
from photostrip.formats.faults import shown, suggestion
from photostrip.project.conversion import distortion_of, semi_axes
from photostrip.project.keys import CRS, UNDULATION, Distortion, Ellipsoid, Unit
from photostrip.project.reading import Reading, read_keys
from photostrip.project.sections import (
    After,
    Axes,
    Before,
    Flag,
    Height,
    Number,
    Pair,
    Positive,
    SchemaNumber,
    Section,
    Triple,
    Whole,
    Words,
    YAxis,
    key,
    wrong,
)

USUAL = simulation.Spec()
USUAL_MODELS = simulation.Models()
USUAL_FILM, USUAL_GNSS, USUAL_ERROR = simulation.Film(), simulation.Gnss(), simulation.GrossError("image")


def _preset(value: str) -> str:
    if value not in simulation.PRESETS:
        expected = f"one of {', '.join(simulation.PRESETS)}"
        fix = suggestion(value, simulation.PRESETS)
        raise wrong(f"`{shown(value)}` is no preset", code="word", expected=expected, fix=fix)
    return value


def _shares(value: object) -> object:
    """Let a single word stand for all points."""
    return {value: "1"} if isinstance(value, str) and value else value


Shares = Annotated[dict[str, Number], Before(_shares)]


class SimulatedCamera(Section):
    """The camera: a preset, and what is different from it."""

    preset: Annotated[Words, After(_preset)] = key("`film` (153 mm, 230 mm) or `digital` (100.5 mm, 6 um)", "film")
    name: Words | None = key("Name of the camera; default: that of the preset", None)
    principal_distance: Positive | None = key("Principal distance", None, unit="mm")
    principal_point: Pair | None = key("Principal point in the system of the image coordinates", None, unit="mm")
    format: Pair | None = key("Width and height of the photo", None, unit="mm")
    pixel_size: Positive | None = key("Size of a pixel", None, unit="mm")
    fiducials: dict[str, Pair] | None = key("Calibrated coordinates of the fiducial marks, by mark", None, unit="mm")
    distortion: Distortion | None = key("Lens distortion, which the images will have exactly", None)


class Ground(Section):
    """Frame and place of the strips."""

    crs: Words = key(f"{CRS}; in `local` the world is flat", USUAL.ground.crs)
    axes: Axes = key("Order of x, y, z in the tables", USUAL.ground.axes)
    height: Height = key("Heights in the tables", USUAL.ground.height)
    geoid_undulation: Number | None = UNDULATION
    ellipsoid: Ellipsoid | None = key("Ellipsoid of `geocentric`; default: WGS 84", None)
    center_deg: Pair = key(
        "Longitude and latitude of the middle of the strips", USUAL.ground.center_deg, unit="degrees"
    )


class Flight(Section):
    """Photos and strips."""

    photos: Whole = key("Photos of each strip", USUAL.flight.photos)
    strips: Whole = key("Parallel strips, each to the left of the one before", USUAL.flight.strips)
    end_lap_percent: Number = key("Overlap of neighbouring photos", USUAL.flight.end_lap_percent, unit="%")
    side_lap_percent: Number = key("Overlap of neighbouring strips", USUAL.flight.side_lap_percent, unit="%")
    scale: Number | None = key("Scale number of the photos; default: 10000", None)
    flying_height: Number | None = key("Height above the mean terrain, instead of `scale`", None, unit="m")
    heading_deg: Number = key("Azimuth of the flight, clockwise from north", USUAL.flight.heading_deg, unit="degrees")
    alternate: Flag = key("Fly every second strip in the opposite direction", USUAL.flight.alternate)
    photo_rotation_deg: Number = key(
        "Turn of the photos' x axis against the flight, counter-clockwise",
        USUAL.flight.photo_rotation_deg,
        unit="degrees",
    )
    attitude_sigma_deg: Triple = key("Scatter of alpha, omega, kappa", USUAL.flight.attitude_sigma_deg, unit="degrees")
    position_sigma: Triple | None = key(
        "Scatter of the cameras along, across, in height; default: 2, 2 and 1 % of the base", None, unit="m"
    )


class Terrain(Section):
    """The ground."""

    height: Number = key("Mean height above the ellipsoid", USUAL.terrain.height, unit="m")
    relief: Number = key("Largest deviation from the plane; 0 is flat", USUAL.terrain.relief, unit="m")
    wavelength: Number | None = key("Mean distance of the hills; default: three bases", None, unit="m")
    slope_percent: Pair = key("Rise along the flight and to its left", USUAL.terrain.slope_percent, unit="%")


class Points(Section):
    """Pass points."""

    rows: Whole = key("Gruber points at the nadir of each photo, side by side", USUAL.points.rows)
    reach_percent: Number = key("Outermost rows, of half the width of the photo", USUAL.points.reach_percent, unit="%")
    scatter_percent: Number = key(
        "Scatter of the Gruber points, of half the zone on three photos", USUAL.points.scatter_percent, unit="%"
    )
    extra_per_model: Whole = key("Further points at random places of each model", USUAL.points.extra_per_model)


class Control(Section):
    """Control and check points."""

    layout: Words = key("`bands`, `corners`, `corners+centre` or `random`, in each strip", USUAL.control.layout)
    bands: Whole = key("Bands across the strip, from the first to the last photo", USUAL.control.bands)
    every: Whole | None = key("Models from band to band, instead of `bands`", None)
    per_band: Whole = key("Points of a band", USUAL.control.per_band)
    count: Whole = key("Control points of a strip in the layout `random`", USUAL.control.count)
    use: Shares = key("`xyz`, `xy` or `z`, or the share of each: {xyz: 0.5, z: 0.5}", USUAL.control.use)
    check: Whole | None = key("Check points; default: ten, or half of the points that are left", None)
    sigma: Triple = key("Stated standard deviations east, north, up", USUAL.control.sigma, unit="m")
    noise: Triple | None = key("Errors added, standard deviations; default: as stated", None, unit="m")
    second_crs: Words | None = key("CRS of a second control file, for points east of the boundary", None)
    boundary_longitude_deg: Number | None = key("Boundary; default: the middle of the strips", None, unit="degrees")


class Image(Section):
    """Measurement of image coordinates."""

    sigma_um: Number = key(
        "Standard deviation of an image coordinate; 0 is free of errors", USUAL.image.sigma_um, unit="um"
    )
    unit: Unit = key("Unit in the tables: `mm`, `um`, `0.1um` or `px`", USUAL.image.unit)
    y_axis: YAxis = key("Direction of y in the tables, `up` or `down`", USUAL.image.y_axis)


class Film(Section):
    """Deformation of the film and its place in the comparator; fiducial marks are measured."""

    scale_ppm: Number = key("Scatter of the scale of each axis", USUAL_FILM.scale_ppm, unit="ppm")
    shear_ppm: Number = key("Scatter of the angle between the axes", USUAL_FILM.shear_ppm, unit="ppm")
    irregular_um: Number = key("Rms of a smooth deformation that is not affine", USUAL_FILM.irregular_um, unit="um")
    rotation_deg: Number = key("Scatter of the turn in the comparator", USUAL_FILM.rotation_deg, unit="degrees")
    offset_mm: Number = key("Scatter of the place in the comparator", USUAL_FILM.offset_mm, unit="mm")


class GrossError(Section):
    """Gross errors of one kind."""

    kind: Words = key("`image`, `control` or `swap`: two points exchanged on a photo")
    count: Whole = key("How many", USUAL_ERROR.count)
    size_um: Number = key("Size in the image", USUAL_ERROR.size_um, unit="um")
    size_m: Number = key("Size of an error of control", USUAL_ERROR.size_m, unit="m")
    photo: Words | None = key("The photo; default: any", None)
    point: Words | None = key("The point; default: any", None)
    axis: Words | None = key("x or y in the image (y up), x, y or z for east, north, up; default: any", None)


class Gnss(Section):
    """Measured positions of the cameras."""

    sigma: Triple = key("Standard deviations east, north, up", USUAL_GNSS.sigma, unit="m")
    use: Flag = key("Name the file in the project", USUAL_GNSS.use)


class Models(Section):
    """Independent models measured on a plotter, in place of image coordinates."""

    sigma_um: Triple = key("Standard deviations of x, y, z of points at model scale", USUAL_MODELS.sigma_um, unit="um")
    center_sigma_um: Triple = key("The same of perspective centres", USUAL_MODELS.center_sigma_um, unit="um")
    scale: Number | None = key("Mean scale number of the models; default: that of the photos", None)
    axes: Words = key("`level`: nearly, turned about the vertical; `any`: lying in any way", USUAL_MODELS.axes)
    hand: Words = key("`right-handed` or `left-handed`", USUAL_MODELS.hand)
    centers: Flag = key("Measure the perspective centres", USUAL_MODELS.centers)


class SimulationFile(Section):
    """A specification: strips of photos to be simulated. Every key has a default."""

    photostrip_simulation: SchemaNumber = key("Number of this schema")
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    name: Words = key("Name of the project", USUAL.name)
    seed: Whole = key("Number that all random numbers come from", USUAL.seed)
    camera: SimulatedCamera = key("Camera", SimulatedCamera())
    ground: Ground = key("Frame and place", Ground())
    flight: Flight = key("Photos and strips", Flight())
    terrain: Terrain = key("The ground", Terrain())
    points: Points = key("Pass points", Points())
    control: Control = key("Control and check points", Control())
    image: Image = key("Measurement of image coordinates", Image())
    film: Film | None = key("Deformed film with measured fiducial marks; default: none", None)
    refraction: Flag = key("Bend the rays in the standard atmosphere", USUAL.refraction)
    gross_errors: list[GrossError] = key("Gross errors", [])
    gnss: Gnss | None = key("Measured positions of the cameras; default: none", None)
    models: Models | None = key("Models measured on a plotter, in place of image coordinates; default: none", None)


@dataclass(frozen=True, eq=False)
class Specification:
    spec: simulation.Spec
    reading: Reading

    def simulate(self) -> simulation.Simulation:
        """Simulate what is specified, or raise all that cannot be simulated, each fault at its place in the file."""
        with self.reading.places():
            return simulation.simulate(self.spec)


def load_specification(path: Path, overrides: Sequence[str] = ()) -> Specification:
    """Read the specification of a simulation, or raise every fault of it."""
    given, reading = read_keys(SimulationFile, path, overrides)
    return Specification(_spec(given), reading)


def _spec(given: SimulationFile) -> simulation.Spec:
    return simulation.Spec(
        **{name: _made(value) for name, value in given if name in simulation.Spec.__dataclass_fields__}
    )


def _made(value: Any) -> Any:  # noqa: ANN401 (any value of a specification)
    """Return a section as what has its name in ``simulation``, with the same fields; values as they are."""
    if isinstance(value, SimulatedCamera):
        return camera_of(value)
    if isinstance(value, Ellipsoid):
        return semi_axes(value)
    if isinstance(value, Section):
        return getattr(simulation, type(value).__name__)(**{name: _made(each) for name, each in value})
    return tuple(map(_made, value)) if isinstance(value, list) else value


def camera_of(given: SimulatedCamera) -> camera.Camera:
    """Return the preset with what is said beside it."""
    changed = {name: value for name, value in given if value is not None and name != "preset"}
    if given.distortion is not None:
        changed["distortion"] = distortion_of(given.distortion)
    return replace(simulation.PRESETS[given.preset], **changed)
