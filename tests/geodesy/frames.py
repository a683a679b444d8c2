"""Short ways to a ground frame, for the tests of this folder."""

from __future__ import annotations

import csv
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from photostrip.arrays import Floats
from photostrip.errors import InputError
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.tying import tie_frames

DATA = Path(__file__).parents[1] / "data" / "geodesy"
ENU = ("east", "north", "up")
NEU = ("north", "east", "up")
XYZ = ("x", "y", "z")


def spec(crs: str, **rest: Any) -> FrameSpec:  # noqa: ANN401 (the fields of a FrameSpec)
    """Give the description of a frame, east first unless `axes` says otherwise."""
    axes = rest.pop("axes", XYZ if crs in {"geocentric", "EPSG:4978"} else ENU)
    return FrameSpec(crs, axes, **rest)


def frame(crs: str, **rest: Any) -> GroundFrame:  # noqa: ANN401
    """Give a frame that stands alone."""
    return tie_frames([spec(crs, **rest)])[1]


def pair(given: FrameSpec | str, output: FrameSpec | str) -> tuple[GroundFrame, GroundFrame]:
    """Give two frames that are tied, the second being the output's."""
    first, second = (each if isinstance(each, FrameSpec) else spec(each) for each in (given, output))
    frames, out = tie_frames([first], second)
    return frames[0], out


def refused(*specs: FrameSpec | str, **rest: Any) -> list[str]:  # noqa: ANN401
    """Give the lines of the refusal of some frames."""
    with pytest.raises(InputError) as caught:
        tie_frames([each if isinstance(each, FrameSpec) else spec(each) for each in specs], **rest)
    return [str(fault) for fault in caught.value.faults]


def rows(name: str) -> list[dict[str, float]]:
    """Read one table of published conversions."""
    with (DATA / name).open(encoding="utf-8", newline="") as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def columns(table: list[dict[str, float]], *names: str) -> Floats:
    """Give columns of a table as an array; a number stands for itself."""
    return np.array([[row[name] for name in names] for row in table])


def with_height(plan: Floats, height: float = 0.0) -> Floats:
    """Append one height to all rows."""
    return np.column_stack([plan, np.full(len(plan), height)])


def write_gtx(path: Path, undulation: Floats, *, south: float, west: float, step: float) -> Path:
    """Write a geoid grid: rows from south to north, columns from west to east, degrees and metres."""
    head = struct.pack(">ddddii", south, west, step, step, *undulation.shape)
    path.write_bytes(head + undulation.astype(">f4").tobytes())
    return path


def krueger(
    lonlat_deg: Floats, *, a: float, flattening: float, lon_0: float, k0: float, east_0: float = 500000.0
) -> tuple[Floats, Floats]:
    """Transverse Mercator by the series of Krueger and Karney, to the sixth order of n: (east, north) and convergence.

    Source: C. F. F. Karney, Transverse Mercator with an accuracy of a few nanometers, eq. 7-11, 23-26, 35.
    """
    n = flattening / (2.0 - flattening)
    e = math.sqrt(flattening * (2.0 - flattening))
    radius = a / (1.0 + n) * (1.0 + n**2 / 4.0 + n**4 / 64.0 + n**6 / 256.0)
    alpha = [
        n / 2 - 2 * n**2 / 3 + 5 * n**3 / 16 + 41 * n**4 / 180 - 127 * n**5 / 288 + 7891 * n**6 / 37800,
        13 * n**2 / 48 - 3 * n**3 / 5 + 557 * n**4 / 1440 + 281 * n**5 / 630 - 1983433 * n**6 / 1935360,
        61 * n**3 / 240 - 103 * n**4 / 140 + 15061 * n**5 / 26880 + 167603 * n**6 / 181440,
        49561 * n**4 / 161280 - 179 * n**5 / 168 + 6601661 * n**6 / 7257600,
        34729 * n**5 / 80640 - 3418889 * n**6 / 1995840,
        212378941 * n**6 / 319334400,
    ]
    lon, lat = np.radians(lonlat_deg[:, 0] - lon_0), np.radians(lonlat_deg[:, 1])
    t = np.sinh(np.arctanh(np.sin(lat)) - e * np.arctanh(e * np.sin(lat)))
    xi1, eta1 = np.arctan2(t, np.cos(lon)), np.arcsinh(np.sin(lon) / np.hypot(t, np.cos(lon)))
    xi, eta, p, q = xi1.copy(), eta1.copy(), np.ones_like(lon), np.zeros_like(lon)
    for j, factor in enumerate(alpha, start=1):
        angle, stretch = 2 * j * xi1, 2 * j * eta1
        xi += factor * np.sin(angle) * np.cosh(stretch)
        eta += factor * np.cos(angle) * np.sinh(stretch)
        p += 2 * j * factor * np.cos(angle) * np.cosh(stretch)
        q += 2 * j * factor * np.sin(angle) * np.sinh(stretch)
    grid = np.column_stack([east_0 + k0 * radius * eta, k0 * radius * xi])
    return grid, np.arctan2(t * np.tan(lon), np.hypot(1.0, t)) + np.arctan2(q, p)
