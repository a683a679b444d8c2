"""The size of image coordinates against the format and the principal distance.

Points of overlapping photos reach far into the format: with 60 % end lap to four fifths of its half, with 90 % to more
than a tenth across the flight. A reach beyond the format or a tenth of it is not a choice of points but another unit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.notes import Finding, counted, listed
from photostrip.plausibility.finding import found
from photostrip.points import PhotoPoints

REACH_SHARE = 0.98  # of the image points; the rest may be gross errors
FEW_SHARE = 0.5  # of the photos of a camera, at most: they are wrong, not all
REACH = (0.12, 1.2)  # of half the format
LIKELY_REACH = (0.3, 1.1)  # a reading that brings the reach into this range explains it
REACH_OF_DISTANCE = (0.06, 3.0)  # of the principal distance, when no format is given: fields of 7 to 143 degrees
LIKELY_OF_DISTANCE = (0.1, 2.0)
LIKELY_PIXELS = 2.2  # counted from a corner they reach twice as far
HALF_DIAGONAL = (0.2, 3.5)  # of the principal distance: fields of 23 to 148 degrees
USUAL_HALF_DIAGONAL = (0.24, 1.9)  # a 610 mm lens and an 85 mm lens on 23 cm film
MARKS_RATIO = (0.5, 2.0)  # calibrated over measured distances; a scan is known to a percent
TOO_GOOD = 30.0  # times better than stated: units differ by a thousand, measurements from what was thought by less
LEAST_MEASURED = 5e-4  # mm; what is better than half a micrometre was computed, not measured
LEAST_CHECKED = 3  # check points that tell how good given coordinates are
INCH = 25.4
READINGS = (
    (1e-3, "micrometres read as millimetres"),
    (1e3, "millimetres read as micrometres"),
    (0.1, "the decimal point one place off, or tenths of a micrometre (`0.1um`) read as micrometres"),
    (10.0, "the decimal point one place off, or centimetres read as millimetres"),
    (1e-4, "tenths of a micrometre read as millimetres"),
    (INCH, "inches read as millimetres"),
    (1e-2, "the decimal point two places off, or hundredths of a millimetre read as millimetres"),
    (1e2, "the decimal point two places off"),
)


class UnitReading(NamedTuple):
    """What would bring image coordinates to a likely size."""

    factor: float  # what they would have to be multiplied by
    name: str  # what may have happened; empty when nothing is known that explains it


def reading_of(ratio: float, likely: tuple[float, float], pixel_size: float | None = None) -> UnitReading:
    """Find the unit that brings a ratio into the likely range.

    Pixels first, then the reading that brings it nearest to the middle of the range; factor 1 when none does.
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
    middle = sum(likely) / 2.0
    likely_ones = [UnitReading(factor, name) for factor, name in READINGS if likely[0] < ratio * factor < likely[1]]
    fits += sorted(likely_ones, key=lambda each: abs(math.log(ratio * each.factor / middle)))
    return fits[0] if fits else UnitReading(1.0, "")


class _Reach(NamedTuple):
    """How far image points reach, in units of half the format, or of the principal distance without a format."""

    whole: float  # of all photos of a camera
    of_photo: dict[str, float]
    middle: Floats  # (2,): middle of what they cover
    about_middle: float  # how far they reach from there


def _scaled(observations: PhotoPoints, cameras: Mapping[str, Camera], camera: Camera) -> tuple[Floats, Numbers]:
    """Image points of a camera in those units (m, 2), and their photos (m,).

    The photos of a strip may lie crosswise in the comparator: then the sides of the format are exchanged.
    """
    of_camera = [photo in cameras and cameras[photo].name == camera.name for photo in observations.photo_ids]
    rows = np.array(of_camera, bool)[observations.photo]
    xy = observations.xy[rows]
    half = np.full(2, camera.principal_distance) if camera.format is None else np.array(camera.format) / 2.0
    either = [xy / half, xy / half[::-1]]
    reach = [np.quantile(np.abs(each).max(axis=1), REACH_SHARE) if len(xy) else 0.0 for each in either]
    crosswise = reach[0] > REACH[1] >= reach[1]
    return either[1 if crosswise else 0], observations.photo[rows]


