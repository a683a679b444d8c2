"""Where on the Earth given coordinates lie, against where their coordinate reference system is made for.

Coordinates with exchanged axes, in feet, or of another system fall hundreds of kilometres away. When they do, the
readings that would bring them back are tried. A neighbouring zone cannot be seen: the same numbers lie in it as well.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from photostrip.arrays import Floats, column_medians, median
from photostrip.errors import GeometryError, InputError
from photostrip.frozen import NamedTuple
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.notes import Finding
from photostrip.triangulation.plausibility.control.straightening import FOOT, KINDS_OF_FEET
from photostrip.triangulation.plausibility.finding import Evidence, found

Area = tuple[float, float, float, float]
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


def find_wrong_place(frame: GroundFrame, area: Area | None, enu: Floats, number: int) -> FramePlace:
    """Compare the place of control list `number` with the area of its coordinate reference system.

    enu: (n, 3), its points east, north, up, in the units of the frame.
    """
    known = _together(enu[np.isfinite(enu[:, :2]).all(axis=1)])
    if area is None or not len(known) or frame.kind not in {"projected", "geographic"}:
        return FramePlace([], None, inside=True)
    level = np.column_stack([known[:, :2], np.zeros(len(known))])
    exchanged = level[:, [1, 0, 2]]
    well_inside = _inside(frame, area, level, margin=0.0)
    tens = 0.0 if well_inside else _tens(frame, area, level)
    if well_inside or (_inside(frame, area, level) and not tens):
        return FramePlace([], None if _inside(frame, area, exchanged) else True, inside=True)
    key = f"control[{number}]"
    where = _where(frame, level, known)
    evidence: Evidence = {
        "area_west_deg": area[0],
        "area_south_deg": area[1],
        "area_east_deg": area[2],
        "area_north_deg": area[3],
    }
    head = f"{key} {where}, and {frame.title} is made for {area[0]:g} to {area[2]:g} E, {area[1]:g} to {area[3]:g} N"
    if tens:
        message = f"{head}; multiplied by {tens:g} it would lie there"
        fix = "give metres; was a digit lost, or are the coordinates in kilometres?"
        evidence["factor"] = tens
        return FramePlace([found("P402", message, fix, evidence, key=key)], sure=None, inside=False)
    if _inside(frame, area, exchanged):
        message = f"{head}; with east and north exchanged it would lie there"
        fix = "put `control.axes` into the order of the columns"
        return FramePlace([found("P401", message, fix, evidence, key=f"{key}.axes")], sure=False, inside=False)
    for code, changed, what, fix in _readings(level):
        if _inside(frame, area, changed):
            finding = found(code, f"{head}; {what}", fix, evidence, key=f"{key}.crs")
            return FramePlace([finding], sure=None, inside=False)
    fix = "is the crs the right one: zone, datum, false easting and northing?"
    return FramePlace([found("P402", head, fix, evidence, key=f"{key}.crs")], sure=None, inside=False)


def _together(enu: Floats) -> Floats:
    """Return points without those that lie so far from the others that no map reaches there."""
    if not len(enu):
        return enu
    far = np.abs(enu[:, :2] - column_medians(enu[:, :2])).max(axis=1)
    return np.asarray(enu[far <= SLIP_OF_PEN * median(far)], float)


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


def _inside(frame: GroundFrame, area: Area, enu: Floats, *, margin: float = 1.0) -> bool:
    """Whether most points lie in an area or beside it, within a part of the usual margin."""
    degrees = _degrees(frame, enu)
    if degrees is None:
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
        east, north = (median(known[:, axis]) for axis in (0, 1))
        return f"lies nowhere on the Earth (east about {east:.6g}, north about {north:.6g})"
    lon, lat = (median(degrees[:, axis]) for axis in (0, 1))
    return f"lies about {abs(lon):.1f} {'E' if lon >= 0 else 'W'}, {abs(lat):.1f} {'N' if lat >= 0 else 'S'}"
