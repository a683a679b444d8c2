"""Given ground coordinates: tables ``point,x,y,z[,use][,role][,sx,sy,sz]``, x, y, z in the order of the list's axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from photostrip.arrays import Flags, Floats
from photostrip.formats.measured.columns import AXES, POINT, SIGMAS, numbers, sigmas
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.table_reader import read_table
from photostrip.formats.text.table_text import UNDECLARED, Form
from photostrip.formats.text.tables import Column, Table
from photostrip.notes import listed

USES = ("xyz", "xy", "z", "off")
ROLES = ("control", "check")
USE = Column("use", required=False, words=USES)
CONTROL = (
    POINT,
    *numbers(*AXES, filled=False),
    USE,
    Column("role", required=False, words=ROLES),
    *sigmas(*AXES),
)


@dataclass(frozen=True, eq=False)
class GivenTable:
    """Given coordinates as the table has them: columns in the order of the list's axes."""

    table: Table
    ids: list[str]
    # xyz, sigma: (n, 3): coordinates and standard deviations, columns x, y, z; NaN where a cell is empty
    xyz: Floats
    sigma: Floats
    use: Flags  # (n, 3): which columns count

    @cached_property
    def used(self) -> Flags:
        """Rows of which anything counts."""
        return np.asarray(self.use.any(axis=1), bool)


@dataclass(frozen=True, eq=False)
class ControlTable(GivenTable):
    """Given coordinates of points on the ground."""

    check: Flags  # (n,): true for check points


def read_control(
    file: str, up: int, findings: Findings, *, default_sigma: bool = True, form: Form = UNDECLARED
) -> ControlTable | None:
    """Read a table of given ground coordinates; None when the header is wrong.

    up: which of the columns x, y, z is the height: ``use: xy`` means the two others, ``use: z`` this one.
    default_sigma: whether the project file has standard deviations for rows without them.
    form: how the table is written.
    """
    table = read_table(file, CONTROL, findings, form=form)
    if table is None:
        return None
    roles = table.cells("role") if "role" in table.ids else [ROLES[0]] * len(table)
    check = np.array([word == "check" for word in roles], bool)
    read = ControlTable(**given_columns(table, "point", up), check=check)
    if findings.number(file) == 0:
        refuse_empty(read, "point", findings)
        if not default_sigma:
            _refuse_without_sigma(read, findings)
    return read


def given_columns(table: Table, name: str, up: int) -> dict[str, Any]:
    """Return the columns of a ``GivenTable``, whose ids stand in the column `name`."""
    height = np.arange(3) == up
    meaning = {"xyz": np.ones(3, bool), "xy": ~height, "z": height}
    uses = _uses(table)
    return {
        "table": table.without_numbers(),
        "ids": table.cells(name),
        "xyz": table.columns(*AXES),
        "sigma": table.columns(*SIGMAS),
        "use": np.array([meaning.get(word, np.zeros(3, bool)) for word in uses], bool).reshape(len(table), 3),
    }


def _uses(table: Table) -> list[str]:
    return table.cells("use") if "use" in table.ids else [USES[0]] * len(table)


def refuse_empty(read: GivenTable, name: str, findings: Findings) -> None:
    """Refuse an empty cell where the coordinate counts."""
    uses = _uses(read.table)
    for row, axis in np.argwhere(read.use & np.isnan(read.xyz)).tolist():
        message = f"{name} {read.ids[row]} has no {AXES[axis]}, but its use is {uses[row]}"
        fix = "fill it in, or set use to xy, z or off"
        findings.add(read.table.fault(row, AXES[axis], message, "no-coordinate", fix=fix))


def _refuse_without_sigma(read: ControlTable, findings: Findings) -> None:
    """Ask for the standard deviations that neither rows nor project give."""
    rows, axes = np.nonzero(read.use & np.isnan(read.sigma))
    if len(rows):
        points = list(dict.fromkeys(read.ids[row] for row in rows))
        message = f"no standard deviation for {listed(points, 1)}"
        fix = "set `sigma: [sx, sy, sz]` of this control list in the project file, or fill the columns sx, sy, sz"
        findings.add(read.table.fault(int(rows[0]), f"s{AXES[axes[0]]}", message, "no-sigma", fix=fix))


def refuse_repeated(tables: Sequence[ControlTable | None], findings: Findings) -> None:
    """Refuse ids that stand twice, in one list or in two; rows with ``use: off`` do not count."""
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
                message = f"point {name} is already given in {where}"
                findings.add(read.table.fault(int(row), "point", message, "given-twice", fix=fix))
