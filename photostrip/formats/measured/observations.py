"""Points measured on photos: tables ``photo,point,x,y[,sx,sy]`` and, for fiducial marks, ``photo,mark,x,y[,sx,sy]``.

Lists of a stereocomparator, a row for each point of a pair, are read as well: see ``pairs``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photostrip.errors import Fault
from photostrip.formats.measured import pairs, repeated
from photostrip.formats.measured.columns import PHOTO, POINT, numbers, refuse_without_sigma, sigmas
from photostrip.formats.measured.measurements import Measurements
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.table_reader import read_table
from photostrip.formats.text.table_text import UNDECLARED, Form
from photostrip.formats.text.tables import Column, Table, joined

MARK = Column("mark", aliases=("mark_id", "fiducial", "fiducial_mark"))
COORDINATES = (*numbers("x", "y"), *sigmas("x", "y"))
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
    form: Form = UNDECLARED  # how it is written
    photos: frozenset[str] = frozenset()  # photos of the strips, by which the names of pairs are understood


def read_measurements(files: Sequence[str], findings: Findings, manner: Manner | None = None) -> Measurements | None:
    """Read tables of measured image coordinates below each other: points of photos or of pairs, or marks.

    One row of the result is one point of a photo. None when a header is wrong, or when pairs are none.
    """
    manner = manner or Manner()
    layout, others = (FIDUCIALS, ()) if manner.marks else (OBSERVATIONS, pairs.LAYOUTS)
    read_each = [read_table(file, layout, findings, others=others, form=manner.form) for file in files]
    tables = [each for each in read_each if each is not None]
    if len(tables) < len(files) or not _alike(tables, findings):
        return None
    in_pairs = "photo" not in tables[0].ids
    if in_pairs:
        of_photos = [pairs.photos_of_pairs(each, manner.photos, findings) for each in tables]
        tables = [each for each in of_photos if each is not None]
    if len(tables) < len(files):
        return None
    table = joined(tables)
    target = "mark" if manner.marks else "point"
    read = Measurements(
        table=table.without_numbers(),
        photo_ids=table.ids["photo"],
        target_ids=table.ids[target],
        photo=table.codes["photo"],
        target=table.codes[target],
        xy=table.columns("x", "y"),
        sigma=table.columns("sx", "sy"),
        times=np.broadcast_to(np.intp(1), len(table)),
    )
    if not manner.has_sigma and not any(map(findings.number, files)):
        key = "fiducial_measurements.sigma or observations.sigma" if manner.marks else "observations.sigma"
        fix = f"set `{key}` in the project file, or fill the columns sx and sy"
        missing = np.asarray(np.isnan(read.sigma).any(axis=1, keepdims=True))
        refuse_without_sigma(table, missing, ("sx", "sy"), fix, findings)
    if in_pairs and pairs.refuse_exchanged(read, findings):
        return read  # every one of their points disagrees with itself
    if manner.repeated == "average" or (in_pairs and not manner.repeated):
        return repeated.averaged(read, target, manner.sigma, findings)
    repeated.refuse(read, target, findings)
    return read


def _alike(tables: Sequence[Table], findings: Findings) -> bool:
    """Refuse a table of pairs below one of photos, or the other way round."""
    of_photos = ["photo" in each.ids for each in tables]
    for table, one in zip(tables, of_photos, strict=True):
        if one != of_photos[0]:
            kinds = ("points of photos", "points of pairs") if one else ("points of pairs", "points of photos")
            message = f"holds {kinds[0]}, but {tables[0].file} {kinds[1]}"
            findings.add(Fault(message, "mixed-tables", table.file, line=1, fix="give all files the same columns"))
    return len(set(of_photos)) == 1
