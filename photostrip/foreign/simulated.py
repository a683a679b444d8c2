"""A simulation as a project: the files that ``photostrip run`` reads, and the truth in the form of a result.

Files are the same to the byte for the same specification: fixed decimals, no time stamps, points in the order in
which they were placed. Image coordinates are rounded to 0.1 micrometre and ground coordinates to 0.1 millimetre, those
without errors to a thousandth of that or less.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict

import numpy as np

from photostrip.arrays import Floats
from photostrip.camera import Camera
from photostrip.foreign.project import in_project
from photostrip.formats.result_json import to_json
from photostrip.geodesy.frame_spec import CARTESIAN_AXES, GROUND_AXES, FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames
from photostrip.geometry.rotation import angles
from photostrip.notes import Document, counted
from photostrip.number_columns import as_fixed, as_texts, joined, repeated
from photostrip.pipeline.inputs import ModelStrip
from photostrip.points import ModelPoints, PhotoPoints
from photostrip.project.resolved import yaml_text
from photostrip.project.sections import Text
from photostrip.result.numbers import MATRIX, to_decimals
from photostrip.result.table import Table
from photostrip.simulation import InjectedError, Simulation

IMAGE_STEP, IMAGE_STEP_FREE = 1e-4, 1e-9  # mm to which image coordinates are rounded, with noise and without
GROUND_STEP, GROUND_STEP_FREE = 1e-4, 1e-7  # metres, likewise
MM_PER = {"mm": 1.0, "um": 1e-3, "0.1um": 1e-4}


def _table(header: str, ids: Sequence[Sequence[str]], values: Floats, decimals: list[int], *more: Sequence[str]) -> str:
    """Write a table: ids, numbers with the decimals of each column, never -0, empty where there is none; then words."""
    numbers = [as_fixed(to_decimals(column, each), each, "") for column, each in zip(values.T, decimals, strict=True)]
    columns = [*map(as_texts, ids), *numbers, *map(as_texts, more)]
    comma = repeated(",", len(values))
    return f"{header}\n{joined([cells for column in columns for cells in (comma, column)][1:], chr(10))}\n"


def _decimals(step: float) -> int:
    return max(0, math.ceil(-math.log10(step) - 1e-9))  # 1e-9: the logarithm of 1e-4 is not exactly -4


def unit_size(camera: Camera, unit: str) -> float:
    """Millimetres of a unit of image coordinates."""
    return MM_PER[unit] if camera.pixel_size is None or unit in MM_PER else camera.pixel_size


def image_origin(simulation: Simulation) -> str:
    """Where the written image coordinates are zero; empty when the marks decide."""
    image = simulation.spec.image
    if simulation.fiducials is not None:
        return ""
    return "top-left" if image.unit == "px" and image.y_axis == "down" else "center"


def measurements_csv(simulation: Simulation, measured: PhotoPoints, target: str) -> str:
    """Image coordinates in the unit, direction and origin of the specification."""
    spec = simulation.spec
    unit = unit_size(spec.camera, spec.image.unit)
    xy = measured.xy * (1.0, 1.0 if spec.image.y_axis == "up" else -1.0)
    if image_origin(simulation) == "top-left":
        xy = xy + np.asarray(spec.format) / 2.0
    step = (IMAGE_STEP if spec.image.sigma_um else IMAGE_STEP_FREE) / unit
    photos = [measured.photo_ids[k] for k in measured.photo.tolist()]
    points = [measured.point_ids[k] for k in measured.point.tolist()]
    return _table(f"photo,{target},x,y", (photos, points), xy / unit, [_decimals(step)] * 2)


def models_csv(simulation: Simulation, measured: ModelPoints) -> str:
    """Model coordinates in mm; a centre has the id of its photo."""
    spec = simulation.spec.models
    step = IMAGE_STEP if spec is not None and any(spec.sigma_um) else IMAGE_STEP_FREE
    points = len(measured.point_ids)
    models = [measured.model_ids[k] for k in measured.model.tolist()]
    names = [measured.point_ids[k] if k < points else measured.photo_ids[k - points] for k in measured.node.tolist()]
    return _table("model,point,x,y,z", (models, names), measured.xyz, [_decimals(step)] * 3)


def ground_decimals(frame: GroundFrame, step: float) -> list[int]:
    """Decimals of ground coordinates in the order of the frame's axes, so that they show a step in metres."""
    plan = frame.plan_factor
    if frame.kind == "geographic" and frame.ellipsoid is not None:
        plan *= frame.ellipsoid[0]
    decimals = [_decimals(step / plan), _decimals(step / plan), _decimals(step / frame.height_factor)]
    return [decimals[k] for k in frame.order]


def control_csv(simulation: Simulation, number: int, frame: GroundFrame) -> str:
    control = simulation.control.take(simulation.control.frame == number)
    noise = simulation.spec.control.noise
    step = GROUND_STEP_FREE if noise is not None and not any(noise) else GROUND_STEP
    xyz = frame.user_from_internal(control.enu)
    roles = ["check" if check else "control" for check in control.check.tolist()]
    uses = [_use(row) for row in control.use.tolist()]
    return _table("point,x,y,z,use,role", (control.ids,), xyz, ground_decimals(frame, step), uses, roles)


