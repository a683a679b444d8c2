"""Plans as plain documents and as tables: what is printed, drawn and written."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.formats.output.csv_text import to_csv
from photostrip.formats.output.plan_strip import along_rows
from photostrip.planning.camera_efficiency import (
    PRINTED_TABLE,
    ComparedCamera,
    Survey,
    by_efficiency,
    compare,
    source_cameras,
    suitability,
)
from photostrip.result.numbers import Document, micrometres, rounded, significant
from photostrip.terrestrial.forecast import PLACES, DisplacementSpec, plan_displacements

SMALL = 6  # decimals of metres: displacements are small

if TYPE_CHECKING:
    from collections.abc import Sequence


def camera_document(
    name: str, cameras: Sequence[ComparedCamera], reference: ComparedCamera, survey: Survey | None = None
) -> Document:
    """Return a comparison of cameras as a document, one row for each camera in the order given."""
    order = [camera.name for camera in by_efficiency(cameras)]
    document: Document = {
        "kind": "cameras",
        "name": name,
        "reference": reference.name,
        "fewest_photos": order[0],
        "smallest_coefficient": min(cameras, key=lambda camera: camera.coefficient).name,
        "cameras": [{**_camera(camera, reference), "rank": order.index(camera.name) + 1} for camera in cameras],
    }
    return document if survey is None else document | _survey(cameras, survey, order)


def _survey(cameras: Sequence[ComparedCamera], survey: Survey, order: Sequence[str]) -> Document:
    """Return what each camera does in one survey, and which of them takes its terrain."""
    terrain = survey.terrain
    rows, suited = [], []
    for camera in cameras:
        flown = survey.flown(camera)
        found = suitability(camera, survey)
        if found.suits:
            suited.append(camera.name)
        rows.append(
            {
                "camera": camera.name,
                "scale": significant(flown.scale, 6),
                "flying_height_m": rounded(flown.flying_height, 1),
                "sigma_z_m": rounded(flown.height_sigma, 4),
                "area_km2": significant(flown.area),
                "sigma_z_per_area_m_km2": significant(flown.height_sigma / flown.area),
                "photos_per_100_km2": rounded(100 / flown.area, 1),
                "largest_relief_m": rounded(found.relief, 1),
                "lap_at_highest_percent": rounded(100 * found.lap, 1),
                "steepest_slope_deg": rounded(np.degrees(found.slope), 2),
                "least_principal_distance_mm": rounded(found.least_focal, 1),
                "suits": found.suits,
            }
        )
    return {
        "survey": rows,
        "terrain": {"relief_m": terrain.relief, "slope_deg": rounded(np.degrees(terrain.slope), 3)},
        "recommended": next((name for name in order if name in suited), None),
    }


def _camera(camera: ComparedCamera, reference: ComparedCamera) -> Document:
    beside = compare(camera, reference)
    return {
        "camera": camera.name,
        "principal_distance_mm": significant(camera.focal, 9),
        "sigma_um": micrometres(camera.sigma),
        "base_mm": rounded(camera.base, 3),
        "useful_width_mm": rounded(camera.width, 3),
        "base_ratio": rounded(camera.focal / camera.base, 4),
        "coefficient_mm2": rounded(camera.coefficient, 4),
        "height_ratio": rounded(camera.height_ratio, 2),
        "scale_ratio": rounded(beside.scale, 4),
        "eta_height": rounded(beside.height_error, 4),
        "eta_area_printed": rounded(beside.printed_area, 4),
        "eta_area": rounded(beside.area, 4),
        "photos_ratio": rounded(beside.photos, 4),
    }


def source_document() -> Document:
    """Return the table of the source, computed again, with the printed numbers in each row."""
    cameras = source_cameras()
    document = camera_document("the table of the source", cameras, cameras[-1])
    for row, printed in zip(document["cameras"], PRINTED_TABLE, strict=True):
        row["printed_coefficient_mm2"] = printed.coefficient
        row["printed_height_ratio"] = printed.height_ratio
        row["printed_eta"] = printed.area
    return document | {"kind": "source-table"}


def displacement_document(name: str, spec: DisplacementSpec) -> Document:
    """Return the plan of a survey of displacements, a row for each distance and place."""
    rows = []
    distances = np.repeat(spec.distances, len(PLACES)).tolist()
    for distance, each in zip(distances, plan_displacements(spec), strict=True):
        row: Document = {"distance_m": distance, "place": each.place}
        for what, values in (("", each.at), ("sigma_", each.sigma), ("found_", each.found)):
            for axis, value in zip(("x", "y", "z"), rounded(values, SMALL), strict=True):
                row[f"{what}{axis}_m"] = value
        rows.append({**row, "worst_found_m": rounded(each.worst, SMALL)})
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


TABLES = {
    "displacement": "points",
    "model": "points",
    "model-source-table": "rows",
    "cameras": "cameras",
    "source-table": "cameras",
}


def plan_csv(document: Document) -> str:
    """Return the main table of a plan as CSV; its columns are the keys of the document's rows."""
    kind = document["kind"]
    rows = along_rows(document) if kind == "strip" else document[TABLES[kind]]
    return to_csv(list(rows[0]), (row.values() for row in rows))
