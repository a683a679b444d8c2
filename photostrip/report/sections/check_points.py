"""Sections on check points and on control left out in turn: differences against their standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from photostrip.notes import Document, counted, listed
from photostrip.report.page.numbers import fixed, joined, metres, ratio, signed
from photostrip.report.page.parts import Part, Section, Table, Words
from photostrip.report.page.tables import Shown, number, tabulated, words
from photostrip.report.sections.points import AXES, DIFFERENCES, IDS_NAMED, given_table, largest
from photostrip.report.sections.strip import ALL_SHOWN, column_of, worst_first

PARTS = "plan", "height"
UNKNOWN = dict.fromkeys(("plan", "height", "p_plan", "p_height", "sigma_x", "sigma_y", "sigma_z"))
MEANING = (
    "σ: of the adjusted point; z: difference over its standard deviation, with that of the given point (in plan by the "
    "whole covariance, 95 % lie below 2.45); p: chance of a larger one"
)
FAILED_SHOWN = 3


def check_section(document: Document, *, everything: bool, most: int = ALL_SHOWN) -> Section:
    rows = [row for row in document["control"] if row["role"] == "check" and row["measured"]]
    if not rows:
        proven = "cross_validation" in document
        text = (
            "None."
            if proven
            else "None. What lies between the control points is not proven by anything in this report."
        )
        return Section("Check points", (Words(text),))
    text = "Adjusted minus given: how good the new points are."
    check = document.get("precision", {}).get("check")
    if check and check["points"]:
        table = _tested(document, rows, everything=everything, most=most)
    else:
        table = given_table(document, rows, "check", everything=everything, most=most)
    return Section("Check points", (Words(text), table))


def _tested(document: Document, given: Sequence[Document], *, everything: bool, most: int) -> Table:
    check = document["precision"]["check"]
    worst, note = _least_likely(check["points"], given, everything=everything, most=most)
    names = {row["id"] for row in worst}
    points, tested = (
        {name: rows[place] for place, name in enumerate(column_of(rows, "id")) if name in names}
        for rows in (document["points"], check["points"])
    )
    shown = []
    for row in worst:
        point, z = (found.get(row["id"], UNKNOWN) for found in (points, tested))
        sigma = {key: point[key] for key in ("sigma_x", "sigma_y", "sigma_z")}
        likely = {"z_plan": z["plan"], "z_height": z["height"], "p_plan": z["p_plan"], "p_height": z["p_height"]}
        shown.append({**row, **sigma, **likely})
    more = (words("use", "use", rank=2), words("strips", lambda row: ", ".join(row["strips"]), rank=3))
    seen = _Seen([check[part]["rms"] for part in PARTS], [_inside(check[part]) for part in PARTS])
    odd = [row["id"] for row in given if row["stands_out"]]
    without = f"rms of z without {listed(odd, IDS_NAMED)}" if odd else ""
    return _table(document, given, shown, more, seen, joined(note, MEANING, without))


def cross_validation_section(document: Document, *, everything: bool, most: int = ALL_SHOWN) -> Section:
    """Differences at control that was left out in turn."""
    block = document["cross_validation"]
    rows, folds = block["points"], block["folds"]
    made = [fold for fold in folds if not fold["reason"]]
    chance = "" if block["p"] is None else f" Probability of larger errors by chance: {_percent(block['p'])} %."
    text = (
        f"The same adjustment without some of the control, {counted(len(made), 'time')}: adjusted minus given at the "
        f"points that it did not see.{chance}"
    )
    parts: list[Part] = [Words(text)]
    parts += [
        Words(f"not without {listed(fold['left_out'], IDS_NAMED)}: {fold['reason']}", "look", "-")
        for fold in [fold for fold in folds if fold["reason"]][:FAILED_SHOWN]
    ]
    if rows:
        where = ("points", "cross-validation", "cross_validation")
        shown, note = worst_first(rows, _unlikely, where, everything=everything, most=most)
        seen = _Seen([block[part]["ratio"] for part in PARTS], [_inside(block[part]) for part in PARTS])
        explained = not everything and document["summary"]["check"]["plan"]["count"]  # above, at the check points
        below = note if explained else joined(note, MEANING)
        parts.append(_table(document, rows, shown, (number("time", "fold", rank=2),), seen, below))
    return Section("Cross-validation", tuple(parts))


class _Seen(NamedTuple):
    """What the points say together, in plan and in height."""

    over: Sequence[float | None]  # rms of the differences over their standard deviations
    inside: Sequence[str]  # how many lie inside their 95 % limits


def _inside(part: Document) -> str:
    return f"{part['inside_95']} of {part['count']}" if part["count"] else ""


def _table(
    document: Document,
    rows: Sequence[Document],
    shown: Sequence[Document],
    more: Sequence[Shown],
    seen: _Seen,
    note: str,
) -> Table:
    """Return the table of points that the adjustment has not seen.

    more: further columns.
    """
    axes = document["frame"]["axes"]
    columns = (
        words("point", "id"),
        *(number(f"d {axis}", key, signed, "m") for axis, key in zip(axes, DIFFERENCES, strict=True)),
        *(number(f"σ {axis}", f"sigma_{key}", 3, "m", rank=1) for axis, key in zip(axes, AXES, strict=True)),
        *(
            column
            for part in PARTS
            for column in (number(f"z {part}", f"z_{part}", 2), number("p", f"p_{part}", _percent, "%"))
        ),
        *more,
    )
    sums = [_rms_and_mean([value for row in rows if (value := row[key]) is not None]) for key in DIFFERENCES]
    blank, nothing = ("",) * 3, ("",) * len(more)
    z = [cell for part in seen.over for cell in (ratio(part), "")]
    inside = [cell for part in seen.inside for cell in (part, "")]
    foot = (
        ("rms", *(metres(rms) for rms, _ in sums), *blank, *z, *nothing),
        ("mean", *(signed(mean) for _, mean in sums), *blank, *("",) * 4, *nothing),
        (
            "largest",
            *(largest(rows, *each) for each in zip(DIFFERENCES, axes, strict=True)),
            *blank,
            *("",) * 4,
            *nothing,
        ),
        ("in 95 %", *("",) * 6, *inside, *nothing),
    )
    return tabulated(shown, columns, foot, note)


def _rms_and_mean(values: Sequence[float]) -> tuple[float | None, float | None]:
    count = len(values)
    return ((sum(value**2 for value in values) / count) ** 0.5, sum(values) / count) if values else (None, None)


def _least_likely(
    tested: Sequence[Document], given: Sequence[Document], *, everything: bool, most: int
) -> tuple[list[Document], str]:
    """Choose the points that are shown, the least likely first; the chances of all go again."""
    unlikely = {row["id"]: _unlikely(row) for row in tested}
    where = ("points", "check", "control")
    return worst_first(given, lambda row: unlikely.get(row["id"], -1.0), where, everything=everything, most=most)


def _unlikely(row: Document) -> float:
    """How unlikely the difference of a point is, in plan or in height."""
    known = [chance for part in PARTS if (chance := row[f"p_{part}"]) is not None]
    return -min(known, default=1.0)


def _percent(chance: float | None) -> str:
    return fixed(None if chance is None else 100 * chance, 1)
