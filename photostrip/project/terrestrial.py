"""Files of phototheodolites: cameras, directions, one station, epochs; their keys and tables, and what they mean."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.errors import Fault
from photostrip.formats import terrestrial
from photostrip.formats.faults import Findings, shown, suggestion
from photostrip.formats.tables import Column, Table
from photostrip.formats.terrestrial import DIRECTION_POINTS, IMAGE_POINTS, ONE_STATION, SIGHTINGS, read_points
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.notes import Note, counted, listed
from photostrip.points import locate
from photostrip.project.reading import KeyPath, Node, Reading, checked, parse, read_document, valid_section
from photostrip.project.sections import (
    After,
    Axes,
    Before,
    Flag,
    Id,
    NotNegative,
    Number,
    Pair,
    Positive,
    Range,
    Refusals,
    SchemaNumber,
    Section,
    Whole,
    Words,
    YAxis,
    choice,
    key,
    length,
    wrong,
)
from photostrip.terrestrial.accuracy import Theodolite
from photostrip.terrestrial.camera_motion import OneStation
from photostrip.terrestrial.monitoring import MOVED_CAMERA, MonitoringSettings, Series
from photostrip.terrestrial.normal_case import (
    GIMBAL,
    SIDES,
    Attitude,
    Phototheodolite,
    StereoPair,
    ground_from_photo,
    normal_pair,
    photo_from_directions,
)
from photostrip.terrestrial.orientation import FREE, SCREENINGS, OrientationSettings, Sightings, orient
from photostrip.units import ARCSECONDS

MILLIMETRES = {"mm": 1.0, "um": 1e-3}  # in a unit of image coordinates
RADIANS = {"deg": np.pi / 180, "gon": np.pi / 200}  # in a unit of angles
COORDINATE = Range(-1e4, 1e4, "mm")
IMAGE_SIGMA = Range(1e-6, 10.0, "mm")
IMAGE_SIGMA_UM = Range(1e-3, 1e4, "µm")
DIRECTION_SIGMA = Range(1e-4, 36_000.0, "″")
DEGREES = Range(-1000.0, 1000.0, "deg")
BASE = Range(1e-3, 1e6, "m")
DISTANCE = Range(1e-2, 1e6, "m")
SIGNIFICANCE = Range(1e-6, 0.5)
LIMITS = {  # of the columns of tables
    **dict.fromkeys(("x", "z", "p", "q", "dx", "dz", "dx_right", "dz_right"), COORDINATE),
    **dict.fromkeys(("sx", "sz", "sigma", "sigma_d"), IMAGE_SIGMA),
    **dict.fromkeys(("s_lambda", "s_beta"), DIRECTION_SIGMA),
    **dict.fromkeys(("distance", "distance_later"), DISTANCE),
    "lambda": DEGREES,
}
STEEPEST = np.radians(89.9999)
MOST_POINTS = 20_000  # of a table over the photo
KILOMETRE = 1e6  # mm
JENA = {"Theo 010": 10.0, "Theo 020": 20.0, "Theo 080": 80.0}
# Standard deviations of a horizontal and of a vertical direction in one round, both faces, arcseconds. Those of Carl
# Zeiss Jena have in their names the lateral error in mm at 1 km [Pollmer 1976], the T2 that of an angle in arcseconds,
# which is the difference of two horizontal directions (GOST 10529).
THEODOLITES = {
    **{name: (size / KILOMETRE * ARCSECONDS,) * 2 for name, size in JENA.items()},
    "T2": (2.0 / np.sqrt(2.0), 2.0),
}
USUAL_DIRECTION = 2.0  # arcseconds
USUAL_SIGMA = 0.005  # mm: of image coordinates of sightings, where the project states none
NORMAL_AXES = ("right", "ahead", "up")
REFERENCE, SECOND = "first", "second"  # names of epochs that have none
FEWEST_EPOCHS = 2
USUAL = MonitoringSettings()
OWN_LIST = "phototheodolites.yaml"

Distance = Annotated[Number, Range(1.0, 1e5, "mm")]
Place = tuple[Annotated[Number, COORDINATE], Annotated[Number, COORDINATE]]
Width = Annotated[Number, Range(1.0, 1e4, "mm")]
Metres = Annotated[Number, Range(-1e8, 1e8, "m")]
Step = Annotated[Number, Range(1e-3, 1e5, "mm")]
Ahead = Annotated[Number, Range(-10.0, 10.0, "m")]
Angle = Annotated[Number, DEGREES]
Micrometres = Annotated[Number, IMAGE_SIGMA_UM]
Seconds = Annotated[Number, DIRECTION_SIGMA]
Level = Annotated[Number, SIGNIFICANCE]
Unit = Annotated[str, choice("mm", "um")]
AngleUnit = Annotated[str, choice("deg", "gon")]
SIGMA = "Standard deviation of x, z and the principal distance"


# ------------------------------------------------------------------------------------------------- cameras


class Preset(Section):
    """One camera of a list."""

    principal_distance: Distance = key("Principal distance", unit="mm")
    principal_point: Place = key("Principal point x0, z0 in the system of the image coordinates", (0.0, 0.0), unit="mm")
    format: tuple[Width, Width] | None = key("Width and height of the field of measurement", None, unit="mm")


class PresetFile(Section):
    """A list of cameras."""

    photostrip_cameras: SchemaNumber = key("Number of this schema: 1")
    cameras: Annotated[dict[Id, Preset], length(1)] = key("Cameras by name")


class Camera(Section):
    """One camera: a preset, or its own numbers, or a preset and what is different from it."""

    preset: Words | None = key("Name of a camera of the list that comes with the program, or of `presets`", None)
    principal_distance: Distance | None = key("Principal distance; default: that of the preset", None, unit="mm")
    principal_point: Place | None = key(
        "Principal point x0, z0 in the system of the image coordinates; default: that of the preset, or 0, 0",
        None,
        unit="mm",
    )
    format: tuple[Width, Width] | None = key("Width and height of the field of measurement", None, unit="mm")

    def rules(self) -> Refusals:
        if self.preset is None and self.principal_distance is None:
            expected = "`preset`, or `principal_distance` in mm"
            yield wrong("nothing says what the camera is", code="missing-key", expected=expected)


def _named(value: object) -> object:
    """Let a name stand for a camera of a list."""
    return {"preset": value} if isinstance(value, str) and value else value


CameraOrName = Annotated[Camera, Before(_named)]


def known_presets(reading: Reading | None = None) -> dict[str, Phototheodolite]:
    """Return all cameras that can be named: those of the program, and before them those of the user's list."""
    findings = Findings()
    text = resources.files("photostrip.terrestrial").joinpath(OWN_LIST).read_text(encoding="utf-8")
    known = _listed(parse(text, OWN_LIST, findings), findings)
    if reading is not None:
        root = reading.table(("presets",), read_document)
        known |= _listed(root, reading.findings)
    return known


