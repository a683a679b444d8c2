"""The plan of a strip as a plain document."""

from __future__ import annotations

import numpy as np

from photostrip.arrays import Floats
from photostrip.notes import Document
from photostrip.planning.ideal_strip import ControlLayout, IdealStrip, Spot, numbers_of
from photostrip.planning.strip_design import BestPlaces, DesignReport, Needed, Outcome, along_the_strip, worst
from photostrip.result.numbers import GROUND, micrometres, rms, rounded, significant

PLACED = 6  # decimals of metres that decide which point is the worst: strips are symmetric


def strip_document(name: str, report: DesignReport) -> Document:
    """Return the plan of a strip: keys carry units, plan is both coordinates, photos and rows count from 1."""
    geometry, design = report.design.geometry, report.design
    spots = {each.layout.name: each.spots for each in report.outcomes}
    return {
        "kind": "strip",
        "name": name,
        "camera": {"name": geometry.camera.name, "principal_distance_mm": geometry.camera.principal_distance},
        "geometry": {
            "photos": geometry.photos,
            "models": geometry.photos - 1,
            "end_lap_percent": geometry.end_lap_percent,
            "scale": significant(geometry.scale, 9),
            "flying_height_m": rounded(report.strip.centers[0, 2], 1),
            "base_m": rounded(geometry.base, 1),
            "rows": geometry.points.rows,
            "points": len(report.strip.xyz),
        },
        "image_sigma_um": micrometres(geometry.image_sigma),
        "required_m": {"plan": design.required.plan, "height": design.required.height},
        "layouts": [_layout(layout, spots[layout.name], report.strip) for layout in design.layouts],
        "accuracy": [_outcome(each, report) for each in report.outcomes],
        "needed": [_needed(each) for each in report.needed],
        "placed": None if report.placed is None else _placed(report.placed),
    }


def _layout(layout: ControlLayout, spots: tuple[Spot, ...], strip: IdealStrip) -> Document:
    numbers = numbers_of(strip, spots)
    return {
        "name": layout.name,
        "sigma_m": list(layout.sigma),
        "gnss_sigma_m": None if layout.gnss is None else list(layout.gnss),
        "gnss_offset": None if layout.gnss is None else layout.gnss_offset,
        "points": [
            {**_spot(spot), "x_m": rounded(strip.xyz[number, 0], 1), "y_m": rounded(strip.xyz[number, 1], 1)}
            for spot, number in zip(spots, numbers, strict=True)
        ],
    }


def _spot(spot: Spot) -> Document:
    return {"photo": spot.photo, "row": spot.row, "use": spot.use}


def _outcome(outcome: Outcome, report: DesignReport) -> Document:
    head = {"layout": outcome.layout.name, "method": outcome.method}
    found = outcome.accuracy
    if found is None or not len(found.new):
        return {**head, "used": None, "reason": outcome.reason or "every point is control"}
    strip, new = report.strip, found.new
    sigmas = found.plan_and_height
    at = [int(new[np.argmax(np.round(sigmas[new, k], PLACED))]) for k in range(2)]
    limits = worst(found)
    return {
        **head,
        "used": found.used,
        "reason": "",
        "rms_plan_m": rounded(rms(sigmas[new, 0]), GROUND),
        "rms_z_m": rounded(rms(sigmas[new, 1]), GROUND),
        "worst_plan_m": rounded(limits[0], GROUND),
        "worst_z_m": rounded(limits[1], GROUND),
        "worst_plan_at": _place(strip, at[0]),
        "worst_z_at": _place(strip, at[1]),
        "meets": report.design.required.met(limits),
        "detectable": [_detectable(*row) for row in zip(outcome.spots, found.detectable, strict=True)],
        "along": [
            {"photo": photo, "plan_m": values[0], "z_m": values[1]}
            for photo, values in enumerate(rounded(along_the_strip(strip, found), GROUND), 1)
        ],
    }


def _place(strip: IdealStrip, number: int) -> Document:
    x, y = strip.xyz[number, :2]
    photo = 1 + int(np.argmin(np.abs(strip.centers[:, 0] - x)))
    return {"photo": photo, "x_m": rounded(x, 1), "y_m": rounded(y, 1)}


def _detectable(spot: Spot, size: Floats) -> Document:
    """Give detectable errors of a control point; JSON has no infinity, so what nothing checks is marked apart."""
    names = ("x_m", "y_m", "z_m")
    checked = [None if np.isnan(value) else bool(np.isfinite(value)) for value in size.tolist()]
    return {**_spot(spot), **dict(zip(names, rounded(size, GROUND), strict=True)), "checked": checked}


def _needed(needed: Needed) -> Document:
    return {
        "method": needed.method,
        "bands": needed.bands,
        "points": needed.points,
        "worst_plan_m": rounded(needed.worst[0], GROUND),
        "worst_z_m": rounded(needed.worst[1], GROUND),
    }


def _placed(placed: BestPlaces) -> Document:
    def pair(values: tuple[float, float]) -> Document:
        return {"plan_m": rounded(values[0], GROUND), "z_m": rounded(values[1], GROUND)}

    return {
        "into": placed.placement.into,
        "method": placed.placement.method,
        "points": [_spot(spot) for spot in placed.spots],
        "worst_before": pair(placed.before),
        "worst_equally_spaced": pair(placed.equal),
        "equally_spaced": [_spot(spot) for spot in placed.equal_spots],
        "worst": pair(placed.found),
        "gain_percent": rounded(100 * placed.gain, 1),
        "layouts_tried": placed.tried,
    }


def along_rows(document: Document) -> list[Document]:
    """Return the standard deviations along the strip as a table."""
    found = [
        {"layout": each["layout"], "method": each["method"], **row}
        for each in document["accuracy"]
        for row in each.get("along", [])
    ]
    return found or [dict.fromkeys(("layout", "method", "photo", "plan_m", "z_m"))]
