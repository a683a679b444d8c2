"""What numbers of a terrestrial survey can be: wide limits that catch a wrong unit or a slip of the pen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from photostrip.formats.text.findings import Findings
from photostrip.formats.text.tables import Table
from photostrip.project.schema.sections import Range

MILLIMETRES = {"mm": 1.0, "um": 1e-3}  # in a unit of image coordinates
RADIANS = {"deg": np.pi / 180, "gon": np.pi / 200}  # in a unit of angles

PRINCIPAL_DISTANCE = Range(1.0, 1e5, "mm")
FORMAT = Range(1.0, 1e4, "mm")
STEP = Range(1e-3, 1e5, "mm")
COORDINATE = Range(-1e4, 1e4, "mm")
IMAGE_SIGMA = Range(1e-6, 10.0, "mm")
IMAGE_SIGMA_UM = Range(1e-3, 1e4, "µm")
DIRECTION_SIGMA = Range(1e-4, 36_000.0, "″")
DEGREES = Range(-1000.0, 1000.0, "deg")
GON = Range(-1000.0, 1000.0, "gon")
POSITION = Range(-1e8, 1e8, "m")
BASE = Range(1e-3, 1e6, "m")
DISTANCE = Range(1e-2, 1e6, "m")
ECCENTRICITY = Range(-10.0, 10.0, "m")
REFRACTION = Range(-10.0, 10.0, "")
TIME = Range(-1e9, 1e9, "")
SIGNIFICANCE = Range(1e-6, 0.5, "")


def refuse_outside(
    table: Table, columns: Sequence[str], limits: Range, findings: Findings, *, scale: float = 1.0, unit: str = ""
) -> None:
    """Refuse numbers of a table outside limits in its unit; empty cells do not count."""
    bounds = limits.scaled(scale, unit)
    for name in columns:
        values = table.column(name)
        for row in np.flatnonzero(~np.isnan(values) & ~((values >= bounds.least) & (values <= bounds.most))):
            message = f"{values[row]:g} is out of range"
            findings.add(table.fault(int(row), name, message, "range", expected=str(bounds)))