def _listed(root: Node | None, findings: Findings) -> dict[str, Phototheodolite]:
    """Return the cameras of a list; none when it is at fault."""
    given = checked(PresetFile, root, findings) if root is not None else None
    return {} if given is None else {name: Phototheodolite(name, **dict(each)) for name, each in given.cameras.items()}


def phototheodolite(
    name: str, given: Camera, known: dict[str, Phototheodolite], reading: Reading, path: KeyPath
) -> Phototheodolite | None:
    """Return a camera: its preset with what is different; None where there is no such preset."""
    if given.preset is not None and given.preset not in known:
        message = f"there is no preset `{given.preset}`"
        expected, fix = f"one of {', '.join(known)}", suggestion(given.preset, known)
        reading.refuse((*path, "preset"), message, "unknown-camera", expected=expected, fix=fix)
        return None
    base = known[given.preset] if given.preset is not None else Phototheodolite(name, given.principal_distance or 0.0)
    return Phototheodolite(
        name=name,
        principal_distance=given.principal_distance or base.principal_distance,
        principal_point=given.principal_point or base.principal_point,
        format=given.format or base.format,
    )


def only_camera(given: Camera, reading: Reading, *, whole: bool = False) -> Phototheodolite:
    """Return the camera under the key ``camera``, or raise every fault; `whole`: one that has a format."""
    name = "camera" if given.preset is None else given.preset
    found = phototheodolite(name, given, known_presets(reading), reading, ("camera",))
    if whole and found is not None and found.format is None:
        message = f"the camera {name} has no format"
        reading.refuse(("camera", "format"), message, "no-format", expected="[width, height] in mm")
    return reading.complete(found)


# ------------------------------------------------------------------------------- keys of a single photo


class CamerasFile(Section):
    """Cameras that can be named."""

    photostrip_terrestrial: SchemaNumber = key("Number of this schema: 1")
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    presets: Words | None = key("A list of cameras of your own", None)


class WithCamera(CamerasFile):
    """What all others of one camera have."""

    camera: CameraOrName = key("Camera: its name in a list, or preset, principal_distance, principal_point, format")
    angles: AngleUnit = key("Unit of angles and directions", "deg")


class Turned(Section):
    """Where a camera looks."""

    alpha: Angle = key("Azimuth of the optical axis, clockwise from north", 0.0, unit="angles")
    omega: Angle = key("Elevation of the optical axis, upwards", 0.0, unit="angles")
    kappa: Angle = key("Roll, counter-clockwise for the photographer", 0.0, unit="angles")

    @property
    def level(self) -> bool:
        """Whether the optical axis and the photo's x axis are horizontal."""
        return self.omega == 0 and self.kappa == 0

    def vertical(self, angles: str, at: str = "") -> Refusals:
        """Refuse an attitude that has no azimuth; `angles`: their unit, `at`: above its keys."""
        if abs(np.cos(self.omega * RADIANS[angles])) < GIMBAL:
            message = f"with {self.omega:g} {angles} the camera looks straight up or down, and has no azimuth"
            yield wrong(message, code="range", at=f"{at}omega", expected="an elevation below 90 degrees")

    def attitude_in(self, angles: str) -> Attitude:
        """Return the attitude; `angles`: their unit."""
        unit = RADIANS[angles]
        turned = (self.alpha * unit, self.omega * unit, self.kappa * unit)
        return Attitude(turned, ground_from_photo(*turned), angles)


class Looking(WithCamera, Turned):
    """A camera and where it looks."""

    def rules(self) -> Refusals:
        return self.vertical(self.angles)

    @property
    def attitude(self) -> Attitude:
        return self.attitude_in(self.angles)


class Pointed(Looking):
    """Points of a table, or single ones."""

    table: Words | None = key("Table `point,x,z` or `point,lambda,beta`, .csv or .csv.gz", None)
    at: list[Pair] = key("Points instead of a table: [[x, z]] or [[lambda, beta]]", [])

    def rules(self) -> Refusals:
        if (self.table is None) == (not self.at):
            message = "points are given twice, in `table` and with `at`" if self.at else "no points are given"
            yield wrong(message, code="no-points", expected="`table` or `at`")


