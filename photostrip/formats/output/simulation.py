"""A simulation as a project: in memory as the pipeline takes it, and as files that ``photostrip run`` reads.

Files are the same to the byte for the same specification: fixed decimals, no time stamps, points in the order in
which they were placed. Image coordinates are rounded to 0.1 micrometre and ground coordinates to 0.1 millimetre,
those without errors to a thousandth of that or less.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from photostrip.formats.text.findings import counted
from photostrip.geodesy.tying import tie_frames
from photostrip.geometry.rotation import angles
from photostrip.pipeline import Inputs, MeasuredModels, ModelStrip, Settings, Strip
from photostrip.points import PhotoPoints
from photostrip.result.numbers import ROTATION, rounded
from photostrip.triangulation.image_coordinates import corrections

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from photostrip.camera import Camera
    from photostrip.geodesy.frame_spec import FrameSpec
    from photostrip.geodesy.ground_frame import GroundFrame
    from photostrip.points import ModelPoints
    from photostrip.simulate import InjectedError, Simulation

    Floats = NDArray[np.float64]
    Document = dict[str, Any]

IMAGE_STEP, IMAGE_STEP_FREE = 1e-4, 1e-9  # mm to which image coordinates are rounded, with noise and without
GROUND_STEP, GROUND_STEP_FREE = 1e-4, 1e-7  # metres, likewise
TRUE_STEP = 1e-7  # metres to which the truth is rounded
ANGLE_DECIMALS = 10  # degrees: 2e-12 rad
ANGLE_SYSTEM = "alpha-omega-kappa"
MM_PER = {"mm": 1.0, "um": 1e-3, "0.1um": 1e-4}


# ------------------------------------------------------------------------------------------------ in memory


def inputs_of(simulation: Simulation) -> Inputs:
    """Return what a project file and its tables would say of a simulation, without rounding."""
    if simulation.models is not None:
        return _inputs_of_models(simulation, simulation.models)
    return Inputs(
        simulation.spec.name,
        tuple(Strip(name, simulation.camera, photos) for name, photos in simulation.strips),
        simulation.observations,
        simulation.control,
        simulation.frames,
        fiducials=simulation.fiducials,
    )


def _inputs_of_models(simulation: Simulation, points: ModelPoints) -> Inputs:
    """Return the same of a simulation of models; those of left-handed axes are turned over, as a project says it."""
    if simulation.spec.models is not None and simulation.spec.models.hand == "left-handed":
        points = replace(points, xyz=points.xyz * (1.0, -1.0, 1.0))
    flights, first = [], 0
    for name, photos in simulation.strips:
        count = len(photos) - 1
        flights.append(ModelStrip(name, photos, points.model_ids[first : first + count]))
        first += count
    nothing = np.zeros(0, np.intp)
    return Inputs(
        simulation.spec.name,
        (),
        PhotoPoints((), points.point_ids, nothing, nothing, np.zeros((0, 2)), np.zeros((0, 2))),
        simulation.control,
        simulation.frames,
        models=MeasuredModels(tuple(flights), points),
    )


def settings_of(simulation: Simulation) -> Settings:
    """Return the settings that the written project has: defaults, and refraction when it was simulated."""
    return Settings(refinement=corrections.ImageCorrectionSettings(refraction=simulation.spec.refraction))


# ------------------------------------------------------------------------------------------------- as files


def project_files(simulation: Simulation) -> dict[str, str]:
    """Write a simulation as a project.

    Returns
    -------
    dict of str to str
        Content by file name: the tables, ``truth.json``, and ``project.yaml`` last.
    """
    frames, output = tie_frames(simulation.frames)
    files = {}
    if simulation.models is None:
        files["observations.csv"] = _measurements(simulation, simulation.observations, "point")
    else:
        files["models.csv"] = _models(simulation, simulation.models)
    if simulation.fiducials is not None:
        files["fiducials.csv"] = _measurements(simulation, simulation.fiducials, "mark")
    for number, frame in enumerate(frames):
        files[control_file(number)] = _control(simulation, number, frame)
    if simulation.gnss is not None:
        files["gnss.csv"] = _gnss(simulation, simulation.gnss, output)
    files["truth.json"] = truth_text(simulation, output)
    files["project.yaml"] = _project(simulation)
    return files


def control_file(number: int) -> str:
    """Name of a control list: ``control.csv``, ``control_2.csv``."""
    return "control.csv" if number == 0 else f"control_{number + 1}.csv"


def _table(header: str, rows: Iterable[tuple[str, ...]]) -> str:
    return "\n".join([header, *(",".join(row) for row in rows)]) + "\n"


def _fixed(values: Floats, decimals: int | list[int]) -> list[list[str]]:
    """Numbers with fixed decimals, given for all columns or for each; empty where there is none; never -0."""
    places = [decimals] * values.shape[1] if isinstance(decimals, int) else decimals
    columns = []
    for column, count in zip(values.T, places, strict=True):
        cleared = np.round(column, count) + 0.0
        columns.append(["" if math.isnan(value) else f"{value:.{count}f}" for value in cleared.tolist()])
    return [list(row) for row in zip(*columns, strict=True)]


def _decimals(step: float) -> int:
    """Decimals that show a step."""
    return max(0, math.ceil(-math.log10(step) - 1e-9))  # 1e-9: the logarithm of 1e-4 is not exactly -4


def _unit(camera: Camera, unit: str) -> float:
    """Millimetres of a unit of image coordinates."""
    return MM_PER[unit] if camera.pixel_size is None or unit in MM_PER else camera.pixel_size


def _origin(simulation: Simulation) -> str:
    """Where the written image coordinates are zero; empty when the marks decide."""
    image = simulation.spec.image
    if simulation.fiducials is not None:
        return ""
    return "top-left" if image.unit == "px" and image.y_axis == "down" else "center"


def _measurements(simulation: Simulation, measured: PhotoPoints, target: str) -> str:
    """Image coordinates in the unit, direction and origin of the specification."""
    spec = simulation.spec
    unit = _unit(spec.camera, spec.image.unit)
    xy = measured.xy * (1.0, 1.0 if spec.image.y_axis == "up" else -1.0)
    if _origin(simulation) == "top-left":
        xy = xy + np.asarray(spec.format) / 2.0
    step = (IMAGE_STEP if spec.image.sigma_um else IMAGE_STEP_FREE) / unit
    cells = _fixed(xy / unit, _decimals(step))
    photos = [measured.photo_ids[k] for k in measured.photo.tolist()]
    points = [measured.point_ids[k] for k in measured.point.tolist()]
    rows = ((photo, point, *row) for photo, point, row in zip(photos, points, cells, strict=True))
    return _table(f"photo,{target},x,y", rows)


def _models(simulation: Simulation, measured: ModelPoints) -> str:
    """Model coordinates in mm; a centre has the id of its photo."""
    spec = simulation.spec.models
    step = IMAGE_STEP if spec is not None and any(spec.sigma_um) else IMAGE_STEP_FREE
    cells, points = _fixed(measured.xyz, _decimals(step)), len(measured.point_ids)
    models = [measured.model_ids[k] for k in measured.model.tolist()]
    names = [measured.point_ids[k] if k < points else measured.photo_ids[k - points] for k in measured.node.tolist()]
    return _table(
        "model,point,x,y,z", ((model, name, *row) for model, name, row in zip(models, names, cells, strict=True))
    )


def _ground_decimals(frame: GroundFrame, step: float) -> list[int]:
    """Decimals of ground coordinates in the order of the frame's axes, so that they show a step in metres."""
    plan = frame.plan_factor
    if frame.kind == "geographic" and frame.ellipsoid is not None:
        plan *= frame.ellipsoid[0]
    decimals = [_decimals(step / plan), _decimals(step / plan), _decimals(step / frame.height_factor)]
    return [decimals[k] for k in frame.order]


