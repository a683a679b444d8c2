"""Image coordinates in a result: the interior orientation of each photo, and the refined coordinates of all points."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import Document
from photostrip.pipeline.results import Result
from photostrip.result.numbers import EXACT, natural_rank, order_of, significant
from photostrip.result.table import Table
from photostrip.units import MICROMETRES


def fiducials_of(result: Result) -> Document:
    """Return the interior orientation of each photo, and the residuals of its marks; nothing without marks."""
    found = result.interior
    if found is None or not found.photo_ids:
        return {}
    photos = {
        "photo": list(found.photo_ids),
        "transform": list(found.transforms),
        "coefficients": significant(found.photo_from_measured.coefficients, EXACT),
        "sigma0_um": found.sigma0 * MICROMETRES,
        "redundancy": found.redundancy,
        "scale_x": found.scale_x,
        "scale_y": found.scale_y,
        "rotation_deg": np.degrees(found.rotation),
        "shear_deg": np.degrees(found.shear),
        "mirrored": found.mirrored,
        "marks": list(map(len, found.marks)),
    }
    residuals = np.concatenate(found.residuals) * MICROMETRES
    marks = {
        "photo": np.repeat(np.array(found.photo_ids, object), photos["marks"]),
        "mark": [mark for marks in found.marks for mark in marks],
        "vx_um": residuals[:, 0],
        "vy_um": residuals[:, 1],
    }
    return {"fiducials": Table.of("fiducials", photos), "fiducial_marks": Table.of("fiducial_marks", marks)}


def refined_table(result: Result) -> Table:
    """Return the table of refined.csv, photos in flight order and points in natural order; of models there are none.

    The coordinates are those that the adjustment takes, corrected by a
    calibration where a bundle has found one.
    """
    found = result.refined.observations
    place = {photo: number for number, photo in enumerate(p for strip in result.inputs.strips for p in strip.photos)}
    order = np.array([place.get(photo, len(place)) for photo in found.photo_ids], np.intp)
    rows = order_of(order[found.photo], natural_rank(found.point_ids)[found.point])
    sigma: Floats = found.sigma[rows] * MICROMETRES
    columns = {
        "photo": np.array(found.photo_ids, object)[found.photo[rows]],
        "point": np.array(found.point_ids, object)[found.point[rows]],
        "x_mm": found.xy[rows, 0],
        "y_mm": found.xy[rows, 1],
        "sigma_x_um": sigma[:, 0],
        "sigma_y_um": sigma[:, 1],
    }
    return Table.of("refined", columns)
