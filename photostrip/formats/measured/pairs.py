"""Stereocomparator lists, one row for a point of a pair: ``pair,point,x,y,p,q`` or ``pair,point,xl,yl,xr,yr``.

Instead of ``pair`` there may be two columns ``left`` and ``right``. With x, y, p, q the left photo has x, y and the
right photo x - p, y - q: p and q are the parallaxes. Every row becomes one row for each of the two photos.
"""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import replace

import numpy as np

from photostrip.arrays import Flags, Floats, Numbers
from photostrip.formats.measured.columns import POINT, numbers, sigmas
from photostrip.formats.measured.measurements import Measurements
from photostrip.formats.text.findings import Findings
from photostrip.formats.text.tables import Column, Table
from photostrip.notes import counted
from photostrip.points import locate

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
FIX = "exchange the two ids, or the columns of the two photos"
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
            _refuse(table, code, pair, known, findings)
    return tuple(number), of_pair[table.codes["pair"]]


def _refuse(table: Table, code: int, pair: str, ways: list[tuple[str, str]], findings: Findings) -> None:
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
        findings.add(read.table.fault(0, "photo", message, "pair-exchanged", fix=FIX))
    for one, other in which:
        inside = (left == one) & (right == other)
        message = (
            f"photos {read.photo_ids[one]} and {read.photo_ids[other]} are exchanged in their pair: its "
            f"{counted(int(inside.sum()), 'point')} agree with the other pairs if they are exchanged"
        )
        findings.add(read.table.fault(2 * int(np.argmax(inside)), "photo", message, "pair-exchanged", fix=FIX))
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
