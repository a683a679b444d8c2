"""Several adjustments of one project as a table."""

from __future__ import annotations

from typing import Any

from photostrip.report.page.figures import metres, micrometres
from photostrip.report.page.parts import Column, Part, Section, Table, Words

Document = dict[str, Any]


def methods_sections(document: Document) -> tuple[Section, ...]:
    """Return the sections of a comparison of methods.

    Parameters
    ----------
    document : dict
        As ``methods.methods_document`` makes it.
    """
    done = [row for row in document["methods"] if row["status"] != "refused"]
    parts: list[Part] = [_table(done, role) for role in ("check", "control")] if done else []
    parts += [
        Words(f"{row['adjustment']}: {row['reason']}", "failed")
        for row in document["methods"]
        if row["status"] == "refused"
    ]
    return (Section("Methods side by side", (*parts, Words(_verdict(document)))),)


def _table(rows: list[Document], role: str) -> Table:
    """Tabulate what is left at the points of one role."""
    columns = (
        Column(f"at {role} points", left=True),
        Column("plan"),
        Column("rms", "m"),
        Column("", "µm"),
        Column("largest", "m"),
        Column("height"),
        Column("rms", "m"),
        Column("", "µm"),
        Column("largest", "m"),
        *((Column("σ plan", "m", rank=1), Column("σ height", "m", rank=1)) if role == "check" else ()),
    )
    cells = []
    for row in rows:
        line = [row["adjustment"]]
        for part in ("plan", "height"):
            each = row[role][part]
            line += [str(each["count"]), metres(each["rms"]), micrometres(each["rms_um"]), metres(each["max"])]
        if role == "check":
            known = row["precision"] or {"plan": None, "height": None}
            line += [metres(known["plan"]), metres(known["height"])]
        cells.append(tuple(line))
    note = "µm: at photo scale; σ: rms of the standard deviations of all points" if role == "check" else ""
    return Table(columns, tuple(cells), note=note)


def _verdict(document: Document) -> str:
    best = document["best"]
    if best["plan"] is None and best["height"] is None:
        return "There are no check points: which method is better cannot be told. Give some points `role: check`."
    if best["plan"] == best["height"]:
        return f"Smallest at check points: {best['plan']}."
    return f"Smallest at check points: {best['plan']} in plan, {best['height']} in height."