class DirectionsFile(Pointed):
    """Image points whose directions are wanted."""

    unit: Unit = key("Unit of image coordinates", "mm")
    sigma_um: Micrometres | None = key(f"{SIGMA}: that of the directions follows", None, unit="um")


class PhotoFile(Pointed):
    """Directions whose image points are wanted."""


class OverPhoto(Looking):
    """A table over the whole photo."""

    step: Step = key("Distance of the points of the table", 20.0, unit="mm")


class AccuracyFile(OverPhoto):
    """How accurately correction directions must be measured, all over the photo."""

    sigma_um: Micrometres = key(SIGMA, 5.0, unit="um")
    as_printed: Flag = key("The formulas as the source prints them; for a level camera", default=False)
    right: Turned | None = key("Where the camera at the right end of the base looks; default: as the left one", None)

    @property
    def both_level(self) -> bool:
        return self.level and (self.right is None or self.right.level)

    @property
    def ends(self) -> list[Attitude]:
        """Attitudes at both ends of the base; one where they are the same."""
        return [self.attitude] if self.right is None else [self.attitude, self.right.attitude_in(self.angles)]

    def rules(self) -> Refusals:
        if self.right is not None:
            yield from self.right.vertical(self.angles, "right.")
        if self.as_printed and not self.both_level:
            message = "the printed formulas hold for a level camera"
            yield wrong(message, code="as-printed", at="as_printed", fix="leave out `omega` and `kappa`")


class Measuring(Section):
    """How well directions are measured."""

    theodolite: Annotated[str, choice(*THEODOLITES)] | None = key(
        f"Theodolite instead of `sigma_arcsec`: {', '.join(THEODOLITES)}", None
    )
    sigma_arcsec: Seconds | None = key(
        "Standard deviation of a direction in one round, both faces", None, unit="arcsec"
    )
    vertical_arcsec: Seconds | None = key("The same of a vertical one; default: as horizontal", None, unit="arcsec")
    rounds: Annotated[Whole, Range(1, 10_000, "rounds")] = key("Rounds measured", 1)

    def rules(self) -> Refusals:
        if self.theodolite is not None and self.sigma_arcsec is not None:
            message = "the theodolite and its standard deviation are both given"
            yield wrong(message, code="two-keys", at="sigma_arcsec", fix="leave out one of them")

    @property
    def measured(self) -> Theodolite:
        usual = self.sigma_arcsec or USUAL_DIRECTION
        horizontal, vertical = (usual, usual) if self.theodolite is None else THEODOLITES[self.theodolite]
        return Theodolite(horizontal, self.vertical_arcsec or vertical, self.rounds)


class TheodoliteFile(OverPhoto, Measuring):
    """Which image accuracy a theodolite can vouch for, all over the photo."""

    sigma_um: Micrometres | None = key("Image accuracy wanted: how many rounds it needs", None, unit="um")

    def rules(self) -> Refusals:
        if self.theodolite is None and self.sigma_arcsec is None:
            message = "nothing says how well directions are measured"
            yield wrong(message, code="no-theodolite", expected="`sigma_arcsec` or `theodolite`")


class OrientationFile(WithCamera, Measuring):
    """A photo oriented by measured directions to points in it."""

    table: Words = key("Table `point,x,z,lambda,beta[,sx,sz][,s_lambda,s_beta][,distance]`, .csv or .csv.gz")
    free: list[Annotated[str, choice(*FREE)]] = key(f"Determined besides the angles: {', '.join(FREE)}", [])
    eccentricity: Ahead = key(
        "Front nodal point ahead of the theodolite's axes; needs the column `distance`", 0.0, unit="m"
    )
    refraction: Annotated[Number, Range(-10.0, 10.0)] = key(
        "Coefficient that computed directions lack; needs the column `distance`", 0.0
    )
    unit: Unit = key("Unit of image coordinates", "mm")
    sigma_um: Micrometres = key("Standard deviation of x and z", 5.0, unit="um")
    screening: Annotated[str, choice(*SCREENINGS)] = key(
        "Test points against the scatter of the others (`deletion`), the `stated` standard deviations, or not (`none`)",
        "deletion",
    )
    significance: Level = key("Probability of rejecting a point of a clean photo", 0.05)

    @property
    def settings(self) -> OrientationSettings:
        return OrientationSettings(
            tuple(self.free), self.screening, self.significance, self.eccentricity, self.refraction
        )


class OneStationFile(Looking):
    """Displacements seen from one station, with known distances of the points."""

    table: Words = key("Table `point,x,z,dx,dz,distance[,distance_later][,sigma][,sigma_d][,sigma_distance]`")
    unit: Unit = key("Unit of image coordinates", "mm")
    sigma_um: Micrometres = key("Standard deviation of x and z", 5.0, unit="um")
    sigma_d_um: Micrometres | None = key("That of dx and dz; default: as of x and z", None, unit="um")
    sigma_distance: NotNegative = key("Standard deviation of a distance", 0.01, unit="m")
    stable: list[Id] = key("Points that did not move", [])
    significance: Level = key("Probability of calling a still point moved", 0.05)


# ----------------------------------------------------------------------------- tables of a single photo