def _reach(observations: PhotoPoints, scaled: Floats, photo: Numbers) -> _Reach:
    """Measure how far image points of a camera reach, photo by photo and from their own middle."""
    size = np.abs(scaled).max(axis=1)
    ends = [[np.quantile(each, share) for each in scaled.T] for share in (1.0 - REACH_SHARE, REACH_SHARE)]
    middle = np.mean(ends, axis=0)
    return _Reach(
        whole=np.quantile(size, REACH_SHARE),
        of_photo={
            observations.photo_ids[number]: np.quantile(size[photo == number], REACH_SHARE)
            for number in np.unique(photo).tolist()
        },
        middle=middle,
        about_middle=np.quantile(np.abs(scaled - middle).max(axis=1), REACH_SHARE),
    )


def find_wrong_units(
    observations: PhotoPoints, cameras: Mapping[str, Camera]
) -> tuple[list[Finding], dict[str, float]]:
    """Look for image coordinates in another unit, and for principal distances that no lens has.

    Returns P101, P105.
    Returns factor by camera that would bring its image coordinates to a likely size; 1 where nothing is wrong.
    """
    findings, factors = [], {}
    by_name = {each.name: each for each in cameras.values()}
    for name, camera in by_name.items():
        known = camera.format is not None
        low, high = REACH if known else REACH_OF_DISTANCE
        factors[name] = 1.0
        scaled, photo = _scaled(observations, cameras, camera)
        if not len(scaled) or low < np.quantile(np.abs(scaled).max(axis=1), REACH_SHARE) < high:
            continue
        reach = _reach(observations, scaled, photo)
        odd = [photo for photo, own in reach.of_photo.items() if not low < own < high]
        if 0 < len(odd) <= FEW_SHARE * len(reach.of_photo):
            findings.append(_odd_photos(camera, odd, reach))
        elif reach.whole > high and low < reach.about_middle < high:
            findings.append(_other_origin(camera, reach))
        else:
            likely = LIKELY_REACH if known else LIKELY_OF_DISTANCE
            reading = reading_of(reach.whole, likely, camera.pixel_size)
            factors[name] = reading.factor
            findings.append(_wrong_unit(camera, reach.whole, reading, list(reach.of_photo)))
    for camera in by_name.values():
        wrong = _unlikely_lens(camera)
        if wrong is not None:
            findings.append(wrong)
    return findings, factors


def _unit_of_reach(camera: Camera) -> str:
    return "half the format" if camera.format is not None else "the principal distance"


def _odd_photos(camera: Camera, photos: Sequence[str], reach: _Reach) -> Finding:
    """Say that some photos of a camera reach too far, or not far enough."""
    own = np.median([reach.of_photo[photo] for photo in photos])
    others = np.median([each for photo, each in reach.of_photo.items() if photo not in photos])
    message = (
        f"image coordinates on {listed(photos)} reach to {own:.3g} times {_unit_of_reach(camera)}, on the other photos "
        f"of camera {camera.name} to {others:.2g}"
    )
    fix = "are their rows in another unit, or counted from another origin?"
    evidence = {"reach": own, "reach_of_others": others}
    return found("P101", message, fix, evidence, photos=photos, key="observations.unit")


def _other_origin(camera: Camera, reach: _Reach) -> Finding:
    """Say that image coordinates are counted from elsewhere, not from the centre."""
    x, y = reach.middle.tolist()
    message = (
        f"image coordinates of camera {camera.name} reach to {reach.whole:.3g} times {_unit_of_reach(camera)}, but to "
        f"{reach.about_middle:.2g} from their own middle, which lies at ({x:.2f}, {y:.2f}) of it: they are not counted "
        "from the centre of the photo"
    )
    fix = "check `observations.origin`; subtract the middle of the fiducial marks, or give the marks"
    evidence = {"reach": reach.whole, "reach_from_middle": reach.about_middle, "middle_x": x, "middle_y": y}
    return found("P101", message, fix, evidence, photos=list(reach.of_photo), key="observations.origin")


