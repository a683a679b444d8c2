"""What is given of cameras: measured positions ``photo,x,y,z[,use][,time][,sx,sy,sz]``, and orientations.

An orientation table has the three angles in columns of their names, ``photo,x,y,z,alpha,omega,kappa`` or those of
another system, and their standard deviations in ``s_alpha`` and so on; ``photos.csv`` of a result can be read as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.formats.measured.columns import (
    AXES,
    PHOTO,
    SIGMAS,
    numbers,
    refuse_without_sigma,
    repeated_rows,
    sigmas,
)
from photostrip.formats.measured.control import USE, GivenTable, given_columns, refuse_empty
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.table_reader import read_table
from photostrip.formats.text.table_text import UNDECLARED, Form
from photostrip.formats.text.tables import Column, Table

FIX = "set `{}` in the project file, or fill the columns"

POSITIONS = (
    PHOTO,
    *numbers(*AXES, filled=False),
    USE,
    Column("time", number=True, required=False),
    *sigmas(*AXES),
)


@dataclass(frozen=True, eq=False)
class PositionTable(GivenTable):
    """Measured positions of cameras."""

    time: Floats  # (n,): time of exposure in the table's unit; NaN where there is none


@dataclass(frozen=True, eq=False)
class OrientationTable:
    table: Table
    ids: list[str]
    # xyz, sigma: (n, 3): perspective centres and their standard deviations, columns x, y, z; NaN where a cell is empty
    xyz: Floats
    sigma: Floats
    angles: Floats  # (n, 3): angles in the order and unit of their system; quaternions (n, 4), matrices (n, 9)
    sigma_angles: Floats  # (n, 3): their standard deviations, or those of small turns about the axes of the photo


def read_positions(
    file: str, up: int, findings: Findings, *, default_sigma: bool = True, form: Form = UNDECLARED
) -> PositionTable | None:
    """Read a table of measured positions of cameras as ``read_control`` reads control."""
    table = read_table(file, POSITIONS, findings, form=form)
    if table is None:
        return None
    read = PositionTable(**given_columns(table, "photo", up), time=table.column("time"))
    if findings.number(file) == 0:
        _refuse_repeated(table, read.ids, np.flatnonzero(read.used), findings)
        refuse_empty(read, "photo", findings)
        if not default_sigma:
            missing = read.use & np.isnan(read.sigma)
            refuse_without_sigma(table, missing, SIGMAS, FIX.format("camera_positions.sigma"), findings)
    return read


QUATERNION, MATRIX = "quaternion", "matrix"
ROTATIONS = {  # by what is no system of angles: columns of the rotation
    QUATERNION: ("qw", "qx", "qy", "qz"),
    MATRIX: tuple(f"r{row}{column}" for row in "123" for column in "123"),
}
TURNS = ("rx", "ry", "rz")  # small turns about the axes of the photo, of which such a table has standard deviations
NO_ROTATION = 1e-3  # of a quaternion's length, or of a product of a matrix's rows: beyond, it is a slip of the pen


def orientation_columns(system: str, unit: str) -> tuple[Column, ...]:
    """Return the columns of a table of orientations by the system of its angles and their unit."""
    names, turns = rotation_names(system)
    angle = tuple(Column(name, number=True, aliases=(f"{name}_{unit}",)) for name in names)
    sigma_angle = tuple(
        replace(each, name=f"s_{name}", aliases=(*each.aliases, f"{each.aliases[0]}_{unit}"))
        for each, name in zip(sigmas(*turns), turns, strict=True)
    )
    return (PHOTO, *numbers(*AXES), *angle, *sigmas(*AXES), *sigma_angle)


def rotation_names(system: str) -> tuple[Sequence[str], Sequence[str]]:
    """Return the columns of the rotation, and what their standard deviations are of."""
    if system in ROTATIONS:
        return ROTATIONS[system], TURNS
    names = system.split("-")
    return names, names


def read_orientations(
    file: str,
    system: str,
    unit: str,
    findings: Findings,
    *,
    needs_sigma: tuple[bool, bool] = (False, False),
    form: Form = UNDECLARED,
) -> OrientationTable | None:
    """Read a table of given exterior orientations; None when the header is wrong.

    system: what their rotations are: angles in a system, ``quaternion`` or ``matrix``.
    unit: unit of the angles, ``deg``, ``gon`` or ``rad``; a column may be called ``kappa`` or ``kappa_deg``.
    needs_sigma: whether rows must have standard deviations of the position and of the angles: they are observations,
        and the project file gives none.
    """
    table = read_table(file, orientation_columns(system, unit), findings, form=form)
    names, turns = rotation_names(system)
    sigma_names = [f"s_{name}" for name in turns]
    if table is None:
        return None
    read = OrientationTable(
        table=table,
        ids=table.cells("photo"),
        xyz=table.columns(*AXES),
        sigma=table.columns(*SIGMAS),
        angles=table.columns(*names),
        sigma_angles=table.columns(*sigma_names),
    )
    if findings.number(file) == 0:
        _refuse_no_rotation(read, system, findings)
        _refuse_repeated(table, read.ids, np.arange(len(table)), findings)
        if needs_sigma[0]:
            refuse_without_sigma(table, np.isnan(read.sigma), SIGMAS, FIX.format("orientations.sigma"), findings)
        if needs_sigma[1]:
            fix = FIX.format("orientations.sigma_angles")
            refuse_without_sigma(table, np.isnan(read.sigma_angles), sigma_names, fix, findings)
    return read


def _refuse_no_rotation(read: OrientationTable, system: str, findings: Findings) -> None:
    """Refuse quaternions whose length is not 1, and matrices that do not turn."""
    if system == QUATERNION:
        off = np.abs(np.linalg.norm(read.angles, axis=1) - 1.0)
        what = "the length of the quaternion of photo {} is {:.4g} off 1"
    elif system == MATRIX:
        matrices = read.angles.reshape(-1, 3, 3)
        off = np.abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        off = np.where(np.linalg.det(matrices) > 0.0, off, np.maximum(off, 2.0))
        what = "the matrix of photo {} is no rotation: its rows are {:.4g} off right angles, length 1 and right hand"
    else:
        return
    for row in np.flatnonzero(off > NO_ROTATION).tolist():
        message = what.format(read.ids[row], off[row])
        fix = f"are the columns {', '.join(ROTATIONS[system])} in this order, without a scale?"
        findings.add(read.table.fault(row, ROTATIONS[system][0], message, "no-rotation", fix=fix))


def _refuse_repeated(table: Table, ids: Sequence[str], rows: Numbers, findings: Findings) -> None:
    """Refuse a second row of the same photo."""
    for again, before in repeated_rows(ids[row] for row in rows.tolist()):
        message = f"photo {ids[rows[again]]} is already given, in line {table.lines[rows[before]]}"
        findings.add(table.fault(int(rows[again]), "photo", message, "given-twice", fix="keep one of the two"))
