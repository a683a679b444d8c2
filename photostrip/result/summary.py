"""A result in a few numbers: counts, sigma0, what is left at control and at check points, tolerances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from photostrip.result.adjustment import models
from photostrip.result.adjustment.bundle import image_fit
from photostrip.result.adjustment.pairs import Parallaxes, rejected_by_strip, sigma0
from photostrip.result.adjustment.strips import AXES
from photostrip.result.numbers import GROUND, Document, Plain, micrometres, rms, rounded
from photostrip.result.points.ground import of_used
from photostrip.result.quantities import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.pipeline import Result
    from photostrip.result.points.ground import Differences

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

# Name of a tolerance in the project file: where its value stands in the summary, and its unit.
TOLERANCES: dict[str, tuple[tuple[str, ...], str]] = {
    f"{role}_{kind}_{short}": ((role, part, kind), "m")
    for role in ("check", "control")
    for kind in ("rms", "max")
    for short, part in (("xy", "plan"), ("z", "height"))
} | {
    "sigma0_um": (("sigma0_um",), "um"),
    "image_rms_um": (("image_rms_um",), "um"),
    "max_parallax_um": (("max_parallax_um",), "um"),
}


def counts_of(result: Result, measurements: int) -> Document:
    """Return the block ``counts``."""
    roles, control = result.roles, result.inputs.control
    measured = result.control_rows >= 0
    part = measured & ~control.check & control.use.any(axis=1)
    strips = result.photo_strips
    bundle = None if result.bundle is None else result.bundle.screened.selection
    out = 0 if result.bundle is None else sum(not each.readmitted for each in result.bundle.screened.rejections)
    found = {
        "strips": len(result.inputs.flights),
        "photos": sum(len(strip.photos) for strip in result.inputs.flights),
        "models": sum(len(s.of_photos.formed.scale) for s in strips),
        "points": len(roles),
        "new_points": roles.count("new"),
        "control_points": int(part.sum()),
        "control_plan": int((part & control.use[:, 0]).sum()),
        "control_height": int((part & control.use[:, 2]).sum()),
        "check_points": int((measured & control.check).sum()),
        "given_not_measured": int((~measured).sum()),
        "image_points": measurements,
        "image_points_used": sum(len(s.of_photos.rows) for s in strips) if bundle is None else int(bundle.images.sum()),
        "pass_point_transfers": sum(int(s.of_photos.formed.junctions.used.sum()) for s in strips),
        "rejected_in_pairs": sum(not rejection.readmitted for s in strips for rejection in s.of_photos.rejections),
        "rejected_in_scale_transfer": sum(int((~s.of_photos.formed.junctions.used).sum()) for s in strips),
        "rejected_for_rays": sum(
            len(np.unique(s.of_photos.contradictions.point[rejected_by_strip(s)])) for s in strips
        ),
        **({} if bundle is None else {"rejected_in_bundle": out}),
        "not_determined": len(result.not_determined),
        "ties": len(result.ties.number),
    }
    return found | models.counts_of(result) if result.model_strips else found


def summary_of(result: Result, found: Differences) -> Document:
    """Return the block ``summary``: the accuracy of the whole project.

    Parameters
    ----------
    found : Differences
        What is left at control and check points; rejected control does not count.
    """
    found = of_used(result, found)
    document = models.summary_of(result) if result.model_strips else _of_photos(result)
    control = result.inputs.control
    roles = {"control": ~control.check & control.use.any(axis=1), "check": control.check}
    for role, rows in roles.items():
        document[f"{role}_rms"] = _axis_rms(found.axes[rows])
        document[f"{role}_rms_um"] = _axis_rms(found.axes[rows] / found.scale[rows, None] * 1e6, 1)
        document[f"{role}_mean"] = _axis_mean(found.axes[rows])
    for role, rows in roles.items():
        document[role] = _role(result, found, rows)
    return document


def _of_photos(result: Result) -> Document:
    """Say how good the image coordinates are, and how large the photos."""
    sums = [Parallaxes.of(strip) for strip in result.photo_strips]
    squares = np.concatenate([each.squares for each in sums])
    redundancy = np.concatenate([each.redundancy for each in sums])
    photos = np.array([len(s.strip.photos) for s in result.photo_strips])
    sigma = [result.refined.observations.sigma[s.of_photos.rows].ravel() for s in result.photo_strips]
    parallax = [
        float(np.abs(s.of_photos.orientation.parallax[s.of_photos.orientation.used]).max()) for s in result.photo_strips
    ]
    document: Document = {
        "sigma0_um": micrometres(sigma0(squares, redundancy)),
        "sigma_given_um": micrometres(rms(np.concatenate(sigma))),
        "redundancy": int(redundancy.sum()),
        "max_parallax_um": micrometres(max(parallax)),
        "image_rms_um": micrometres(
            rms(np.concatenate([s.of_photos.resection.residuals.ravel() for s in result.photo_strips]))
        ),
        "photo_scale": rounded(np.average([s.scale_number for s in result.photo_strips], weights=photos), 1),
        "flying_height": rounded(np.average([s.depth for s in result.photo_strips], weights=photos), 2),
    }
    if result.bundle is not None:
        document |= record("summary", image_fit(result.bundle)) | {"sigma0_pairs_um": document["sigma0_um"]}
    return document


def _axis_rms(values: Floats, decimals: int = GROUND) -> Document:
    return dict(zip(AXES, rounded([rms(column) for column in values.T], decimals), strict=True))


def _axis_mean(values: Floats) -> Document:
    known = ~np.isnan(values)
    with np.errstate(invalid="ignore"):
        mean = np.where(known, values, 0.0).sum(axis=0) / known.sum(axis=0)
    return dict(zip(AXES, rounded(mean, GROUND), strict=True))


def _role(result: Result, found: Differences, rows: Flags) -> Document:
    """Sum up plan and height of one role: number, rms, maximum and where it is."""
    ids = result.inputs.control.ids
    return {
        "plan": _part(found.plan, found.scale, rows, ids),
        "height": _part(np.abs(found.height), found.scale, rows, ids),
        "normalised": rounded(_normalised(result, found, rows), 2),
    }


def _part(values: Floats, scale: Floats, rows: Flags, ids: tuple[str, ...]) -> Document:
    counted = np.flatnonzero(rows & ~np.isnan(values))
    if not len(counted):
        return {"count": 0, "rms": None, "max": None, "worst": None, "rms_um": None, "max_um": None}
    worst = int(counted[np.argmax(values[counted])])
    return {
        "count": len(counted),
        "rms": rounded(rms(values[counted]), GROUND),
        "max": rounded(values[worst], GROUND),
        "worst": ids[worst],
        "rms_um": rounded(rms(values[counted] / scale[counted]) * 1e6, 1),
        "max_um": rounded(values[worst] / scale[worst] * 1e6, 1),
    }


def _normalised(result: Result, found: Differences, rows: Flags) -> float:
    """Root mean square of the differences in units of what control and one model let expect."""
    counted = np.where(found.rejected, np.nan, result.control_differences)
    return rms((counted[rows] / found.sigma[rows]).ravel())


def tolerances_of(result: Result, summary: Document) -> list[Document]:
    """Return the list ``tolerances``: what the project allows and what it got.

    A tolerance without a value, as that of check points where there are none, counts as failed: what cannot be shown
    to be kept is not kept.
    """
    return [_tolerance(name, limit, summary) for name, limit in sorted(result.settings.tolerances.items())]


def _tolerance(name: str, limit: float, summary: Document) -> Document:
    path, unit = TOLERANCES[name]
    value: Plain = summary
    for key in path:
        value = value[key]
    return {"name": name, "value": value, "limit": limit, "unit": unit, "passed": value is not None and value <= limit}
