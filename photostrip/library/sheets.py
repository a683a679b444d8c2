"""Sheets: expected accuracy before any photo is taken or measured, computations of a phototheodolite."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NamedTuple

from photostrip.errors import Fault, InputError
from photostrip.library.project import assignments_of, place_of, reading_from
from photostrip.notes import Document, Note
from photostrip.planning import PlanKind
from photostrip.planning.model_plan import both_forms, given_errors, plan_model
from photostrip.planning.screening import screening_experiment
from photostrip.planning.strip_design import plan_strip
from photostrip.project import plans
from photostrip.project import terrestrial as keys
from photostrip.project.reading import Reading, read_keys
from photostrip.project.simulation import camera_of
from photostrip.sheets import directions, displacements
from photostrip.sheets.model_plan import model_sheet
from photostrip.sheets.plans import camera_sheet, displacement_sheet, screening_sheet
from photostrip.sheets.sheet import Sheet
from photostrip.sheets.strip_plan import strip_sheet
from photostrip.terrestrial import TerrestrialKind
from photostrip.terrestrial.accuracy import grid
from photostrip.terrestrial.camera_motion import one_station
from photostrip.terrestrial.monitoring import monitor
from photostrip.terrestrial.normal_case import Phototheodolite
from photostrip.terrestrial.orientation import orient


class Plan:
    """What a plan lets expect."""

    def __init__(self, sheet: Sheet, files: Sequence[str] = ()) -> None:
        self.sheet = sheet
        self.files = tuple(files)
        """Every file that was read."""

    @property
    def document(self) -> Document:
        """What ``photostrip plan --format json`` prints."""
        return self.sheet.document()

    def report(self, form: Literal["text", "md"] = "text") -> str:
        """Return the plan as text or Markdown."""
        return self.sheet.rendered(form)

    def __repr__(self) -> str:
        """Return the report: a plan is small."""
        return self.report()


def plan(
    kind: PlanKind,
    specification: str | PathLike[str] | Mapping[str, Any] | None = None,
    **overrides: Any,  # noqa: ANN401 (values of a plan)
) -> Plan:
    """Compute a plan, as ``photostrip plan model``, ``strip``, ``camera``, ``displacement`` or ``screening`` does.

    specification: a file, or its content as a mapping; without one the overrides say all.
    overrides: keys with other values: ``plan("model", end_lap_percent=70, control={"layout": "six"})``.
    Raises InputError with every fault of the plan.
    """
    path, source, rest = None, None, dict[str, Any](overrides)
    if specification is not None:
        schema = f"photostrip_plan_{'cameras' if kind == 'camera' else kind}"
        path, source, rest = place_of(specification, "specification", overrides, schema)
    with reading_from(source):
        return planned(kind, path, assignments_of(rest))


def planned(kind: str, path: Path | None, assignments: Sequence[str]) -> Plan:
    """Read a plan from its file, or from assignments to its keys alone, and compute it."""
    match kind:
        case "model":
            model, reading = read_keys(plans.ModelPlanFile, path, assignments)
            spec, printed, name = model.spec, model.closed_form == "printed", camera_of(model.camera).name
            forms = None if model.closed_form == "no" else both_forms(spec)
            forecast, errors = plan_model(spec), given_errors(spec)
            return Plan(model_sheet(model.name, name, forecast, errors, forms, printed=printed), reading.files)
        case "strip":
            strip, reading = read_keys(plans.StripPlanFile, path, assignments)
            with reading.places(plans.SIMULATED):
                report = plan_strip(strip.design)
            return Plan(strip_sheet(strip.name, report), reading.files)
        case "camera":
            if path is None:
                raise InputError(Fault("no cameras are given", "plan-cameras", fix="name a YAML file"))
            cameras, reading = read_keys(plans.CameraPlanFile, path, assignments)
            compared = cameras.compared
            reference = next((each for each in compared if each.name == cameras.reference), compared[-1])
            return Plan(camera_sheet(cameras.name, compared, reference, cameras.survey), reading.files)
        case "displacement":
            survey, reading = read_keys(plans.DisplacementPlanFile, path, assignments)
            return Plan(displacement_sheet(survey.name, survey.spec(reading)), reading.files)
        case "screening":
            tried, reading = read_keys(plans.ScreeningPlanFile, path, assignments)
            return Plan(screening_sheet(tried.name, screening_experiment(tried.spec)), reading.files)
    message = f"there is no plan {kind!r}: model, strip, camera, displacement or screening"
    raise ValueError(message)


class Computed(NamedTuple):
    """What was computed, from which files, with what was to be said of it."""

    sheet: Sheet
    files: Sequence[str]
    notes: Sequence[Note]


def terrestrial(kind: TerrestrialKind, path: Path | None, assignments: Sequence[str]) -> Computed:
    """Compute what a file asks for, or the keys that are set alone."""
    match kind:
        case "displacement":
            survey = keys.load_survey(path, assignments)
            result = monitor(survey.series, survey.pair, survey.settings)
            sheet = displacements.displacement_sheet(survey, result)
            return Computed(sheet, survey.files, (*survey.notes, *result.notes))
        case "cameras":
            _, reading = read_keys(keys.CamerasFile, path, assignments)
            known = keys.known_presets(reading)
            reading.findings.stop()
            sheet = directions.cameras_sheet(known)
        case "directions":
            given, reading = read_keys(keys.DirectionsFile, path, assignments)
            camera, points = keys.only_camera(given.camera, reading), keys.image_points(given, reading)
            sheet = directions.directions_sheet(camera, given.attitude, points.ids, points.values, _mm(given.sigma_um))
        case "photo":
            asked, reading = read_keys(keys.PhotoFile, path, assignments)
            camera = keys.only_camera(asked.camera, reading)
            points = keys.direction_points(asked, reading, camera)
            sheet = directions.photo_sheet(camera, asked.attitude, points.ids, points.values)
        case "accuracy":
            needed, reading = read_keys(keys.AccuracyFile, path, assignments)
            camera, over = _over_photo(needed, reading, level=needed.both_level)
            sigma, printed = needed.sigma_um / 1000, needed.as_printed
            sheet = directions.accuracy_sheet(camera, needed.ends, sigma, over, keys.THEODOLITES, as_printed=printed)
        case "theodolite":
            vouched, reading = read_keys(keys.TheodoliteFile, path, assignments)
            camera, over = _over_photo(vouched, reading, level=vouched.level)
            wanted = _mm(vouched.sigma_um)
            sheet = directions.theodolite_sheet(camera, vouched.attitude, vouched.measured, wanted, over)
        case "orientation":
            sheet, reading = _orientation(path, assignments)
        case "one-station":
            sheet, reading = _one_station(path, assignments)
    return Computed(sheet, reading.files, reading.findings.notes)


def _mm(micrometres: float | None) -> float | None:
    return None if micrometres is None else micrometres / 1000


def _over_photo(
    given: keys.AccuracyFile | keys.TheodoliteFile, reading: Reading, *, level: bool
) -> tuple[Phototheodolite, directions.Grid]:
    """Return the camera, and the grid of a table over its photo."""
    camera = keys.only_camera(given.camera, reading, whole=True)
    width, height = camera.format or (0.0, 0.0)
    if width * height / given.step**2 > keys.MOST_POINTS:
        message = f"a step of {given.step:g} mm gives more than {keys.MOST_POINTS} points"
        reading.refuse(("step",), message, "range", expected="a larger step")
        reading.findings.stop()
    return camera, grid((width, height), given.step, level=level)


def _orientation(path: Path | None, assignments: Sequence[str]) -> tuple[Sheet, Reading]:
    given, reading = read_keys(keys.OrientationFile, path, assignments)
    camera, sigma = keys.only_camera(given.camera, reading), given.sigma_um / 1000
    read = partial(keys.read_sightings, unit=given.unit, angles=given.angles, sigma=sigma, theodolite=given.measured)
    measured = reading.complete(reading.table(("table",), read))
    oriented = orient(measured, camera.principal_distance, camera.principal_point, given.settings)
    return directions.orientation_sheet(camera, measured, oriented, given.settings, given.angles), reading


def _one_station(path: Path | None, assignments: Sequence[str]) -> tuple[Sheet, Reading]:
    given, reading = read_keys(keys.OneStationFile, path, assignments)
    camera = keys.only_camera(given.camera, reading)
    points = reading.complete(reading.table(("table",), partial(keys.read_one_station, given=given, camera=camera)))
    moved = one_station(points, camera.principal_distance, given.attitude.rotation, given.significance)
    return displacements.one_station_sheet(points, moved, camera, given.attitude, given.significance), reading