class Points(NamedTuple):
    """Points of a table, or of ``at``, where they are numbered."""

    ids: tuple[str, ...]
    values: Floats  # (n, 2): coordinates x, z in mm, or directions lambda, beta in radians


def refuse_outside(table: Table, unit: str, findings: Findings, angles: str = "deg") -> None:
    """Refuse numbers of a table out of range, in its units of image coordinates and of angles; empty ones count not."""
    for name, usual in LIMITS.items():
        scale, label = (MILLIMETRES[unit], unit) if usual.unit == "mm" else (1.0, angles if usual is DEGREES else "")
        limits, values = usual.scaled(scale, label), table.column(name)  # NaN where there is no such column
        for row in np.flatnonzero(~np.isnan(values) & ~((values >= limits.least) & (values <= limits.most))):
            message = f"{values[row]:g} is out of range"
            findings.add(table.fault(int(row), name, message, "range", expected=str(limits)))


def image_points(given: DirectionsFile, reading: Reading) -> Points:
    """Read image points, or raise every fault."""
    scale = MILLIMETRES[given.unit]
    points, _ = _points(given, reading, IMAGE_POINTS, COORDINATE.scaled(scale, given.unit), given.unit)
    return points._replace(values=points.values * scale)


def direction_points(given: PhotoFile, reading: Reading, camera: Phototheodolite) -> Points:
    """Read directions; refuse what the photo cannot show."""
    points, table = _points(given, reading, DIRECTION_POINTS, DEGREES.scaled(1.0, given.angles), "mm")
    directions = points.values * RADIANS[given.angles]
    steep = np.abs(directions[:, 1]) > STEEPEST
    seen = photo_from_directions(directions, camera.principal_distance, given.attitude.rotation)
    for row in np.flatnonzero(steep | np.isnan(seen).any(axis=1)).tolist():
        column, expected = "lambda", "a direction into the photo"
        message = f"the direction to point {points.ids[row]} is 90 degrees or more from the optical axis"
        if steep[row]:
            column, expected = "beta", "an elevation between -90 and 90 degrees"
            message = f"the direction to point {points.ids[row]} is not below the zenith"
        if table is None:
            reading.refuse(("at", row), message, "range", expected=expected)
        else:
            reading.findings.add(table.fault(row, column, message, "range", expected=expected))
    reading.findings.stop()
    return points._replace(values=directions)


def _points(
    given: Pointed, reading: Reading, layout: Sequence[Column], limits: Range, unit: str
) -> tuple[Points, Table | None]:
    """Read points from one of the two sources, in the unit of the limits."""

    def read(path: str, findings: Findings) -> Table | None:
        table = read_points(path, layout, findings)
        if table is not None:
            refuse_outside(table, unit, findings, given.angles)
        return table

    table = reading.table(("table",), read)
    for row, pair in enumerate(given.at):
        for column, value in enumerate(pair):
            if not limits.holds(value):
                reading.refuse(("at", row, column), f"{value:g} is out of range", "range", expected=str(limits))
    reading.findings.stop()
    if table is not None:
        names = [column.name for column in layout if column.number]
        return Points(tuple(table.cells("point")), table.columns(*names)), table
    return Points(tuple(map(str, range(1, len(given.at) + 1))), np.array(given.at).reshape(-1, 2)), None


def read_sightings(
    file: str, findings: Findings, unit: str, angles: str, sigma: float, theodolite: Theodolite
) -> Sightings | None:
    """Read the points of a photo with their directions ``point,x,z,lambda,beta[,sx,sz][,s_lambda,s_beta][,distance]``.

    Standard deviations are in the unit of the coordinates and in seconds of arc, distances in metres. One of lambda and
    beta may be empty. `sigma` (mm) and `theodolite` hold for rows without their own. None where there are faults.
    """
    read = read_points(file, SIGHTINGS, findings)
    if read is None:
        return None
    scale, ids = MILLIMETRES[unit], tuple(read.cells("point"))
    refuse_outside(read, unit, findings, angles)
    directions = read.columns("lambda", "beta")
    for row in np.flatnonzero(np.isnan(directions).all(axis=1)):
        if not findings.number(file):
            message = f"neither direction to point {ids[row]} is given"
            findings.add(read.fault(int(row), "lambda", message, "no-direction", expected="lambda, beta or both"))
    steep = np.abs(np.nan_to_num(directions[:, 1])) * RADIANS[angles] > STEEPEST
    for row in np.flatnonzero(steep):
        message = f"{directions[row, 1]:g} {angles} is not below the zenith"
        expected = "an elevation between -90 and 90 degrees, not a zenith distance"
        findings.add(read.fault(int(row), "beta", message, "range", expected=expected))
    image, angular = read.columns("sx", "sz") * scale, read.columns("s_lambda", "s_beta")
    usual = np.array([theodolite.horizontal, theodolite.vertical]) / theodolite.rounds**0.5
    return Sightings(
        ids=ids,
        xz=read.columns("x", "z") * scale,
        directions=directions * RADIANS[angles],
        sigma_xz=np.where(np.isnan(image), sigma, image),
        sigma_directions=np.where(np.isnan(angular), usual, angular) / ARCSECONDS,
        distances=read.columns("distance")[:, 0],
    )


