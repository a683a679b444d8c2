"""Tables of measured and given coordinates: image points, fiducial marks, control, camera positions, orientations.

``photo,point,x,y[,sx,sy]`` and, for fiducial marks, ``photo,mark,x,y[,sx,sy]``; stereocomparator lists, a row for a
point of a pair, ``pair,point,x,y,p,q`` or ``pair,point,xl,yl,xr,yr``, or ``left`` and ``right`` for ``pair``: the
left photo has x, y and the right photo x - p, y - q, and every row becomes one for each photo.
Given ground coordinates: ``point,x,y,z[,use][,role][,sx,sy,sz]``, x, y, z in the order of the list's axes; measured
camera positions ``photo,x,y,z[,use][,time][,sx,sy,sz]``. An orientation table has the three angles in columns of their
names, ``photo,x,y,z,alpha,omega,kappa`` or those of another system, and their standard deviations in ``s_alpha`` and so
on; ``photos.csv`` of a result can be read as it is. A point measured several times on one photo is refused, or averaged
with its spread noted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.errors import Fault
from photostrip.formats.faults import Findings
from photostrip.formats.tables import UNDECLARED, Column, Form, Table, joined, read_table
from photostrip.notes import Note, counted, listed
from photostrip.points import locate

AXES = ("x", "y", "z")
PHOTO = Column("photo", aliases=("photo_id", "image", "image_id"))
POINT = Column("point", aliases=("point_id", "id"))
SIGMAS = tuple(f"s{axis}" for axis in AXES)


def numbers(*names: str, filled: bool = True) -> tuple[Column, ...]:
    """Return columns of numbers that a table must have."""
    return tuple(Column(name, number=True, filled=filled) for name in names)


def sigmas(*axes: str) -> tuple[Column, ...]:
    """Return columns of standard deviations that a table may have."""
    return tuple(
        Column(f"s{axis}", number=True, required=False, filled=False, positive=True, aliases=(f"sigma_{axis}",))
        for axis in axes
    )


def refuse_without_sigma(table: Table, missing: Flags, columns: Sequence[str], fix: str, findings: Findings) -> None:
    """Ask for the standard deviations that neither rows nor project give; `missing` marks their cells."""
    rows, places = np.nonzero(missing)
    if len(rows):
        number = counted(len(np.unique(rows)), "row has no standard deviation", "rows have no standard deviation")
        message = f"{number} ({', '.join(columns)}), and the project file gives none"
        findings.add(table.fault(int(rows[0]), columns[int(places[0])], message, "no-sigma", fix=fix))


def repeated_rows(keys: Iterable[object]) -> Iterator[tuple[int, int]]:
    """Yield the number of each row whose key stands in a row before, and of the first such row."""
    first: dict[object, int] = {}
    for row, key in enumerate(keys):
        before = first.setdefault(key, row)
        if before != row:
            yield row, before


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measured image coordinates as the table gives them: in its unit, with its direction of y."""

    table: Table
    # photo_ids, target_ids: ids of the photos, and of the points or marks, in order of first appearance
    photo_ids: tuple[str, ...]
    target_ids: tuple[str, ...]
    # photo, target: (n,): photo and target of each row
    photo: Numbers
    target: Numbers
    xy: Floats  # (n, 2): coordinates in the unit of the table
    sigma: Floats  # (n, 2): standard deviations in the unit of the table; NaN where the row has none
    times: Numbers  # (n,): number of measurements of which each row is the mean


POLICIES = ("refuse", "average")
LEAST_TOGETHER = 4  # points measured several times, of which more than
MOST_SHARE = 0.5  # disagree for one reason
REACH_SHARE = 0.98  # of the coordinates
AGREEING_SHARE = 3e-4  # of what coordinates reach to: 30 micrometres of 100 mm
FARTHEST_SIGMAS = 10.0  # standard deviations from the mean; beyond, two measurements are not of one point
DECIMALS = 9  # of the unit of a table: what is left beyond is rounding


def refuse(read: Measurements, target: str, findings: Findings) -> None:
    """Refuse a second measurement of the same point, or mark, on the same photo."""
    key = _key(read)
    order = np.argsort(key, kind="stable")
    again = np.flatnonzero(key[order][1:] == key[order][:-1]) + 1
    first: dict[int, int] = {}
    for told, place in enumerate(again):
        if findings.full(read.table.file):
            findings.count(read.table.file, len(again) - told)
            return
        row = int(order[place])
        number = first.setdefault(int(key[row]), int(order[place - 1]))
        name, photo = read.target_ids[read.target[row]], read.photo_ids[read.photo[row]]
        message = f"{target} {name} is already measured on photo {photo}, in {read.table.lines_of(number)}"
        fix = "keep one of the two, give one another id, or set `repeated: average`"
        findings.add(read.table.fault(row, target, message, "measured-twice", fix=fix))


