"""Tables of single steps of the method: points in two systems, or on two photos."""

from __future__ import annotations

from typing import Any

import numpy as np

from photostrip.errors import InputError
from photostrip.formats.faults import Findings
from photostrip.formats.measured import POINT, Measurements, numbers, read_measurements
from photostrip.formats.tables import Column
from photostrip.formats.terrestrial import read_points

WEIGHT = Column("weight", number=True, required=False, filled=False, positive=True)
MARK = Column("point", aliases=("mark", "photo", *POINT.aliases))


def read_step(file: str, columns: str) -> tuple[Any, ...]:
    """Read the table of a step: ids, an array (n, k) for each of its systems, or raise its faults.

    columns: as ``strip.STEPS`` has them. Weights of empty cells, and of a table without any, are 1.
    """
    findings = Findings()
    systems = [names.split(", ") for names in columns.split("; ")[1:]]
    wanted = [(WEIGHT,) if names == ["weight"] else numbers(*names) for names in systems]
    table = read_points(file, (MARK, *(column for each in wanted for column in each)), findings)
    findings.stop()
    if table is None:  # cannot be: what is not read has a fault, and stop() raised it
        raise InputError(f"{file} cannot be read")
    table.numbers.setdefault("weight", np.ones(len(table.lines)))
    arrays = [table.columns(*names) for names in systems]
    return table.cells("point"), *(np.where(np.isnan(each), 1.0, each) for each in arrays)


def read_rays(file: str) -> Measurements:
    """Read image coordinates of photos in flight order, or raise every fault of their table."""
    findings = Findings()
    read = read_measurements([file], findings)
    findings.stop()
    if read is None:  # cannot be, see above
        raise InputError(f"{file} cannot be read")
    return read
