"""A result in words and in a few numbers: conventions, settings, corrections, cameras; counts, accuracy, tolerances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, is_dataclass

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.camera import Camera
from photostrip.geodesy.ground_frame import plural
from photostrip.notes import Document
from photostrip.pipeline.inputs import BUNDLE, POLYNOMIAL, SIMILARITY
from photostrip.pipeline.results import NEW, ROLES, Result
from photostrip.result import strips
from photostrip.result.bundle import image_fit
from photostrip.result.given import Differences, of_used
from photostrip.result.numbers import Plain, mean, record, rms
from photostrip.result.points import ImageResiduals, ground_sample_distance
from photostrip.result.rejected import rejected_by_strip
from photostrip.result.strips import Parallaxes, sigma0_of_pairs
from photostrip.result.table import Table

ROTATION = {
    "projected": "grid east, grid north and the ellipsoid's normal at the perspective centre",
    "geographic": "true east, true north and the ellipsoid's normal at the perspective centre",
    "geocentric": "the geocentric axes X, Y, Z",
    "local": "the axes east, north, up of the local frame",
}
OF_PHOTOS, OF_MODELS = ("relative", "formation", "interior", "refinement"), ("links",)
EFFECTS = ("principal point", "distortion", "refraction")
MEANT_OF_PHOTOS = ("vx_um, vy_um", "q_um")
MEANT_OF_MODELS = {
    "_um": "micrometres in the model; of ground differences at model scale",
    "r11 to r33": "of photos: not known from model coordinates; of models: rows of the matrix that takes model axes to "
    "the axes along, across, up of the strip",
    "vx_um, vy_um, vz_um": "model after minus model before at their common points, along the axes of the model before",
}
LENS = "model", "direction", "k", "p", "b", "radius", "distortion"
CURVATURE = "earth curvature"  # named with the other ways to treat it


def conventions_of(result: Result) -> Document:
    """Return the block ``conventions``: units, axes and signs of everything in the result."""
    frame = result.output
    plan, height = plural(frame.plan_unit), plural(frame.height_unit)
    found: Document = {
        "lengths": "metres, unless the key ends in _mm or _um",
        "x, y, z": f"{', '.join(frame.axes)}; plan in {plan}, heights in {height}",
        "dx, dy, dz": f"adjusted minus given, metres, along {', '.join(frame.axes)}",
        "plan, height": "length of a difference in plan and difference in height, metres",
        "_um": "micrometres in the photo; of ground differences at photo scale",
        "r11 to r33": "rows of the matrix that takes image axes (x right, y up, the camera looks along -z) to "
        f"{ROTATION[frame.kind]}",
        "angle_1 to angle_3": f"{result.settings.angle_system}, {result.settings.angle_unit}",
        "vx_um, vy_um": "image residuals, measured minus computed, under the final orientations and points",
        "q_um": "y parallax y1 - y2 in the base frame; an image coordinate is better by the square root of 2",
        "along, across, up": "X along the strip, Y to its left, Z up: the axes of the polynomials",
        "rms": "square root of the mean square",
        "order": "photos in flight order, points in natural order of their ids",
    }
    if not result.model_strips:
        return found
    return {key: value for key, value in found.items() if key not in MEANT_OF_PHOTOS} | MEANT_OF_MODELS


def adjustment_of(result: Result) -> str:
    """Name the adjustment that was made."""
    if result.bundle is not None:
        return BUNDLE
    return SIMILARITY if all(strip.polynomial is None for strip in result.strips) else POLYNOMIAL


def settings_of(result: Result) -> Document:
    """Return the block ``settings``: what was asked for, with the keys and units of the project file."""
    settings = result.settings
    found: Document = {"adjustment": settings.adjustment}
    for name, value in vars(settings).items():
        if name == "bundle" and not settings.together:
            continue
        if name in (OF_PHOTOS if result.model_strips else OF_MODELS):
            continue
        if is_dataclass(value):
            found[name] = {key: list(each) if isinstance(each, tuple) else each for key, each in asdict(value).items()}
    return found


def angles_of(result: Result) -> Document:
    """Return the block ``angles``: what the three angles of a photo are."""
    return {"system": result.settings.angle_system, "unit": result.settings.angle_unit}


def cameras_of(result: Result) -> Table:
    """Return the table ``cameras``, in the order of the strips."""
    cameras = result.inputs.camera_named
    in_pixels = any(camera.unit == "px" for camera in cameras.values())
    rows = [
        {
            "id": name,
            "principal_distance_mm": camera.principal_distance,
            "principal_point_mm": list(camera.principal_point),
            "format_mm": None if camera.format is None else list(camera.format),
            "fiducials": len(camera.fiducials),
            "distortion": camera.distortion and f"{camera.distortion.model}, {camera.distortion.direction}",
            **_image_of(result, camera),
            **({"unit": camera.unit} if in_pixels else {}),
        }
        for name, camera in cameras.items()
    ]
    return Table.of_rows("cameras", rows)


def _image_of(result: Result, camera: Camera) -> Document:
    """Return what makes measured image coordinates of a camera from ideal ones; None where there is nothing."""
    singles = [strip.photos[0] for strip in result.inputs.strips if len(strip.photos) == 1 and strip.camera == camera]
    lens: Document = {} if camera.distortion is None else asdict(camera.distortion)
    return {
        "pixel_size_mm": camera.pixel_size,
        "pixel_affinity": list(camera.pixel_affinity) if any(camera.pixel_affinity) else None,
        **{f"lens_{key}": lens.get(key) or None for key in LENS},
        "single_photos": singles,
    }


def corrections_of(result: Result) -> Document:
    """Return the block ``corrections``: what was done to the measured coordinates, and how large it was."""
    largest = result.refined.largest_um
    effects = {
        effect.replace(" ", "_"): {"applied": effect in largest, "largest_um": largest.get(effect, 0.0)}
        for effect in EFFECTS
    }
    return record("corrections", effects | {"interior": _interior(result), "earth_curvature": _curvature(result)})


def _interior(result: Result) -> Document | None:
    found = result.interior
    if found is None:
        return None
    lengths = [np.hypot(each[:, 0], each[:, 1]) for each in found.residuals]
    worst = max(range(len(lengths)), key=lambda n: float(lengths[n].max(initial=0.0)), default=-1)
    mark = int(np.argmax(lengths[worst])) if worst >= 0 and len(lengths[worst]) else -1
    return {
        "photos": len(found.photo_ids),
        "transforms": sorted(set(found.transforms)),
        "rms_um": 1000.0 * rms(np.concatenate([each.ravel() for each in found.residuals] or [np.zeros(0)])),
        "largest_um": 1000.0 * lengths[worst][mark] if mark >= 0 else None,
        "largest_photo": found.photo_ids[worst] if mark >= 0 else None,
        "largest_mark": found.marks[worst][mark] if mark >= 0 else None,
        "without_marks": list(found.without_marks),
        "interpolated": found.film is not None,
    }


def _curvature(result: Result) -> Document:
    """Say how the Earth's curvature was treated, and what it makes of the heights at the ends of the strips."""
    wanted, radius = result.settings.absolute.earth_curvature, result.output.spec.curvature_radius
    if CURVATURE in (shifts := result.refined.largest_um):
        how = f"image points shifted outwards, R = {result.settings.refinement.earth_radius:.0f} m"
        return {"asked": wanted, "treatment": how, "largest": 0.0, "largest_um": shifts[CURVATURE]}
    if radius is not None:
        points = result.points
        size = float(np.abs(points.ground[:, 2] - points.cartesian[:, 2]).max(initial=0.0))
        how = f"heights corrected by D^2/2R, R = {radius:.0f} m"
    elif result.output.kind == "local":
        size, how = 0.0, "none: the local frame is taken as truly Cartesian"
    else:
        a, b = result.output.ellipsoid or (6378137.0, 6356752.3)
        whole = result.points.cartesian - result.points.cartesian.mean(axis=0)  # of single photos, which are no strips
        parts = [strip.xyz[:, :2] for strip in result.strips] or [whole]
        reach = max(float(np.linalg.norm(part, axis=1).max(initial=0.0)) for part in parts)
        size, how = reach**2 / (a + b), "carried by the frames: coordinates go through geocentric space"
    return {"asked": wanted, "treatment": how, "largest": size}


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
    out = [] if bundle is None else bundle.screened.out
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
        values[f"{role}_mean"] = _by_axis(mean, found.axes[rows])
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
    sigma0_um = 1000.0 * sigma0_of_pairs(np.concatenate([each.squares for each in sums]), redundancy)
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
    of_models = result.model_strips
    redundancy = np.array([strip.of_models.formed.links.solved.redundancy.sum() for strip in of_models])
    share = redundancy / max(int(redundancy.sum()), 1)
    ratio = np.sqrt((share * np.nan_to_num([strips.sigma0_of_links(strip) ** 2 for strip in of_models])).sum())
    stated = rms(np.array([strips.stated_sigma(strip) for strip in of_models]))
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
        "model_scale": _mean_of_strips(result, [strip.scale_number for strip in of_models]),
        "flying_height": _mean_of_strips(result, [strip.depth for strip in of_models]),
    }


def _mean_of_strips(result: Result, values: list[float]) -> float:
    size = [len(strip.strip.photos) - bool(result.model_strips) for strip in result.strips]
    return float(np.average(values, weights=size))


def _by_axis(sum_up: Callable[[Floats], float], values: Floats) -> Document:
    return {axis: sum_up(column) for axis, column in zip("xyz", values.T, strict=True)}


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
