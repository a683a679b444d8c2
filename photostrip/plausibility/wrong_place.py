"""Where on the Earth given coordinates lie, against where their coordinate reference system is made for.

Coordinates with exchanged axes, in feet, or of another system fall hundreds of kilometres away. When they do, the
readings that would bring them back are tried: one that does is an error. Without one the area alone proves nothing: a
zone of Gauss-Kruger serves at any latitude, whoever registered it for which country. A neighbouring zone of UTM cannot
be seen: the same numbers lie in it as well; those of Gauss-Kruger begin with the number of their zone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.crs import Area, AreasOfUse
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.notes import Finding
from photostrip.plausibility.finding import WARNING, Evidence, found

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
        fix = "put `control.axes` into the order of the columns" + (f", or {zone}" if zone else "")
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
