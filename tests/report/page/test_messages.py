"""Findings as people read them: a few examples of each kind, and how many there are."""

from __future__ import annotations

import copy

from photostrip.errors import Fault
from photostrip.notes import Note
from photostrip.report.page.messages import MOST_OF_A_KIND, finding_of, lines_of
from photostrip.report.page.parts import Words
from photostrip.report.sections.findings import cures_section, findings_sections
from photostrip.triangulation.plausibility import found
from tests.reports import saved

SHARED = [found("P301", f"point {number} stands for two points", "", points=(f"{number}",)) for number in range(4427)]
OUTSIDE = found("P402", "control[0] lies elsewhere", "correct the crs")


def test_a_kind_is_told_by_examples_and_a_count() -> None:
    lines = lines_of([finding_of(each) for each in (*SHARED, OUTSIDE)])
    assert len(lines) == MOST_OF_A_KIND + 2
    assert lines[MOST_OF_A_KIND - 1].startswith("warning: P301 point 4 stands")
    assert lines[MOST_OF_A_KIND] == "warning: P301 4422 more like these; --format json names all"
    assert lines[-1].startswith("error: P402 ")


def test_notes_are_counted_and_faults_all_told() -> None:
    notes = [finding_of(Note("unused", f"row {number} is not used")) for number in range(9)]
    faults = [finding_of(Fault(f"row {number} is no number", "not-a-number")) for number in range(9)]
    assert len(lines_of(notes)) == MOST_OF_A_KIND + 1
    assert lines_of(notes)[-1] == "warning: unused 4 more like these; --format json names all"
    assert len(lines_of(faults)) == len(faults)


def test_reports_show_every_kind() -> None:
    document = copy.deepcopy(saved())
    document["findings"] = [finding_of(each) for each in (*SHARED, OUTSIDE)]
    (section,) = findings_sections(document, everything=False)
    for parts in (section.parts, cures_section(document, 12).parts):
        texts = [part.text for part in parts if isinstance(part, Words)]
        assert sum(text.startswith("P301 one id for two points (") for text in texts) == MOST_OF_A_KIND
        assert sum(text.startswith("P402") for text in texts) == 1
        assert any("4422 more" in text for text in texts)
