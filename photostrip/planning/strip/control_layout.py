"""Where control is to be placed along a strip: by bands, at the corners, or point by point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from photostrip.errors import Fault, InputError
from photostrip.notes import counted
from photostrip.planning.strip.ideal_strip import IdealStrip

LAYOUTS = ("bands", "corners", "corners+centre", "points")
USES = {"xyz": (True, True, True), "xy": (True, True, False), "z": (False, False, True)}

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Spot:
    """One control point."""

    photo: int  # photo at whose nadir it lies, counted from 1
    row: int  # row of pass points from left to right, counted from 1
    use: str = "xyz"  # ``xyz``, ``xy`` or ``z``


@dataclass(frozen=True)
class ControlLayout:
    """A layout of control to be compared with others."""

    name: str
    kind: str = "bands"
    bands: int = 3  # number of bands, spread evenly from the first to the last photo
    every: int | None = None  # models from band to band, instead of `bands`; the last photo always has a band
    per_band: int = 3  # points of a band: 1 in the middle, 2 at the edges, and so on
    use: str = "xyz"  # ``xyz``, ``xy`` or ``z`` of the points of bands and corners
    spots: tuple[Spot, ...] = ()  # points, for ``points`` instead of bands, and in addition to the others
    sigma: Triple = (0.05, 0.05, 0.08)  # standard deviations along, across and in height, metres
    # standard deviations of measured perspective centres along, across and in height, metres
    gnss: Triple | None = None
    gnss_offset: bool = True  # whether they have a constant offset, which is to be determined


def spots_of(layout: ControlLayout, photos: int, rows: int) -> tuple[Spot, ...]:
    """Control points of a layout by photo and row, none twice; a spot named one by one wins over one of a band.

    Raises InputError when a spot lies outside the strip, or a band has more points than there are rows.
    """
    last = photos - 1
    if layout.kind == "points":
        places = []
    elif layout.kind == "bands":
        places = [(photo, row) for photo in _stations(layout, last) for row in across(layout.per_band, rows)]
    else:
        places = [(photo, row) for photo in (0, last) for row in across(2, rows)]
        if layout.kind == "corners+centre":
            places += [(photos // 2, row) for row in across(1, rows)]
    chosen = {(photo, row): Spot(photo + 1, row + 1, layout.use) for photo, row in places}
    for spot in layout.spots:
        if not (1 <= spot.photo <= photos and 1 <= spot.row <= rows):
            message = f"there is no row {spot.row} at photo {spot.photo}"
            expected = f"photos 1 to {photos}, rows 1 to {rows}"
            raise InputError(Fault(message, "plan-place", key="layouts", expected=expected))
        chosen[spot.photo - 1, spot.row - 1] = spot
    return tuple(chosen[place] for place in sorted(chosen))


def _stations(layout: ControlLayout, last: int) -> list[int]:
    """Photos of the bands, from 0."""
    if layout.every is not None:
        return sorted({*range(0, last + 1, layout.every), last})
    count = layout.bands
    if not 1 <= count <= last + 1:
        message = f"{counted(count, 'band')} cannot be placed on {last + 1} photos"
        raise InputError(Fault(message, "plan-place", key="layouts", expected=f"1 to {last + 1} bands"))
    return sorted({round(place) for place in np.linspace(0, last, count).tolist()}) if count > 1 else [last // 2]


def across(count: int, rows: int) -> list[int]:
    """Rows of the points of a band, spread evenly: the middle one, both edges, and so on."""
    if not 1 <= count <= rows:
        message = f"a band of {counted(count, 'point')} does not fit into {counted(rows, 'row')} of pass points"
        raise InputError(Fault(message, "plan-place", key="layouts", expected=f"1 to {rows} points"))
    return [rows // 2] if count == 1 else sorted({round(place) for place in np.linspace(0, rows - 1, count).tolist()})


def numbers_of(strip: IdealStrip, spots: tuple[Spot, ...]) -> list[int]:
    """Return the numbers of control points among the points of a strip."""
    return [strip.at(spot.photo - 1, spot.row - 1) for spot in spots]
