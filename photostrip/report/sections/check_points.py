"""The section on check points: their differences against the standard deviations of the adjusted and given points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from photostrip.report.page.numbers import fixed, joined, listed, metres, ratio, signed
from photostrip.report.page.parts import Document, Section, Table, Words
from photostrip.report.page.tables import number, tabulated, words
from photostrip.report.sections.points import AXES, DIFFERENCES, IDS_NAMED, given_table, largest
from photostrip.report.sections.strip import ALL_SHOWN, worst_first

if TYPE_CHECKING:
    from collections.abc import Sequence

PARTS = "plan", "height"
UNKNOWN = dict.fromkeys(("plan", "height", "p_plan", "p_height", "sigma_x", "sigma_y", "sigma_z"))


def check_section(document: Document, *, everything: bool, most: int = ALL_SHOWN) -> Section:
    """Differences at the check points."""
    rows = [row for row in document["control"] if row["role"] == "check" and row["measured"]]
    if not rows:
        text = "None. What lies between the control points is not proven by anything in this report."
        return Section("Check points", (Words(text),))
    text = "Adjusted minus given. These points took no part in anything: they say how good the new points are."
    check = document.get("precision", {}).get("check")
    if check and check["points"] and "p_plan" in check["points"][0]:  # results of older versions have no probabilities
        table = _tested(document, rows, everything=everything, most=most)
    else:
        table = given_table(document, rows, "check", everything=everything, most=most)
    return Section("Check points", (Words(text), table))


def _tested(document: Document, given: Sequence[Document], *, everything: bool, most: int) -> Table:
    check, axes, summary = document["precision"]["check"], document["frame"]["axes"], document["summary"]
    tested = {row["id"]: row for row in check["points"]}
    points = {row["id"]: row for row in document["points"]}
    rows = [{**row, "point": points.get(row["id"], UNKNOWN), "z": tested.get(row["id"], UNKNOWN)} for row in given]
    where = ("points", "check", "control")
    shown, note = worst_first(rows, _unlikely, where, everything=everything, most=most)
    columns = (
        words("point", "id"),
        *(number(f"d {axis}", key, signed, "m") for axis, key in zip(axes, DIFFERENCES, strict=True)),
        *(number(f"σ {axis}", f"point.sigma_{key}", 3, "m", rank=1) for axis, key in zip(axes, AXES, strict=True)),
        *(
            column
            for part in PARTS
            for column in (number(f"z {part}", f"z.{part}", 2), number("p", f"z.p_{part}", _percent, "%"))
        ),
        words("use", "use", rank=2),
        words("strips", lambda row: ", ".join(row["strips"]), rank=3),
    )
    rms, mean = summary["check_rms"], summary["check_mean"]
    blank, nothing = ("",) * 3, ("",) * 6
    over = [cell for part in PARTS for cell in (ratio(check[part]["rms"]), "")]
    foot = (
        ("rms", *(metres(rms[axis]) for axis in AXES), *blank, *over, "", ""),
        ("mean", *(signed(mean[axis]) for axis in AXES), *blank, *nothing),
        (
            "largest",
            *(largest(given, key, axis) for key, axis in zip(DIFFERENCES, axes, strict=True)),
            *blank,
            *nothing,
        ),
    )
    below = (
        "σ: of the adjusted point; z: difference over its standard deviation, that of the given point included (in "
        "plan the length in the metric of the covariance: 2.45 for 95 %); p: probability of a larger one by chance"
    )
    odd = [row["id"] for row in given if row.get("stands_out")]
    without = f"rms of z without {listed(odd, IDS_NAMED)}" if odd else ""
    return tabulated(shown, columns, foot, joined(note, below, without))


def _unlikely(row: Document) -> float:
    """How unlikely the difference of a point is, in plan or in height."""
    known = [row["z"][f"p_{part}"] for part in PARTS if row["z"][f"p_{part}"] is not None]
    return -min(known, default=1.0)


def _percent(chance: float | None) -> str:
    return fixed(None if chance is None else 100 * chance, 1)
