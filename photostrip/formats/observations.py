"""Points measured on photos: tables ``photo,point,x,y[,sx,sy]`` and, for fiducial marks, ``photo,mark,x,y[,sx,sy]``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from photostrip.formats.findings import counted
from photostrip.formats.tables import Column, Table, read_table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.formats.findings import Findings

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


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measured image coordinates as the table gives them: in its unit, with its direction of y.

    Parameters
    ----------
    table : Table
        Where they stand.
    photo_ids, target_ids : tuple of str
        Ids of the photos, and of the points or marks, in order of first appearance.
    photo, target : ndarray of int, shape (n,)
        Photo and target of each row.
    xy : ndarray, shape (n, 2)
        Coordinates in the unit of the table.
    sigma : ndarray, shape (n, 2)
        Standard deviations in the unit of the table; NaN where the row has none.
    """

    table: Table
    photo_ids: tuple[str, ...]
    target_ids: tuple[str, ...]
    photo: Numbers
    target: Numbers
    xy: Floats
    sigma: Floats

    @cached_property
    def photos_measured(self) -> frozenset[str]:
        """Photos on which anything is measured."""
        return frozenset(self.photo_ids)


def read_measurements(
    file: str, findings: Findings, *, marks: bool = False, default_sigma: bool = True
) -> Measurements | None:
    """Read a table of measured image coordinates.

    Parameters
    ----------
    file : str
        Path of a ``.csv`` or ``.csv.gz`` file.
    findings : Findings
        Where faults and notes go.
    marks : bool
        Whether fiducial marks are measured; otherwise points.
    default_sigma : bool
        Whether the project file has a standard deviation for rows without one.

    Returns
    -------
    Measurements or None
        What could be read; None when the header is wrong.
    """
    table = read_table(file, FIDUCIALS if marks else OBSERVATIONS, findings)
    if table is None:
        return None
    target = "mark" if marks else "point"
    read = Measurements(
        table,
        table.ids["photo"],
        table.ids[target],
        table.codes["photo"],
        table.codes[target],
        np.column_stack([table.column("x"), table.column("y")]),
        np.column_stack([table.column("sx"), table.column("sy")]),
    )
    _refuse_repeated(read, target, findings)
    if not default_sigma:
        key = "fiducial_measurements.sigma or observations.sigma" if marks else "observations.sigma"
        _refuse_without_sigma(table, read.sigma, key, findings)
    return read


def _refuse_repeated(read: Measurements, target: str, findings: Findings) -> None:
    """Refuse a second measurement of the same point on the same photo."""
    key = read.photo * len(read.target_ids) + read.target
    order = np.argsort(key, kind="stable")
    again = np.flatnonzero(key[order][1:] == key[order][:-1]) + 1
    first: dict[int, int] = {}
    for place in again:
        row = int(order[place])
        number = first.setdefault(int(key[row]), int(order[place - 1]))
        if findings.full(read.table.file):
            findings.count(read.table.file, 1)
            continue
        name, photo = read.target_ids[read.target[row]], read.photo_ids[read.photo[row]]
        message = f"{target} {name} is measured on photo {photo} already, in line {read.table.lines[number]}"
        fix = "keep one of the two, or give one another id"
        findings.add(read.table.fault(row, target, message, "measured-twice", fix=fix))


def _refuse_without_sigma(table: Table, sigma: Floats, key: str, findings: Findings) -> None:
    """Ask for the standard deviations that neither rows nor project give."""
    rows = np.flatnonzero(np.isnan(sigma).any(axis=1))
    if not len(rows) or findings.number(table.file):
        return
    number = counted(len(rows), "row has no standard deviation", "rows have no standard deviation")
    message = f"{number} (sx, sy), and the project file gives none"
    fix = f"set `{key}` in the project file, or fill the columns sx and sy"
    findings.add(table.fault(int(rows[0]), "sx", message, "no-sigma", fix=fix))