def _control(simulation: Simulation, number: int, frame: GroundFrame) -> str:
    """One control list."""
    control = simulation.control.take(simulation.control.frame == number)
    noise = simulation.spec.control.noise
    step = GROUND_STEP_FREE if noise is not None and not any(noise) else GROUND_STEP
    cells = _fixed(frame.user_from_internal(control.enu), _ground_decimals(frame, step))
    roles = ["check" if check else "control" for check in control.check.tolist()]
    uses = [_use(row) for row in control.use.tolist()]
    rows = (
        (*head, *xyz, use, role) for head, xyz, use, role in zip(_heads(control.ids), cells, uses, roles, strict=True)
    )
    return _table("point,x,y,z,use,role", rows)


def _heads(ids: Iterable[str]) -> Iterator[tuple[str]]:
    return ((name,) for name in ids)


def _use(given: list[bool]) -> str:
    """Word for given coordinates: plan and height, whatever the order of the columns."""
    return ("xy" if given[0] else "") + ("z" if given[2] else "")


def _gnss(simulation: Simulation, positions: Floats, frame: GroundFrame) -> str:
    """Measured perspective centres, with their standard deviations in metres."""
    cells = _fixed(frame.user_from_internal(positions), _ground_decimals(frame, GROUND_STEP))
    gnss = simulation.spec.gnss
    sigma = [f"{gnss.sigma[k]:g}" for k in frame.order] if gnss is not None else []
    rows = ((photo, *xyz, *sigma) for photo, xyz in zip(simulation.truth.photo_ids, cells, strict=True))
    return _table("photo,x,y,z,sx,sy,sz", rows)


