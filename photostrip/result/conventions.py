"""What the numbers of a result mean: units, axes, signs; what was asked for and which corrections were made."""

from __future__ import annotations

from dataclasses import asdict, is_dataclass

import numpy as np

from photostrip.camera import Camera
from photostrip.geodesy.ground_frame import plural
from photostrip.notes import Document
from photostrip.pipeline.inputs import BUNDLE, POLYNOMIAL, SIMILARITY
from photostrip.pipeline.results import Result
from photostrip.result.numbers import rms
from photostrip.result.quantities import record
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
    cameras = {strip.camera.name: strip.camera for strip in result.inputs.strips}
    rows = [
        {
            "id": name,
            "principal_distance_mm": camera.principal_distance,
            "principal_point_mm": list(camera.principal_point),
            "format_mm": None if camera.format is None else list(camera.format),
            "fiducials": len(camera.fiducials),
            "distortion": camera.distortion and f"{camera.distortion.model}, {camera.distortion.direction}",
            **_image_of(result, camera),
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
