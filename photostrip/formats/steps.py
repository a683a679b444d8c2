"""Tables of single steps of the method: points in two systems, or on two photos."""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np

from photostrip.errors import InputError
from photostrip.formats.faults import Findings
from photostrip.formats.measured import POINT, Measurements, numbers, read_measurements
from photostrip.formats.tables import Column, Table
from photostrip.formats.terrestrial import read_points

WEIGHT = Column("weight", number=True, required=False, filled=False, positive=True)
MARK = Column("point", aliases=("mark", "photo", *POINT.aliases))


def read_step(file: str, columns: str) -> tuple[Any, ...]:
    """Read the table of a step, or raise its faults: ids, an array (n, k) for each of its systems.

    Of image coordinates of photos in flight order: ids of photos and of points, and the rays.
    columns: as ``strip.STEPS`` has them. Weights of empty cells, and of a table without any, are 1.
    """
    findings = Findings()
    systems = [names.split(", ") for names in columns.split("; ")[1:]]
    read: Measurements | Table | None
    if systems[0] == ["point"]:
        read = read_measurements([file], findings)
    else:
        listed = ([WEIGHT] if names == ["weight"] else numbers(*names) for names in systems)
        read = read_points(file, (MARK, *chain.from_iterable(listed)), findings)
    findings.stop()
    if read is None:  # cannot be: what is not read has a fault, and stop() raised it
        raise InputError(f"{file} cannot be read")
    if isinstance(read, Measurements):
        return read.photo_ids, read.target_ids, (read.photo, read.target, read.xy)
    read.numbers.setdefault("weight", np.ones(len(read.lines)))
    arrays = [read.columns(*names) for names in systems]
    return read.cells("point"), *(np.where(np.isnan(each), 1.0, each) for each in arrays)