# ---------------------------------------------------------------------------------------- the project file


def _project(simulation: Simulation) -> str:
    """Write the project file. Every text stands in quotation marks, as JSON writes it, which YAML reads."""
    spec = simulation.spec
    lines = ["photostrip: 1", f"name: {_flow(spec.name)}"]
    lines += _of_photos(simulation) if simulation.models is None else _of_models(simulation, simulation.models)
    lines += ["control:"]
    for number, frame in enumerate(simulation.frames):
        lines += _listed(control_file(number), frame, spec.control.sigma, "  - ", "    ")
    if spec.gnss is not None and spec.gnss.use:
        lines += ["camera_positions:", *_listed("gnss.csv", simulation.frames[0], spec.gnss.sigma, "  ", "  ")]
    if spec.refraction:
        lines += ["processing:", "  refraction: true"]
    return "\n".join(lines) + "\n"


def _of_models(simulation: Simulation, measured: ModelPoints) -> list[str]:
    """Lines of strips and models."""
    lines = ["strips:"]
    listed, first = simulation.spec.models is not None and not simulation.spec.models.centers, 0
    for name, photos in simulation.strips:
        lines += [f"  - id: {_flow(name)}", f"    photos: {_flow(photos)}"]
        count = len(photos) - 1
        if listed:  # without centres nothing else tells which photos a model shows
            lines += [f"    models: {_flow(measured.model_ids[first : first + count])}"]
        first += count
    lines += ["models:", "  file: models.csv", "  unit: mm"]
    if simulation.spec.models is not None and simulation.spec.models.hand != "right-handed":
        lines += [f"  axes: {simulation.spec.models.hand}"]
    center = measured.node >= len(measured.point_ids)
    for key, rows in (("sigma", ~center), ("center_sigma", center)):
        if rows.any():
            lines += [f"  {key}: {_flow([float(f'{value:.6g}') for value in measured.sigma[rows][0].tolist()])}"]
    return lines


