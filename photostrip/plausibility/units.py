"""The size of image coordinates against the format and the principal distance.

Points of overlapping photos reach far into the format: with 60 % end lap to four fifths of its half, with 90 % to more
than a tenth across the flight. A reach beyond the format or a tenth of it is not a choice of points but another unit.

Where on the Earth given coordinates lie, against where their coordinate reference system is made for.

Coordinates with exchanged axes, in feet, or of another system fall hundreds of kilometres away. When they do, the
readings that would bring them back are tried: one that does is an error. Without one the area alone proves nothing: a
zone of Gauss-Kruger serves at any latitude, whoever registered it for which country. A neighbouring zone of UTM cannot
be seen: the same numbers lie in it as well; those of Gauss-Kruger begin with the number of their zone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.camera import Camera
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.crs import Area, AreasOfUse
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.notes import Finding, counted, listed
from photostrip.plausibility.finding import ERROR, WARNING, Evidence, found
from photostrip.points import PhotoPoints
from photostrip.strip.pixel_cameras import PIXEL_SIZE

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
SAME_UNIT = 0.5  # a factor nearer to one than this is no other unit
MOST_SIZES = 10.0  # of a photo, that one which was taken for it is larger at most
BEGIN_SHARE = 0.2  # of their reach: points that are counted from a corner begin nearer to it
AT_CORNER = 0.15  # of half the format: how near the middle of the points is to where another origin would put it
PLACE_OF_POINT = 0.1  # of the format: how far a principal point may lie from the middle of photos as they were taken


class UnitReading(NamedTuple):
    """What would bring image coordinates to a likely size."""

    factor: float  # what they would have to be multiplied by
    name: str  # what may have happened; empty when nothing is known that explains it


READINGS = (
    UnitReading(1e-3, "micrometres read as millimetres"),
    UnitReading(1e3, "millimetres read as micrometres"),
    UnitReading(0.1, "the decimal point one place off, or tenths of a micrometre (`0.1um`) read as micrometres"),
    UnitReading(10.0, "the decimal point one place off, or centimetres read as millimetres"),
    UnitReading(1e-4, "tenths of a micrometre read as millimetres"),
    UnitReading(INCH, "inches read as millimetres"),
    UnitReading(1e-2, "the decimal point two places off, or hundredths of a millimetre read as millimetres"),
    UnitReading(1e2, "the decimal point two places off"),
)


def reading_of(ratio: float, likely: tuple[float, float], pixel_size: float | None = None) -> UnitReading:
    """Find the unit that brings a ratio into the likely range.

    Pixels first, then the reading that brings it nearest to the middle of the range; factor 1 when none does. Of a
    pixel of about a micrometre, as one whose size nobody knows is taken, micrometres are no other reading.
    """
    size = pixel_size or np.nan
    pixels = [
        UnitReading(size, "pixels read as millimetres"),
        UnitReading(size * 1e3, "pixels read as micrometres"),
        UnitReading(1 / size, "millimetres read as pixels"),
    ]
    for each in pixels:
        if likely[0] < ratio * each.factor < LIKELY_PIXELS and abs(each.factor - 1.0) > SAME_UNIT:
            return each
    middle, others = sum(likely) / 2.0, [each for each in READINGS if likely[0] < ratio * each.factor < likely[1]]
    nearest_first = sorted(others, key=lambda each: abs(math.log(ratio * each.factor / middle)))
    return next(iter(nearest_first), UnitReading(1.0, ""))


@dataclass(frozen=True, eq=False)
class _Reach:
    """How far image points reach, in units of half the format, or of the principal distance without a format."""

    size: Floats  # (m,): of each image point
    photo: Numbers  # (m,): number of its photo
    photo_ids: Sequence[str]
    whole: float  # of all photos of a camera
    middle: Floats  # (2,): middle of what they cover
    about_middle: float  # how far they reach from there

    @cached_property
    def of_photo(self) -> dict[str, float]:
        """Of each photo, which is asked only where something is wrong."""
        return {
            self.photo_ids[number]: float(np.quantile(self.size[self.photo == number], REACH_SHARE))
            for number in np.unique(self.photo).tolist()
        }


def _scaled(xy: Floats, camera: Camera) -> Floats:
    """Image points of a camera (m, 2), mm, in those units.

    The photos of a strip may lie crosswise in the comparator: then the sides of the format are exchanged.
    """
    half = np.full(2, camera.principal_distance) if camera.format is None else np.array(camera.format) / 2.0
    either = [xy / half, xy / half[::-1]]
    reach = [np.quantile(np.abs(each).max(axis=1), REACH_SHARE) for each in either]
    crosswise = reach[0] > REACH[1] >= reach[1]
    return either[1 if crosswise else 0]


def _reach(observations: PhotoPoints, scaled: Floats, photo: Numbers) -> _Reach:
    """Measure how far image points of a camera reach, and from their own middle."""
    size = np.abs(scaled).max(axis=1)
    ends = [[np.quantile(each, share) for each in scaled.T] for share in (1.0 - REACH_SHARE, REACH_SHARE)]
    middle = np.mean(ends, axis=0)
    return _Reach(
        size=size,
        photo=photo,
        photo_ids=observations.photo_ids,
        whole=np.quantile(size, REACH_SHARE),
        middle=middle,
        about_middle=np.quantile(np.abs(scaled - middle).max(axis=1), REACH_SHARE),
    )


def find_wrong_units(
    observations: PhotoPoints, cameras: Mapping[str, Camera]
) -> tuple[list[Finding], dict[str, float]]:
    """Look for image coordinates in another unit, and for principal distances that no lens has.

    Returns P101, P105, and P111 of cameras in pixels.
    Returns factor by camera that would bring its image coordinates to a likely size; 1 where nothing is wrong.
    """
    findings: list[Finding] = []
    factors: dict[str, float] = {}
    by_name = {each.name: each for each in cameras.values()}
    for name, camera in by_name.items():
        known = camera.format is not None
        low, high = REACH if known else REACH_OF_DISTANCE
        factors[name] = 1.0
        shown = np.array([photo in cameras and cameras[photo].name == name for photo in observations.photo_ids], bool)
        rows = shown[observations.photo]
        if not rows.any():
            continue
        reach = _reach(observations, _scaled(observations.xy[rows], camera), observations.photo[rows])
        if low < reach.whole < high:
            if camera.unit == "px" and reach.about_middle < low:  # at a corner: millimetres, perhaps
                findings.append(_wrong_unit(camera, reach.about_middle, UnitReading(1.0, ""), list(reach.of_photo)))
            continue
        odd = [photo for photo, own in reach.of_photo.items() if not low < own < high]
        if 0 < len(odd) <= FEW_SHARE * len(reach.of_photo):
            findings.append(_odd_photos(camera, odd, reach))
        elif (size := _reached(camera, observations.xy[rows])) is not None:
            findings.append(_other_size(camera, size, list(reach.of_photo)))
        elif reach.whole > high and low < reach.about_middle < high:
            findings.append(_other_origin(camera, reach))
        else:
            likely = LIKELY_REACH if known else LIKELY_OF_DISTANCE
            reading = reading_of(reach.whole, likely, camera.pixel_size)
            factors[name] = reading.factor
            findings.append(_wrong_unit(camera, reach.whole, reading, list(reach.of_photo)))
    wrong_size = {each.key for each in findings}
    for camera in by_name.values():
        if camera.size_key in wrong_size:
            continue  # nothing else can be said of it
        findings += filter(None, (_unlikely_lens(camera), _far_point(camera)))
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
    why = "they are not counted from the centre of the photo"
    key, fix = "observations.origin", "check `observations.origin`"
    if camera.unit != "px":
        fix += "; subtract the middle of the fiducial marks, or give the marks"
    elif abs(x) < AT_CORNER and abs(y - 2.0) < AT_CORNER:
        key, fix = "observations.y_axis", "write `y_axis: down` where rows grow downwards, else `up`"
        why = "y is counted the other way"
    elif abs(x - 1.0) < AT_CORNER and abs(abs(y) - 1.0) < AT_CORNER:
        fix = "write `origin: top-left`" + ", and `y_axis: down`" * (y > 0.0)
    message = (
        f"image coordinates of camera {camera.name} reach to {reach.whole:.3g} times {_unit_of_reach(camera)}, but to "
        f"{reach.about_middle:.2g} from their own middle, which lies at ({x:.2f}, {y:.2f}) of it: {why}"
    )
    evidence = {"reach": reach.whole, "reach_from_middle": reach.about_middle, "middle_x": x, "middle_y": y}
    return found("P101", message, fix, evidence, photos=list(reach.of_photo), key=key)


def _reached(camera: Camera, xy: Floats) -> Floats | None:
    """Return how far points reach that are counted from the corner of a larger photo (2,), pixels from that corner.

    xy: (m, 2), image points of the camera, mm. None for other points, and for cameras that are not given in pixels.
    """
    if camera.unit != "px" or camera.format is None:
        return None
    xy = xy * [1.0, -1.0] + np.array(camera.format) / 2.0
    from_corner = np.quantile(xy, 1.0 - REACH_SHARE, axis=0), np.quantile(xy, REACH_SHARE, axis=0)
    beyond = (from_corner[1] > camera.format).any()
    beyond &= (from_corner[1] < MOST_SIZES * np.array(camera.format)).all()  # farther away it is another unit
    beyond &= (from_corner[0] > 0.0).all() and (from_corner[0] < BEGIN_SHARE * from_corner[1]).all()
    return np.array([camera.in_unit(each) for each in xy.max(axis=0)]) if beyond else None


def _other_size(camera: Camera, reached: Floats, photos: Sequence[str]) -> Finding:
    """Say that photos are larger than the camera, or have their sides exchanged."""
    width, height = (camera.in_unit(each) for each in camera.format or ())
    message = (
        f"image coordinates of camera {camera.name} reach to column {reached[0]:.0f} and row {reached[1]:.0f}, and its "
        f"`image_size` is [{width:g}, {height:g}]"
    )
    fix = "give `image_size` of the photos in which they were measured"
    if (reached < (height, width)).all():
        fix = f"exchange width and height: `image_size: [{height:g}, {width:g}]`"
    evidence: Evidence = {"column": reached[0], "row": reached[1], "width_px": width, "height_px": height}
    return found("P101", message, fix, evidence, photos=photos, key=camera.size_key)


def _far_point(camera: Camera) -> Finding | None:
    """Question the principal point of a camera in pixels that lies far from the middle of the photo (P111).

    An error where it lies in the middle, counted from another origin, or outside a photo of twice the size; else the
    photo may be a part of a larger one.
    """
    if camera.unit != "px" or camera.format is None:
        return None
    off, size = np.array(camera.principal_point), np.array(camera.format)
    if (np.abs(off) < PLACE_OF_POINT * size).all():
        return None
    x, y = (camera.in_unit(each) for each in off)
    message = (
        f"the principal point of camera {camera.name} lies {x:+.0f} px in x and {y:+.0f} px in y (up) from the middle "
        "of the photo"
    )
    fix = "count it from where the `convention` does"
    elsewhere = {
        "it is counted from the corner, and the `convention` counts from the middle": [0.5, -0.5],
        "it is counted from the middle, and the `convention` counts from the corner": [-0.5, 0.5],
    }
    meant = [text for text, corner in elsewhere.items() if (np.abs(off / size - corner) < PLACE_OF_POINT).all()]
    message += "".join(f": {text}" for text in meant)
    evidence: Evidence = {"x_px": x, "y_px": y}
    finding = found("P111", message, fix, evidence, key=f"cameras.{camera.name}.principal_point")
    if meant or (np.abs(off) > size).any():
        return replace(finding, severity=ERROR)
    return replace(finding, fix=f"{fix}; is the photo a part of a larger one, `accept: [P111]`")


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
            message += f"; or the principal distance is not {camera.length(camera.principal_distance)}"
            fix += ", or the principal distance"
    else:
        fix = "check `observations.unit`, `observations.origin` and the format of the camera"
        if camera.unit == "px" and reach < LIKELY_REACH[0]:
            fix = "are they in millimetres? A camera in pixels goes with columns and rows in pixels"
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
    fix = f"is it {camera.length(fits[0])}?" if fits else "take principal distance and format from the certificate"
    if camera.unit == "px":
        converted = camera.in_unit(camera.in_unit(camera.principal_distance))  # of mm, by the stated size
        least, most = (camera.length(half / each, in_pixels=".0f") for each in (high, low))
        fix = (
            "`focal_length` is in pixels (mm divided by the size of a pixel in mm), of `opensfm` in parts of the larger"
            f" side; here usually {least} to {most}"
        )
        if camera.pixel_size != PIXEL_SIZE and low < camera.in_unit(half) / converted < high:
            fix = f"is it {converted:.0f} px? {fix}"
    message = (
        f"camera {camera.name} with a principal distance of {camera.length(camera.principal_distance)} and a format of "
        f"{camera.in_unit(camera.format[0]):g} x {camera.length(camera.format[1])} would have a field of "
        f"{field:.1f} degrees"
    )
    evidence = {"principal_distance_mm": camera.principal_distance, "half_diagonal_mm": half, "field_deg": field}
    return found("P105", message, fix, evidence, key=camera.distance_key)


FOOT = 0.3048  # metres
KINDS_OF_FEET = "international feet (0.3048 m) and US survey feet (1200/3937 m) differ by 2 ppm, 1.2 m at 600 km"
MARGIN_SHARES = (0.6, 0.25)  # of the width and the height of the area: a neighbouring zone is used at times
MARGIN_LIMITS_DEG = (1.0, 4.0)
CIRCLE_DEG = 360.0
MOST_OUTSIDE_SHARE = 0.5  # of the points: single ones are slips
# times the median distance from the median place: a slip of the pen, which says nothing of the others
SLIP_OF_PEN = 1000.0
MOST_ROUND_TRIP = 1.0  # units of the frame between a point and where its geocentric coordinates lead back to
MILLION = 1e6
TENS = (10.0, 100.0, 1000.0)  # of coordinates with lost digits, or in kilometres


class FramePlace(NamedTuple):
    """Where a control list lies."""

    findings: list[Finding]  # P401, P402, P403
    # whether its axes are right because the exchanged ones would lie elsewhere (True), wrong (False), or nobody knows
    # (None)
    sure: bool | None
    inside: bool  # whether it lies where its coordinate reference system is made for, as far as that is known


def find_wrong_place(frame: GroundFrame, areas: AreasOfUse, enu: Floats, number: int) -> FramePlace:
    """Compare the place of control list `number` with the areas of its coordinate reference system.

    enu: (n, 3), its points east, north, up, in the units of the frame.
    """
    area = areas.crs
    known = _together(enu[np.isfinite(enu[:, :2]).all(axis=1)])
    if area is None or not len(known) or frame.kind not in {"projected", "geographic"}:
        return FramePlace([], None, inside=True)
    level = np.column_stack([known[:, :2], np.zeros(len(known))])
    exchanged = level[:, [1, 0, 2]]
    well_inside = _inside(frame, area, level, margin=0.0)
    tens = 0.0 if well_inside else _tens(frame, area, level)
    if well_inside or (_inside(frame, area, level) and not tens):
        return FramePlace([], None if _inside(frame, area, exchanged) else True, inside=True)
    finding = _outside(frame, areas, level, f"control[{number}] {_where(frame, level, known)}", tens)
    if finding is None:
        return FramePlace([], None, inside=True)
    finding = replace(finding, key=f"control[{number}]{finding.key}")
    return FramePlace([finding], sure=False if finding.code == "P401" else None, inside=False)


def _outside(frame: GroundFrame, areas: AreasOfUse, level: Floats, where: str, tens: float) -> Finding | None:
    """Say how points outside the area of their CRS would lie in it; its key is below that of their list.

    Without such a reading there is nothing to say where their projection is made for the place, and little elsewhere.
    """
    if areas.crs is None:
        return None
    west, south, east, north = areas.crs
    evidence: Evidence = {
        "area_west_deg": west,
        "area_south_deg": south,
        "area_east_deg": east,
        "area_north_deg": north,
    }
    head = f"{where}, and {frame.title} is made for {west:g} to {east:g} E, {south:g} to {north:g} N"
    if tens:
        fix = "give metres; was a digit lost, or are the coordinates in kilometres?"
        return found("P402", f"{head}; multiplied by {tens:g} it would lie there", fix, evidence | {"factor": tens})
    zone = _other_zone(frame, areas.projection, level)
    if _inside(frame, areas.crs, level[:, [1, 0, 2]]):
        message = f"{head}; with east and north exchanged it would lie there"
        axes = ", ".join({"east": "north", "north": "east"}.get(axis, axis) for axis in frame.axes)
        fix = f"write `axes: [{axes}]`" + (f", or {zone}" if zone else "")
        return found("P401", message, fix, evidence, key=".axes")
    for code, changed, what, fix in _readings(level):
        if _inside(frame, areas.crs, changed):
            return found(code, f"{head}; {what}", fix, evidence, key=".crs")
    if _inside(frame, areas.projection, level):
        return None
    fix = zone or "is the crs the right one: zone, datum, false easting and northing?"
    finding = found("P402", head, fix, evidence, key=".crs")
    return finding if _degrees(frame, level) is None else replace(finding, severity=WARNING)


def _other_zone(frame: GroundFrame, area: Area | None, level: Floats) -> str:
    """Say what to do where eastings begin with the number of the next zone: those of this one would lie in its area."""
    begin = np.floor(np.median(level[:, 0]) / MILLION)
    steps = np.array([[-MILLION, 0.0, 0.0], [MILLION, 0.0, 0.0]]) if begin > 0 else ()
    if not any(_inside(frame, area, level + step, margin=0.0) for step in steps):
        return ""
    return f"name the crs of zone {begin:.0f}, with which its eastings begin"


def _together(enu: Floats) -> Floats:
    """Return points without those that lie so far from the others that no map reaches there."""
    if not len(enu):
        return enu
    far = np.abs(enu[:, :2] - np.median(enu[:, :2], axis=0)).max(axis=1)
    return np.asarray(enu[far <= SLIP_OF_PEN * np.median(far)], float)


def _readings(level: Floats) -> Iterator[tuple[str, Floats, str, str]]:
    """Give readings of coordinates with their code, what happened, and the cure."""
    feet = f"name a crs in feet, or convert the table; {KINDS_OF_FEET}"
    yield "P403", level * FOOT, "read as feet it would lie there", feet
    yield "P403", level / FOOT, "read as metres it would lie there: the crs counts in feet", "name a crs in metres"
    yield "P403", level[:, [1, 0, 2]] * FOOT, "read as feet with exchanged axes it would lie there", feet
    zone = level.copy()
    zone[:, 0] -= np.floor(zone[:, 0] / MILLION) * MILLION
    prefixed = "without the millions of its eastings it would lie there: they are a zone number"
    yield "P402", zone, prefixed, "name the crs of that zone, as of Gauss-Kruger zones"
    yield (
        "P402",
        level * [1.0, -1.0, 1.0],
        "with northings of the other sign it would lie there",
        "is the crs southern?",
    )
    yield "P402", level / 1000.0, "read as millimetres it would lie there", "give metres"


def _tens(frame: GroundFrame, area: Area, level: Floats) -> float:
    """Power of ten that brings points from outside the area, or from beside it, into it; 0 where none does.

    Near the origin of a map, where scaled numbers lie, some areas are not far.
    """
    if frame.kind != "projected":
        return 0.0
    return next((each for each in TENS if _inside(frame, area, each * level, margin=0.0)), 0.0)


def _inside(frame: GroundFrame, area: Area | None, enu: Floats, *, margin: float = 1.0) -> bool:
    """Whether most points lie in an area or beside it, within a part of the usual margin."""
    degrees = None if area is None else _degrees(frame, enu)
    if area is None or degrees is None:
        return False
    west, south, east, north = area
    width = (east - west) % CIRCLE_DEG or CIRCLE_DEG
    beside, above = (
        margin * float(np.clip(part * size, *MARGIN_LIMITS_DEG))
        for part, size in zip(MARGIN_SHARES, (width, north - south), strict=True)
    )
    lon = (degrees[:, 0] - west + beside) % CIRCLE_DEG
    within = (lon <= width + 2.0 * beside) | (width + 2.0 * beside >= CIRCLE_DEG)
    within &= (degrees[:, 1] >= south - above) & (degrees[:, 1] <= north + above)
    return bool(within.mean() > MOST_OUTSIDE_SHARE)


def _degrees(frame: GroundFrame, enu: Floats) -> Floats | None:
    """Longitude and latitude of points; None where they lie nowhere."""
    try:
        cartesian = frame.cartesian_from_ground(enu)
        degrees = np.degrees(frame.geodetic(cartesian)[:, :2])
        back = frame.difference(frame.ground_from_cartesian(cartesian), enu)
    except (GeometryError, InputError):
        return None
    # far from its zone a projection gives places from which no way leads back
    returned = np.abs(back[:, :2]).max(axis=1) < MOST_ROUND_TRIP
    sound = np.isfinite(degrees).all() and bool(returned.mean() > MOST_OUTSIDE_SHARE)
    return degrees if sound else None


def _where(frame: GroundFrame, level: Floats, known: Floats) -> str:
    degrees = _degrees(frame, level)
    if degrees is None:
        east, north = (np.median(known[:, axis]) for axis in (0, 1))
        return f"lies nowhere on the Earth (east about {east:.6g}, north about {north:.6g})"
    lon, lat = (np.median(degrees[:, axis]) for axis in (0, 1))
    return f"lies about {abs(lon):.1f} {'E' if lon >= 0 else 'W'}, {abs(lat):.1f} {'N' if lat >= 0 else 'S'}"
