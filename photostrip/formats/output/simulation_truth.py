"""The truth of a simulation as JSON, in the form of a result."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

import numpy as np

from photostrip.arrays import Floats
from photostrip.formats.output.simulation_tables import ground_decimals, on_one_line
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geometry.rotation import angles
from photostrip.notes import Document
from photostrip.result.numbers import ROTATION, rounded
from photostrip.simulation import InjectedError, Simulation

TRUE_STEP = 1e-7  # metres to which the truth is rounded
DEGREE_DECIMALS = 10  # degrees: 2e-12 rad
ANGLE_SYSTEM = "alpha-omega-kappa"


def truth_text(simulation: Simulation, output: GroundFrame) -> str:
    """Write the truth: frame, photos and points in the form of a result, gross errors, seed and specification.

    Each photo, point and error stands on a line of its own.
    """
    blocks = {
        "photos": [on_one_line(each) for each in _photos(simulation, output)],
        "points": [on_one_line(each) for each in _points(simulation, output)],
        "errors": [on_one_line(_error(error, output)) for error in simulation.truth.errors],
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
    lines = [f" {on_one_line(name)}: {on_one_line(value)}" for name, value in head.items()]
    for name, rows in blocks.items():
        inner = ",\n".join(f"  {row}" for row in rows)
        lines.append(f" {on_one_line(name)}: [\n{inner}\n ]" if rows else f" {on_one_line(name)}: []")
    spec = {key: value for key, value in asdict(simulation.spec).items() if key != "models" or value is not None}
    del spec["camera"]["pixel_affinity"]  # which no specification has
    lines.append(f' "spec": {on_one_line(spec)}')
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _directions(output: GroundFrame) -> str:
    """Say between what a rotation turns."""
    if output.kind == "geocentric":
        return "geocentric X, Y, Z"
    return "east, north, up" + ("" if output.kind == "local" else " at the perspective center")


def _photos(simulation: Simulation, output: GroundFrame) -> Iterator[Document]:
    truth = simulation.truth
    xyz = _rounded(output.user_from_internal(truth.centers_ground), ground_decimals(output, TRUE_STEP))
    rotations = rounded(truth.rotations_local.reshape(-1, 9), ROTATION)
    turned = rounded(np.degrees(angles(truth.rotations_local, ANGLE_SYSTEM)), DEGREE_DECIMALS)
    strip_of = {photo: name for name, photos in simulation.strips for photo in photos}
    for photo, center, rotation, values in zip(truth.photo_ids, xyz, rotations, turned, strict=True):
        place = dict(zip("xyz", center, strict=True))
        oriented = {"rotation": rotation, "angles": {"system": ANGLE_SYSTEM, "unit": "deg", "values": values}}
        yield {"id": photo, "strip": strip_of[photo], **place, **oriented}


def _points(simulation: Simulation, output: GroundFrame) -> Iterator[Document]:
    truth, control = simulation.truth, simulation.control
    roles = {
        name: "check" if check else "control" for name, check in zip(control.ids, control.check.tolist(), strict=True)
    }
    xyz = _rounded(output.user_from_internal(truth.ground.xyz), ground_decimals(output, TRUE_STEP))
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
