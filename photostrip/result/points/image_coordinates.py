"""Image coordinates in a result: the interior orientation of each photo, and the refined coordinates of all points."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import Document
from photostrip.pipeline.results import Result
from photostrip.result.numbers import EXACT, RoundedColumn, natural_rank, order_of, significant
from photostrip.result.quantities import grouped
from photostrip.result.records import Named, Records
from photostrip.units import MICROMETRES


def fiducials_of(result: Result) -> Document:
    """Return the list ``fiducials`` under its key: the interior orientation of each photo; nothing without marks."""
    found = result.interior
    if found is None or not found.photo_ids:
        return {}
    heads = {
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
    }
    residuals = np.concatenate(found.residuals) * MICROMETRES
    of_marks = {
        "marks": [mark for marks in found.marks for mark in marks],
        "vx_um": residuals[:, 0],
        "vy_um": residuals[:, 1],
    }
    ends = np.cumsum([0, *map(len, found.marks)]).tolist()
    return {"fiducials": list(grouped("fiducials", heads, of_marks, ends))}


def refined_rows(result: Result) -> Records:
    """Return the rows of refined.csv, photos in flight order and points in natural order; of models there are none.

    The coordinates are those that the adjustment takes, corrected by a
    calibration where a bundle has found one.
    """
    found = result.refined.observations
    place = {photo: number for number, photo in enumerate(p for strip in result.inputs.strips for p in strip.photos)}
    order = np.array([place.get(photo, len(place)) for photo in found.photo_ids], np.intp)
    rows = order_of(order[found.photo], natural_rank(found.point_ids)[found.point])
    sigma: Floats = found.sigma[rows] * MICROMETRES
    columns = {
        "photo": Named(found.photo_ids, found.photo[rows]),
        "point": Named(found.point_ids, found.point[rows]),
        "x_mm": RoundedColumn(found.xy[rows, 0]),
        "y_mm": RoundedColumn(found.xy[rows, 1]),
        "sigma_x_um": RoundedColumn(sigma[:, 0]),
        "sigma_y_um": RoundedColumn(sigma[:, 1]),
    }
    return Records(columns)
