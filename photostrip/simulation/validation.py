"""What cannot be simulated, said in words before anything is computed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from photostrip.errors import Fault
from photostrip.notes import counted
from photostrip.simulation.spec import ERROR_KINDS, HANDS, LAYOUTS, MODEL_AXES, USES, Spec
from photostrip.strip.image_coordinates import lens_distortion

LEAST_LAP, LARGEST_LAP = 50.0, 95.0  # percent; up to 50 % no point lies on three photos
LARGEST_SIDE_LAP = 90.0
MOST_PHOTOS = 20_000  # of all strips
MOST_POINTS = 1_000_000
LEAST_DEPTH = 0.2  # of the flying height: nearer to the camera no terrain may come
LARGEST_TILT_DEG = 25.0
LARGEST_LON, LARGEST_LAT = 360.0, 90.0  # degrees
LARGEST_ARC = 0.5  # radians of the body that strips may cover


def faults_of(spec: Spec) -> list[Fault]:
    """Everything in a specification that cannot be simulated, with the paths of the keys."""
    found = [fault for part in (_camera, _flight, _terrain, _points, _control, _image, _models) for fault in part(spec)]
    return [*found, *_errors(spec), *(() if found else _together(spec))]


def _fault(key: str, message: str, expected: str = "", fix: str = "") -> Fault:
    return Fault(message, code="simulation-spec", key=key, expected=expected, fix=fix)


def _range(key: str, value: float | None, low: float, high: float, unit: str = "") -> Iterator[Fault]:
    """Refuse a number outside [low, high], or one that is no number; None is sound."""
    if value is not None and not low <= value <= high:
        unit = f" {unit}" if unit else ""
        yield _fault(key, f"{value:g}{unit} is out of range", f"{low:g} to {high:g}{unit}")


def _each(key: str, values: tuple[float, ...] | None, low: float, high: float, unit: str) -> Iterator[Fault]:
    for value in values or ():
        yield from _range(key, value, low, high, unit)


def _models(spec: Spec) -> Iterator[Fault]:
    """Refuse models that no plotter measures, and what belongs to images."""
    models = spec.models
    if models is None:
        return
    yield from _each("models.sigma_um", models.sigma_um, 0.0, 10_000.0, "um")
    yield from _each("models.center_sigma_um", models.center_sigma_um, 0.0, 10_000.0, "um")
    yield from _range("models.scale", models.scale, 1.0, 1e7)
    for key, word, words in (("axes", models.axes, MODEL_AXES), ("hand", models.hand, HANDS)):
        if word not in words:
            yield _fault(f"models.{key}", f"`{word}` is not known", " or ".join(words))
    of_images = {"film": spec.film is not None, "refraction": spec.refraction}
    of_images["gross_errors"] = any(error.kind != "control" for error in spec.gross_errors)
    for key in (key for key, asked in of_images.items() if asked):
        yield _fault(key, "belongs to image coordinates, and models are measured", fix="remove it, or `models`")


def _camera(spec: Spec) -> Iterator[Fault]:
    camera = spec.camera
    yield from _range("camera.principal_distance", camera.principal_distance, 1.0, 10_000.0, "mm")
    if camera.format is None:
        yield _fault("camera.format", "the camera has no format", "width and height of the photo in mm")
    yield from _each("camera.format", camera.format, 1.0, 2_000.0, "mm")
    for fault in lens_distortion.faults(camera):
        yield replace(fault, key="camera.distortion")
    yield from _range("camera.pixel_size", camera.pixel_size, 1e-5, 1.0, "mm")


def _flight(spec: Spec) -> Iterator[Fault]:
    flight = spec.flight
    if flight.photos < 2:
        yield _fault("flight.photos", f"{counted(flight.photos, 'photo')} cannot make a strip", "two or more")
    if flight.strips < 1:
        yield _fault("flight.strips", f"{counted(flight.strips, 'strip')} cannot be simulated", "one or more")
    if flight.photos * flight.strips > MOST_PHOTOS:
        number = flight.photos * flight.strips
        yield _fault("flight.photos", f"{number} photos are too many", f"at most {MOST_PHOTOS} in all strips")
    if not LEAST_LAP < flight.end_lap_percent <= LARGEST_LAP:
        low = "with it no point lies on three photos" if flight.end_lap_percent <= LEAST_LAP else "photos hardly move"
        yield _fault(
            "flight.end_lap_percent",
            f"an end lap of {flight.end_lap_percent:g} % cannot be simulated: {low}",
            f"more than {LEAST_LAP:g} and at most {LARGEST_LAP:g}",
        )
    yield from _range("flight.side_lap_percent", flight.side_lap_percent, 0.0, LARGEST_SIDE_LAP, "%")
    if flight.scale is not None and flight.flying_height is not None:
        yield _fault("flight.scale", "scale and flying_height are both given", "one of them")
    yield from _range("flight.scale", flight.scale, 1.0, 1e7)
    yield from _range("flight.flying_height", flight.flying_height, 0.1, 1e6, "m")
    yield from _range("flight.heading_deg", flight.heading_deg, -360.0, 360.0, "degrees")
    yield from _range("flight.photo_rotation_deg", flight.photo_rotation_deg, -360.0, 360.0, "degrees")
    yield from _each("flight.attitude_sigma_deg", flight.attitude_sigma_deg, 0.0, LARGEST_TILT_DEG, "degrees")
    yield from _each("flight.position_sigma", flight.position_sigma, 0.0, 1e6, "m")


def _terrain(spec: Spec) -> Iterator[Fault]:
    terrain = spec.terrain
    yield from _range("terrain.height", terrain.height, -1e5, 1e5, "m")
    yield from _range("terrain.relief", terrain.relief, 0.0, 1e5, "m")
    yield from _range("terrain.wavelength", terrain.wavelength, 1e-3, 1e9, "m")
    yield from _each("terrain.slope_percent", terrain.slope_percent, -50.0, 50.0, "%")


def _points(spec: Spec) -> Iterator[Fault]:
    points = spec.points
    yield from _range("points.rows", points.rows, 2, 50)
    yield from _range("points.reach_percent", points.reach_percent, 10.0, 97.0, "%")
    yield from _range("points.scatter_percent", points.scatter_percent, 0.0, 100.0, "%")
    yield from _range("points.extra_per_model", points.extra_per_model, 0, 10_000)
    number = spec.flight.photos * spec.flight.strips * (points.rows + points.extra_per_model)
    if number > MOST_POINTS:
        yield _fault("points.extra_per_model", f"{number} points are too many", f"at most {MOST_POINTS}")


def _control(spec: Spec) -> Iterator[Fault]:
    control, last = spec.control, spec.flight.photos - 1
    if control.layout not in LAYOUTS:
        yield _fault("control.layout", f"the layout {control.layout!r} is not known", " | ".join(LAYOUTS))
    if control.layout == "bands":
        yield from _range("control.bands", control.bands, 1, max(last + 1, 2))
        yield from _range("control.per_band", control.per_band, 1, spec.points.rows)
        yield from _range("control.every", control.every, 1, max(last, 1), "models")
    if control.layout == "random":
        yield from _range("control.count", control.count, 1, MOST_POINTS)
    yield from _range("control.check", control.check, 0, MOST_POINTS)
    for name, share in control.use.items():
        if name not in USES:
            yield _fault(f"control.use.{name}", f"{name!r} is no set of coordinates", " | ".join(USES))
        yield from _range(f"control.use.{name}", share, 0.0, 1e6)
    if not sum(control.use.values()) > 0.0:
        yield _fault("control.use", "no coordinates are given at all", "shares of xyz, xy, z")
    yield from _each("control.sigma", control.sigma, 1e-6, 1e4, "m")
    yield from _each("control.noise", control.noise, 0.0, 1e4, "m")
    yield from _boundary(spec)


def _boundary(spec: Spec) -> Iterator[Fault]:
    control = spec.control
    if control.boundary_longitude_deg is not None and control.second_crs is None:
        yield _fault("control.boundary_longitude_deg", "a boundary needs a second frame", fix="add second_crs")
    yield from _range("control.boundary_longitude_deg", control.boundary_longitude_deg, -360.0, 360.0, "degrees")
    if control.second_crs is not None and "local" in {control.second_crs, spec.ground.crs}:
        yield _fault("control.second_crs", "nobody knows where `local` lies", "two frames on the Earth")


def _image(spec: Spec) -> Iterator[Fault]:
    image = spec.image
    yield from _range("image.sigma_um", image.sigma_um, 0.0, 10_000.0, "um")
    if image.unit not in {"mm", "um", "0.1um", "px"}:
        yield _fault("image.unit", f"the unit {image.unit!r} is not known", "mm | um | 0.1um | px")
    if image.unit == "px" and spec.camera.pixel_size is None:
        yield _fault("image.unit", "pixels need a size", fix="add camera.pixel_size")
    if image.y_axis not in {"up", "down"}:
        yield _fault("image.y_axis", f"{image.y_axis!r} is not known", "up | down")
    if spec.film is not None:
        if len(spec.camera.fiducials) < 3:
            yield _fault("film", "the film is deformed, but the camera has no three fiducial marks to see it by")
        for name in ("scale_ppm", "shear_ppm", "irregular_um", "rotation_deg", "offset_mm"):
            yield from _range(f"film.{name}", getattr(spec.film, name), 0.0, 10_000.0)
    if spec.gnss is not None:
        yield from _each("gnss.sigma", spec.gnss.sigma, 1e-6, 1e4, "m")


def _errors(spec: Spec) -> Iterator[Fault]:
    for number, entry in enumerate(spec.gross_errors):
        key = f"gross_errors[{number}]"
        if entry.kind not in ERROR_KINDS:
            yield _fault(f"{key}.kind", f"gross errors of kind {entry.kind!r} are not known", " | ".join(ERROR_KINDS))
            continue
        yield from _range(f"{key}.count", entry.count, 1, MOST_POINTS)
        axes = {"image": "xy", "control": "xyz", "swap": ""}[entry.kind]
        if entry.axis is not None and (entry.axis not in axes or len(entry.axis) != 1):
            expected = " | ".join(axes) or "none"
            yield _fault(f"{key}.axis", f"an error of kind {entry.kind} has no axis {entry.axis!r}", expected)
        if entry.kind == "control" and entry.photo is not None:
            yield _fault(f"{key}.photo", "control is given on the ground, not on a photo", fix="drop it")
        for name in ("size_um", "size_m"):
            if not math.isfinite(getattr(entry, name)):
                yield _fault(f"{key}.{name}", "the size of the error is not a number")


def _together(spec: Spec) -> Iterator[Fault]:
    """Refuse what is only wrong together, the single values being sound."""
    flight, terrain = spec.flight, spec.terrain
    length, width = flight.photos * spec.base, flight.strips * spec.strip_distance
    rise = (abs(terrain.slope_percent[0]) * length + abs(terrain.slope_percent[1]) * width) / 200.0
    highest = terrain.relief + rise
    if highest > (1.0 - LEAST_DEPTH) * spec.flying_height:
        message = (
            f"the terrain rises to {highest:.0f} m above its mean height, the camera is at {spec.flying_height:.0f} m"
        )
        yield _fault("terrain.relief", message, fix="less relief or slope, a shorter strip or a higher flight")
    lon, lat = spec.ground.center_deg
    if not (abs(lon) <= LARGEST_LON and abs(lat) < LARGEST_LAT):
        yield _fault("ground.center_deg", f"{lon:g}, {lat:g} is no place", "longitude and latitude in degrees")
