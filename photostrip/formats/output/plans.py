"""Plans as plain documents and as tables: what is printed, drawn and written."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.formats.output.csv_text import to_csv
from photostrip.formats.output.plan_strip import along_rows
from photostrip.planning.camera_efficiency import PRINTED_TABLE, ComparedCamera, by_efficiency, compare, source_cameras
from photostrip.planning.element_errors import FREE
from photostrip.planning.model_plan import Forecast, simple_accuracy
from photostrip.result.numbers import GROUND, Document, micrometres, rms, rounded, significant

if TYPE_CHECKING:
    from collections.abc import Sequence

    from photostrip.arrays import Floats

ARCSECONDS = 206264.806
IN_PHOTO = 2  # decimals of mm: places of points


def model_document(name: str, camera: str, forecast: Forecast) -> Document:
    """Return the plan of one model as a document: keys carry units, plan is both coordinates together."""
    spec = forecast.spec
    unit = spec.ground_unit
    shares = forecast.shares()
    together = forecast.sigmas
    adjusted = forecast.adjusted_sigmas
    worst = int(np.argmax(together[:, 2]))
    return {
        "kind": "model",
        "name": name,
        "camera": {"name": camera, "principal_distance_mm": significant(spec.focal, 9)},
        "geometry": {
            "base_mm": rounded(spec.base, 3),
            "width_mm": rounded(spec.width, 3),
            "scale": significant(spec.scale, 9),
            "flying_height_m": rounded(spec.focal * unit, 1),
            "base_m": rounded(spec.base * unit, 1),
        },
        "image_sigma_um": micrometres(spec.image_sigma),
        "parallax_sigma_um": micrometres(spec.parallax_sigma),
        "orientation": {
            "points": len(spec.orientation_points) or 6 * spec.zone_points,
            "sigmas": _element_sigmas(forecast),
        },
        "control": _control(forecast),
        "control_sigma_m": list(spec.control_sigma),
        "points": [
            {
                "x_mm": x,
                "y_mm": y,
                "sigma_x_m": s[0],
                "sigma_y_m": s[1],
                "sigma_plan_m": s[2],
                "sigma_z_m": s[3],
                "adjusted_plan_m": a[2],
                "adjusted_z_m": a[3],
            }
            for (x, y), s, a in zip(
                rounded(forecast.places, IN_PHOTO), _with_plan(together), _with_plan(adjusted), strict=True
            )
        ],
        "sources": [_share(source, values) for source, values in shares.items()],
        "worst": {
            "x_mm": rounded(forecast.places[worst, 0], IN_PHOTO),
            "y_mm": rounded(forecast.places[worst, 1], IN_PHOTO),
            "sigma_plan_m": rounded(np.hypot(*together[worst, :2]), GROUND),
            "sigma_z_m": rounded(together[worst, 2], GROUND),
        },
        "simple": [
            {
                "place": each.place,
                "x_mm": rounded(each.at[0], IN_PHOTO),
                "y_mm": rounded(each.at[1], IN_PHOTO),
                "source_plan_m": rounded(each.source.plan, GROUND),
                "source_z_m": rounded(each.source.height, GROUND),
                "rigorous_plan_m": rounded(each.rigorous.plan, GROUND),
                "rigorous_z_m": rounded(each.rigorous.height, GROUND),
            }
            for each in simple_accuracy(spec)
        ],
    }


def _with_plan(sigmas: Floats) -> list[list[float]]:
    """Give along, across, plan and height of each point, rounded."""
    plan = np.hypot(sigmas[:, 0], sigmas[:, 1])
    rows: list[list[float]] = rounded(np.column_stack([sigmas[:, :2], plan, sigmas[:, 2]]), GROUND)
    return rows


def _element_sigmas(forecast: Forecast) -> list[Document]:
    found = []
    for name, value in zip(FREE, forecast.elements.tolist(), strict=True):
        shift = name == "dbz"
        size = rounded(value * 1000.0, 2) if shift else rounded(value * ARCSECONDS, 2)
        found.append({"element": name, "sigma": size, "unit": "um" if shift else "arcsec"})
    return found


def _control(forecast: Forecast) -> list[Document]:
    rows = zip(forecast.spec.control, _with_plan(forecast.at_control), strict=True)
    return [
        {
            "x_mm": rounded(point.at[0], IN_PHOTO),
            "y_mm": rounded(point.at[1], IN_PHOTO),
            "use": point.use,
            "sigma_plan_m": s[2],
            "sigma_z_m": s[3],
        }
        for point, s in rows
    ]


def _share(source: str, sigmas: Floats) -> Document:
    plan, height = np.hypot(sigmas[:, 0], sigmas[:, 1]), sigmas[:, 2]
    return {
        "source": source,
        "plan_rms_m": rounded(rms(plan), GROUND),
        "plan_max_m": rounded(plan.max(), GROUND),
        "z_rms_m": rounded(rms(height), GROUND),
        "z_max_m": rounded(height.max(), GROUND),
    }


def camera_document(name: str, cameras: Sequence[ComparedCamera], reference: ComparedCamera) -> Document:
    """Return a comparison of cameras as a document, one row for each camera in the order given."""
    order = [camera.name for camera in by_efficiency(cameras)]
    return {
        "kind": "cameras",
        "name": name,
        "reference": reference.name,
        "fewest_photos": order[0],
        "smallest_coefficient": min(cameras, key=lambda camera: camera.coefficient).name,
        "cameras": [{**_camera(camera, reference), "rank": order.index(camera.name) + 1} for camera in cameras],
    }


def _camera(camera: ComparedCamera, reference: ComparedCamera) -> Document:
    beside = compare(camera, reference)
    return {
        "camera": camera.name,
        "principal_distance_mm": significant(camera.focal, 9),
        "sigma_um": micrometres(camera.sigma),
        "base_mm": rounded(camera.base, 3),
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


TABLES = {"model": "points", "cameras": "cameras", "source-table": "cameras"}


def plan_csv(document: Document) -> str:
    """Return the main table of a plan as CSV; its columns are the keys of the document's rows."""
    kind = document["kind"]
    rows = along_rows(document) if kind == "strip" else document[TABLES[kind]]
    return to_csv(list(rows[0]), (row.values() for row in rows))