def read_one_station(
    file: str, findings: Findings, given: OneStationFile, camera: Phototheodolite
) -> OneStation | None:
    """Read ``point,x,z,dx,dz,distance[,distance_later][,sigma][,sigma_d][,sigma_distance]``; None with faults."""
    read = read_points(file, ONE_STATION, findings)
    if read is None:
        return None
    scale, ids = MILLIMETRES[given.unit], tuple(read.cells("point"))
    refuse_outside(read, given.unit, findings)
    for number, name in enumerate(given.stable):
        if name not in ids:
            message, fix = f"{file} has no point {shown(name)}", suggestion(name, ids)
            findings.add(Fault(message, "unknown-point", key=f"stable[{number}]", fix=fix))
    own = read.columns("sigma", "sigma_d", "sigma_distance") * [scale, scale, 1.0]
    usual = (given.sigma_um / 1000, (given.sigma_d_um or given.sigma_um) / 1000, given.sigma_distance)
    own = np.where(np.isnan(own), usual, own)
    return OneStation(
        points=ids,
        first=read.columns("x", "z") * scale - camera.principal_point,
        change=read.columns("dx", "dz") * scale,
        sigma=own[:, 0],
        sigma_change=own[:, 1],
        distances=read.columns("distance", "distance_later"),
        sigma_distance=own[:, 2],
        stable=np.isin(ids, list(given.stable)),
    )


# ------------------------------------------------------------------------ keys of a survey of two stations


def _short_epoch(value: object) -> object:
    """Let a single word stand for an epoch without a time."""
    return {"id": value} if isinstance(value, str) else value


def _ground_axes(value: tuple[str, str, str]) -> tuple[str, str, str]:
    if sorted(value) != sorted(GROUND_AXES):
        raise wrong("the axes of the stations are not on the ground", expected="a permutation of [east, north, up]")
    return value


class Station(Section):
    """One of the two stations. Position and angles belong together; without them it is the normal case."""

    camera: Id = key("Camera, a key of `cameras`")
    position: tuple[Metres, Metres, Metres] | None = key("Perspective centre in the order of `axes`", None, unit="m")
    directions: Words | None = key(
        "Table `point,x,z,lambda,beta[,sx,sz][,s_lambda,s_beta][,distance]` of correction directions that orient the"
        " photo of the first epoch, instead of the angles",
        None,
    )
    sigma_arcsec: Seconds = key("Standard deviation of these directions in rows without one", 2.0, unit="arcsec")
    eccentricity: Ahead = key(
        "Perspective centre ahead of `position` on the optical axis, where that is the theodolite's", 0.0, unit="m"
    )
    alpha: Angle | None = key("Azimuth of the optical axis, clockwise from north", None, unit="angle_unit")
    omega: Angle | None = key("Elevation of the optical axis, upwards; default: 0", None, unit="angle_unit")
    kappa: Angle | None = key(
        "Roll, the photo's x axis turning counter-clockwise for the photographer; default: 0", None, unit="angle_unit"
    )

    def rules(self) -> Refusals:
        turned = [name for name in ("alpha", "omega", "kappa") if getattr(self, name) is not None]
        if self.directions is not None and turned:
            message = f"`directions` gives the orientation of the photo, and `{turned[0]}` another one"
            yield wrong(message, code="two-keys", at=turned[0], fix="remove one of the two")
        if (self.position is None) != (self.alpha is None and self.directions is None):
            given = "alpha" if self.directions is None else "directions"
            missing, other = ("position", given) if self.position is None else ("alpha", "position")
            message = f"`{other}` is given and `{missing}` is not"
            yield wrong(message, code="missing-key", expected="both, or neither in the normal case")
        if self.position is None and turned:
            yield wrong("angles are given without a position", code="missing-key", expected="position and alpha too")

    @property
    def free(self) -> bool:
        """Whether it has a position and angles of its own."""
        return self.position is not None


class Stations(Section):
    """The two stations."""

    left: Station = key("The left station")
    right: Station = key("The right station")


class Epoch(Section):
    """One epoch."""

    id: Id = key("Id of the epoch, as in the table")
    time: Annotated[Number, Range(-1e9, 1e9)] | None = key("Its time, for rates", None, unit="time_unit")


class Measurements(Section):
    """The table of measurements."""

    coordinates: Words | None = key("Table `epoch,photo,point,x,z[,sx,sz]`, .csv or .csv.gz", None)
    pseudo_parallaxes: Words | None = key(
        "Table `point[,epoch],x,z,p[,q],dx,dz,dx_right[,dz_right][,sigma][,sigma_d]`, .csv or .csv.gz", None
    )
    unit: Unit = key("Unit of the table: `mm` or `um`")
    z_axis: YAxis = key("Direction of z, `up` or `down`; x grows to the right", "up")
    sigma: Positive | None = key("Standard deviation of a coordinate in rows without one", None, unit="unit")
    sigma_d: Positive | None = key(
        "Standard deviation of a pseudo-parallax in rows without one; default: `sigma`", None, unit="unit"
    )

    def rules(self) -> Refusals:
        if (self.coordinates is None) == (self.pseudo_parallaxes is None):
            what = "two tables are named" if self.coordinates is not None else "no table is named"
            yield wrong(what, code="missing-key", expected="either `coordinates` or `pseudo_parallaxes`")
        if self.coordinates is not None and self.sigma_d is not None:
            message = "coordinates have no pseudo-parallaxes that could have a standard deviation"
            yield wrong(message, at="sigma_d", fix="remove it; use `sigma`")
        for name, value in (("sigma", self.sigma), ("sigma_d", self.sigma_d)):
            if value is not None and not IMAGE_SIGMA.holds(value * MILLIMETRES[self.unit]):
                message = f"{value:g} {self.unit} is out of range"
                yield wrong(message, code="range", at=name, expected=f"{IMAGE_SIGMA}: is the unit right?")

    @property
    def scale(self) -> Floats:
        """Factors that bring x and z into millimetres, z up."""
        return MILLIMETRES[self.unit] * np.array([1.0, -1.0 if self.z_axis == "down" else 1.0])


