"""The report says what the result says: from the file as from the run, worst things first, units everywhere."""

from __future__ import annotations

import copy
import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy import stats

from photostrip.errors import InputError
from photostrip.formats.result_json import checked, to_json
from photostrip.library.result import Result
from photostrip.report.page.layout import to_markdown, to_text
from photostrip.report.page.parts import Column, Facts, Section, Table, Words
from photostrip.report.sections.accuracy_report import chosen_sections, sections_of, title_of
from photostrip.result.table import Table as ResultTable
from tests.loops import nonempty
from tests.reports import FOLDER, SNAPSHOTS, fresh, saved
from tests.results import a_note, case, in_tables

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.results import Document


def changed(**keys: object) -> Document:
    found: Document = in_tables({**copy.deepcopy(saved()), **keys})
    return found


def reported(document: Document) -> str:
    """Give the report of a document that was read from a file."""
    return Result(checked(document, "result.json")).report()


def section(document: Document, title: str) -> Section:
    return next(each for each in sections_of(document) if each.title == title)


def words(found: Section) -> str:
    parts = [part.text for part in found.parts if isinstance(part, Words)]
    return " ".join([*parts, *(f"{a}: {b}" for part in found.parts if isinstance(part, Facts) for a, b in part.rows)])


def tables(found: Section) -> list[Table]:
    return [part for part in found.parts if isinstance(part, Table)]


@pytest.mark.parametrize("name", SNAPSHOTS)
def test_the_report_looks_as_it_did(name: str) -> None:
    """Renew with ``python -m tests.reports`` and review the difference."""
    assert SNAPSHOTS[name]() == (FOLDER / name).read_text(encoding="utf-8")


def paths(value: object, path: str = "") -> Iterator[str]:
    if isinstance(value, ResultTable):
        yield from (f"{path}.{name}" for name in value.columns)
    elif isinstance(value, dict):
        for key, each in value.items():
            yield from paths(each, f"{path}.{key}")
    else:
        yield path


@pytest.mark.slow
def test_the_saved_result_has_the_keys_of_a_fresh_one() -> None:
    """If not, renew with ``python -m tests.reports result``."""
    assert set(paths(saved())) == set(paths(fresh()))


@pytest.mark.parametrize("key", sorted(saved().keys() - {"polynomial_terms", "polynomial_evidence"}))
def test_an_incomplete_file_is_refused_in_words(key: str) -> None:
    document = json.loads(to_json(case("projected").document))
    del document[key]
    if key in {"correlations", "polynomials", "precision"}:  # not every project has them
        assert reported(document)
    else:
        with pytest.raises(InputError, match=rf"result\.json: ({key}: is missing|has no key `{key}`)"):
            reported(document)


@pytest.mark.parametrize("everything", [False, True])
@pytest.mark.parametrize("count", [0, 1, 2])
def test_the_verdict_is_said_first_and_last_with_what_to_look_at(count: int, *, everything: bool) -> None:
    verdict = saved()["verdict"] | {"accuracy": "rms 0.1 m", "agreement": "", "verified": True}
    verdict |= {"look_at": [f"thing {n}" for n in range(count)]}
    document = changed(status="look" if count else "good", verdict=verdict, tolerances=[])
    lines = to_text(title_of(document), chosen_sections(document, everything=everything), 100).splitlines()
    counted = f"LOOK at {count} thing{'s' if count > 1 else ''} before you use this."
    assert lines[0] == "Accuracy report: small"
    assert lines[3] == lines[-1] == (counted if count else "GOOD: nothing calls for a second look.")
    assert lines[4 : 5 + count] == ["Rms 0.1 m.", *(f"{n + 1}. thing {n}" for n in range(count))]
    assert lines.count("Rms 0.1 m.") == 1


