"""Section on strips that were adjusted with their own covariance."""

from __future__ import annotations

from collections.abc import Sequence

from photostrip.notes import Document, counted
from photostrip.report.page.numbers import fixed, joined, ratio, signed
from photostrip.report.page.parts import Facts, Part, Section, Table, Words
from photostrip.report.page.tables import number, tabulated, words
from photostrip.report.sections.strip import worst_first


def covariance_section(document: Document, *, everything: bool) -> Section:
    """Show the test of the whole adjustment and of each control coordinate."""
    blocks = document["covariance"]
    # a result that was written before the choice existed has none
    distances = document["settings"].get("covariance", {}).get("distances", True)
    text = (
        f"The misclosures at the control {'and the distances of the pass points ' if distances else 'alone '}are "
        "distributed to every point by least-squares prediction with the covariance of the strip itself."
    )
    parts: list[Part] = [Words(text)]
    for block in blocks:
        parts += (Facts(tuple(_facts(block, several=len(blocks) > 1))), _control(block, everything=everything))
    return Section("Adjustment with the covariance of the strip", tuple(parts))


def _facts(block: Document, *, several: bool) -> Sequence[tuple[str, str]]:
    rows: list[tuple[str, str]] = [("strip", block["strip"])] if several else []
    conditions = (
        f"{counted(block['control_coordinates'], 'control coordinate')}, "
        f"{counted(block['distances'], 'distance')} of pass points, {counted(block['models'], 'model')}"
    )
    test = f"σ0 {ratio(block['sigma0'])} (1 if all standard deviations are right), redundancy {block['redundancy']}"
    if block["p"] is not None:
        test += f", probability of a larger one by chance {fixed(100 * block['p'], 1)} %"
    if block.get("passes", 1) > 1:
        rows.append(
            ("passes", f"{block['passes']}: the strip was so bent that it was formed again from corrected images")
        )
    return [*rows, ("conditions", conditions), ("test of the whole", test)]


def _control(block: Document, *, everything: bool) -> Table:
    shown, note = worst_first(
        block["control"],
        lambda row: abs(row["test"] or 0.0),
        ("coordinates", "covariance", "covariance"),
        everything=everything,
    )
    columns = (
        words("control", "id"),
        words("axis", "axis"),
        number("test", "test", 2),
        number("error that would explain it", "size", signed, "m"),
        words("", lambda row: "WRONG?" if row["test"] is not None and abs(row["test"]) > block["limit"] else ""),
    )
    below = f"test: standard normal for correct control; beyond {ratio(block['limit'])} it is doubtful"
    return tabulated(shown, columns, note=joined(note, below))