class Processing(Section):
    """How displacements are tested."""

    significance: Level = key("Probability of calling a point moved that did not move", USUAL.significance)
    moved_camera: Annotated[str, choice(*MOVED_CAMERA)] = key(
        "Turn of a camera that the stable points show: taken out `always`, when significant (`auto`), or `never`",
        USUAL.moved_camera,
    )


class DisplacementFile(CamerasFile):
    """Displacements from photos of two stations."""

    name: Words = key("Name of the survey", "displacements")
    cameras: Annotated[dict[Id, CameraOrName], length(1)] = key("Cameras by name")
    stations: Stations | None = key("The two stations; default: the normal case, with the only camera at both", None)
    axes: Annotated[Axes, After(_ground_axes)] | None = key(
        "Order of the coordinates of the stations and of the results: a permutation of east, north, up", None
    )
    angle_unit: AngleUnit = key("Unit of alpha, omega, kappa", "deg")
    base: Annotated[Number, BASE] | None = key(
        "Base of the normal case, instead of positions and angles", None, unit="m"
    )
    epochs: list[Annotated[Epoch, Before(_short_epoch)]] | None = key(
        "Epochs, the first being the reference; default: as they stand in the table", None
    )
    time_unit: Words = key("Unit of the times of the epochs, for rates", "year")
    measurements: Measurements = key("The table of measurements")
    stable: list[Id] = key("Points that are taken not to move", [])
    processing: Processing = key("How displacements are tested", Processing())

    @property
    def both(self) -> tuple[Station, Station]:
        """The left and the right station."""
        if self.stations is None:
            station = Station(camera=next(iter(self.cameras)))
            return station, station
        return self.stations.left, self.stations.right

    def rules(self) -> Refusals:
        if self.stations is None and len(self.cameras) > 1:
            yield wrong("nothing says which camera stands where", code="missing-key", expected="`stations`")
        left, right = self.both
        if left.free != right.free:
            message = f"the {'right' if left.free else 'left'} station has no position"
            yield wrong(message, code="missing-key", at="stations", expected="both or none")
        if left.free and self.base is not None:
            yield wrong("the base follows from the positions of the stations", at="base", fix="remove it")
        if not left.free and self.base is None:
            expected = "`base` for the normal case, or position and alpha of both stations"
            yield wrong("nothing says how far apart the stations are", code="missing-key", expected=expected)
        if left.free and self.axes is None:
            expected = "axes: [east, north, up], or [north, east, up] where x points north"
            yield wrong("nothing says which coordinate of a station is east", code="missing-key", expected=expected)
        if not left.free and self.axes is not None:
            yield wrong("the normal case has axes of its own: right, ahead, up", at="axes", fix="remove it")


class ReportFrame(NamedTuple):
    """Axes and times as the user wants them."""

    axes: tuple[str, str, str]  # names of the ground axes in the user's order
    order: tuple[int, int, int]  # which internal axis each of them is
    time_unit: str


@dataclass(frozen=True, eq=False)
class Survey:
    """What displacements are computed from."""

    name: str
    series: Series
    pair: StereoPair  # stations; ground axes are east, north, up, or right, ahead, up in the normal case
    settings: MonitoringSettings
    cameras: tuple[Phototheodolite, Phototheodolite]
    frame: ReportFrame
    files: tuple[str, ...]
    notes: tuple[Note, ...]


def load_survey(path: Path | None, overrides: Sequence[str] = ()) -> Survey:
    """Read a terrestrial project and its table, or raise every fault of every file."""
    reading = Reading.of(DisplacementFile, path, overrides)
    checked = reading.checked(DisplacementFile)
    cameras = _cameras(checked, reading) if checked is not None else []
    series = _series(checked, reading, cameras)
    given = reading.complete(checked)
    axes = given.axes or NORMAL_AXES
    east, north, up = (GROUND_AXES.index(each) if given.axes else number for number, each in enumerate(axes))
    return Survey(
        name=given.name,
        series=reading.complete(series),
        pair=_pair(given, cameras, reading),
        settings=MonitoringSettings(**dict(given.processing)),
        cameras=(cameras[0], cameras[1]),
        frame=ReportFrame(axes, (east, north, up), given.time_unit),
        files=tuple(reading.files),
        notes=tuple(reading.findings.notes),
    )


def _cameras(given: DisplacementFile, reading: Reading) -> list[Phototheodolite]:
    """Return the cameras of both stations; fewer when one is at fault."""
    known = known_presets(reading)
    found = {
        name: phototheodolite(name, each, known, reading, ("cameras", name)) for name, each in given.cameras.items()
    }
    for side, station in zip(SIDES, given.both, strict=True):
        if station.camera not in found:
            message = f"there is no camera `{station.camera}`"
            expected, fix = f"one of {', '.join(found)}", suggestion(station.camera, found)
            reading.refuse(("stations", side, "camera"), message, "unknown-camera", expected=expected, fix=fix)
    return [camera for station in given.both if (camera := found.get(station.camera)) is not None]