def find_wrong_mark_units(scales: Floats, photos: Sequence[str]) -> list[Finding]:
    """Look for fiducial marks in another unit (P106), by calibrated over measured distances of each photo, (p,)."""
    odd = (scales < MARKS_RATIO[0]) | (scales > MARKS_RATIO[1])
    if not odd.any():
        return []
    scale = np.median(scales[odd])
    names = tuple(photo for photo, each in zip(photos, odd, strict=True) if each)
    reading = reading_of(1.0 / scale, MARKS_RATIO)
    message = (
        f"the fiducial marks of {counted(len(names), 'photo')} are measured {1 / scale:.4g} times as far apart as "
        "they are calibrated"
    )
    if reading.name:
        message += f": {reading.name}"
    fix = "correct `unit`: the points come out right all the same, their standard deviations do not"
    evidence = {"measured_over_calibrated": 1.0 / scale, "photos": len(names)}
    return [found("P106", message, fix, evidence, photos=names, key="fiducial_measurements.unit")]


def is_measured(sigma0: Floats) -> bool:
    """Whether pairs of photos have noise, by their standard deviations of an image coordinate (p,), mm."""
    known = sigma0[np.isfinite(sigma0)]
    return bool(len(known) and np.median(known) > LEAST_MEASURED)


def find_wrong_sigmas(sigma0: Floats, stated: float, strip: str) -> list[Finding]:
    """Look for a standard deviation of image coordinates in another unit (P108).

    sigma0: (p,), of each pair of photos, mm; stated: what the project says, mm.
    """
    if not is_measured(sigma0):
        return []
    middle = np.median(sigma0[np.isfinite(sigma0)])
    if middle > stated / TOO_GOOD:
        return []
    message = (
        f"strip {strip}: image coordinates have a standard deviation of {1000 * middle:.1f} µm, {stated / middle:.0f} "
        f"times less than stated ({1000 * stated:.4g} µm)"
    )
    evidence = {"found_mm": middle, "stated_mm": stated}
    fix = "give `observations.sigma` in the unit of the image coordinates"
    return [found("P108", message, fix, evidence, strips=(strip,), key="observations.sigma")]


def find_wrong_sigmas_of_given(off: Floats, sigma: Floats) -> list[Finding]:
    """Look for standard deviations of given coordinates in another unit (P108).

    off, sigma: (c, 3), how far check points are off, and their own standard deviations, metres; NaN where not known.
    """
    for columns, name in (([0, 1], "plan"), ([2], "height")):
        known = np.isfinite(off[:, columns] / sigma[:, columns]).all(axis=1)
        if known.sum() < LEAST_CHECKED:
            continue
        middle, expected = (np.median(np.abs(each[known][:, columns])) for each in (off, sigma))
        if middle < expected / TOO_GOOD:
            message = (
                f"check points are {middle:.3g} m off in {name}, less than a thirtieth of the standard deviation that "
                f"is given for them ({expected:.3g} m)"
            )
            evidence = {"off_m": middle, "expected_m": expected, "points": int(known.sum())}
            fix = "give `sigma` of the control in metres"
            return [found("P108", message, fix, evidence, key="control")]
    return []


def _wrong_unit(camera: Camera, reach: float, reading: UnitReading, photos: Sequence[str]) -> Finding:
    message = f"image coordinates of camera {camera.name} reach to {reach:.3g} times {_unit_of_reach(camera)}"
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
    meant = [camera.principal_distance * factor for factor in (1e-3, 1e-2, 0.1, 10.0, INCH, 1e2, 1e3)]
    fits = sorted((each for each in meant if low < half / each < high), key=lambda each: abs(np.log(half / each)))
    fix = f"is it {fits[0]:g} mm?" if fits else "take principal distance and format from the certificate"
    message = (
        f"camera {camera.name} with a principal distance of {camera.principal_distance:g} mm and a format of "
        f"{camera.format[0]:g} x {camera.format[1]:g} mm would have a field of {field:.1f} degrees"
    )
    evidence = {"principal_distance_mm": camera.principal_distance, "half_diagonal_mm": half, "field_deg": field}
    return found("P105", message, fix, evidence, key=f"cameras.{camera.name}.principal_distance")
