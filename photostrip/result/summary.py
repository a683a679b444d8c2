"""A result in a few numbers: counts, sigma0, what is left at control and at check points, tolerances."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.notes import Document
from photostrip.pipeline.results import NEW, ROLES, Result
from photostrip.result.adjustment import links
from photostrip.result.adjustment.bundle import image_fit
from photostrip.result.adjustment.pairs import Parallaxes, sigma0
from photostrip.result.adjustment.rejected import rejected_by_strip
from photostrip.result.numbers import Plain, rms
from photostrip.result.points.given import Differences, of_used
from photostrip.result.points.photos import ImageResiduals, ground_sample_distance
from photostrip.result.quantities import record
from photostrip.result.table import Table

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
    """Return the block ``counts``; `measurements` is the number of image points."""
    roles, control = result.roles, result.inputs.control
    measured = result.control_rows >= 0
    part = measured & ~control.check & control.use.any(axis=1)
    photos = [strip.of_photos for strip in result.photo_strips]
    transfers = [each.formed.junctions.used for each in photos]
    transfers += [strip.of_models.formed.links.used for strip in result.model_strips]
    bundle = result.bundle
    used = sum(len(strip.rows) for strip in result.photo_strips)
    if bundle is not None and not result.model_strips:
        used = int(bundle.screened.selection.images.sum())
    out = [] if bundle is None else [each for each in bundle.screened.rejections if not each.readmitted]
    return {
        "strips": len(result.inputs.lines),
        "photos": sum(len(strip.photos) for strip in result.inputs.flights),
        "models": sum(len(strip.strip.photos) - 1 for strip in result.strips),
        "points": len(roles),
        "new_points": int((roles == ROLES.index(NEW)).sum()),
        "control_points": int(part.sum()),
        "control_plan": int((part & control.use[:, 0]).sum()),
        "control_height": int((part & control.use[:, 2]).sum()),
        "check_points": int((measured & control.check).sum()),
        "given_not_measured": sum(
            not (has or name in result.not_determined) for has, name in zip(measured, control.ids, strict=True)
        ),
        "image_points": measurements,
        "image_points_used": used,
        "pass_point_transfers": sum(int(used.sum()) for used in transfers),
        "rejected_in_pairs": sum(not rejection.readmitted for each in photos for rejection in each.rejections),
        "rejected_in_scale_transfer": sum(int((~each.formed.junctions.used).sum()) for each in photos),
        "rejected_for_rays": sum(
            len({int(result.refined.observations.point[each.row]) for each in rejected_by_strip(strip)})
            for strip in result.photo_strips
        ),
        **({} if bundle is None else {"rejected_in_bundle": len(out)}),
        "not_determined": len(result.not_determined),
        "ties": len(result.ties.number),
        **(_counts_of_models(result) if result.model_strips else {}),
    }


def _counts_of_models(result: Result) -> Document:
    formed = [strip.of_models.formed for strip in result.model_strips]
    points = [each.models.node < each.models.points for each in formed]
    return {
        "model_points": sum(int(each.sum()) for each in points),
        "model_points_used": sum(int((each & one.used).sum()) for each, one in zip(points, formed, strict=True)),
        "model_centers": sum(int((~each).sum()) for each in points),
        "rejected_in_links": sum(len(each.links.rejections) for each in formed),
    }


def summary_of(result: Result, images: Sequence[ImageResiduals], found: Differences) -> Document:
    """Return the block ``summary``: the accuracy of the whole project.

    `images` holds the residuals of all photos, `found` what is left at control and check points; rejected control does
    not count.
    """
    found = of_used(result, found)
    control = result.inputs.control
    roles = {"control": ~control.check & control.use.any(axis=1), "check": control.check}
    if result.model_strips:
        values = _of_models(result)
    else:
        values = _of_photos(result) if result.photo_strips else _of_singles(result)
    values |= ground_sample_distance(images)
    for role, rows in roles.items():
        values[f"{role}_rms"] = _by_axis(rms, found.axes[rows])
        values[f"{role}_rms_um"] = _by_axis(rms, found.axes[rows] / found.scale[rows, None] * 1e6)
        values[f"{role}_mean"] = _by_axis(_mean, found.axes[rows])
    for role, rows in roles.items():
        values[role] = _role(result, found, rows)
    return record("summary", values)


def _of_photos(result: Result) -> Document:
    strips = result.photo_strips
    sums = [Parallaxes.of(strip) for strip in result.photo_strips]
    redundancy = np.concatenate([each.redundancy for each in sums])
    sigma = [result.refined.observations.sigma[each.rows].ravel() for each in strips]
    oriented = [strip.of_photos.orientation for strip in strips]
    parallax = [np.abs(each.parallax[each.used]).max() for each in oriented]
    sigma0_um = 1000.0 * sigma0(np.concatenate([each.squares for each in sums]), redundancy)
    values: Document = {
        "sigma0_um": sigma0_um,
        "sigma_given_um": 1000.0 * rms(np.concatenate(sigma)),
        "redundancy": int(redundancy.sum()),
        "max_parallax_um": 1000.0 * max(parallax),
        "image_rms_um": 1000.0 * rms(np.concatenate([each.resection.residuals.ravel() for each in strips])),
        "photo_scale": _mean_of_strips(result, [strip.scale_number for strip in result.strips]),
        "flying_height": _mean_of_strips(result, [strip.depth for strip in result.strips]),
    }
    return values if result.bundle is None else values | image_fit(result.bundle) | {"sigma0_pairs_um": sigma0_um}


def _of_singles(result: Result) -> Document:
    """Sum up a bundle of photos that are strips of their own each: there are no pairs and no parallaxes."""
    if result.bundle is None:
        msg = "single photos without a bundle adjustment"
        raise TypeError(msg)
    singles, sigma = result.bundle.singles, result.bundle.screened.problem.images.sigma
    return {
        "sigma_given_um": 1000.0 * rms(sigma.ravel()),
        "max_parallax_um": None,
        "photo_scale": float(np.mean([single.scale_number for single in singles])),
        "flying_height": float(np.mean([single.depth for single in singles])),
        **image_fit(result.bundle),
    }


def _of_models(result: Result) -> Document:
    strips = result.model_strips
    redundancy = np.array([strip.of_models.formed.links.solved.redundancy.sum() for strip in strips])
    share = redundancy / max(int(redundancy.sum()), 1)
    ratio = np.sqrt((share * np.nan_to_num([links.sigma0(strip) ** 2 for strip in strips])).sum())
    stated = rms(np.array([links.stated_sigma(strip) for strip in strips]))
    freedom = int(redundancy.sum())
    if result.bundle is not None:
        solution = result.bundle.screened.solution
        ratio, freedom = solution.sigma0, solution.redundancy
    return {
        "sigma0_um": 1000.0 * (ratio * stated) if freedom else None,
        "sigma_given_um": 1000.0 * stated,
        "redundancy": freedom,
        "max_parallax_um": None,
        "image_rms_um": None,
        "photo_scale": None,
        "model_scale": _mean_of_strips(result, [strip.scale_number for strip in strips]),
        "flying_height": _mean_of_strips(result, [strip.depth for strip in strips]),
    }


def _mean_of_strips(result: Result, values: list[float]) -> float:
    size = [len(strip.strip.photos) - bool(result.model_strips) for strip in result.strips]
    return float(np.average(values, weights=size))


def _by_axis(sum_up: Callable[[Floats], float], values: Floats) -> Document:
    return {axis: sum_up(column) for axis, column in zip("xyz", values.T, strict=True)}


def _mean(values: Floats) -> float:
    """Mean of what is not NaN; NaN when there is nothing."""
    known = ~np.isnan(values)
    return float(np.where(known, values, 0.0).sum() / known.sum()) if known.any() else float("nan")


def _role(result: Result, found: Differences, rows: Flags) -> Document:
    """Sum up plan and height of one role, and its differences over what control and one model let expect."""
    ids = result.inputs.control.ids
    counted = np.where(found.rejected, np.nan, result.control_differences)
    return {
        "plan": _part(found.plan, found.scale, rows, ids),
        "height": _part(np.abs(found.height), found.scale, rows, ids),
        "normalised": rms((counted[rows] / found.sigma[rows]).ravel()),
    }


def _part(values: Floats, scale: Floats, rows: Flags, ids: tuple[str, ...]) -> Document:
    """Count differences; their rms, the largest and where it is."""
    counted = np.flatnonzero(rows & ~np.isnan(values))
    if not len(counted):
        return {"count": 0, "rms": None, "max": None, "worst": None, "rms_um": None, "max_um": None}
    worst = int(counted[np.argmax(values[counted])])
    return {
        "count": len(counted),
        "rms": rms(values[counted]),
        "max": values[worst],
        "worst": ids[worst],
        "rms_um": rms(values[counted] / scale[counted]) * 1e6,
        "max_um": values[worst] / scale[worst] * 1e6,
    }


def tolerances_of(result: Result, summary: Document) -> Table:
    """Return the table ``tolerances``: what the project allows and what it got.

    A tolerance without a value, as that of check points where there are none, counts as failed: what cannot be shown
    to be kept is not kept.
    """
    found = []
    for name, limit in sorted(result.settings.tolerances.items()):
        path, unit = TOLERANCES[name]
        value: Plain = summary
        for key in path:
            value = value[key]
        passed = value is not None and value <= limit
        found.append({"name": name, "value": value, "limit": limit, "unit": unit, "passed": passed})
    return Table.of_rows("tolerances", found)
