"""Computations of a phototheodolite: a file or its keys read, computed, and told as a sheet."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from photostrip.notes import Note
from photostrip.terrestrial import TerrestrialKind

if TYPE_CHECKING:
    from photostrip.project.reading import Reading
    from photostrip.project.terrestrial import AccuracyFile, TheodoliteFile
    from photostrip.sheets.directions import Grid
    from photostrip.sheets.sheet import Sheet
    from photostrip.terrestrial.normal_case import Phototheodolite


class Computed(NamedTuple):
    """What was computed, from which files, with what was to be said of it."""

    sheet: Sheet
    files: Sequence[str]
    notes: Sequence[Note]


def terrestrial(kind: TerrestrialKind, path: Path | None, assignments: Sequence[str]) -> Computed:
    """Compute what a file asks for, or the keys that are set alone."""
    from photostrip.project import terrestrial as keys
    from photostrip.project.reading import read_keys
    from photostrip.project.terrestrial import known_presets, only_camera
    from photostrip.sheets import directions as sheets

    match kind:
        case "displacement":
            return _displacement(path, assignments)
        case "one-station":
            return _one_station(path, assignments)
        case "cameras":
            _, reading = read_keys(keys.CamerasFile, path, assignments)
            known = known_presets(reading)
            reading.findings.stop()
            sheet = sheets.cameras_sheet(known)
        case "directions":
            given, reading = read_keys(keys.DirectionsFile, path, assignments)
            camera, points = only_camera(given.camera, reading), keys.image_points(given, reading)
            sigma = None if given.sigma_um is None else given.sigma_um / 1000
            sheet = sheets.directions_sheet(camera, given.attitude, points.ids, points.values, sigma)
        case "photo":
            asked, reading = read_keys(keys.PhotoFile, path, assignments)
            camera = only_camera(asked.camera, reading)
            points = keys.direction_points(asked, reading, camera)
            sheet = sheets.photo_sheet(camera, asked.attitude, points.ids, points.values)
        case "accuracy":
            needed, reading = read_keys(keys.AccuracyFile, path, assignments)
            camera, grid = _over_photo(needed, reading)
            sigma_mm, printed = needed.sigma_um / 1000, needed.as_printed
            sheet = sheets.accuracy_sheet(camera, needed.ends, sigma_mm, grid, keys.THEODOLITES, as_printed=printed)
        case "theodolite":
            vouched, reading = read_keys(keys.TheodoliteFile, path, assignments)
            camera, grid = _over_photo(vouched, reading)
            sigma = None if vouched.sigma_um is None else vouched.sigma_um / 1000
            sheet = sheets.theodolite_sheet(camera, vouched.attitude, vouched.measured, sigma, grid)
        case "orientation":
            sheet, reading = _orientation(path, assignments)
    return Computed(sheet, reading.files, reading.findings.notes)


def _over_photo(given: AccuracyFile | TheodoliteFile, reading: Reading) -> tuple[Phototheodolite, Grid]:
    """Return the camera, and the grid of a table over its photo."""
    from photostrip.project.terrestrial import MOST_POINTS, AccuracyFile, only_camera
    from photostrip.terrestrial.accuracy import grid

    camera = only_camera(given.camera, reading, whole=True)
    width, height = camera.format or (0.0, 0.0)
    if width * height / given.step**2 > MOST_POINTS:
        message = f"a step of {given.step:g} mm gives more than {MOST_POINTS} points"
        reading.refuse(("step",), message, "range", expected="a larger step")
        reading.findings.stop()
    return camera, grid(
        (width, height), given.step, level=given.both_level if isinstance(given, AccuracyFile) else given.level
    )


def _orientation(path: Path | None, assignments: Sequence[str]) -> tuple[Sheet, Reading]:
    from photostrip.project.reading import read_keys
    from photostrip.project.terrestrial import OrientationFile, only_camera, read_sightings
    from photostrip.sheets.directions import orientation_sheet
    from photostrip.terrestrial.orientation import orient

    given, reading = read_keys(OrientationFile, path, assignments)
    camera, sigma = only_camera(given.camera, reading), given.sigma_um / 1000
    read = partial(read_sightings, unit=given.unit, angles=given.angles, sigma=sigma, theodolite=given.measured)
    found = reading.complete(reading.table(("table",), read))
    oriented = orient(found, camera.principal_distance, camera.principal_point, given.settings)
    return orientation_sheet(camera, found, oriented, given.settings, given.angles), reading


def _one_station(path: Path | None, assignments: Sequence[str]) -> Computed:
    from photostrip.project.reading import read_keys
    from photostrip.project.terrestrial import OneStationFile, only_camera, read_one_station
    from photostrip.sheets.displacements import one_station_sheet
    from photostrip.terrestrial.camera_motion import one_station

    given, reading = read_keys(OneStationFile, path, assignments)
    camera = only_camera(given.camera, reading)
    points = reading.complete(reading.table(("table",), partial(read_one_station, given=given, camera=camera)))
    found = one_station(points, camera.principal_distance, given.attitude.rotation, given.significance)
    sheet = one_station_sheet(points, found, camera, given.attitude, given.significance)
    return Computed(sheet, reading.files, reading.findings.notes)


def _displacement(path: Path | None, assignments: Sequence[str]) -> Computed:
    from photostrip.project.terrestrial import load_survey
    from photostrip.sheets.displacements import displacement_sheet
    from photostrip.terrestrial.monitoring import monitor

    survey = load_survey(path, assignments)
    result = monitor(survey.series, survey.pair, survey.settings)
    return Computed(displacement_sheet(survey, result), survey.files, (*survey.notes, *result.notes))
