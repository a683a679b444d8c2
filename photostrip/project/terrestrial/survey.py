"""A terrestrial project, or a table of the normal case alone, read and checked: plain input for the mathematics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import InputError
from photostrip.formats.output.terrestrial_directions import Theodolite
from photostrip.formats.output.terrestrial_displacements import ReportFrame
from photostrip.formats.text.findings import Findings, suggestion
from photostrip.geodesy.frame_spec import GROUND_AXES
from photostrip.notes import Note
from photostrip.project.terrestrial.cameras import listed_cameras, own_presets
from photostrip.project.terrestrial.options import SightingOptions, read_sightings
from photostrip.project.terrestrial.ranges import MILLIMETRES, RADIANS
from photostrip.project.terrestrial.series import Table, Wanted, read_series
from photostrip.project.terrestrial.survey_file import Camera, Measurements, Station, TerrestrialFile
from photostrip.project.yaml.parsing import read_document
from photostrip.project.yaml.reading import Reading
from photostrip.project.yaml.validation import valid_section
from photostrip.terrestrial.monitoring import MonitoringSettings, Series
from photostrip.terrestrial.normal_case import SIDES, Phototheodolite, StereoPair, ground_from_photo, normal_pair
from photostrip.terrestrial.orientation import OrientationSettings, orient

USUAL_SIGMA = 0.005  # mm: of image coordinates of sightings, where the project states none
NORMAL_AXES = ("right", "ahead", "up")


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


def load_survey(path: Path, overrides: Sequence[str] = ()) -> Survey:
    """Read a terrestrial project and its table, or raise every fault of every file."""
    reading = Reading.of(str(path), overrides)
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


def load_normal_case(
    file: str,
    camera: Phototheodolite,
    base: float,
    table: Table,
    stable: Sequence[str],
    settings: MonitoringSettings,
) -> Survey:
    """Read a table of the normal case, without a project file, or raise its faults."""
    findings = Findings()
    centre = np.array([camera.principal_point] * 2)
    series = read_series(file, table, centre, Wanted(stable=tuple(stable)), findings)
    findings.stop()
    if series is None:  # cannot be: stop() raised the reason
        raise InputError(f"{file} cannot be read")
    return Survey(
        name="displacements",
        series=series,
        pair=normal_pair(camera.principal_distance, base),
        settings=settings,
        cameras=(camera, camera),
        frame=ReportFrame(NORMAL_AXES, (0, 1, 2), "year"),
        files=(file,),
        notes=tuple(findings.notes),
    )


def _cameras(given: TerrestrialFile, reading: Reading) -> list[Phototheodolite]:
    """Return the cameras of both stations; fewer when one is at fault."""
    known = own_presets()
    for path, findings in reading.named(("presets",)):
        tree = read_document(path, findings)
        known |= listed_cameras(tree, reading.findings)
    found = {str(name): _camera(str(name), each, known, reading) for name, each in given.cameras.items()}
    result = []
    for side, station in zip(SIDES, (given.stations.left, given.stations.right), strict=True):
        if station.camera in found:
            result += [camera for camera in [found[station.camera]] if camera is not None]
            continue
        message = f"there is no camera `{station.camera}`"
        expected, fix = f"one of {', '.join(found)}", suggestion(station.camera, found)
        reading.refuse(("stations", side, "camera"), message, "unknown-camera", expected=expected, fix=fix)
    return result


def _camera(name: str, given: Camera, known: dict[str, Phototheodolite], reading: Reading) -> Phototheodolite | None:
    """Return a camera: its preset with what is different."""
    if given.preset is not None and given.preset not in known:
        message = f"there is no preset `{given.preset}`"
        expected, fix = f"one of {', '.join(known)}", suggestion(given.preset, known)
        reading.refuse(("cameras", name, "preset"), message, "unknown-camera", expected=expected, fix=fix)
        return None
    base = known[given.preset] if given.preset is not None else Phototheodolite(name, given.principal_distance or 0.0)
    return Phototheodolite(
        name=name,
        principal_distance=given.principal_distance or base.principal_distance,
        principal_point=given.principal_point or base.principal_point,
        format=given.format or base.format,
    )


def _pair(given: TerrestrialFile, cameras: Sequence[Phototheodolite], reading: Reading) -> StereoPair:
    focal = (cameras[0].principal_distance, cameras[1].principal_distance)
    if given.axes is None:
        normal = normal_pair(focal[0], given.base or 0.0)
        return StereoPair(focal, normal.centers, normal.rotations)
    order = [given.axes.index(axis) for axis in GROUND_AXES]
    both = (given.stations.left, given.stations.right)
    centers = np.array([each.position for each in both], float)[:, order]
    rotations = np.array([_rotation(given, side, camera, reading) for side, camera in zip(SIDES, cameras, strict=True)])
    ahead = np.array([each.eccentricity for each in both])
    # the optical axis is the third axis of the photo turned round
    return StereoPair(focal, centers - ahead[:, None] * rotations[:, :, 2], rotations)


def _rotation(given: TerrestrialFile, side: str, camera: Phototheodolite, reading: Reading) -> Floats:
    """Photo to ground of a station, from its angles or from the directions measured there."""
    station: Station = getattr(given.stations, side)
    unit = MILLIMETRES[str(given.measurements.unit)]
    sigma = USUAL_SIGMA if given.measurements.sigma is None else given.measurements.sigma * unit
    wanted = SightingOptions(
        unit=str(given.measurements.unit),
        angles=given.angle_unit,
        sigma=sigma,
        theodolite=Theodolite(station.sigma_arcsec, station.sigma_arcsec, 1),
    )
    sightings = None
    for path, findings in reading.named(("stations", side, "directions")):
        sightings, notes = read_sightings(path, wanted)
        findings.notes.extend(notes)
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