def averaged(read: Measurements, target: str, default: float | None, findings: Findings) -> Measurements:
    """Replace several measurements of a point, or mark, on a photo by their weighted mean.

    The mean stands where the first measurement stood. Its standard deviation follows from those of the measurements,
    not from their spread, which becomes a note. Measurements too far apart to be of one point are refused.

    default: standard deviation of rows without one, in the unit of the table.
    """
    _, first, group, count = np.unique(_key(read), return_index=True, return_inverse=True, return_counts=True)
    if (count == 1).all():
        return read
    sigma = np.where(np.isnan(read.sigma), np.nan if default is None else default, read.sigma)
    weight = np.where(np.isfinite(sigma), sigma, 1.0) ** -2.0
    total = _sums(group, weight)
    mean = _sums(group, weight * read.xy) / total
    off = np.where(count[group, None] > 1, read.xy - mean[group], 0.0)
    ratio = np.abs(off) / sigma
    if not _refuse_all(read, target, off, ratio, group, findings):
        _refuse_far(read, target, ratio, group, findings)
    findings.notes.append(_spread(read, target, off, count))
    of_mean = np.where(np.isnan(_sums(group, sigma)), np.nan, total**-0.5)
    order = np.argsort(first)
    rows, several = first[order], count[order, None] > 1
    return replace(
        read,
        table=read.table.take(rows),
        photo=read.photo[rows],
        target=read.target[rows],
        xy=np.where(several, mean[order], read.xy[rows]),
        sigma=np.where(several, of_mean[order], read.sigma[rows]),
        times=count[order],
    )


def _key(read: Measurements) -> Numbers:
    return np.asarray(read.photo * len(read.target_ids) + read.target, np.intp)


def _sums(group: Numbers, values: Floats) -> Floats:
    return np.stack([np.bincount(group, column) for column in values.T], axis=1, dtype=float)


def _refuse_all(
    read: Measurements, target: str, off: Floats, ratio: Floats, group: Numbers, findings: Findings
) -> bool:
    """Refuse measurements of which most disagree: they have one cause, often the unit.

    Measurements that differ by next to nothing of what they reach to agree, and what they are tested against is wrong.
    """
    several = np.bincount(group)[group] > 1
    far = several & (np.nan_to_num(ratio.max(axis=1)) > FARTHEST_SIGMAS)
    names = len(np.unique(group[several]))
    if names < LEAST_TOGETHER or far.sum() <= MOST_SHARE * several.sum():
        return False
    scatter = np.median(np.abs(off[several]).max(axis=1))
    reach = np.quantile(np.abs(read.xy), REACH_SHARE)
    head = (
        f"{names} {target}s are measured several times on a photo, and {len(np.unique(group[far]))} of them lie more "
        f"than {FARTHEST_SIGMAS:g} standard deviations from their mean"
    )
    if scatter < AGREEING_SHARE * reach:
        message = (
            f"{head}, by {scatter:.2g}, of coordinates that reach to {reach:.4g}: they agree as measurements do, so "
            "that the unit or the standard deviation is wrong"
        )
        fix = "correct `observations.unit` or `observations.sigma`"
    else:
        message = f"{head}, by {scatter:.2g}, of coordinates that reach to {reach:.4g}"
        fix = (
            "were photos set up again between two pairs, or points renumbered? reduce coordinates to the fiducial marks"
        )
    findings.add(read.table.fault(int(np.argmax(far)), target, message, "measurements-disagree", fix=fix))
    return True