def _use(given: list[bool]) -> str:
    """Word for given coordinates: plan and height, whatever the order of the columns."""
    return ("xy" if given[0] else "") + ("z" if given[2] else "")


def gnss_csv(simulation: Simulation, positions: Floats, frame: GroundFrame) -> str:
    """Measured perspective centres, with their standard deviations in metres."""
    gnss, photos = simulation.spec.gnss, simulation.truth.photo_ids
    sigma = [[f"{gnss.sigma[k]:g}"] * len(photos) for k in frame.order] if gnss is not None else []
    xyz = frame.user_from_internal(positions)
    return _table("photo,x,y,z,sx,sy,sz", (photos,), xyz, ground_decimals(frame, GROUND_STEP), *sigma)


TRUE_STEP = 1e-7  # metres to which the truth is rounded
ANGLE_SYSTEM = "alpha-omega-kappa"


def truth_text(simulation: Simulation, output: GroundFrame) -> str:
    """Write the truth: frame, photos and points in the form of a result, gross errors, seed and specification.

    Photos, points and errors are tables.
    """
    spec = {key: value for key, value in asdict(simulation.spec).items() if key != "models" or value is not None}
    del spec["camera"]["pixel_affinity"]  # which no specification has
    document: Document = {
        "photostrip_truth": 2,
        "name": simulation.spec.name,
        "seed": simulation.spec.seed,
        "frame": {"crs": output.spec.crs, "axes": list(output.axes)},
        "units": {
            "points, photos": f"plan in {output.plan_unit}, heights in {output.height_unit}",
            "r11 to r33": f"rows of the matrix from image axes (x right, y up) to {_directions(output)}",
            "angle_1 to angle_3": f"{ANGLE_SYSTEM}, deg",
            "errors": "size_um in the image (x right, y up), size_m on the ground along x, y, z of the frame",
        },
        "photos": _photos(simulation, output),
        "points": _points(simulation, output),
        "errors": Table.of_rows("truth.errors", (_error(error, output) for error in simulation.truth.errors)),
        "spec": spec,
    }
    return to_json(document)


def _directions(output: GroundFrame) -> str:
    """Say between what a rotation turns."""
    if output.kind == "geocentric":
        return "geocentric X, Y, Z"
    return "east, north, up" + ("" if output.kind == "local" else " at the perspective center")


def _photos(simulation: Simulation, output: GroundFrame) -> Table:
    truth = simulation.truth
    strip_of = {photo: name for name, photos in simulation.strips for photo in photos}
    turned = np.degrees(angles(truth.rotations_local, ANGLE_SYSTEM))
    columns = {
        "id": list(truth.photo_ids),
        "strip": [strip_of[photo] for photo in truth.photo_ids],
        **_places(output, truth.centers_ground),
        **dict(zip(MATRIX, truth.rotations_local.reshape(-1, 9).T, strict=True)),
        **{f"angle_{k}": column for k, column in enumerate(turned.T, 1)},
    }
    return Table.of("truth.photos", columns)


def _points(simulation: Simulation, output: GroundFrame) -> Table:
    truth, control = simulation.truth, simulation.control
    roles = {
        name: "check" if check else "control" for name, check in zip(control.ids, control.check.tolist(), strict=True)
    }
    columns = {
        "id": list(truth.ground.ids),
        "role": [roles.get(name, "new") for name in truth.ground.ids],
        **_places(output, truth.ground.xyz),
        "rays": np.bincount(simulation.observations.point),
    }
    return Table.of("truth.points", columns)


def _places(output: GroundFrame, xyz: Floats) -> dict[str, Floats]:
    """Return columns of coordinates, each rounded to its own decimals."""
    decimals = ground_decimals(output, TRUE_STEP)
    columns = zip("xyz", output.user_from_internal(xyz).T, decimals, strict=True)
    return {axis: to_decimals(column, count) for axis, column, count in columns}


def _error(error: InjectedError, output: GroundFrame) -> Document:
    """One gross error; the axis of a given coordinate as its column in the file."""
    row: Document = dict.fromkeys(("kind", "photo", "point", "other", "axis", "size_um", "size_m"))
    row |= {"kind": error.kind, "point": error.point}
    if error.kind == "swap":
        return row | {"photo": error.photo, "other": error.other}
    if error.kind == "image":
        return row | {"photo": error.photo, "axis": error.axis, "size_um": error.size * 1000.0}
    return row | {"axis": "xyz"[output.order.index("xyz".index(error.axis))], "size_m": error.size}


def project_files(simulation: Simulation) -> dict[str, str]:
    """Write a simulation as a project: content by file name, the tables, ``truth.json``, ``project.yaml`` last."""
    frames, output = tie_frames(simulation.frames)
    files = {}
    if simulation.models is None:
        files["observations.csv"] = measurements_csv(simulation, simulation.observations, "point")
    else:
        files["models.csv"] = models_csv(simulation, simulation.models)
    if simulation.fiducials is not None:
        files["fiducials.csv"] = measurements_csv(simulation, simulation.fiducials, "mark")
    for number, frame in enumerate(frames):
        files[control_file(number)] = control_csv(simulation, number, frame)
    if simulation.gnss is not None:
        files["gnss.csv"] = gnss_csv(simulation, simulation.gnss, output)
    files["truth.json"] = truth_text(simulation, output)
    files["project.yaml"] = _project(simulation)
    return files


