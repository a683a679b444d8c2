"""The truth of a simulation as JSON, in the form of a result."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from photostrip.arrays import Floats
from photostrip.formats.output.result_json import to_json
from photostrip.formats.output.simulation_tables import ground_decimals
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geometry.rotation import angles
from photostrip.notes import Document
from photostrip.result.numbers import to_decimals
from photostrip.result.quantities import MATRIX
from photostrip.result.table import Table
from photostrip.simulation import InjectedError, Simulation

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
