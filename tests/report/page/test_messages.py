"""Findings as people read them: a few examples of each kind, and how many there are."""

from __future__ import annotations

from photostrip.errors import Fault
from photostrip.notes import Note
from photostrip.plausibility import found
from photostrip.report.page.messages import MOST_OF_A_KIND, finding_of, lines_of

SHARED = [found("P301", f"point {number} stands for two points", "", points=(f"{number}",)) for number in range(4427)]
OUTSIDE = found("P402", "control[0] lies elsewhere", "correct the crs")


def test_a_kind_is_told_by_examples_and_a_count() -> None:
    lines = lines_of([finding_of(each) for each in (*SHARED, OUTSIDE)])
    assert len(lines) == MOST_OF_A_KIND + 2
    assert lines[MOST_OF_A_KIND - 1].startswith("warning: P301 point 4 stands")
    assert lines[MOST_OF_A_KIND] == "warning: P301 4422 more like these; --format json names all"
    assert lines[-1].startswith("error: P402 ")


def test_notes_are_counted() -> None:
    notes = [finding_of(Note("unused", f"row {number} is not used")) for number in range(9)]
    assert len(lines_of(notes)) == MOST_OF_A_KIND + 1
    assert lines_of(notes)[-1] == "warning: unused 4 more like these; --format json names all"


def test_faults_are_told_by_column_and_by_the_key_of_a_list() -> None:
    def told(*faults: Fault) -> list[str]:
        return lines_of([finding_of(each) for each in faults])

    rows = [Fault("no number", "not-a-number", "o.csv", line, 9, "x") for line in range(1, 201)]
    more = Fault("and 7 more faults in this file", "more", "o.csv")
    lines = told(*rows, more)
    assert lines[:MOST_OF_A_KIND] == [f"error: o.csv:{line}:9: x: no number" for line in range(1, 6)]
    assert lines[MOST_OF_A_KIND:] == [
        "error: o.csv: not-a-number 195 more like these; --format json names all",
        "error: o.csv: and 7 more faults in this file",
    ]
    assert len(told(*(Fault("2 points", "few", "p.yaml", key=f"strips[0].photos[{i}]") for i in range(40)))) == 6
    keys = [Fault("no key", "unknown-key", "p.yaml", key=key) for key in ("a", "b", "c", "d", "e", "f", "g")]
    assert len(told(*keys)) == len(keys)
