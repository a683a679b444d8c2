"""The tables of a simulated project: image coordinates, models, control, perspective centres.

Image coordinates are rounded to 0.1 micrometre and ground coordinates to 0.1 millimetre, those without errors to a
thousandth of that or less.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable

import numpy as np

from photostrip.arrays import Floats
from photostrip.camera import Camera
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.points import ModelPoints, PhotoPoints
from photostrip.simulation import Simulation

IMAGE_STEP, IMAGE_STEP_FREE = 1e-4, 1e-9  # mm to which image coordinates are rounded, with noise and without
GROUND_STEP, GROUND_STEP_FREE = 1e-4, 1e-7  # metres, likewise
MM_PER = {"mm": 1.0, "um": 1e-3, "0.1um": 1e-4}


def on_one_line(value: object) -> str:
    """Write a text, number or list on one line, as JSON and as YAML."""
    return json.dumps(value, ensure_ascii=False)


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
    cells = _fixed(xy / unit, _decimals(step))
    photos = [measured.photo_ids[k] for k in measured.photo.tolist()]
    points = [measured.point_ids[k] for k in measured.point.tolist()]
    rows = ((photo, point, *row) for photo, point, row in zip(photos, points, cells, strict=True))
    return _table(f"photo,{target},x,y", rows)


def models_csv(simulation: Simulation, measured: ModelPoints) -> str:
    """Model coordinates in mm; a centre has the id of its photo."""
    spec = simulation.spec.models
    step = IMAGE_STEP if spec is not None and any(spec.sigma_um) else IMAGE_STEP_FREE
    cells, points = _fixed(measured.xyz, _decimals(step)), len(measured.point_ids)
    models = [measured.model_ids[k] for k in measured.model.tolist()]
    names = [measured.point_ids[k] if k < points else measured.photo_ids[k - points] for k in measured.node.tolist()]
    rows = ((model, name, *row) for model, name, row in zip(models, names, cells, strict=True))
    return _table("model,point,x,y,z", rows)


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
    cells = _fixed(frame.user_from_internal(control.enu), ground_decimals(frame, step))
    roles = ["check" if check else "control" for check in control.check.tolist()]
    uses = [_use(row) for row in control.use.tolist()]
    rows = ((name, *xyz, use, role) for name, xyz, use, role in zip(control.ids, cells, uses, roles, strict=True))
    return _table("point,x,y,z,use,role", rows)


def _use(given: list[bool]) -> str:
    """Word for given coordinates: plan and height, whatever the order of the columns."""
    return ("xy" if given[0] else "") + ("z" if given[2] else "")


def gnss_csv(simulation: Simulation, positions: Floats, frame: GroundFrame) -> str:
    """Measured perspective centres, with their standard deviations in metres."""
    cells = _fixed(frame.user_from_internal(positions), ground_decimals(frame, GROUND_STEP))
    gnss = simulation.spec.gnss
    sigma = [f"{gnss.sigma[k]:g}" for k in frame.order] if gnss is not None else []
    rows = ((photo, *xyz, *sigma) for photo, xyz in zip(simulation.truth.photo_ids, cells, strict=True))
    return _table("photo,x,y,z,sx,sy,sz", rows)
