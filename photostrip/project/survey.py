"""A survey of displacements: its keys; read and checked, plain input for the mathematics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.formats.text.findings import suggestion
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.notes import Note
from photostrip.project.phototheodolites import (
    BASE,
    DEGREES,
    DIRECTION_SIGMA,
    ECCENTRICITY,
    IMAGE_SIGMA,
    MILLIMETRES,
    POSITION,
    RADIANS,
    SIGNIFICANCE,
    TIME,
    CameraOrName,
    known_presets,
    phototheodolite,
)
from photostrip.project.sections import (
    After,
    Axes,
    Before,
    FirstSchema,
    Id,
    Number,
    Positive,
    Section,
    Words,
    YAxis,
    bounded,
    key,
    length,
    one_of,
    rule,
    wrong,
)
from photostrip.project.terrestrial_tables import SightingUnits, Table, Wanted, read_series, read_sightings
from photostrip.project.yaml.reading import Reading, valid_section
from photostrip.terrestrial.accuracy import Theodolite
from photostrip.terrestrial.monitoring import MOVED_CAMERA, MonitoringSettings, Series
from photostrip.terrestrial.normal_case import SIDES, Phototheodolite, StereoPair, ground_from_photo, normal_pair
from photostrip.terrestrial.orientation import OrientationSettings, orient

USUAL = MonitoringSettings()
Coordinate = Annotated[Number, After(bounded(POSITION))]
Three = tuple[Coordinate, Coordinate, Coordinate]
Angle = Annotated[Number, After(bounded(DEGREES))]


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
    position: Three | None = key("Perspective centre in the order of `axes`", None, unit="m")
    directions: Words | None = key(
        "Table `point,x,z,lambda,beta[,sx,sz][,s_lambda,s_beta][,distance]` of correction directions that orient the"
        " photo of the first epoch, instead of the angles",
        None,
    )
    sigma_arcsec: Annotated[Positive, After(bounded(DIRECTION_SIGMA))] = key(
        "Standard deviation of these directions in rows without one", 2.0, unit="arcsec"
    )
    eccentricity: Annotated[Number, After(bounded(ECCENTRICITY))] = key(
        "Perspective centre ahead of `position` on the optical axis, where that is the theodolite's", 0.0, unit="m"
    )
    alpha: Angle | None = key("Azimuth of the optical axis, clockwise from north", None, unit="angle_unit")
    omega: Angle | None = key("Elevation of the optical axis, upwards; default: 0", None, unit="angle_unit")
    kappa: Angle | None = key(
        "Roll, the photo's x axis turning counter-clockwise for the photographer; default: 0", None, unit="angle_unit"
    )

    @rule
    def _is_complete(self) -> None:
        turned = [name for name in ("alpha", "omega", "kappa") if getattr(self, name) is not None]
        if self.directions is not None and turned:
            message = f"`directions` gives the orientation of the photo, and `{turned[0]}` another one"
            raise wrong(message, code="two-keys", at=turned[0], fix="remove one of the two")
        if (self.position is None) != (self.alpha is None and self.directions is None):
            given = "alpha" if self.directions is None else "directions"
            missing, other = ("position", given) if self.position is None else ("alpha", "position")
            message = f"`{other}` is given and `{missing}` is not"
            raise wrong(message, code="missing-key", expected="both, or neither in the normal case")
        if self.position is None and turned:
            raise wrong("angles are given without a position", code="missing-key", expected="position and alpha too")

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
    time: Annotated[Number, After(bounded(TIME))] | None = key("Its time, for rates", None, unit="time_unit")


class Measurements(Section):
    """The table of measurements."""

    coordinates: Words | None = key("Table `epoch,photo,point,x,z[,sx,sz]`, .csv or .csv.gz", None)
    pseudo_parallaxes: Words | None = key(
        "Table `point[,epoch],x,z,p[,q],dx,dz,dx_right[,dz_right][,sigma][,sigma_d]`, .csv or .csv.gz", None
    )
    unit: Annotated[Words, After(one_of("mm", "um"))] = key("Unit of the table: `mm` or `um`")
    z_axis: YAxis = key("Direction of z, `up` or `down`; x grows to the right", "up")
    sigma: Positive | None = key("Standard deviation of a coordinate in rows without one", None, unit="unit")
    sigma_d: Positive | None = key(
        "Standard deviation of a pseudo-parallax in rows without one; default: `sigma`", None, unit="unit"
    )

    @rule
    def _one_table(self) -> None:
        if (self.coordinates is None) == (self.pseudo_parallaxes is None):
            what = "two tables are named" if self.coordinates is not None else "no table is named"
            raise wrong(what, code="missing-key", expected="either `coordinates` or `pseudo_parallaxes`")
        if self.coordinates is not None and self.sigma_d is not None:
            message = "coordinates have no pseudo-parallaxes that could have a standard deviation"
            raise wrong(message, at="sigma_d", fix="remove it; use `sigma`")
        for name, value in (("sigma", self.sigma), ("sigma_d", self.sigma_d)):
            if value is not None and not IMAGE_SIGMA.holds(value * MILLIMETRES[self.unit]):
                message = f"{value:g} {self.unit} is out of range"
                raise wrong(message, code="range", at=name, expected=f"{IMAGE_SIGMA}: is the unit right?")


class Processing(Section):
    """How displacements are tested."""

    significance: Annotated[Number, After(bounded(SIGNIFICANCE))] = key(
        "Probability of calling a point moved that did not move", USUAL.significance
    )
    moved_camera: Annotated[Words, After(one_of(*MOVED_CAMERA))] = key(
        "Turn of a camera that the stable points show: taken out `always`, when significant (`auto`), or `never`",
        USUAL.moved_camera,
    )


class TerrestrialFile(Section):
    """Displacements from photos of two stations."""

    photostrip_terrestrial: FirstSchema = key("Number of this schema: 1")
    extends: Words | None = key("Another file whose keys are taken where this one has none", None)
    name: Words = key("Name of the survey", "displacements")
    presets: Words | None = key("A list of cameras of your own", None)
    cameras: Annotated[dict[Id, CameraOrName], length(1)] = key("Cameras by name")
    stations: Stations | None = key("The two stations; default: the normal case, with the only camera at both", None)
    axes: Annotated[Axes, After(_ground_axes)] | None = key(
        "Order of the coordinates of the stations and of the results: a permutation of east, north, up", None
    )
    angle_unit: Annotated[Words, After(one_of("deg", "gon"))] = key("Unit of alpha, omega, kappa", "deg")
    base: Annotated[Number, After(bounded(BASE))] | None = key(
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

    @rule
    def _one_geometry(self) -> None:
        if self.stations is None and len(self.cameras) > 1:
            raise wrong("nothing says which camera stands where", code="missing-key", expected="`stations`")
        left, right = self.both
        if left.free != right.free:
            side = "right" if left.free else "left"
            raise wrong(
                f"the {side} station has no position", code="missing-key", at="stations", expected="both or none"
            )
        if left.free and self.base is not None:
            raise wrong("the base follows from the positions of the stations", at="base", fix="remove it")
        if not left.free and self.base is None:
            expected = "`base` for the normal case, or position and alpha of both stations"
            raise wrong("nothing says how far apart the stations are", code="missing-key", expected=expected)
        if left.free and self.axes is None:
            expected = "axes: [east, north, up], or [north, east, up] where x points north"
            raise wrong("nothing says which coordinate of a station is east", code="missing-key", expected=expected)
        if not left.free and self.axes is not None:
            raise wrong("the normal case has axes of its own: right, ahead, up", at="axes", fix="remove it")


USUAL_SIGMA = 0.005  # mm: of image coordinates of sightings, where the project states none
NORMAL_AXES = ("right", "ahead", "up")


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
    reading = Reading.of_keys(TerrestrialFile, path, overrides)
    checked = reading.checked(TerrestrialFile)
    cameras = _cameras(checked, reading) if checked is not None else []
    series = _series(checked, reading, cameras)
    given = reading.complete(checked)
    axes = given.axes or NORMAL_AXES
    east, north, up = (GROUND_AXES.index(each) if given.axes else number for number, each in enumerate(axes))
    return Survey(
        name=str(given.name),
        series=reading.complete(series),
        pair=_pair(given, cameras, reading),
        settings=MonitoringSettings(given.processing.significance, str(given.processing.moved_camera)),
        cameras=(cameras[0], cameras[1]),
        frame=ReportFrame(axes, (east, north, up), str(given.time_unit)),
        files=tuple(reading.files),
        notes=tuple(reading.findings.notes),
    )


def _cameras(given: TerrestrialFile, reading: Reading) -> list[Phototheodolite]:
    """Return the cameras of both stations; fewer when one is at fault."""
    known = known_presets(reading)
    found = {
        str(name): phototheodolite(str(name), each, known, reading, ("cameras", str(name)))
        for name, each in given.cameras.items()
    }
    result = []
    for side, station in zip(SIDES, given.both, strict=True):
        if station.camera in found:
            result += [camera for camera in [found[station.camera]] if camera is not None]
            continue
        message = f"there is no camera `{station.camera}`"
        expected, fix = f"one of {', '.join(found)}", suggestion(station.camera, found)
        reading.refuse(("stations", side, "camera"), message, "unknown-camera", expected=expected, fix=fix)
    return result


def _pair(given: TerrestrialFile, cameras: Sequence[Phototheodolite], reading: Reading) -> StereoPair:
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


def _rotation(given: TerrestrialFile, side: str, camera: Phototheodolite, reading: Reading) -> Floats:
    """Photo to ground of a station, from its angles or from the directions measured there."""
    station = given.both[SIDES.index(side)]
    unit = MILLIMETRES[str(given.measurements.unit)]
    sigma = USUAL_SIGMA if given.measurements.sigma is None else given.measurements.sigma * unit
    wanted = SightingUnits(
        unit=str(given.measurements.unit),
        angles=given.angle_unit,
        sigma=sigma,
        theodolite=Theodolite(station.sigma_arcsec, station.sigma_arcsec, 1),
    )
    sightings = None
    for path, findings in reading.named(("stations", side, "directions")):
        sightings = read_sightings(path, wanted, findings)
    reading.findings.stop()
    if sightings is not None:
        settings = OrientationSettings(eccentricity=station.eccentricity)
        return orient(sightings, camera.principal_distance, camera.principal_point, settings).rotation
    scale = RADIANS[given.angle_unit]
    return ground_from_photo(*(scale * (angle or 0.0) for angle in (station.alpha, station.omega, station.kappa)))


def _series(given: TerrestrialFile | None, reading: Reading, cameras: Sequence[Phototheodolite]) -> Series | None:
    """Read the table of measurements, whether or not the rest of the project is right."""
    node = reading.root.find("measurements")
    measured = valid_section(Measurements, node) if node is not None else None
    if measured is None:
        return None
    kind = "coordinates" if measured.coordinates is not None else "pseudo_parallaxes"
    centre = np.array([each.principal_point for each in cameras] if len(cameras) == len(SIDES) else np.zeros((2, 2)))
    table = Table(
        kind=kind,
        unit=str(measured.unit),
        z_axis=measured.z_axis,
        sigma=measured.sigma,
        sigma_d=measured.sigma_d,
    )
    wanted, series = Wanted(), None
    if given is not None:
        epochs = tuple(str(each.id) for each in given.epochs or ())
        wanted = Wanted(epochs, _times(given, reading), tuple(map(str, given.stable)))
    for path, findings in reading.named(("measurements", kind)):
        series = read_series(path, table, centre, wanted, findings)
    return series


def _times(given: TerrestrialFile, reading: Reading) -> tuple[float, ...] | None:
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
