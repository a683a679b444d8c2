"""What is given of cameras: measured positions ``photo,x,y,z[,use][,time][,sx,sy,sz]``, and orientations.

An orientation table has the three angles in columns of their names, ``photo,x,y,z,alpha,omega,kappa`` or those of
another system, and their standard deviations in ``s_alpha`` and so on; ``photos.csv`` of a result can be read as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from photostrip.formats.measured.control import AXES, USES
from photostrip.formats.measured.observations import PHOTO
from photostrip.formats.text.findings import counted
from photostrip.formats.text.tables import Column, Table, read_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from photostrip.formats.text.findings import Findings

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

SIGMAS = tuple(
    Column(f"s{axis}", number=True, required=False, filled=False, positive=True, aliases=(f"sigma_{axis}",))
    for axis in AXES
)
POSITIONS = (
    PHOTO,
    *(Column(axis, number=True, filled=False) for axis in AXES),
    Column("use", required=False, words=USES),
    Column("time", number=True, required=False),
    *SIGMAS,
)


@dataclass(frozen=True, eq=False)
class PositionTable:
    """Measured positions of cameras as the table has them: columns in the order of the list's axes."""

    table: Table
    ids: list[str]
    # xyz, sigma: (n, 3): coordinates and standard deviations, columns x, y, z; NaN where a cell is empty
    xyz: Floats
    sigma: Floats
    use: Flags  # (n, 3): which columns count
    time: Floats  # (n,): time of exposure in the table's unit; NaN where there is none

    @cached_property
    def used(self) -> Flags:
        """Rows of which anything counts."""
        return np.asarray(self.use.any(axis=1), bool)


@dataclass(frozen=True, eq=False)
class OrientationTable:
    """Given exterior orientations as the table has them."""

    table: Table
    ids: list[str]
    # xyz, sigma: (n, 3): perspective centres and their standard deviations, columns x, y, z; NaN where a cell is empty
    xyz: Floats
    sigma: Floats
    # angles, sigma_angles: (n, 3): angles in the order and unit of their system, and their standard deviations
    angles: Floats
    sigma_angles: Floats


def read_positions(file: str, up: int, findings: Findings, *, default_sigma: bool = True) -> PositionTable | None:
    """Read a table of measured positions of cameras.

    Parameters
    ----------
    up : int
        Which of the columns x, y, z is the height, for ``use: xy`` and ``use: z``.
    default_sigma : bool
        Whether the project file has standard deviations for rows without them.

    Returns
    -------
    PositionTable or None
        What could be read; None when the header is wrong.
    """
    table = read_table(file, POSITIONS, findings)
    if table is None:
        return None
    n = len(table)
    uses = table.cells("use") if "use" in table.ids else [USES[0]] * n
    height = np.arange(3) == up
    meaning = {"xyz": np.ones(3, bool), "xy": ~height, "z": height}
    read = PositionTable(
        table,
        table.cells("photo"),
        np.column_stack([table.column(axis) for axis in AXES]),
        np.column_stack([table.column(f"s{axis}") for axis in AXES]),
        np.array([meaning.get(word, np.zeros(3, bool)) for word in uses], bool).reshape(n, 3),
        table.column("time"),
    )
    if findings.number(file) == 0:
        _refuse_repeated(table, read.ids, read.used, findings)
        _refuse_empty(read, uses, findings)
        if not default_sigma:
            wanted = read.use & np.isnan(read.sigma)
            _refuse_without_sigma(table, wanted, [f"s{axis}" for axis in AXES], "camera_positions.sigma", findings)
    return read


def read_orientations(
    file: str,
    names: Sequence[str],
    unit: str,
    findings: Findings,
    *,
    needs_sigma: tuple[bool, bool] = (False, False),
) -> OrientationTable | None:
    """Read a table of given exterior orientations.

    Parameters
    ----------
    names : sequence of str
        Names of the three angles, in the order of their system.
    unit : str
        Their unit, ``deg``, ``gon`` or ``rad``; a column may be called ``kappa`` or ``kappa_deg``.
    needs_sigma : tuple of bool
        Whether rows must have standard deviations of the position and of the angles: they are observations, and
        the project file gives none.

    Returns
    -------
    OrientationTable or None
        What could be read; None when the header is wrong.
    """
    angle = tuple(Column(name, number=True, aliases=(f"{name}_{unit}",)) for name in names)
    sigma_angle = tuple(
        Column(
            f"s_{name}",
            number=True,
            required=False,
            filled=False,
            positive=True,
            aliases=(f"sigma_{name}", f"sigma_{name}_{unit}"),
        )
        for name in names
    )
    layout = (PHOTO, *(Column(axis, number=True) for axis in AXES), *angle, *SIGMAS, *sigma_angle)
    table = read_table(file, layout, findings)
    if table is None:
        return None
    read = OrientationTable(
        table,
        table.cells("photo"),
        np.column_stack([table.column(axis) for axis in AXES]),
        np.column_stack([table.column(f"s{axis}") for axis in AXES]),
        np.column_stack([table.column(name) for name in names]),
        np.column_stack([table.column(f"s_{name}") for name in names]),
    )
    if findings.number(file) == 0:
        _refuse_repeated(table, read.ids, np.ones(len(table), bool), findings)
        for needed, sigma, columns, key in (
            (needs_sigma[0], read.sigma, [f"s{axis}" for axis in AXES], "orientations.sigma"),
            (needs_sigma[1], read.sigma_angles, [f"s_{name}" for name in names], "orientations.sigma_angles"),
        ):
            if needed:
                _refuse_without_sigma(table, np.isnan(sigma), columns, key, findings)
    return read


def _refuse_repeated(table: Table, ids: Sequence[str], used: Flags, findings: Findings) -> None:
    """Refuse a second row of the same photo."""
    first: dict[str, int] = {}
    for row in np.flatnonzero(used).tolist():
        before = first.setdefault(ids[row], row)
        if before != row:
            message = f"photo {ids[row]} is given already, in line {table.lines[before]}"
            findings.add(table.fault(row, "photo", message, "given-twice", fix="keep one of the two"))


def _refuse_empty(read: PositionTable, uses: Sequence[str], findings: Findings) -> None:
    """Refuse an empty cell where the coordinate counts."""
    for row, axis in np.argwhere(read.use & np.isnan(read.xyz)).tolist():
        message = f"photo {read.ids[row]} has no {AXES[axis]}, but its use is {uses[row]}"
        fix = "fill it in, or set use to xy, z or off"
        findings.add(read.table.fault(row, AXES[axis], message, "no-coordinate", fix=fix))


def _refuse_without_sigma(table: Table, missing: Flags, columns: Sequence[str], key: str, findings: Findings) -> None:
    """Ask for the standard deviations that neither rows nor project give."""
    rows, axes = np.nonzero(missing)
    if len(rows):
        number = counted(len(np.unique(rows)), "row has no standard deviation", "rows have no standard deviation")
        message = f"{number} ({', '.join(columns)}), and the project file gives none"
        fix = f"set `{key}` in the project file, or fill the columns"
        findings.add(table.fault(int(rows[0]), columns[int(axes[0])], message, "no-sigma", fix=fix))
