"""Tables of terrestrial photogrammetry: image points, directions, epochs, pseudo-parallaxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.formats.faults import Findings
from photostrip.formats.measured import POINT, repeated_rows
from photostrip.formats.tables import Column, Table, read_table
from photostrip.terrestrial.normal_case import SIDES

EPOCH = Column("epoch", aliases=("epoch_id",))
IMAGE = (Column("x", number=True), Column("z", number=True, aliases=("y",)))
DIRECTIONS = (
    Column("lambda", number=True, aliases=("horizontal", "azimuth", "hz")),
    Column("beta", number=True, aliases=("vertical", "elevation", "v")),
)


def _optional(*names: str, positive: bool = False) -> tuple[Column, ...]:
    return tuple(Column(name, number=True, required=False, filled=False, positive=positive) for name in names)


IMAGE_POINTS = (POINT, *IMAGE)
DIRECTION_POINTS = (POINT, *DIRECTIONS)
SIGHTINGS = (
    POINT,
    *IMAGE,
    *(Column(each.name, number=True, filled=False, aliases=each.aliases) for each in DIRECTIONS),
    *_optional("sx", "sz", "s_lambda", "s_beta", "distance", positive=True),
)
ONE_STATION = (
    POINT,
    *IMAGE,
    *(Column(name, number=True) for name in ("dx", "dz")),
    Column("distance", number=True, positive=True),
    *_optional("distance_later", "sigma", "sigma_d", "sigma_distance", positive=True),
)
COORDINATES = (EPOCH, Column("photo", words=SIDES), POINT, *IMAGE, *_optional("sx", "sz", positive=True))
PSEUDO_PARALLAXES = (
    POINT,
    Column("epoch", required=False, aliases=("epoch_id",)),
    *(Column(name, number=True, filled=False) for name in ("x", "z", "p")),
    *_optional("q"),
    *(Column(name, number=True) for name in ("dx", "dz", "dx_right")),
    *_optional("dz_right"),
    *_optional("sigma", "sigma_d", positive=True),
)


def read_points(file: str, layout: Sequence[Column], findings: Findings) -> Table | None:
    """Read a table with one row for each point; None when the header is wrong."""
    table = read_table(file, layout, findings)
    if table is not None:
        _refuse_repeated(table, table.codes["point"], "", findings)
    return table


def _refuse_repeated(table: Table, keys: Numbers, where: str, findings: Findings) -> None:
    names = table.cells("point")
    for row, before in repeated_rows(keys.tolist()):
        message = f"point {names[row]} stands in line {table.lines[before]} already{where}"
        fix = "keep one of the two, or give one another id"
        findings.add(table.fault(row, "point", message, "measured-twice", fix=fix))


@dataclass(frozen=True, eq=False)
class EpochTable:
    """Measurements of several epochs, row by row."""

    table: Table
    # epochs, points: ids in order of first appearance; no epoch when the table has no such column
    epochs: tuple[str, ...]
    points: tuple[str, ...]
    # epoch, point: (n,): epoch and point of each row
    epoch: Numbers
    point: Numbers

    @property
    def side(self) -> Numbers:
        """Photo of each row of a table of coordinates: 0 left, 1 right, shape (n,)."""
        code = np.array([SIDES.index(name) for name in self.table.ids["photo"]], np.intp)
        return np.asarray(code[self.table.codes["photo"]], np.intp)


def read_coordinates(file: str, findings: Findings) -> EpochTable | None:
    """Read a table of image coordinates ``epoch,photo,point,x,z[,sx,sz]``, photo being left or right."""
    table = read_table(file, COORDINATES, findings)
    if table is None:
        return None
    read = EpochTable(
        table=table,
        epochs=table.ids["epoch"],
        points=table.ids["point"],
        epoch=table.codes["epoch"],
        point=table.codes["point"],
    )
    if not findings.number(file):
        key = (read.epoch * len(SIDES) + read.side) * len(read.points) + read.point
        _refuse_repeated(table, key, " for the same photo and epoch", findings)
    return read


def read_pseudo_parallaxes(file: str, findings: Findings) -> EpochTable | None:
    """Read a table of pseudo-parallaxes.

    The columns are ``point[,epoch],x,z,p[,q],dx,dz,dx_right[,dz_right][,sigma][,sigma_d]``: coordinates on the left
    photo of the reference epoch, parallaxes to the right one, and what changed on both photos until the epoch. x, z, p
    and q may be empty where an earlier row of the point has them.
    """
    table = read_table(file, PSEUDO_PARALLAXES, findings)
    if table is None:
        return None
    named = "epoch" in table.codes
    epoch = table.codes["epoch"] if named else np.zeros(len(table), np.intp)
    read = EpochTable(
        table=table,
        epochs=table.ids["epoch"] if named else (),
        points=table.ids["point"],
        epoch=epoch,
        point=table.codes["point"],
    )
    if not findings.number(file):
        where = " for the same epoch" if named else ""
        _refuse_repeated(table, read.epoch * len(read.points) + read.point, where, findings)
    return read


def reference_values(read: EpochTable, findings: Findings) -> Floats:
    """Return x, z, p and q of each point of a table of pseudo-parallaxes, shape (points, 4); NaN for q not measured.

    A point without values, or with different ones in different rows, is refused.
    """
    names = ("x", "z", "p", "q")
    found = np.full((len(read.points), len(names)), np.nan)
    source = np.zeros(found.shape, np.intp)
    values = read.table.columns(*names)
    for row, point in enumerate(read.point.tolist()):
        for column, name in enumerate(names):
            value = values[row, column]
            if np.isnan(value):
                continue
            if np.isnan(found[point, column]):
                found[point, column], source[point, column] = value, row
            elif value != found[point, column]:
                line = read.table.lines[source[point, column]]
                message = (
                    f"{name} of point {read.points[point]} is {found[point, column]:g} in line {line}, here {value:g}"
                )
                fix = "write the coordinates of the reference epoch once, or alike"
                findings.add(read.table.fault(row, name, message, "reference-differs", fix=fix))
    first = {point: row for row, point in reversed(list(enumerate(read.point.tolist())))}
    for point, column in np.argwhere(np.isnan(found[:, :3])):
        message = f"{names[column]} of point {read.points[point]} stands in no row"
        findings.add(read.table.fault(first[int(point)], names[column], message, "no-reference", expected="a number"))
    return found
