"""Tables of single steps of the method: points in two systems, or on two photos."""

from __future__ import annotations

from photostrip.arrays import Floats
from photostrip.errors import InputError
from photostrip.formats.measured.columns import POINT, numbers
from photostrip.formats.measured.measurements import Measurements
from photostrip.formats.measured.observations import read_measurements
from photostrip.formats.measured.terrestrial import read_points
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.tables import Column

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
}
MARK = Column("point", aliases=("mark", "photo", *POINT.aliases))


def read_step(file: str, step: str) -> tuple[list[str], list[Floats]]:
    """Read the table of a step: ids, and its coordinates by system; or raise every fault of it."""
    findings = Findings()
    systems = COLUMNS[step]
    table = read_points(file, (MARK, *(each for names in systems for each in numbers(*names))), findings)
    findings.stop()
    if table is None:  # cannot be: what is not read has a fault, and stop() raised it
        raise InputError(f"{file} cannot be read")
    return table.cells("point"), [table.columns(*names) for names in systems]


def read_rays(file: str) -> Measurements:
    """Read image coordinates of photos in flight order, or raise every fault of their table."""
    findings = Findings()
    read = read_measurements([file], findings)
    findings.stop()
    if read is None:  # cannot be, see above
        raise InputError(f"{file} cannot be read")
    return read
