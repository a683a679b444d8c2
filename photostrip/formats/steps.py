"""Tables of single steps of the method: points in two systems, or on two photos."""

from __future__ import annotations

from functools import partial

import numpy as np

from photostrip.arrays import Floats
from photostrip.errors import InputError
from photostrip.formats.faults import Findings
from photostrip.formats.measured import POINT, Measurements, numbers, read_measurements
from photostrip.formats.tables import Column, Table
from photostrip.formats.terrestrial import read_points

IMAGE, XYZ, GROUND = ("x", "y"), ("x", "y", "z"), ("x_ground", "y_ground", "z_ground")
PHOTOS = (("x_left", "y_left"), ("x_right", "y_right"))
COLUMNS: dict[str, tuple[tuple[str, ...], ...]] = {
    "interior": (IMAGE, ("x_photo", "y_photo")),
    "refine": (IMAGE,),
    "relative": PHOTOS,
    "intersection": PHOTOS,
    "chain": (("omega", "phi", "kappa"),),
    "scale": (XYZ, ("x_next", "y_next", "z_next")),
    "absolute": (XYZ, GROUND),
    "polynomial": (XYZ, ("misclosure",)),
    "resection": (IMAGE, GROUND),
    "bundle": (GROUND,),  # of its control
    "frame": (("longitude", "latitude", "height"),),
    "curvature": (XYZ,),
    "pair-scales": (XYZ, GROUND),
    "closed-form": (IMAGE,),
    "deformation": (IMAGE, ("dz",)),
}
WEIGHTED = ("scale", "absolute")  # may have the column ``weight``
WEIGHT = Column("weight", number=True, required=False, filled=False, positive=True)
MARK = Column("point", aliases=("mark", "photo", *POINT.aliases))


def read_step(file: str, step: str, systems: tuple[tuple[str, ...], ...] = ()) -> tuple[list[str], list[Floats]]:
    """Read the table of a step: ids, its coordinates by system, weights where it may have them, or raise its faults.

    systems: its columns, where they are not the usual ones.
    """
    findings = Findings()
    wanted, weights = systems or COLUMNS[step], (WEIGHT,) if step in WEIGHTED else ()
    table = read_points(file, (MARK, *(each for names in wanted for each in numbers(*names)), *weights), findings)
    findings.stop()
    if table is None:  # cannot be: what is not read has a fault, and stop() raised it
        raise InputError(f"{file} cannot be read")
    return table.cells("point"), [*(table.columns(*names) for names in wanted), *map(partial(_weights, table), weights)]


def _weights(table: Table, column: Column) -> Floats:
    """Return the weights of the points: those of empty cells, and of a table without any, are 1."""
    given = table.numbers.get(column.name)
    return np.ones(len(table.lines)) if given is None else np.where(np.isnan(given), 1.0, given)


def read_rays(file: str) -> Measurements:
    """Read image coordinates of photos in flight order, or raise every fault of their table."""
    findings = Findings()
    read = read_measurements([file], findings)
    findings.stop()
    if read is None:  # cannot be, see above
        raise InputError(f"{file} cannot be read")
    return read
