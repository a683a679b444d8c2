"""Sections by themselves, and the short report of them: never longer than a page and a half, the verdict first."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.formats.result_json import read_baseline
from photostrip.plausibility import found as finding
from photostrip.report.page.layout import to_text
from photostrip.report.page.messages import MOST_OF_A_KIND, finding_of
from photostrip.report.page.parts import Facts, Section, Table, Words
from photostrip.report.sections import points
from photostrip.report.sections.accuracy_report import NAMES, chosen_sections, sections_of, title_of
from photostrip.report.sections.overview import MOST_LINES, overview
from photostrip.report.sections.project import decisions
from photostrip.report.sections.verdict import cures, findings, verdict
from photostrip.result.verdict import POOR_CONTROL, _control
from tests.loops import nonempty
from tests.reports import saved
from tests.results import Document, a_finding, a_note, by_rows, case, in_tables
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterable

    from photostrip.report.page.parts import Part


def facts(document: dict[str, object]) -> dict[str, str]:
    (part,) = decisions(in_tables(document))
    return dict(part.rows) if isinstance(part, Facts) else {}


def weights(document: dict[str, object]) -> Table:
    (part,) = points.weights(in_tables(document))
    assert isinstance(part, Table)
    return part


def texts(parts: Iterable[Part]) -> list[str]:
    return [part.text for part in parts if isinstance(part, Words)]


@pytest.mark.parametrize(("count", "more"), [(6, 0), (7, 1), (13, 7)])
def test_what_of_the_verdict_is_not_shown_is_counted(count: int, more: int) -> None:
    document = copy.deepcopy(saved())
    document["verdict"]["look_at"] = [f"reason {number}" for number in range(count)]
    said = texts(verdict(document, 6))
    rest = f"{more} more {'thing' if more == 1 else 'things'}: --section verdict, or `verdict` in result.json"
    assert [text for text in said if "`verdict`" in text] == [rest] * (more > 0)
    assert sum(text.startswith("reason ") for text in said) == 6
    assert sum(text.startswith("reason ") for text in texts(verdict(document))) == count


@pytest.mark.parametrize(("ratio", "reasons"), [(None, 0), (POOR_CONTROL, 0), (POOR_CONTROL + 0.01, 1)])
def test_control_is_poor_beyond_the_limit(ratio: float | None, reasons: int) -> None:
    assert len(list(_control({"summary": {"control": {"normalised": ratio}}, "control": []}))) == reasons


def test_the_short_report_shows_every_kind_of_finding_the_long_one_every_finding() -> None:
    document = copy.deepcopy(saved())
    shared = [finding("P301", f"point {number} stands for two points", "") for number in range(40)]
    outside = finding("P402", "control[0] lies elsewhere", "correct the crs")
    document["findings"] = [finding_of(each) for each in (*shared, outside)]
    short, long = texts(cures(document, 12)), texts(findings(document))
    assert [sum(text.startswith("P301 one id for two points (") for text in each) for each in (short, long)] == [
        MOST_OF_A_KIND, 40
    ]  # fmt: skip
    assert all(sum(text.startswith("P402") for text in each) == 1 for each in (short, long))
    assert any("35 more" in text for text in short)


@pytest.mark.parametrize("frame", ["projected", "local", "north first"])
def test_what_auto_came_to_is_said(frame: str) -> None:
    document = case(frame).document
    found = facts(document)
    assert found["Earth curvature"].startswith(document["corrections"]["earth_curvature"]["treatment"])
    assert "global test" in found["screening"]
    degree = document["polynomials"][0]["degree"]
    assert (f"degree {degree}" if degree else "none") in found["polynomial"]


def test_what_was_asked_for_is_no_decision_automatic_limits_and_heights_are() -> None:
    document = by_rows(case("local").document)
    document["polynomials"][0]["asked"] = "2"
    document["settings"]["relative"]["screening"] = "tau"
    document["corrections"]["earth_curvature"]["asked"] = "none"
    assert facts(document) == {}
    document["settings"]["relative"]["screening"] = "parallax+grubbs"
    document["settings"]["refinement"]["refraction"] = True
    document["settings"]["interior"]["transform"] = "auto"
    document["corrections"]["interior"] = {"transforms": ["affine", "conformal"]}
    found = facts(document)
    assert "four times its standard deviation" in found["limit of y parallax"]
    assert "flying height above ground" in found["heights for refraction"]
    assert found["fiducial marks"].startswith("affine and conformal transformation")


def test_a_weight_is_that_of_the_fit_and_coordinates_that_do_not_count_weigh_nothing() -> None:
    """The standard deviation in the fit is that of the given coordinate together with that of a point of a model."""
    document = case("projected").document
    table = weights(document)
    plan, height = (document["strips"][0][f"precision_{part}"] for part in ("plan", "height"))
    point = np.array([plan, plan, height])
    assert len(table.rows) == sum(row["role"] == "control" for row in document["control"])
    for row in nonempty(table.rows):
        given, fit = np.array(row[2:5], float), np.array(row[5:8], float)
        assert np.abs(np.hypot(given, point) - fit).max() < 0.0011
    document = by_rows(case("projected").document)
    row = next(each for each in document["control"] if each["role"] == "control")
    row["use"] = "xy"
    first = weights(document).rows[0]
    assert (first[1], first[4], first[7]) == ("xy", "–", "–")
    row["use"] = "z"
    first = weights(document).rows[0]
    assert (first[2], first[3], first[5], first[6]) == ("–",) * 4
    assert first[4] != "–"


def lines(document: Document, width: int = 100) -> list[str]:
    return to_text(title_of(document), chosen_sections(document, width=width), width).splitlines()


def crowded() -> Document:
    """Give a result in which there is too much of everything: a block of 60 strips with 1000 pairs."""
    document = by_rows(saved())
    control, check = (next(row for row in document["control"] if row["role"] == role) for role in ("control", "check"))
    strip, pair, polynomial = document["strips"][0], document["models"][0], document["polynomials"][0]
    text = "a sentence of some length that says with ids, numbers and units what is wrong with this one and why " * 3
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
        "notes": [a_note(f"kind {n % 40}", text, severity="note") for n in range(400)],
        "findings": [a_finding(f"P{100 + n}", text, severity="error", fix=text) for n in range(50)],
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
    labels = ["relative orientation", "scale transfer", "absolute orientation", "polynomial"]
    assert [label for label, _ in facts.rows][:4] == labels
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
    finding = a_finding("P101", "too large by 1000", title="units", fix="write `um`")
    document |= {"notes": [a_note("c", "mind this")], "findings": [finding]}
    document["verdict"] = {**document["verdict"], "look_at": ["P101 too large by 1000", "mind this"]}
    printed = "\n".join(lines(in_tables(document)))
    assert printed.count("mind this") == 1
    assert printed.count("too large by 1000") == 1
    assert "- P101 units (warning). To put it right: write `um`." in printed


def test_notes_of_a_kind_are_said_once() -> None:
    notes = [a_note("c", f"strip {name}: so", severity="note", strip=name) for name in "ABC"]
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
        "findings", "cross-validation", "positions", "camera", "fiducials", "links", "models", "bundle", "classical",
        "certificate",
    ]  # fmt: skip
