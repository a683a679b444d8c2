"""The short report: never longer than a page and a half, verdict first, and where the rest is."""

from __future__ import annotations

import pytest

from photostrip.formats.result_json import read_baseline
from photostrip.report.page.layout import to_text
from photostrip.report.page.parts import Facts, Section, Table, Words
from photostrip.report.sections.accuracy_report import NAMES, chosen_sections, sections_of, title_of
from photostrip.report.sections.overview import MOST_LINES, overview
from tests.loops import nonempty
from tests.reports import saved
from tests.results import FRAMES, Document, by_rows, case, in_tables
from tests.source_tree import ROOT


def lines(document: Document, width: int = 100) -> list[str]:
    return to_text(title_of(document), chosen_sections(document, width=width), width).splitlines()


def crowded() -> Document:
    """Give a result in which there is too much of everything: a block of 60 strips with 1000 pairs."""
    document = by_rows(saved())
    control, check = (next(row for row in document["control"] if row["role"] == role) for role in ("control", "check"))
    strip, pair, polynomial = document["strips"][0], document["models"][0], document["polynomials"][0]
    text = "a sentence of some length that says with ids, numbers and units what is wrong with this one and why " * 3
    note = {"severity": "note", "message": text, "strip": "", "photos": [], "points": []}
    note |= {"file": "", "line": 0, "column": 0, "key": ""}
    finding = {"title": "a mistake", "severity": "error", "accepted": False, "message": text, "fix": text}
    finding |= {
        "evidence": {"size_m": 1.0},
        "points": [],
        "photos": [],
        "strips": [],
        "file": "",
        "line": 0,
        "column": 0,
        "key": "",
    }
    document |= {
        "status": "failed",
        "control": [{**row, "id": f"{n}"} for n in range(300) for row in (control, check)],
        "strips": [{**strip, "id": f"S{n}"} for n in range(60)],
        "absolute": [{**document["absolute"][0], "strip": f"S{n}"} for n in range(60)],
        "polynomials": [{**polynomial, "strip": f"S{n}"} for n in range(60)],
        "models": [{**pair, "left": f"L{n}"} for n in range(1000)],
        "cameras": [{**document["cameras"][0], "id": f"C{n}"} for n in range(60)],
        "rejected": [{**document["rejected"][0], "point": f"R{n}"} for n in range(500)],
        "not_determined": [{"id": f"U{n}", "reason": f"reason {n % 20}"} for n in range(500)],
        "notes": [{**note, "code": f"kind {n % 40}"} for n in range(400)],
        "findings": [{**finding, "code": f"P{100 + n}"} for n in range(50)],
        "tolerances": [{"name": f"t{n}", "value": 1.0, "limit": 0.5, "unit": "m", "passed": False} for n in range(11)],
        "verdict": {**document["verdict"], "look_at": [f"{n} {text}" for n in range(50)]},
    }
    document["counts"]["strips"] = 60
    document["precision"]["check"]["points"] = [
        {**document["precision"]["check"]["points"][0], "id": f"{n}", "plan": float(n), "p_plan": 1.0 / (1 + n)}
        for n in range(300)
    ]
    found: Document = in_tables(document)
    return found


@pytest.mark.parametrize("strips", [1, 2])
@pytest.mark.parametrize("frame", FRAMES)
def test_it_is_short(frame: str, strips: int) -> None:
    assert len(lines(case(frame, strips).document)) < 100


@pytest.mark.slow
def test_it_is_short_with_too_much_of_everything() -> None:
    printed = lines(crowded())
    assert 80 < len(printed) <= MOST_LINES
    assert "the data contradict themselves, 50 findings" in printed[3]
    said = " ".join(printed)
    for name in ("verdict", "findings", "control", "check", "rejected", "undetermined", "notes"):
        assert f"--section {name}" in said
    assert [width for width in (80, 120, 200) if len(lines(crowded(), width)) > MOST_LINES] == []


@pytest.mark.parametrize("sample", ["simulated-20", "apollo15-metric-strip"])
def test_it_is_short_on_a_terminal_of_80_columns(sample: str) -> None:
    document = read_baseline(str(ROOT / "sample_data" / sample / "baseline.json"))
    assert 60 < len(lines(document, 80)) <= MOST_LINES


def test_each_stage_has_one_line() -> None:
    (stages,) = (each for each in overview(case().document, 100) if each.title == "Stages")
    (facts,) = stages.parts
    assert isinstance(facts, Facts)
    assert [label for label, _ in facts.rows][:4] == [
        "relative orientation",
        "scale transfer",
        "absolute orientation",
        "polynomial",
    ]
    printed = to_text("", [stages], 100).splitlines()
    assert len(printed) == 1 + len(facts.rows)


def test_the_worst_check_points_are_shown_and_the_others_counted() -> None:
    document = crowded()
    (section,) = (each for each in overview(document, 100) if each.title == "Check points")
    (table,) = (part for part in section.parts if isinstance(part, Table))
    assert [row[0] for row in table.rows[:2]] == ["299", "298"]
    assert f"{300 - len(table.rows)} more points: --section check, or `control` in result.json" in table.note


def test_nothing_is_said_twice() -> None:
    """What a warning or a finding says stands in the verdict alone; the plausibility has its cure."""
    document = by_rows(saved())
    warning = {"code": "c", "severity": "warning", "message": "mind this", "strip": "", "photos": [], "points": []}
    warning |= {"file": "", "line": 0, "column": 0, "key": ""}
    finding = {
        "code": "P101", "title": "units", "severity": "warning", "accepted": False, "message": "too large by 1000",
        "fix": "write `um`", "evidence": {}, "points": [], "file": "", "line": 0, "column": 0,
    }  # fmt: skip
    document |= {"notes": [warning], "findings": [finding]}
    document["verdict"] = {**document["verdict"], "look_at": ["P101 too large by 1000", "mind this"]}
    printed = "\n".join(lines(in_tables(document)))
    assert printed.count("mind this") == 1
    assert printed.count("too large by 1000") == 1
    assert "- P101 units (warning). To put it right: write `um`." in printed


def test_notes_of_a_kind_are_said_once() -> None:
    notes = [
        {"code": "c", "severity": "note", "message": f"strip {name}: so", "strip": name, "photos": [], "points": []}
        | {"file": "", "line": 0, "column": 0, "key": ""}
        for name in "ABC"
    ]
    assert "- strip A: so (and the same for strips B, C)" in lines({**saved(), "notes": notes})


def test_every_section_has_a_name_and_keeps_its_place() -> None:
    document = saved()
    absent = "This result has no section `{}`."
    found: list[Section] = []
    missing: list[str] = []
    for name in nonempty(NAMES):
        sections = chosen_sections(document, names=[name])
        if sections[0].parts == (Words(absent.format(name)),):
            missing.append(name)
        else:
            found += sections
    assert tuple(found) == sections_of(document)
    assert missing == [
        "findings", "cross-validation", "fiducials", "links", "models", "bundle", "classical", "certificate",
    ]  # fmt: skip