def test_every_number_of_a_table_has_its_unit() -> None:
    """A column of numbers has a unit, or counts something, or is a ratio, which its name says."""
    without = {
        "points", "rej.", "condition", "scale ratio", "σ0", "redund.", "degree", "terms", "F", "p", "coefficient",
        "σ", "t", "d/σ", "d/σ plan", "d/σ height", "photos", "scale 1:", "value", "limit", "found", "allowed", "asked",
        "list",
    }  # fmt: skip
    for found in nonempty(sections_of(saved())):
        for table in tables(found):
            assert all(c.unit or c.left or c.name in without for c in table.columns), found.title


def test_the_probability_of_a_check_point_is_that_of_its_difference() -> None:
    """By scipy, and the difference by the point's own standard deviation and the given one."""
    document = case("projected", 2).document
    points = {row["id"]: row for row in document["points"]}
    given = {row["id"]: row for row in document["control"]}
    for row in nonempty(document["precision"]["check"]["points"]):
        sigma = np.hypot(points[row["id"]]["sigma_z"], given[row["id"]]["sigma_3"])
        assert row["height"] == pytest.approx(given[row["id"]]["dz"] / sigma, abs=0.01)
        assert row["p_height"] == pytest.approx(2 * stats.norm.sf(abs(row["height"])), abs=0.006)
        assert row["p_plan"] == pytest.approx(stats.chi2.sf(row["plan"] ** 2, 2), abs=0.006)


def of_corrections() -> Document:
    corrections = copy.deepcopy(saved()["corrections"])
    corrections["distortion"] = {"applied": True, "largest_um": 7.25}
    corrections["interior"] = {
        "photos": 10, "transforms": ["affine"], "rms_um": 4.2, "largest_um": 9.1, "largest_photo": "1003",
        "largest_mark": "F2", "without_marks": [],
    }  # fmt: skip
    return changed(corrections=corrections)


def screened(**settings: object) -> Document:
    document = changed()
    document["settings"]["relative"] = {"grubbs_alpha": 0.05, "parallax_limit": None} | settings
    return document


LACKING = [*({"id": f"P{n}", "reason": "measured on one photo"} for n in range(15)), {"id": "Q", "reason": "rejected"}]


@pytest.mark.parametrize(
    ("title", "document", "texts"),
    [
        (
            "Control points",
            changed(not_determined=[{"id": "G4 bis", "reason": "rays contradict each other"}]),
            ["without coordinates: G4 bis"],
        ),
        (
            "Check points",
            changed(control=[row for row in saved()["control"] if row["role"] == "control"]),
            ["None. What lies between"],
        ),
        (
            "Points without coordinates",
            changed(not_determined=LACKING),
            ["15 points (measured on one photo): P0, P1", "P13, P14", "1 point (rejected): Q"],
        ),
        ("Notes", changed(notes=[a_note("c", "mind this")]), ["warning: mind this"]),
        ("Scale transfer and junctions", changed(junctions=[]), ["One model: no scale was transferred."]),
        (
            "Project",
            of_corrections(),
            [
                "lens distortion up to 7.2 µm",
                "affine transformation of 10 photos; residuals rms 4.2 µm, largest 9.1 µm, at mark F2 of photo 1003",
            ],
        ),
        ("Project", screened(screening="none"), ["screening: none"]),
        ("Project", screened(screening="tau"), ["screening: tau, level 0.05"]),
        ("Project", screened(screening="parallax+grubbs", parallax_limit=0.03), ["0.05, y parallax up to 30 µm"]),
    ],
)
def test_what_other_projects_have_is_said(title: str, document: Document, texts: list[str]) -> None:
    said = words(section(document, title))
    assert [text for text in texts if text not in said] == []
    assert "given, but not measured" not in said


def test_markdown_escapes_ids() -> None:
    table = Table((Column("point", left=True), Column("x", "m")), (("a|b*c_d", "1"),), note="`k` of <x>")
    text = to_markdown("A #1", [Section("S", (table, Words("w", "good", "-"), Facts((("l", "v"),))))])
    assert "# A \\#1\n\n## S\n\n| point | x, m |\n|:--|--:|\n| a\\|b\\*c\\_d | 1 |\n" in text
    assert "\\`k\\` of \\<x\\>" in text
    assert "- **w**" in text
    assert text.endswith("- l: v\n")
