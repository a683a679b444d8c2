"""Points measured on photos: tables ``photo,point,x,y[,sx,sy]`` and, for fiducial marks, ``photo,mark,x,y[,sx,sy]``.

Lists of a stereocomparator, a row for each point of a pair, are read as well: see ``pairs``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from photostrip.formats.measured import pairs, repeated
from photostrip.formats.measured.measurements import Measurements
from photostrip.formats.text.findings import counted
from photostrip.formats.text.tables import Column, Table, read_table

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from photostrip.formats.text.findings import Findings

    Floats = NDArray[np.float64]
    Numbers = NDArray[np.intp]

PHOTO = Column("photo", aliases=("photo_id", "image", "image_id"))
POINT = Column("point", aliases=("point_id", "id"))
MARK = Column("mark", aliases=("mark_id", "fiducial", "fiducial_mark"))
COORDINATES = (
    Column("x", number=True),
    Column("y", number=True),
    Column("sx", number=True, required=False, filled=False, positive=True, aliases=("sigma_x",)),
    Column("sy", number=True, required=False, filled=False, positive=True, aliases=("sigma_y",)),
)
OBSERVATIONS = (PHOTO, POINT, *COORDINATES)
FIDUCIALS = (PHOTO, MARK, *COORDINATES)


@dataclass(frozen=True)
class Manner:
    """How a table of image coordinates is to be read."""

    marks: bool = False  # whether fiducial marks are measured; otherwise points
    has_sigma: bool = True  # whether the project has a standard deviation for rows without one
    # that standard deviation, in the unit of the table; None when it is none, or stands in another unit
    sigma: float | None = None
    # ``refuse`` or ``average`` several measurements of one point on a photo; empty: averaged in lists of pairs
    repeated: str = ""
    # names in the header of columns that are called otherwise than here
    columns: Mapping[str, str] = field(default_factory=dict)
    photos: frozenset[str] = frozenset()  # photos of the strips, by which the names of pairs are understood


def read_measurements(file: str, findings: Findings, manner: Manner | None = None) -> Measurements | None:
    """Read a table of measured image coordinates.

    Parameters
    ----------
    file : str
        Path of a ``.csv`` or ``.csv.gz`` file: points of photos or of pairs, or marks.

    Returns
    -------
    Measurements or None
        What could be read, one row for each point of a photo; None when the header is wrong or pairs are none.
    """
    manner = manner or Manner()
    layout, others = (FIDUCIALS, ()) if manner.marks else (OBSERVATIONS, pairs.LAYOUTS)
    table = read_table(file, layout, findings, others=others, columns=manner.columns)
    if table is None:
        return None
    in_pairs = pairs.is_pair_list(table)
    table = pairs.photos_of_pairs(table, manner.photos, findings) if in_pairs else table
    if table is None:
        return None
    target = "mark" if manner.marks else "point"
    read = Measurements(
        table,
        table.ids["photo"],
        table.ids[target],
        table.codes["photo"],
        table.codes[target],
        np.column_stack([table.column("x"), table.column("y")]),
        np.column_stack([table.column("sx"), table.column("sy")]),
        np.ones(len(table), np.intp),
    )
    if not manner.has_sigma:
        key = "fiducial_measurements.sigma or observations.sigma" if manner.marks else "observations.sigma"
        _refuse_without_sigma(table, read.sigma, key, findings)
    if manner.repeated == "average" or (in_pairs and not manner.repeated):
        return repeated.averaged(read, target, manner.sigma, findings)
    repeated.refuse(read, target, findings)
    return read


def _refuse_without_sigma(table: Table, sigma: Floats, key: str, findings: Findings) -> None:
    """Ask for the standard deviations that neither rows nor project give."""
    rows = np.flatnonzero(np.isnan(sigma).any(axis=1))
    if not len(rows) or findings.number(table.file):
        return
    number = counted(len(rows), "row has no standard deviation", "rows have no standard deviation")
    message = f"{number} (sx, sy), and the project file gives none"
    fix = f"set `{key}` in the project file, or fill the columns sx and sy"
    findings.add(table.fault(int(rows[0]), "sx", message, "no-sigma", fix=fix))