def model_strips(simulation: Simulation, points: ModelPoints) -> Iterator[ModelStrip]:
    """Name the strips of models as a project does, one for each strip of photos."""
    first = 0
    for name, photos in simulation.strips:
        end = first + len(photos) - 1
        yield ModelStrip(name, photos, points.model_ids[first:end])
        first = end


def control_file(number: int) -> str:
    """Name of a control list: ``control.csv``, ``control_2.csv``."""
    return "control.csv" if number == 0 else f"control_{number + 1}.csv"


def _project(simulation: Simulation) -> str:
    spec, frames = simulation.spec, simulation.frames
    lists = enumerate(frames)
    project: Document = {
        "photostrip": 1,
        "name": Text(spec.name),
        **(_of_photos(simulation) if simulation.models is None else _of_models(simulation, simulation.models)),
        "control": [_listed(control_file(number), frame, spec.control.sigma) for number, frame in lists],
    }
    if spec.gnss is not None and spec.gnss.use:
        project["camera_positions"] = _listed("gnss.csv", frames[0], spec.gnss.sigma)
    if spec.refraction:
        project["processing"] = {"refraction": True}
    return yaml_text(project)


def _of_models(simulation: Simulation, measured: ModelPoints) -> Document:
    spec, center = simulation.spec.models, measured.node >= len(measured.point_ids)
    # without centres nothing else tells which photos a model shows
    listed = spec is not None and not spec.centers
    strips = [
        {"id": Text(strip.id), "photos": _texts(strip.photos)} | ({"models": _texts(strip.models)} if listed else {})
        for strip in model_strips(simulation, measured)
    ]
    models: Document = {"file": "models.csv", "unit": "mm"}
    if spec is not None and spec.hand != "right-handed":
        models["axes"] = spec.hand
    for key, rows in (("sigma", ~center), ("center_sigma", center)):
        if rows.any():
            models[key] = [float(f"{value:.6g}") for value in measured.sigma[rows][0].tolist()]
    return {"strips": strips, "models": models}


def _of_photos(simulation: Simulation) -> Document:
    """Return cameras, strips and image coordinates."""
    spec, origin, camera = simulation.spec, image_origin(simulation), Text(simulation.spec.camera.name)
    sigma = float(simulation.observations.sigma[0, 0]) / unit_size(spec.camera, spec.image.unit)
    observations = {"file": "observations.csv", "unit": spec.image.unit, "y_axis": spec.image.y_axis}
    of_marks = {} if simulation.fiducials is None else {"fiducial_measurements": {"file": "fiducials.csv"}}
    return {
        "cameras": {camera: in_project(spec.camera)},
        "strips": [
            {"id": Text(name), "camera": camera, "photos": _texts(photos)} for name, photos in simulation.strips
        ],
        "observations": observations | ({"origin": origin} if origin else {}) | {"sigma": float(f"{sigma:.6g}")},
        **of_marks,
    }


def _texts(names: Iterable[str]) -> list[Text]:
    return list(map(Text, names))


def _listed(file: str, frame: FrameSpec, sigma: tuple[float, float, float]) -> Document:
    """Return a list of ground coordinates: its file, its frame, its standard deviations in the order of the axes."""
    names = GROUND_AXES if "east" in frame.axes else CARTESIAN_AXES
    found: Document = {"file": file, "crs": Text(frame.crs), "axes": list(frame.axes)}
    if frame.height != "ellipsoidal":
        found["height"] = frame.height
    if frame.geoid_undulation is not None:
        found["geoid_undulation"] = frame.geoid_undulation
    if frame.ellipsoid is not None:
        found["ellipsoid"] = dict(zip("ab", frame.ellipsoid, strict=True))
    return found | {"sigma": [sigma[names.index(axis)] for axis in frame.axes]}


def summary(simulation: Simulation) -> str:
    """Say in one line what was simulated: counts of strips, photos, points and errors, photo scale and seed."""
    spec, control, models = simulation.spec, simulation.control, simulation.models
    check = int(control.check.sum())
    measured = (
        counted(len(simulation.observations), "image point")
        if models is None
        else f"{counted(len(models), 'point')} of {counted(len(models.model_ids), 'model')}"
    )
    parts = [
        counted(len(simulation.strips), "strip"),
        counted(len(simulation.truth.photo_ids), "photo"),
        f"scale 1:{spec.scale:.0f}",
        counted(len(simulation.truth.points), "point"),
        measured,
        counted(len(control) - check, "control point"),
        counted(check, "check point"),
    ]
    if simulation.truth.errors:
        parts.append(counted(len(simulation.truth.errors), "gross error"))
    return ", ".join([*parts, f"seed {spec.seed}"])