def _of_photos(simulation: Simulation) -> list[str]:
    """Lines of cameras, strips and image coordinates."""
    spec = simulation.spec
    lines = ["cameras:", *_camera(spec.camera), "strips:"]
    for name, photos in simulation.strips:
        lines += [f"  - id: {_flow(name)}", f"    camera: {_flow(spec.camera.name)}", f"    photos: {_flow(photos)}"]
    unit = _unit(spec.camera, spec.image.unit)
    sigma = float(simulation.observations.sigma[0, 0]) / unit
    lines += [
        "observations:",
        "  file: observations.csv",
        f"  unit: {spec.image.unit}",
        f"  y_axis: {spec.image.y_axis}",
    ]
    if origin := _origin(simulation):
        lines += [f"  origin: {origin}"]
    lines += [f"  sigma: {sigma:.6g}"]
    if simulation.fiducials is not None:
        lines += ["fiducial_measurements:", "  file: fiducials.csv"]
    return lines


def _flow(value: object) -> str:
    """Write a text, number or list on one line."""
    return json.dumps(value, ensure_ascii=False)


def _camera(camera: Camera) -> list[str]:
    """Lines of the camera."""
    lines = [
        f"  {_flow(camera.name)}:",
        f"    principal_distance: {camera.principal_distance!r}",
        f"    principal_point: {_flow(camera.principal_point)}",
        f"    format: {_flow(camera.format)}",
    ]
    if camera.pixel_size is not None:
        lines += [f"    pixel_size: {camera.pixel_size!r}"]
    if camera.fiducials:
        lines += ["    fiducials:", *(f"      {_flow(mark)}: {_flow(xy)}" for mark, xy in camera.fiducials.items())]
    if camera.distortion is not None:
        shape = asdict(camera.distortion)
        names = ("k", "p", "b") if camera.distortion.model == "brown" else ("radius", "distortion")
        lines += ["    distortion:", f"      model: {shape['model']}", f"      direction: {shape['direction']}"]
        lines += [f"      {name}: {_flow(shape[name])}" for name in names]
    return lines


def _listed(file: str, frame: FrameSpec, sigma: tuple[float, float, float], first: str, indent: str) -> list[str]:
    """Lines of a list of ground coordinates: its file, its frame, its standard deviations in the order of the axes."""
    names = ("east", "north", "up") if "east" in frame.axes else ("x", "y", "z")
    lines = [f"{first}file: {file}", f"{indent}crs: {_flow(frame.crs)}", f"{indent}axes: [{', '.join(frame.axes)}]"]
    if frame.height != "ellipsoidal":
        lines += [f"{indent}height: {frame.height}"]
    if frame.geoid_undulation is not None:
        lines += [f"{indent}geoid_undulation: {frame.geoid_undulation!r}"]
    if frame.ellipsoid is not None:
        lines += [f"{indent}ellipsoid: {{a: {frame.ellipsoid[0]!r}, b: {frame.ellipsoid[1]!r}}}"]
    return [*lines, f"{indent}sigma: {_flow([sigma[names.index(axis)] for axis in frame.axes])}"]


# ------------------------------------------------------------------------------------------------ the truth


def truth_text(simulation: Simulation, output: GroundFrame) -> str:
    """Write the truth.

    Returns
    -------
    str
        JSON: frame, photos and points in the form of a result, gross errors, seed and specification; one line for
        each photo, point and error.
    """
    blocks = {
        "photos": [_flow(each) for each in _photos(simulation, output)],
        "points": [_flow(each) for each in _points(simulation, output)],
        "errors": [_flow(_error(error, output)) for error in simulation.truth.errors],
    }
    head: Document = {
        "photostrip_truth": 1,
        "name": simulation.spec.name,
        "seed": simulation.spec.seed,
        "frame": {"crs": output.spec.crs, "axes": list(output.axes)},
        "units": {
            "points, photos": f"plan in {output.plan_unit}, heights in {output.height_unit}",
            "rotation": f"rows of the matrix from image axes (x right, y up) to {_directions(output)}",
            "errors": "size_um in the image (x right, y up), size_m on the ground along x, y, z of the frame",
        },
    }
    lines = [f" {_flow(name)}: {_flow(value)}" for name, value in head.items()]
    for name, rows in blocks.items():
        inner = ",\n".join(f"  {row}" for row in rows)
        lines.append(f" {_flow(name)}: [\n{inner}\n ]" if rows else f" {_flow(name)}: []")
    spec = {key: value for key, value in asdict(simulation.spec).items() if key != "models" or value is not None}
    lines.append(f' "spec": {_flow(spec)}')
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _directions(output: GroundFrame) -> str:
    """Say between what a rotation turns."""
    if output.kind == "geocentric":
        return "geocentric X, Y, Z"
    return "east, north, up" + ("" if output.kind == "local" else " at the perspective center")


