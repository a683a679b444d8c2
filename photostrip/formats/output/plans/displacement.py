"""The plan of a survey of displacements as a plain document."""

from __future__ import annotations

import numpy as np

from photostrip.notes import Document
from photostrip.result.numbers import micrometres, rounded, significant
from photostrip.terrestrial.accuracy import PLACES, DisplacementSpec, plan_displacements

DECIMALS = 6  # decimals of metres: displacements are small


def displacement_document(name: str, spec: DisplacementSpec) -> Document:
    """Return the plan of a survey of displacements, a row for each distance and place."""
    rows = []
    distances = np.repeat(spec.distances, len(PLACES)).tolist()
    for distance, each in zip(distances, plan_displacements(spec), strict=True):
        row: Document = {"distance_m": distance, "place": each.place}
        for what, values in (("", each.at), ("sigma_", each.sigma), ("found_", each.found)):
            for axis, value in zip(("x", "y", "z"), rounded(values, DECIMALS), strict=True):
                row[f"{what}{axis}_m"] = value
        rows.append({**row, "worst_found_m": rounded(each.worst, DECIMALS)})
    return {
        "kind": "displacement",
        "name": name,
        "camera": {
            "name": spec.camera.name,
            "principal_distance_mm": significant(spec.camera.principal_distance, 9),
            "format_mm": list(spec.camera.format or ()),
        },
        "stations": 1 if spec.base is None else 2,
        "base_m": spec.base,
        "convergence_deg": rounded(np.degrees(spec.convergence), 6),
        "change_sigma_um": micrometres(spec.sigma),
        "significance": spec.significance,
        "power": spec.power,
        "points": rows,
    }
