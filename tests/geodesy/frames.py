"""Short ways to a ground frame, for the tests of this folder."""

from __future__ import annotations

import csv
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
