"""Report of what the sources print."""

from __future__ import annotations

from photostrip.notes import Document
from photostrip.report.page.numbers import short
from photostrip.report.page.parts import Part, Section, Words
from photostrip.report.page.tables import number, tabulated, words


def sources_report(document: Document) -> tuple[str, tuple[Section, ...]]:
    worked = tabulated(
        document["worked"],
        (
            words("source", "source"),
            words("number", "what"),
            number("printed", "printed", short),
            number("formula", "formula", short),
            number("correct", "correct", short),
            words("", "unit"),
            words("remark", "remark"),
        ),
        note="formula: that of the source, not rounded; correct: without its misprints and assumptions",
    )
    tags = sorted({row["source"] for row in document["misprints"]})
    equations = tabulated(
        document["equations"],
        (
            words("equation", "equation"),
            words("what", "what", rank=1),
            words("function", "function"),
            words("command", "command", rank=2),
        ),
        note="with the commands in every form but text on a narrow page",
    )
    return "What the sources print", (
        Section("Worked numbers, computed again", (worked,)),
        *(Section(f"Misprints of {tag}", _misprints(document, tag)) for tag in tags),
        Section("From an equation to a function", (equations,)),
    )


def _misprints(document: Document, tag: str) -> tuple[Part, ...]:
    found = []
    for row in document["misprints"]:
        if row["source"] == tag:
            shows = f" ({row['shows']})" if row["shows"] else ""
            found.append(Words(f"{row['place']}: {row['printed']}. Correct: {row['correct']}{shows}.", mark="-"))
    return tuple(found)