def _refuse_far(read: Measurements, target: str, ratio: Floats, group: Numbers, findings: Findings) -> None:
    """Refuse measurements that lie farther from their mean than one point's can."""
    farthest = np.zeros(group.max() + 1)
    np.maximum.at(farthest, group, np.nan_to_num(ratio.max(axis=1)))
    for number in np.flatnonzero(farthest > FARTHEST_SIGMAS).tolist():
        if findings.full(read.table.file):
            findings.count(read.table.file, 1)
            continue
        rows = np.flatnonzero(group == number)
        apart = np.ptp(read.xy[rows], axis=0)
        name, photo = read.target_ids[read.target[rows[0]]], read.photo_ids[read.photo[rows[0]]]
        lines = read.table.lines_of(*rows.tolist())
        message = (
            f"{target} {name} is measured {len(rows)} times on photo {photo} ({lines}), up to {apart.max():g} in "
            f"{'xy'[int(apart.argmax())]} apart: {farthest[number]:.0f} standard deviations from the mean"
        )
        fix = "remove the wrong one, or give the other point an id of its own"
        findings.add(read.table.fault(int(rows[-1]), target, message, "measurements-disagree", fix=fix))


def _spread(read: Measurements, target: str, off: Floats, count: Numbers) -> Note:
    """Tell how well repeated measurements agree."""
    several = count > 1
    freedom = int((count[several] - 1).sum())
    off = np.round(off, DECIMALS)
    scatter = np.sqrt((off**2).sum(axis=0) / freedom)
    worst = int(np.abs(off).max(axis=1).argmax())
    name, photo = read.target_ids[read.target[worst]], read.photo_ids[read.photo[worst]]
    message = (
        f"{counted(int(several.sum()), target)} measured up to {count.max()} times on a photo, the mean is used; one"
        f" measurement scatters by {scatter[0]:.3g} in x and {scatter[1]:.3g} in y (standard deviations, unit of the"
        f" table), the worst is {target} {name} on photo {photo}, {np.abs(off[worst]).max():.3g} beside the mean of "
        "its measurements"
    )
    line, file = int(read.table.lines[worst]), read.table.file_of(worst)
    return Note("measurements-averaged", message, "note", photos=(photo,), points=(name,), file=file, line=line)


PAIR = (Column("pair", aliases=("pair_id", "model", "stereopair")),)
BOTH = (
    Column("left", aliases=("left_photo", "photo_left")),
    Column("right", aliases=("right_photo", "photo_right")),
)
PARALLAXES = numbers(*"xypq")
TWO_POINTS = tuple(
    Column(f"{axis}{side}", number=True, aliases=(f"{axis}_{word}",))
    for side, word in (("l", "left"), ("r", "right"))
    for axis in "xy"
)
LAYOUTS = tuple(
    (*names, POINT, *columns, *sigmas(*"xy")) for names in (PAIR, BOTH) for columns in (PARALLAXES, TWO_POINTS)
)
FIX_EXCHANGED = "exchange the two ids, or the columns of the two photos"
LEAST_AGAIN = 3  # measurements of a pair that are made in other pairs too, to see whether its photos are exchanged
EXCHANGED_SHARE = 0.01  # of how far they differ as given, within which they agree when the photos are exchanged
SIGNS = "-–—/:_+ "  # dashes as spreadsheets write them


def photos_of_pairs(table: Table, photos: AbstractSet[str], findings: Findings) -> Table | None:
    """Make a table of photos of a table of pairs, two rows for each row: left, then right.

    `photos` are those of the strips, by which the name of a pair is divided. None when a pair names no two of them.
    """
    ids, codes = _photos(table, photos, findings)
    if (codes < 0).any():
        return None
    n, table = len(table), table.placed_as("photo", "pair" if "pair" in table.ids else "left")
    xy = np.stack([np.stack(each, -1) for each in _coordinates(table)], 1).reshape(2 * n, 2)
    numbers = {"x": xy[:, 0], "y": xy[:, 1]}
    numbers |= {name: np.repeat(table.numbers[name], 2) for name in ("sx", "sy") if name in table.numbers}
    return replace(
        table,
        lines=np.repeat(table.lines, 2),
        numbers=numbers,
        codes={"photo": codes.reshape(-1), "point": np.repeat(table.codes["point"], 2)},
        ids={"photo": ids, "point": table.ids["point"]},
    )


def _coordinates(table: Table) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    if "xl" in table.numbers:
        xl, yl, xr, yr = (table.numbers[column.name] for column in TWO_POINTS)
        return (xl, yl), (xr, yr)
    x, y, p, q = (table.numbers[column.name] for column in PARALLAXES)
    return (x, y), (x - p, y - q)