def _pair(given: DisplacementFile, cameras: Sequence[Phototheodolite], reading: Reading) -> StereoPair:
    focal = (cameras[0].principal_distance, cameras[1].principal_distance)
    if given.axes is None:
        normal = normal_pair(focal[0], given.base or 0.0)
        return StereoPair(focal, normal.centers, normal.rotations)
    order = [given.axes.index(axis) for axis in GROUND_AXES]
    centers = np.array([each.position for each in given.both], float)[:, order]
    rotations = np.array([_rotation(given, side, camera, reading) for side, camera in zip(SIDES, cameras, strict=True)])
    ahead = np.array([each.eccentricity for each in given.both])
    # the optical axis is the third axis of the photo turned round
    return StereoPair(focal, centers - ahead[:, None] * rotations[:, :, 2], rotations)


def _rotation(given: DisplacementFile, side: str, camera: Phototheodolite, reading: Reading) -> Floats:
    """Photo to ground of a station, from its angles or from the directions measured there."""
    station, unit = given.both[SIDES.index(side)], given.measurements.unit
    sigma = USUAL_SIGMA if given.measurements.sigma is None else given.measurements.sigma * MILLIMETRES[unit]
    theodolite = Theodolite(station.sigma_arcsec, station.sigma_arcsec, 1)
    wanted = partial(read_sightings, unit=unit, angles=given.angle_unit, sigma=sigma, theodolite=theodolite)
    sightings = reading.table(("stations", side, "directions"), wanted)
    reading.findings.stop()
    if sightings is not None:
        settings = OrientationSettings(eccentricity=station.eccentricity)
        return orient(sightings, camera.principal_distance, camera.principal_point, settings).rotation
    scale = RADIANS[given.angle_unit]
    return ground_from_photo(*(scale * (angle or 0.0) for angle in (station.alpha, station.omega, station.kappa)))


# --------------------------------------------------------------------------------- the table of all epochs


class _Measured(NamedTuple):
    """Coordinates and variances of a ``Series``."""

    coordinates: Floats
    of_epoch: Floats
    shared: Floats


def _series(given: DisplacementFile | None, reading: Reading, cameras: Sequence[Phototheodolite]) -> Series | None:
    """Read the table of measurements, whether or not the rest of the project is right; None when there are faults.

    It is brought into mm, reduced to the principal points, z up.
    """
    node = reading.root.find("measurements")
    measured = None if node is None else valid_section(Measurements, node)
    if measured is None:
        return None
    centre = np.array([each.principal_point for each in cameras] if len(cameras) == len(SIDES) else np.zeros((2, 2)))
    times = None if given is None else _times(given, reading)
    kind = "coordinates" if measured.coordinates is not None else "pseudo_parallaxes"
    read = partial(_read_series, given=given, measured=measured, centre=centre)
    series = reading.table(("measurements", kind), read)
    if series is None or times is None or len(times) != len(series.epochs):
        return series
    return replace(series, times=np.array(times))


def _read_series(
    file: str, findings: Findings, given: DisplacementFile | None, measured: Measurements, centre: Floats
) -> Series | None:
    coordinates = measured.coordinates is not None
    read = (terrestrial.read_coordinates if coordinates else terrestrial.read_pseudo_parallaxes)(file, findings)
    if read is None or findings.number(file):
        return None
    refuse_outside(read.table, measured.unit, findings)
    named = () if given is None else tuple(each.id for each in given.epochs or ())
    epochs = _epochs(read, named, findings, coordinates=coordinates)
    stable = _stable(read, () if given is None else given.stable, findings)
    build = _from_coordinates if coordinates else _from_pseudo_parallaxes
    built = build(read, measured, centre, epochs, findings)
    if findings.number(file) or findings.number("") or built is None:
        return None
    return Series(read.points, epochs, *built, stable=stable)


def _times(given: DisplacementFile, reading: Reading) -> tuple[float, ...] | None:
    """Return the times of the epochs, when they have any."""
    times = [each.time for each in given.epochs or ()]
    if not any(time is not None for time in times):
        return None
    for number, (before, time) in enumerate(zip([None, *times], times, strict=False)):
        if time is None:
            message, fix = "the epoch has no time, others have", "give all epochs a time, or none"
            reading.refuse(("epochs", number), message, "missing-key", fix=fix)
        elif before is not None and time <= before:
            message = f"the time {time:g} is not later than that of the epoch before, {before:g}"
            reading.refuse(("epochs", number, "time"), message, "order", expected="ascending times")
    return tuple(time for time in times if time is not None)


