"""Several adjustments of one project as a table."""

from __future__ import annotations

from collections.abc import Callable

from photostrip.notes import Document
from photostrip.report.page.parts import Part, Section, Table, Words
from photostrip.report.page.tables import number, tabulated, words


def methods_sections(document: Document) -> tuple[Section, ...]:
    done = [row for row in document["methods"] if row["status"] != "refused"]
    parts: list[Part] = [_table(done, role) for role in ("check", "control")] if done else []
    parts += [
        Words(f"{row['adjustment']}: {row['reason']}", "failed")
        for row in document["methods"]
        if row["status"] == "refused"
    ]
    parts.append(Words(_verdict(document)))
    return (Section("Methods side by side", tuple(parts)),)


def _table(rows: list[Document], role: str) -> Table:
    left_over = [
        column
        for part in ("plan", "height")
        for column in (
            number(part, f"{role}.{part}.count"),
            number("rms", f"{role}.{part}.rms", 3, "m"),
            number("", f"{role}.{part}.rms_um", 1, "µm"),
            number("largest", f"{role}.{part}.max", 3, "m"),
        )
    ]
    columns = [words(f"at {role} points", "adjustment"), *left_over]
    if role == "check":
        columns += [number(f"σ {part}", _precision(part), 3, "m", rank=1) for part in ("plan", "height")]
    note = "µm: at photo scale; σ: rms of the standard deviations of all points" if role == "check" else ""
    return tabulated(rows, columns, note=note)


def _precision(part: str) -> Callable[[Document], float | None]:
    """Return what reads the rms standard deviation of all points, where it is known."""
    return lambda row: row["precision"][part] if row["precision"] else None


def _verdict(document: Document) -> str:
    best = document["best"]
    if best["plan"] is None and best["height"] is None:
        return (
            "There are no check points: which method is better cannot be told. Give some of the points `role: check`."
        )
    if best["plan"] == best["height"]:
        return f"Smallest at check points: {best['plan']}."
    return f"Smallest at check points: {best['plan']} in plan, {best['height']} in height."
