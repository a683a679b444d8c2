"""GNSS events beside any block, one at each exposure: ``Timestamp.MRK`` of DJI, ``events.pos`` of RTKLIB and Emlid.

A line of DJI has the number of the photo, the time, the offset from the antenna to the camera as ``3,N 0,E 75,V`` in
millimetres (V down), ``lat,Lat lon,Lon h,Ellh``, standard deviations north, east, up in metres, ``50,Q`` for a fixed
solution. A line of RTKLIB has the columns of its header, which begins with ``%``: of the antenna, sdn, sde, sdu in
metres, Q 1 for a fixed solution. Both are WGS 84 as their base station gave it, heights over the ellipsoid.

The layouts are in the manual of RTKLIB, appendix B, and in DJI's description of the files of the Phantom 4 RTK.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import Fault, InputError
from photostrip.foreign.places import Place, unique
from photostrip.foreign.tables import NORTHERNMOST, ROUND, ForeignBlock, GivenPositions
from photostrip.formats.faults import NotANumber, shown
from photostrip.formats.faults import number as read_number
from photostrip.formats.tables import content
from photostrip.geodesy.ground_frame import WGS84
from photostrip.notes import counted

NUMBER = r"(-?[0-9.]+)"
MRK = re.compile(
    rf"(\d{{1,9}})\s+[0-9.]+\s+\[\s*\d+\s*\]\s+{NUMBER},N\s+{NUMBER},E\s+{NUMBER},V\s+{NUMBER},Lat\s+{NUMBER},Lon\s+"
    rf"{NUMBER},Ellh\s+{NUMBER},\s*{NUMBER},\s*{NUMBER}\s+(\d+),Q\s*"
)
COLUMNS = ("latitude(deg)", "longitude(deg)", "height(m)", "sdn(m)", "sde(m)", "sdu(m)", "Q")
LAST_NUMBER = re.compile(r"(\d{1,9})\D*$")


@dataclass(frozen=True, eq=False)
class Event:
    place: Place
    number: int  # of the file, or of its lines
    position: tuple[float, float, float]  # longitude, latitude in degrees, height in metres
    sigma: tuple[float, float, float]  # east, north, up in metres
    fixed: bool


def with_events(block: ForeignBlock, file: str) -> ForeignBlock:
    """Give the photos of a block their positions.

    Raises InputError with file and line for all that is no such file, and where events and photos do not match.
    """
    lines = [(Place(file, n), line.strip()) for n, line in enumerate(content(file)[0].decode().split("\n"), 1)]
    dji = any(MRK.fullmatch(line) for _, line in lines)
    if not dji and not any(line.startswith("%") for _, line in lines):
        expected = "Timestamp.MRK of DJI, or events.pos of RTKLIB with its header"
        raise InputError(Fault("holds no events of a receiver", "foreign", file, expected=expected))
    given = list(_dji(lines) if dji else _rtklib(lines))
    events = list(dict(unique("event", ((each.place, each.number, each) for each in given))).values())
    chosen, rule = _matched(file, block.photos, events, numbered=dji)
    for each in chosen:
        longitude, latitude, _ = each.position
        if not (abs(latitude) < NORTHERNMOST and abs(longitude) <= ROUND and min(each.sigma) > 0.0):
            raise each.place.wrong("latitude, longitude or a standard deviation is none", "range")
    floating = sum(not each.fixed for each in chosen)
    said = (
        f"{counted(len(chosen), 'event')} of {'DJI' if dji else 'RTKLIB'}, {rule}; WGS 84, heights over the ellipsoid; "
    )
    said += "of the camera, its offset applied" if dji else "of the antenna: give its lever_arm in the project"
    positions = GivenPositions(
        xyz=np.array([each.position for each in chosen]),
        sigma=np.array([each.sigma for each in chosen]),
        said=f"{said}; {floating} of them without fixed ambiguities" if floating else said,
    )
    return replace(block, files=(*block.files, file), positions=positions)


def _dji(lines: Sequence[tuple[Place, str]]) -> Iterator[Event]:
    for place, line in lines:
        if not line:
            continue
        found = MRK.fullmatch(line)
        if found is None:
            expected = "number, time, [week], offsets N, E, V, Lat, Lon, Ellh, three standard deviations, Q"
            raise place.wrong(f"`{shown(line)}` is no event of DJI", expected=expected)
        north, east, down, latitude, longitude, height, *sigma = _numbers(place, found.groups()[1:-1])
        per_degree = np.radians(_radii(latitude))
        position = (
            longitude + east / 1000.0 / (per_degree[1] * np.cos(np.radians(latitude))),
            latitude + north / 1000.0 / per_degree[0],
            height - down / 1000.0,
        )
        yield Event(
            place=place,
            number=int(found[1]),
            position=position,
            sigma=(sigma[1], sigma[0], sigma[2]),
            fixed=found.groups()[-1] == "50",
        )


def _radii(latitude: float) -> Floats:
    """Radii of curvature of the ellipsoid along the meridian and across it."""
    a, b = WGS84
    across = a * a / np.hypot(a * np.cos(np.radians(latitude)), b * np.sin(np.radians(latitude)))
    return np.array([across**3 * b * b / a**4, across])


def _rtklib(lines: Sequence[tuple[Place, str]]) -> Iterator[Event]:
    heads = [(place, line.lstrip("% ").split()) for place, line in lines if line.startswith("%")]
    place, names = heads[-1]
    if missing := [name for name in COLUMNS if name not in names]:
        fix = "write it with latitude and longitude in degrees (out-solformat llh, out-degform deg)"
        raise place.wrong(f"the header has no column {', '.join(missing)}", "foreign", fix=fix)
    number = 0
    for place, line in lines:
        if not line or line.startswith("%"):
            continue
        words, number = line.split(), number + 1
        if len(words) != len(names) + 1:  # date and time, or week and second, are one name of the header
            message, expected = f"{counted(len(words), 'value')} in the line", f"{len(names) + 1}, as in the header"
            raise place.wrong(message, "row-length", expected=expected)
        row = dict(zip(names, words[1:], strict=True))
        latitude, longitude, height, north, east, up, quality = _numbers(place, [row[name] for name in COLUMNS])
        position = longitude, latitude, height
        yield Event(place=place, number=number, position=position, sigma=(east, north, up), fixed=quality == 1.0)


def _numbers(place: Place, words: Sequence[str]) -> list[float]:
    try:
        return [read_number(word) for word in words]
    except NotANumber as error:
        raise place.wrong(error.message, "number", fix=error.fix) from None


def _matched(file: str, photos: Sequence[str], events: Sequence[Event], *, numbered: bool) -> tuple[list[Event], str]:
    """Give each photo its event: by the last number of its name where all have one of DJI's, else in order."""
    by_number = {each.number: each for each in events}
    found = [LAST_NUMBER.search(name.rpartition(".")[0] or name) for name in photos]
    numbers = [int(each[1]) for each in found if each is not None]
    if numbered and len(set(numbers)) == len(photos) and by_number.keys() >= set(numbers):
        chosen, rule = [by_number[each] for each in numbers], "by the number in the photo's name"
    elif len(events) == len(photos):
        chosen, rule = list(events), "in the order of the photos' names"
    else:
        message = f"has {counted(len(events), 'event')}, the block {counted(len(photos), 'photo')}, from \
{shown(photos[0])} to {shown(photos[-1])}"
        fix = "give a file with the events of these photos alone, one line for each, in the order of their names"
        raise InputError(Fault(message, "foreign", file, fix=fix))
    return chosen, f"{rule}: {shown(photos[0])} is line {chosen[0].place.line}"