def _photos(simulation: Simulation, output: GroundFrame) -> Iterator[Document]:
    """List the true exterior orientations."""
    truth = simulation.truth
    xyz = _rounded(output.user_from_internal(truth.centers_ground), _ground_decimals(output, TRUE_STEP))
    rotations = rounded(truth.rotations_local.reshape(-1, 9), ROTATION)
    turned = rounded(np.degrees(angles(truth.rotations_local, ANGLE_SYSTEM)), ANGLE_DECIMALS)
    strip_of = {photo: name for name, photos in simulation.strips for photo in photos}
    for photo, center, rotation, values in zip(truth.photo_ids, xyz, rotations, turned, strict=True):
        place = dict(zip("xyz", center, strict=True))
        oriented = {"rotation": rotation, "angles": {"system": ANGLE_SYSTEM, "unit": "deg", "values": values}}
        yield {"id": photo, "strip": strip_of[photo], **place, **oriented}


def _points(simulation: Simulation, output: GroundFrame) -> Iterator[Document]:
    """List the true coordinates of all points."""
    truth, control = simulation.truth, simulation.control
    roles = {
        name: "check" if check else "control" for name, check in zip(control.ids, control.check.tolist(), strict=True)
    }
    xyz = _rounded(output.user_from_internal(truth.ground.xyz), _ground_decimals(output, TRUE_STEP))
    rays = np.bincount(simulation.observations.point).tolist()
    for name, place, count in zip(truth.ground.ids, xyz, rays, strict=True):
        yield {"id": name, "role": roles.get(name, "new"), **dict(zip("xyz", place, strict=True)), "rays": count}


def _rounded(values: Floats, decimals: list[int]) -> list[list[float]]:
    """Round each column to its own decimals."""
    columns = [rounded(column, count) for column, count in zip(values.T, decimals, strict=True)]
    return [list(row) for row in zip(*columns, strict=True)]


def _error(error: InjectedError, output: GroundFrame) -> Document:
    """One gross error; the axis of a given coordinate as its column in the file."""
    if error.kind == "swap":
        return {"kind": error.kind, "photo": error.photo, "point": error.point, "other": error.other}
    if error.kind == "image":
        size_um = round(error.size * 1000.0, 4)
        return {"kind": "image", "photo": error.photo, "point": error.point, "axis": error.axis, "size_um": size_um}
    axis = "xyz"[output.order.index("xyz".index(error.axis))]
    return {"kind": "control", "point": error.point, "axis": axis, "size_m": round(error.size, 6)}


def _measured_words(simulation: Simulation) -> str:
    """Count what was measured."""
    if simulation.models is None:
        return counted(len(simulation.observations), "image point")
    return f"{counted(len(simulation.models), 'point')} of {counted(len(simulation.models.model_ids), 'model')}"


def summary(simulation: Simulation) -> str:
    """Say in one line what was simulated.

    Returns
    -------
    str
        Counts of strips, photos, points and errors, photo scale and seed.
    """
    spec, control = simulation.spec, simulation.control
    check = int(control.check.sum())
    parts = [
        counted(len(simulation.strips), "strip"),
        counted(len(simulation.truth.photo_ids), "photo"),
        f"scale 1:{spec.scale:.0f}",
        counted(len(simulation.truth.points), "point"),
        _measured_words(simulation),
        counted(len(control) - check, "control point"),
        counted(check, "check point"),
    ]
    if simulation.truth.errors:
        parts.append(counted(len(simulation.truth.errors), "gross error"))
    return ", ".join([*parts, f"seed {spec.seed}"])