def _photos(table: Table, photos: AbstractSet[str], findings: Findings) -> tuple[tuple[str, ...], Numbers]:
    """Left and right photo of each row, shape (n, 2), counted in the ids; -1 where a pair is none, which is refused."""
    if "pair" not in table.ids:
        names = tuple(dict.fromkeys((*table.ids["left"], *table.ids["right"])))
        sides = [locate(table.ids[side], names)[table.codes[side]] for side in ("left", "right")]
        return names, np.stack(sides, -1)
    number: dict[str, int] = {}
    of_pair = np.full((len(table.ids["pair"]), 2), -1, np.intp)
    for code, pair in enumerate(table.ids["pair"]):
        ways = [(pair[:place].strip(), pair[place + 1 :].strip()) for place, sign in enumerate(pair) if sign in SIGNS]
        known = list(dict.fromkeys(way for way in ways if way[0] in photos and way[1] in photos))
        if len(known) == 1:
            of_pair[code] = [number.setdefault(name, len(number)) for name in known[0]]
        else:
            _refuse_pair(table, code, pair, known, findings)
    return tuple(number), of_pair[table.codes["pair"]]


def _refuse_pair(table: Table, code: int, pair: str, ways: list[tuple[str, str]], findings: Findings) -> None:
    row = int(np.argmax(table.codes["pair"] == code))
    if ways:
        either = " or ".join(f"{left} and {right}" for left, right in ways)
        message = f"pair {pair} may be photos {either}"
    else:
        message = f"pair {pair} does not name two photos of the strips"
    fix = "write it as LEFT-RIGHT with ids of the strips' photos, or use two columns left and right"
    findings.add(table.fault(row, "pair", message, "pair", expected="a pair such as 1001-1002", fix=fix))


def refuse_exchanged(read: Measurements, findings: Findings) -> bool:
    """Refuse pairs whose measurements agree with those of the other pairs when their photos are exchanged.

    read: rows as ``photos_of_pairs`` makes them, left and right in turn.
    """
    left, right = read.photo[0::2], read.photo[1::2]
    exchanged = _exchanged(read, np.ones(len(left), bool))
    pairs = np.unique(np.column_stack([left, right]), axis=0)
    which = [] if exchanged else [pair for pair in pairs if _exchanged(read, (left == pair[0]) & (right == pair[1]))]
    if exchanged:
        message = "in every pair the measurements agree with those of the other pairs when left and right are exchanged"
        findings.add(read.table.fault(0, "photo", message, "pair-exchanged", fix=FIX_EXCHANGED))
    for one, other in which:
        inside = (left == one) & (right == other)
        message = (
            f"photos {read.photo_ids[one]} and {read.photo_ids[other]} are exchanged in their pair: its "
            f"{counted(int(inside.sum()), 'point')} agree with the other pairs if they are exchanged"
        )
        findings.add(
            read.table.fault(2 * int(np.argmax(inside)), "photo", message, "pair-exchanged", fix=FIX_EXCHANGED)
        )
    return exchanged or bool(which)


def _exchanged(read: Measurements, inside: Flags) -> bool:
    """Whether rows agree with the others, and all with each other, when their two photos are exchanged."""
    swapped = read.photo.reshape(-1, 2).copy()
    swapped[inside] = swapped[inside][:, ::-1]
    given, then = (_apart(read, photo, np.repeat(inside, 2)) for photo in (read.photo, swapped.reshape(-1)))
    if min(len(given), len(then)) < LEAST_AGAIN:
        return False
    return bool(np.median(then) < EXCHANGED_SHARE * np.median(given))


def _apart(read: Measurements, photo: Numbers, inside: Flags) -> Floats:
    """How far measurements of some rows lie from the others of the same point on the same photo."""
    key = photo * len(read.target_ids) + read.target
    order = np.argsort(key, kind="stable")
    one, other = order[:-1], order[1:]
    again = (key[one] == key[other]) & (inside[one] | inside[other])
    return np.asarray(np.abs(read.xy[one[again]] - read.xy[other[again]]).max(axis=1), float)


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
    layout, others = (FIDUCIALS, ()) if manner.marks else (OBSERVATIONS, LAYOUTS)
    read_each = [read_table(file, layout, findings, others=others, form=manner.form) for file in files]
    tables = [each for each in read_each if each is not None]
    if len(tables) < len(files) or not _alike(tables, findings):
        return None
    in_pairs = "photo" not in tables[0].ids
    if in_pairs:
        of_photos = [photos_of_pairs(each, manner.photos, findings) for each in tables]
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
    if in_pairs and refuse_exchanged(read, findings):
        return read  # every one of their points disagrees with itself
    if manner.repeated == "average" or (in_pairs and not manner.repeated):
        return averaged(read, target, manner.sigma, findings)
    refuse(read, target, findings)
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
