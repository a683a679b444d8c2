"""Control with its image marks in one table, beside any block: HISTORIX and openMVS, OpenDroneMap.

HISTORIX and openMVS write CSV, ``gcp_label,image_file_name,x,y,lon,lat,elev`` or ``x_map,y_map,elev``, with standard
deviations in ``lon_acc`` or ``x_map_acc`` and so on, metres. ``gcp_list.txt`` of OpenDroneMap has its CRS in the first
line, then rows ``X Y Z px py image [name]`` (X to the east, whatever the CRS says); a height of 0 or NaN is unknown, a
name that begins with ``CHK-`` is a check point, rows without names are one point where their coordinates are the same.
Pixels count from the corner of the first one.

The layouts are documented in docs.opendronemap.org/gcp and github.com/shippp/history.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from photostrip.arrays import Floats, Numbers
from photostrip.errors import Fault, InputError
from photostrip.foreign.tables import ForeignBlock, GivenControl
from photostrip.formats.faults import Findings, shown, suggestion
from photostrip.formats.measured import numbers
from photostrip.formats.tables import Column, Table, read_table
from photostrip.geodesy.frame_spec import GROUND_AXES, FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.notes import counted, listed
from photostrip.points import locate

PLACES, ACCURACIES = ("x_map", "y_map", "elev"), ("x_map_acc", "y_map_acc", "elev_acc")
MARKS = (
    Column("gcp_label", aliases=("point", "gcp", "name")),
    Column("image_file_name", aliases=("photo", "image")),
    *numbers("x", "y"),
    Column("x_map", number=True, aliases=("lon",)),
    Column("y_map", number=True, aliases=("lat",)),
    Column("elev", number=True, filled=False),
    *(
        Column(name, number=True, required=False, filled=False, positive=True, aliases=aliases)
        for name, aliases in zip(ACCURACIES, (("lon_acc",), ("lat_acc",), ()), strict=True)
    ),
)
ODM_HEADER = b"x_map,y_map,elev,x,y,image_file_name,gcp_label"
UTM = re.compile(r"WGS84 UTM (\d{1,2})([NS])")
CHECK = "CHK-"


@dataclass(frozen=True)
class Asked:
    """What is said about a table of control: by options, where the file does not say it."""

    file: str
    crs: str = ""
    sigma: tuple[float, float, float] | None = None  # metres, of points without their own
    mark_sigma: float | None = None  # pixels; None: that of the other image points
    width: float | None = None  # pixels of the photos on which the marks were measured; None: those of the block


def with_control(block: ForeignBlock, asked: Asked) -> ForeignBlock:
    """Put marks of control into a block.

    Raises InputError with file and line for all that is no such table, and where it does not say what is needed.
    """
    findings, head = Findings(), _Head()
    table = read_table(asked.file, MARKS, findings, rewritten=head.rewritten)
    if table is None:
        raise InputError(findings.faults)
    findings.stop()
    crs = asked.crs or head.crs()
    if not crs:
        fix = "give --crs CRS, as EPSG:32633; EPSG:4979 is longitude and latitude of WGS 84"
        raise InputError(
            Fault("nothing says in which frame the control lies", "option", asked.file, key="--crs", fix=fix)
        )
    tie_frames([FrameSpec(crs, GROUND_AXES)], keys=["--crs"])
    labels = _labels(table, unnamed=head.unnamed)
    ids = tuple(dict.fromkeys(labels))
    number = locate(labels, ids)
    xyz, sigma = table.columns(*PLACES).copy(), table.columns(*ACCURACIES).copy()
    if head.odm:
        xyz[xyz[:, 2] == 0.0, 2] = np.nan
    first = np.unique(number, return_index=True)[1]
    for row in np.flatnonzero((np.nan_to_num(xyz) != np.nan_to_num(xyz[first[number]])).any(axis=1)).tolist():
        before = int(table.lines[first[number[row]]])
        message = f"point {labels[row]} has other coordinates than in line {before}"
        findings.add(table.fault(row, "x_map", message, "given-twice", fix="give one point one name"))
    if asked.sigma is not None:
        sigma = np.where(np.isnan(sigma), asked.sigma, sigma)
    elif np.isnan(sigma[first]).any():
        findings.add(no_precision(asked.file))
    rows, photo, strangers = _on_photos(table, block)
    xy = _pixels(table, block, (rows, photo), asked, labels, findings)
    findings.stop()
    control = GivenControl(
        source=f"{'gcp_list of OpenDroneMap' if head.odm else 'table of marks'}, {asked.file}",
        ids=ids,
        crs=crs,
        xyz=xyz[first],
        sigma=sigma[first],
        check=tuple(head.odm and name.startswith(CHECK) for name in ids),
        marks=len(rows),
    )
    return joined(block, control, Marks(ids=ids, photo=photo, point=number[rows], xy=xy), asked, strangers)


@dataclass(frozen=True, eq=False)
class Marks:
    """Rays of points that are not in a block yet."""

    ids: tuple[str, ...]  # of points
    photo: Numbers  # (n,): of the block
    point: Numbers  # (n,): numbers in ids
    xy: Floats  # (n, 2): pixels from the corner of the first one


def joined(
    block: ForeignBlock, control: GivenControl | None, marks: Marks, asked: Asked, left_out: Iterable[str]
) -> ForeignBlock:
    """Put control and marks into a block."""
    own = np.full(len(marks.xy), np.nan if asked.mark_sigma is None else asked.mark_sigma)
    return replace(
        block,
        files=(*block.files, asked.file),
        points=(*block.points, *marks.ids),
        photo=np.concatenate([block.photo, marks.photo]),
        point=np.concatenate([block.point, len(block.points) + marks.point]),
        xy=np.concatenate([block.xy, marks.xy]),
        sigma=None if asked.mark_sigma is None else np.concatenate([np.full(len(block.xy), np.nan), own]),
        control=control,
        left_out=(*block.left_out, *left_out),
    )


def no_precision(file: str) -> Fault:
    message, fix = "nothing says how precise the control is", "give --control-sigma M, or EAST,NORTH,UP, in metres"
    return Fault(message, "no-sigma", file, key="--control-sigma", fix=fix)


class _Head:
    """The first line of a gcp_list.txt, which has no header but a CRS."""

    def __init__(self) -> None:
        self.odm, self.unnamed, self.line = False, False, ""

    def rewritten(self, data: bytes) -> bytes:
        """Write a gcp_list.txt as CSV, line for line; a table with a header stays what it is."""
        first, *rest = data.splitlines() or [b""]
        if b"," in first and not first.lstrip().startswith(b"+"):
            return data
        self.odm, self.line = True, " ".join(first.decode().split())
        rows = [line.split() if not line.lstrip().startswith(b"#") else [] for line in rest]
        self.unnamed = all(len(row) < 7 for row in rows)
        return b"\n".join([ODM_HEADER, *map(self._row, rows)]) + b"\n"

    def _row(self, row: list[bytes]) -> bytes:
        if len(row) < 6:
            return b",".join(row)
        x, y, z, *rest = row
        cells = [x, y, b"" if z.lower() == b"nan" else z, *rest[:3], rest[3] if len(rest) > 3 else b"-"]
        return b",".join(b'"%b"' % cell.replace(b'"', b'""') if set(cell) & set(b',"') else cell for cell in cells)

    def crs(self) -> str:
        """Give the CRS of the first line in the words of a project; empty where it says none."""
        if found := UTM.fullmatch(self.line.upper()):
            return f"EPSG:{(32600 if found[2] == 'N' else 32700) + int(found[1])}"
        return self.line if self.line.startswith("+") or self.line.upper().startswith("EPSG:") else ""


def _labels(table: Table, *, unnamed: bool) -> list[str]:
    """Give the name of the point of each row; where none has one, one for each place."""
    if not unnamed:
        return table.cells("gcp_label")
    places = list(map(tuple, np.nan_to_num(table.columns(*PLACES)).tolist()))
    numbers_of = {place: number for number, place in enumerate(dict.fromkeys(places), 1)}
    return [f"gcp-{numbers_of[place]}" for place in places]


def _on_photos(table: Table, block: ForeignBlock) -> tuple[Numbers, Numbers, Iterator[str] | Sequence[str]]:
    """Find the photo of each row by its name, or by the last part of it where only one photo has it.

    Returns the rows that have one, their photos, and what is said of the others.
    """
    by_part: dict[str, list[int]] = {}
    for photo, name in enumerate(block.photos):
        by_part.setdefault(_part(name), []).append(photo)
    whole = {name: photo for photo, name in enumerate(block.photos)}
    names = table.ids["image_file_name"]
    parts = [by_part.get(_part(name), []) for name in names]
    found = np.array(
        [whole.get(name, part[0] if len(part) == 1 else -1) for name, part in zip(names, parts, strict=True)]
    )
    photo = found[table.codes["image_file_name"]]
    rows = np.flatnonzero(photo >= 0)
    if not len(rows):
        message = f"none of its photos is in the block: {listed(names, 4)}; the block has {listed(block.photos, 4)}"
        raise InputError(Fault(message, "unknown-photo", table.file, fix=suggestion(names[0], block.photos)))
    lost = [name for name, photo in zip(names, found.tolist(), strict=True) if photo < 0]
    said = f"{counted(len(table) - len(rows), 'mark')} on photos that the block does not have: {listed(lost, 4)}"
    return rows, photo[rows], [said] if lost else []


def _part(name: str) -> str:
    return name.replace("\\", "/").rpartition("/")[2].casefold()


def _pixels(
    table: Table,
    block: ForeignBlock,
    on: tuple[Numbers, Numbers],
    asked: Asked,
    labels: Sequence[str],
    findings: Findings,
) -> Floats:
    """Give the marks in pixels of the block's photos; refuse those that lie outside, or stand on a photo twice."""
    rows, photo = on
    sizes = np.array([block.image_size(each) for each in range(len(block.photos))])[photo]
    xy = table.columns("x", "y")[rows] * (1.0 if asked.width is None else sizes[:, :1] / asked.width)
    seen: dict[tuple[str, int], int] = {}
    for place, (row, each) in enumerate(zip(rows.tolist(), photo.tolist(), strict=True)):
        before = seen.setdefault((labels[row], each), row)
        if before != row:
            message = f"point {labels[row]} is already marked on this photo, in line {table.lines[before]}"
            findings.add(table.fault(row, "image_file_name", message, "measured-twice", fix="keep one of the two"))
        if (xy[place] < 0.0).any() or (xy[place] > sizes[place]).any():
            width, height = sizes[place].tolist()
            message = f"the mark lies outside photo {shown(block.photos[each])}, which has {width:g} x {height:g} px"
            fix = "if it was made on photos of another width, give that: --mark-width PX"
            findings.add(table.fault(row, "x", message, "range", fix=fix))
    return xy
