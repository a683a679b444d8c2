"""Given ground coordinates: tables ``point,x,y,z[,use][,role][,sx,sy,sz]``, x, y, z in the order of the list's axes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from photostrip.formats.text.tables import Column, Table, read_table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from photostrip.formats.text.findings import Findings

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

AXES = ("x", "y", "z")
USES = ("xyz", "xy", "z", "off")
ROLES = ("control", "check")
CONTROL = (
    Column("point", aliases=("point_id", "id")),
    *(Column(axis, number=True, filled=False) for axis in AXES),
    Column("use", required=False, words=USES),
    Column("role", required=False, words=ROLES),
    *(
        Column(f"s{axis}", number=True, required=False, filled=False, positive=True, aliases=(f"sigma_{axis}",))
        for axis in AXES
    ),
)


@dataclass(frozen=True, eq=False)
class ControlTable:
    """Given coordinates as the table has them: columns in the order of the list's axes."""

    table: Table
    ids: list[str]
    # xyz, sigma: (n, 3): coordinates and standard deviations, columns x, y, z; NaN where a cell is empty
    xyz: Floats
    sigma: Floats
    use: Flags  # (n, 3): which columns count
    check: Flags  # (n,): true for check points

    @cached_property
    def used(self) -> Flags:
        """Rows of which anything counts."""
        return np.asarray(self.use.any(axis=1), bool)


def read_control(
    file: str, up: int, findings: Findings, *, default_sigma: bool = True, columns: Mapping[str, str] | None = None
) -> ControlTable | None:
    """Read a table of given ground coordinates.

    Parameters
    ----------
    up : int
        Which of the columns x, y, z is the height: ``use: xy`` means the two others, ``use: z`` this one.
    default_sigma : bool
        Whether the project file has standard deviations for rows without them.
    columns : mapping of str to str, optional
        Names in the header of columns that are called otherwise than here.

    Returns
    -------
    ControlTable or None
        What could be read; None when the header is wrong.
    """
    table = read_table(file, CONTROL, findings, columns=columns)
    if table is None:
        return None
    n = len(table)
    uses = table.cells("use") if "use" in table.ids else [USES[0]] * n
    roles = table.cells("role") if "role" in table.ids else [ROLES[0]] * n
    height = np.arange(3) == up
    meaning = {"xyz": np.ones(3, bool), "xy": ~height, "z": height}
    nothing = np.zeros(3, bool)
    read = ControlTable(
        table,
        table.cells("point"),
        np.column_stack([table.column(axis) for axis in AXES]),
        np.column_stack([table.column(f"s{axis}") for axis in AXES]),
        np.array([meaning.get(word, nothing) for word in uses], bool).reshape(n, 3),
        np.array([word == "check" for word in roles], bool),
    )
    if findings.number(file) == 0:
        _refuse_empty(read, uses, findings)
        if not default_sigma:
            _refuse_without_sigma(read, findings)
    return read


def _refuse_empty(read: ControlTable, uses: Sequence[str], findings: Findings) -> None:
    """Refuse an empty cell where the coordinate counts."""
    for row, axis in np.argwhere(read.use & np.isnan(read.xyz)):
        if findings.full(read.table.file):
            findings.count(read.table.file, 1)
            continue
        message = f"point {read.ids[row]} has no {AXES[axis]}, but its use is {uses[row]}"
        fix = "fill it in, or set use to xy, z or off"
        findings.add(read.table.fault(int(row), AXES[axis], message, "no-coordinate", fix=fix))


def _refuse_without_sigma(read: ControlTable, findings: Findings) -> None:
    """Ask for the standard deviations that neither rows nor project give."""
    rows, axes = np.nonzero(read.use & np.isnan(read.sigma))
    if len(rows):
        points = list(dict.fromkeys(read.ids[row] for row in rows))
        message = f"no standard deviation for {points[0]}" + (f" and {len(points) - 1} more" if len(points) > 1 else "")
        fix = "set `sigma: [sx, sy, sz]` of this control list in the project file, or fill the columns sx, sy, sz"
        findings.add(read.table.fault(int(rows[0]), f"s{AXES[axes[0]]}", message, "no-sigma", fix=fix))


def refuse_repeated(tables: Sequence[ControlTable | None], findings: Findings) -> None:
    """Refuse ids that stand twice, in one list or in two.

    Parameters
    ----------
    tables : sequence of ControlTable or None
        Control lists of the project; rows with ``use: off`` do not count.
    """
    first: dict[str, tuple[ControlTable, int]] = {}
    for read in tables:
        if read is None:
            continue
        for row in np.flatnonzero(read.used):
            name = read.ids[row]
            if not name:
                continue
            owner, before = first.setdefault(name, (read, int(row)))
            if (owner, before) != (read, int(row)):
                where = f"{owner.table.file}:{owner.table.lines[before]}"
                fix = "keep one, or set use to off in the other"
                message = f"point {name} is given already in {where}"
                findings.add(read.table.fault(int(row), "point", message, "given-twice", fix=fix))
