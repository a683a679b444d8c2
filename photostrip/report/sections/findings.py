"""What the data say against themselves, at the top of the report: each finding, its numbers and its cure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from photostrip.notes import before
from photostrip.report.page.parts import Document, Part, Section, Words

if TYPE_CHECKING:
    from collections.abc import Iterator


def findings_sections(document: Document) -> tuple[Section, ...]:
    """Return the section of the findings; none when there are none."""
    findings = document.get("findings", [])
    if not findings:
        return ()
    parts = tuple(part for each in findings for part in _paragraphs(each))
    return (Section("Plausibility of the data", parts),)


def _paragraphs(finding: Document) -> Iterator[Part]:
    place = before(finding["file"], finding["line"], finding["column"])
    word = "accepted" if finding["accepted"] else finding["severity"]
    colour = "" if finding["accepted"] else "failed" if finding["severity"] == "error" else "look"
    yield Words(f"{finding['code']} {finding['title']} ({word}): {place}{finding['message']}.", colour, "-")
    if finding["evidence"]:
        numbers = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in finding["evidence"].items())
        yield Words(f"Evidence: {numbers}.", "", " ")
    if finding["fix"] and not finding["accepted"]:
        cure = finding["fix"]
        yield Words(f"To put it right: {cure}{'' if cure.endswith('?') else '.'}", "", " ")
