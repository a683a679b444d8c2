"""A comparison of cameras as a plain document."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.notes import Document
from photostrip.planning.camera_efficiency import (
    PRINTED_TABLE,
    ComparedCamera,
    FlownSurvey,
    by_efficiency,
    compare,
    source_cameras,
    suitability,
)
from photostrip.result.numbers import micrometres, rounded, significant


def camera_document(
    name: str, cameras: Sequence[ComparedCamera], reference: ComparedCamera, survey: FlownSurvey | None = None
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


def _survey(cameras: Sequence[ComparedCamera], survey: FlownSurvey, order: Sequence[str]) -> Document:
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