def _epochs(
    read: terrestrial.EpochTable, named: tuple[str, ...], findings: Findings, *, coordinates: bool
) -> tuple[str, ...]:
    """Return the epochs in order, the first being the reference, and refuse those that are not measured.

    named: epochs in the order of the project; none: as they stand in the table.
    """
    known = read.epochs
    if not coordinates:  # the reference epoch has no rows of its own
        later = read.epochs or (named[1:] if len(named) == FEWEST_EPOCHS else (SECOND,))
        known = (*(named[:1] or (REFERENCE,)), *later)
    epochs = named or tuple(dict.fromkeys(known))
    for name, times in Counter(epochs).items():
        if times > 1:
            findings.add(Fault(f"epoch {name} is named {times} times", "duplicate", key="epochs", fix="remove one"))
    if len(epochs) < FEWEST_EPOCHS:
        message = f"has only one epoch, {epochs[0]}" if epochs else "has no epoch"
        file, key = ("", "epochs") if named else (read.table.file, "epoch")
        message = f"the list {message}" if named else message
        findings.add(Fault(message, "one-epoch", file, key=key, expected="two or more"))
    missing = [(number, name) for number, name in enumerate(epochs) if name not in known]
    for number, name in missing:
        near = suggestion(name, [each for each in known if each not in epochs])
        message = f"{read.table.file} has no measurement of epoch {name}"
        fix = near or f"its epochs are {listed(read.epochs)}"
        findings.add(Fault(message, "not-measured", key=f"epochs[{number}]", fix=fix))
    if not coordinates and epochs and epochs[0] in read.epochs:
        row = int(np.flatnonzero(read.epoch == read.epochs.index(epochs[0]))[0])
        message = f"epoch {epochs[0]} is the reference, against which pseudo-parallaxes are measured"
        fix = "name the reference epoch first in `epochs`, and only later epochs in the table"
        findings.add(read.table.fault(row, "epoch", message, "reference-epoch", fix=fix))
    others = [name for name in read.epochs if name not in epochs]
    if others and not missing:
        rows = int(np.isin(read.epoch, [read.epochs.index(name) for name in others]).sum())
        message = (
            f"{read.table.file}: {counted(rows, 'row')} of epochs that the project does not name: {listed(others)}"
        )
        findings.notes.append(Note("epoch-not-used", message))
    return epochs


def _stable(read: terrestrial.EpochTable, stable: Sequence[str], findings: Findings) -> Flags:
    """Mark the points that are taken not to move, and refuse those that are not measured."""
    for number, name in enumerate(stable):
        if name not in read.points:
            message = f"{read.table.file} has no point {name}"
            fix = suggestion(name, read.points) or "correct the id, or remove it"
            findings.add(Fault(message, "not-measured", key=f"stable[{number}]", fix=fix))
    return np.array([name in set(stable) for name in read.points], bool)


def _from_coordinates(
    read: terrestrial.EpochTable, given: Measurements, centre: Floats, epochs: tuple[str, ...], findings: Findings
) -> _Measured | None:
    """Coordinates of each epoch have errors of their own and share none."""
    sigma = _filled(read, ("sx", "sz"), given.sigma, "sigma", findings)
    if sigma is None:
        return None
    number = locate(read.epochs, epochs)[read.epoch]
    rows = np.flatnonzero(number >= 0)
    shape = (len(epochs), len(read.points), len(SIDES), 2)
    coordinates, of_epoch = np.full(shape, np.nan), np.ones(shape)
    where = (number[rows], read.point[rows], read.side[rows])
    coordinates[where] = read.table.columns("x", "z")[rows] * given.scale - centre[read.side[rows]]
    of_epoch[where] = (sigma[rows] * given.scale) ** 2
    flat = (*shape[:2], 4)
    return _Measured(coordinates.reshape(flat), of_epoch.reshape(flat), np.zeros(flat[1:]))


def _from_pseudo_parallaxes(
    read: terrestrial.EpochTable, given: Measurements, centre: Floats, epochs: tuple[str, ...], findings: Findings
) -> _Measured | None:
    """Pseudo-parallaxes have errors of their own; those of the reference photos all epochs share."""
    sigma = _filled(read, ("sigma",), given.sigma, "sigma", findings)
    usual = given.sigma if given.sigma_d is None else given.sigma_d
    sigma_d = _filled(read, ("sigma_d",), usual, "sigma_d", findings)
    reference = terrestrial.reference_values(read, findings)
    if sigma is None or sigma_d is None or findings.number(read.table.file):
        return None
    scale = np.tile(given.scale, 2)
    x, z, p, q = reference.T
    first = np.column_stack([x, z, x - p, z - q]) * scale - centre.ravel()
    names = read.epochs or epochs[1:2] or (SECOND,)
    number = locate(names, epochs)[read.epoch]
    rows = np.flatnonzero(number >= 0)
    shape = (len(epochs), len(read.points), 4)
    coordinates, of_epoch = np.full(shape, np.nan), np.zeros(shape)
    coordinates[0] = first
    change = read.table.columns("dx", "dz", "dx_right", "dz_right")[rows] * scale
    coordinates[number[rows], read.point[rows]] = first[read.point[rows]] + change
    of_epoch[1:] = 1.0
    of_epoch[number[rows], read.point[rows]] = (sigma_d[rows] * scale[0]) ** 2
    shared = np.zeros((len(read.points), 4))
    shared[read.point[::-1]] = (sigma[::-1] * scale[0]) ** 2  # the first row of a point counts
    return _Measured(coordinates, of_epoch, shared)


def _filled(
    read: terrestrial.EpochTable, columns: tuple[str, ...], usual: float | None, key: str, findings: Findings
) -> Floats | None:
    """Give standard deviations row by row, in the unit of the table."""
    sigma = read.table.columns(*columns)
    missing = np.flatnonzero(np.isnan(sigma).any(axis=1))
    if usual is not None:
        return np.where(np.isnan(sigma), usual, sigma)
    if len(missing):
        number = counted(len(missing), "row has no standard deviation", "rows have no standard deviation")
        names = ", ".join(columns)
        message = f"{number} ({names}), and none is given for all"
        fix = f"set `measurements.{key}` in the project, or fill the column {names}"
        findings.add(read.table.fault(int(missing[0]), columns[0], message, "no-sigma", fix=fix))
        return None
    return sigma
