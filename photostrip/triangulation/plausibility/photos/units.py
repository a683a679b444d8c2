"""The size of image coordinates against the format and the principal distance.

Points of overlapping photos reach far into the format: with 60 % end lap to four fifths of its half, with 90 % to more
than a tenth across the flight. A reach beyond the format or a tenth of it is not a choice of points but another unit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from photostrip.triangulation.plausibility.finding import found

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from photostrip.arrays import Floats
    from photostrip.camera import Camera
    from photostrip.notes import Finding
    from photostrip.points import PhotoPoints


REACH_SHARE = 0.98  # of the image points; the rest may be gross errors
REACH = (0.12, 1.2)  # of half the format
LIKELY_REACH = (0.3, 1.1)  # a reading that brings the reach into this range explains it
REACH_OF_DISTANCE = (0.06, 3.0)  # of the principal distance, when no format is given: fields of 7 to 143 degrees
LIKELY_OF_DISTANCE = (0.1, 2.0)
MOST_LIKELY = 0.5  # of the upper end of such a range; below it other readings come first
LIKELY_PIXELS = 2.2  # counted from a corner they reach twice as far
HALF_DIAGONAL = (0.2, 3.5)  # of the principal distance: fields of 23 to 148 degrees
USUAL_HALF_DIAGONAL = (0.24, 1.9)  # a 610 mm lens and an 85 mm lens on 23 cm film
MARKS_RATIO = (0.5, 2.0)  # calibrated over measured distances; a scan is known to a percent
READINGS = (
    (1e-3, "micrometres read as millimetres"),
    (1e3, "millimetres read as micrometres"),
    (0.1, "tenths of a micrometre read as micrometres"),
    (10.0, "centimetres read as millimetres, or micrometres read as tenths"),
    (1e-4, "tenths of a micrometre read as millimetres"),
    (25.4, "inches read as millimetres"),
    (1e-2, "hundredths of a millimetre read as millimetres"),
    (1e2, "a decimal point two places off"),
)


class UnitReading(NamedTuple):
    """What would bring image coordinates to a likely size."""

    factor: float  # what they would have to be multiplied by
    name: str  # what may have happened; empty when nothing is known that explains it


def reading_of(ratio: float, likely: tuple[float, float], pixel_size: float | None = None) -> UnitReading:
    """Find the unit that brings a ratio into the likely range.

    The first reading that brings it into the upper half of the range, or else into the rest of it, pixels first;
    factor 1 when none does.
    """
    pixels = (
        []
        if pixel_size is None
        else [
            (pixel_size, "pixels read as millimetres"),
            (pixel_size * 1e3, "pixels read as micrometres"),
            (1 / pixel_size, "millimetres read as pixels"),
        ]
    )
    fits = [UnitReading(factor, name) for factor, name in pixels if likely[0] < ratio * factor < LIKELY_PIXELS]
    for least in (MOST_LIKELY * likely[1], likely[0]):
        fits += [UnitReading(factor, name) for factor, name in READINGS if least < ratio * factor < likely[1]]
    return fits[0] if fits else UnitReading(1.0, "")


def reaches(observations: PhotoPoints, cameras: Mapping[str, Camera]) -> dict[str, tuple[float, bool]]:
    """Measure how far image points reach, camera by camera.

    Returns by name of the camera: the reach, in units of half the format (or of the principal distance), and whether
        the format is known.
    """
    size_of = {}
    owner = [cameras[photo].name if photo in cameras else "" for photo in observations.photo_ids]
    for name, camera in {each.name: each for each in cameras.values()}.items():
        rows = np.array([each == name for each in owner], bool)[observations.photo]
        if not rows.any():
            continue
        half = camera.principal_distance if camera.format is None else np.array(camera.format) / 2.0
        size = (np.abs(observations.xy[rows]) / half).max(axis=1)
        size_of[name] = float(np.quantile(size, REACH_SHARE)), camera.format is not None
    return size_of


def find_wrong_units(
    observations: PhotoPoints, cameras: Mapping[str, Camera]
) -> tuple[list[Finding], dict[str, float]]:
    """Look for image coordinates in another unit, and for principal distances that no lens has.

    Returns P101, P105.
    Returns factor by camera that would bring its image coordinates to a likely size; 1 where nothing is wrong.
    """
    findings, factors = [], {}
    by_name = {each.name: each for each in cameras.values()}
    for name, (reach, known) in reaches(observations, cameras).items():
        camera = by_name[name]
        low, high = REACH if known else REACH_OF_DISTANCE
        factors[name] = 1.0
        if not low < reach < high:
            likely = LIKELY_REACH if known else LIKELY_OF_DISTANCE
            reading = reading_of(reach, likely, camera.pixel_size)
            factors[name] = reading.factor
            photos = [photo for photo in observations.photo_ids if photo in cameras and cameras[photo].name == name]
            findings.append(_wrong_unit(camera, reach, reading, photos))
    for camera in by_name.values():
        wrong = _unlikely_lens(camera)
        if wrong is not None:
            findings.append(wrong)
    return findings, factors


def find_wrong_mark_units(scales: Floats, photos: Sequence[str]) -> list[Finding]:
    """Look for fiducial marks in another unit (P106), by calibrated over measured distances of each photo, (p,)."""
    odd = (scales < MARKS_RATIO[0]) | (scales > MARKS_RATIO[1])
    if not odd.any():
        return []
    scale = float(np.median(scales[odd]))
    names = tuple(photo for photo, each in zip(photos, odd, strict=True) if each)
    reading = reading_of(1.0 / scale, MARKS_RATIO)
    message = (
        f"the fiducial marks of {len(names)} photos are measured {1 / scale:.4g} times as far apart as they are "
        "calibrated"
    )
    if reading.name:
        message += f": {reading.name}"
    fix = "correct `unit`: the points come out right all the same, their standard deviations do not"
    evidence = {"measured_over_calibrated": 1.0 / scale, "photos": len(names)}
    return [found("P106", message, fix, evidence, photos=names, key="fiducial_measurements.unit")]


def _wrong_unit(camera: Camera, reach: float, reading: UnitReading, photos: Sequence[str]) -> Finding:
    what = "half the format" if camera.format is not None else "the principal distance"
    message = f"image coordinates of camera {camera.name} reach to {reach:.3g} times {what}"
    if reading.name:
        message += (
            f"; multiplied by {reading.factor:g} they would reach to {reach * reading.factor:.2f}: {reading.name}"
        )
        fix = "correct `observations.unit`, or the columns of the table"
        if camera.format is None:
            message += f"; or the principal distance is not {camera.principal_distance:g} mm"
            fix += ", or the principal distance"
    else:
        fix = "check `observations.unit`, `observations.origin` and the format of the camera"
    evidence = {"reach": reach, "factor": reading.factor, "principal_distance_mm": camera.principal_distance}
    if camera.format is not None:
        evidence |= {"format_width_mm": camera.format[0], "format_height_mm": camera.format[1]}
    return found("P101", message, fix, evidence, photos=photos, key="observations.unit")


def _unlikely_lens(camera: Camera) -> Finding | None:
    if camera.format is None:
        return None
    half = float(np.hypot(*camera.format)) / 2.0
    ratio = half / camera.principal_distance
    if HALF_DIAGONAL[0] < ratio < HALF_DIAGONAL[1]:
        return None
    field = 2.0 * np.degrees(np.arctan(ratio))
    low, high = USUAL_HALF_DIAGONAL
    meant = [camera.principal_distance * 10.0**k for k in (-3, -2, -1, 1, 2, 3)]
    fits = [value for value in meant if low < half / value < high]
    fix = f"is it {fits[0]:g} mm?" if fits else "take principal distance and format from the certificate"
    message = (
        f"camera {camera.name} with a principal distance of {camera.principal_distance:g} mm and a format of "
        f"{camera.format[0]:g} x {camera.format[1]:g} mm would have a field of {field:.1f} degrees"
    )
    evidence = {"principal_distance_mm": camera.principal_distance, "half_diagonal_mm": half, "field_deg": field}
    return found("P105", message, fix, evidence, key=f"cameras.{camera.name}.principal_distance")
