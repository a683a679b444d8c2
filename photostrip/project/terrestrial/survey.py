"""A terrestrial project, read and checked: plain input for the mathematics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.formats.text.findings import suggestion
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.notes import Note
from photostrip.project.terrestrial.cameras import known_presets, phototheodolite
from photostrip.project.terrestrial.ranges import MILLIMETRES, RADIANS
from photostrip.project.terrestrial.series import Table, Wanted, read_series
from photostrip.project.terrestrial.survey_file import Measurements, TerrestrialFile
from photostrip.project.terrestrial.tables import SightingUnits, read_sightings
from photostrip.project.yaml.reading import Reading, valid_section
from photostrip.terrestrial.accuracy import Theodolite
from photostrip.terrestrial.monitoring import MonitoringSettings, Series
from photostrip.terrestrial.normal_case import SIDES, Phototheodolite, StereoPair, ground_from_photo, normal_pair
from photostrip.terrestrial.orientation import OrientationSettings, orient

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
