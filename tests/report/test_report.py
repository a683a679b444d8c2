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
from photostrip.report.page.layout import cells, to_markdown, to_text
from photostrip.report.page.parts import Column, Facts, Section, Table, Words
from photostrip.report.sections.accuracy_report import chosen_sections, sections_of, title_of
from photostrip.result.table import Table as ResultTable
from tests.loops import nonempty
from tests.reports import FOLDER, SNAPSHOTS, fresh, saved
from tests.results import FRAMES, case, in_tables

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.results import Document


def printed(document: Document, width: int = 100) -> str:
    return to_text(title_of(document), sections_of(document), width)


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


# ---------------------------------------------------------------------------------------------------- snapshots


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


# ------------------------------------------------------------------------------------------------ from the file


@pytest.mark.parametrize("width", [60, 80, 140, 200])
@pytest.mark.parametrize("frame", FRAMES)
def test_no_line_is_wider_than_the_page(frame: str, width: int) -> None:
    assert max(cells(line) for line in printed(case(frame).document, width).splitlines()) <= width


@pytest.mark.parametrize("key", sorted(saved().keys() - {"polynomial_terms", "polynomial_evidence"}))
def test_an_incomplete_file_is_refused_in_words(key: str) -> None:
    document = json.loads(to_json(case("projected").document))
    del document[key]
    if key in {"correlations", "polynomials", "precision"}:  # not every project has them
        assert reported(document)
    else:
        with pytest.raises(InputError, match=rf"result\.json: ({key}: is missing|has no key `{key}`)"):
            reported(document)


@pytest.mark.parametrize("value", [None, 1, "text", [1], [{}]])
@pytest.mark.parametrize("key", ["strips", "models", "summary", "photos", "control", "verdict", "status", "frame"])
def test_a_file_with_something_else_in_it_is_refused_in_words(key: str, value: object) -> None:
    with pytest.raises(InputError, match=r"small: cannot be reported|result\.json: "):
        reported(json.loads(to_json(saved() | {key: value})))


# ---------------------------------------------------------------------------------------------------- the verdict


def judged(status: str, *look_at: str, tolerances: tuple[bool, ...] = (), everything: bool = False) -> str:
    rows = [
        {"name": f"t{n}", "value": 1.0, "limit": 1.0, "unit": "m", "passed": passed}
        for n, passed in enumerate(tolerances)
    ]
    verdict = saved()["verdict"] | {"accuracy": "rms 0.1 m", "agreement": "", "verified": True}
    verdict |= {"look_at": list(look_at)}
    document = changed(status=status, verdict=verdict, tolerances=rows)
    return to_text(title_of(document), chosen_sections(document, everything=everything), 100)


@pytest.mark.parametrize("everything", [False, True])
def test_a_good_result_says_so_first_and_last(everything: bool) -> None:
    lines = judged("good", everything=everything).splitlines()
    assert lines[0] == "Accuracy report: small"
    assert lines[3] == lines[-1] == "GOOD: nothing calls for a second look."
    assert lines[4] == "Rms 0.1 m."
    assert lines.count("Rms 0.1 m.") == 1


def test_what_to_look_at_is_listed_first() -> None:
    text = judged("look", "the first thing", "the second thing")
    assert "LOOK at 2 things before you use this.\nRms 0.1 m.\n1. the first thing\n2. the second thing\n" in text
    assert "LOOK at 1 thing " in judged("look", "a thing")


def test_failed_tolerances_are_counted() -> None:
    text = judged("failed", "t1 is", tolerances=(True, False, True))
    assert "FAILED: 1 of 3 tolerances not kept." in text
    assert text.count("NOT KEPT") == 1
    assert text.count("  kept\n") == 2


def test_quiet_is_the_verdict_alone() -> None:
    (only,) = chosen_sections(saved(), quiet=True)
    assert to_text("", [only], 100).splitlines()[0] == "FAILED: 1 of 3 tolerances not kept."
    assert len(only.parts) == 2


def test_warnings_stand_among_the_notes() -> None:
    note = {"code": "c", "severity": "warning", "message": "mind this", "strip": "", "photos": [], "points": []}
    note |= {"file": "", "line": 0, "column": 0, "key": ""}
    found = sections_of(changed(notes=[note]))
    assert found[-1].title == "Notes"
    assert found[-1].parts == (Words("warning: mind this", "look", "-"),)


# --------------------------------------------------------------------------------------------- numbers and units


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


def test_ranks_keep_the_point_and_its_differences() -> None:
    differences = ["d north", "d east", "d up"]
    expected = {
        "Control points": ["point", "use", *differences, "plan", "height"],
        "Check points": ["point", *differences, "d/σ plan", "p", "d/σ height", "p"],
    }
    for title, names in nonempty(expected.items()):
        (table,) = tables(section(case("north first", 2).document, title))
        assert [column.name for column in table.columns if column.rank == 0] == names


def test_numbers_are_those_of_the_result() -> None:
    document = case("north first", 2).document
    (table,) = tables(section(document, "Check points"))
    rows = [row for row in document["control"] if row["role"] == "check"]
    points, tested = ({row["id"]: row for row in found} for found in (document["points"], _tested(document)))
    for shown, row in nonempty(zip(table.rows, rows, strict=True)):
        point, z = points[row["id"]], tested[row["id"]]
        assert shown[:-2] == (
            row["id"], *(f"{row[key]:+.3f}" for key in ("dx", "dy", "dz")),
            *(f"{point[key]:.3f}" for key in ("sigma_x", "sigma_y", "sigma_z")),
            f"{z['plan']:.2f}", f"{100 * z['p_plan']:.1f}", f"{z['height']:.2f}", f"{100 * z['p_height']:.1f}",
        )  # fmt: skip
    assert table.foot[0][1:4] == tuple(f"{document['summary']['check_rms'][axis]:.3f}" for axis in "xyz")


def _tested(document: Document) -> list[Document]:
    found: list[Document] = document["precision"]["check"]["points"]
    return found


def test_the_probability_of_a_check_point_is_that_of_its_difference() -> None:
    """By scipy, and the difference by the point's own standard deviation and the given one."""
    document = case("projected", 2).document
    points = {row["id"]: row for row in document["points"]}
    given = {row["id"]: row for row in document["control"]}
    for row in nonempty(_tested(document)):
        sigma = np.hypot(points[row["id"]]["sigma_z"], given[row["id"]]["sigma_3"])
        assert row["height"] == pytest.approx(given[row["id"]]["dz"] / sigma, abs=0.01)
        assert row["p_height"] == pytest.approx(2 * stats.norm.sf(abs(row["height"])), abs=0.006)
        assert row["p_plan"] == pytest.approx(stats.chi2.sf(row["plan"] ** 2, 2), abs=0.006)


def test_given_points_that_were_not_measured_are_named() -> None:
    assert "given, but not measured: G4 bis" in words(section(saved(), "Control points"))


def test_a_given_point_whose_rays_were_rejected_is_not_called_unmeasured() -> None:
    document = changed(not_determined=[{"id": "G4 bis", "reason": "rays contradict each other"}])
    text = words(section(document, "Control points"))
    assert "without coordinates: G4 bis" in text
    assert "given, but not measured" not in text


def test_without_check_points_the_report_says_what_that_means() -> None:
    control = [row for row in saved()["control"] if row["role"] == "control"]
    assert words(section(changed(control=control), "Check points")).startswith("None. What lies between")


def test_points_without_coordinates_are_grouped_by_reason() -> None:
    missing = [{"id": f"P{n}", "reason": "measured on one photo"} for n in range(15)]
    missing.append({"id": "Q", "reason": "rejected in every pair"})
    text = words(section(changed(not_determined=missing), "Points without coordinates"))
    assert "15 points (measured on one photo): P0, P1" in text
    assert "P13, P14" in text
    assert "1 point (rejected in every pair): Q" in text


def test_a_strip_without_joints() -> None:
    assert "One model: no scale was transferred." in words(
        section(changed(junctions=[]), "Scale transfer and junctions")
    )


def test_corrections_are_stated_with_their_size() -> None:
    corrections = copy.deepcopy(saved()["corrections"])
    corrections["distortion"] = {"applied": True, "largest_um": 7.25}
    corrections["interior"] = {
        "photos": 10, "transforms": ["affine"], "rms_um": 4.2, "largest_um": 9.1, "largest_photo": "1003",
        "largest_mark": "F2", "without_marks": [],
    }  # fmt: skip
    text = words(section(changed(corrections=corrections), "Project"))
    assert "lens distortion up to 7.2 µm" in text
    assert "refraction none" in text
    assert "affine transformation of 10 photos; residuals rms 4.2 µm, largest 9.1 µm, at mark F2 of photo 1003" in text
    assert "carried by the frames: coordinates go through geocentric space, up to 0.369 m in height" in text


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"screening": "auto"}, "screening: auto"),
        ({"screening": "none"}, "screening: none"),
        ({"screening": "tau"}, "screening: tau, level 0.05"),
        ({"screening": "parallax+grubbs"}, "level 0.05, y parallax up to 4 times its standard deviation"),
        ({"screening": "parallax+grubbs", "parallax_limit": 0.03}, "level 0.05, y parallax up to 30 µm"),
    ],
)
def test_screening_is_stated(settings: Document, text: str) -> None:
    document = changed()
    document["settings"]["relative"] = {"grubbs_alpha": 0.05, "parallax_limit": None} | settings
    assert text in words(section(document, "Project"))


# ------------------------------------------------------------------------------------------------------ Markdown


def test_markdown_escapes_ids() -> None:
    table = Table((Column("point", left=True), Column("x", "m")), (("a|b*c_d", "1"),), note="`k` of <x>")
    text = to_markdown("A #1", [Section("S", (table, Words("w", "good", "-"), Facts((("l", "v"),))))])
    assert "# A \\#1\n\n## S\n\n| point | x, m |\n|:--|--:|\n| a\\|b\\*c\\_d | 1 |\n" in text
    assert "\\`k\\` of \\<x\\>" in text
    assert "- **w**" in text
    assert text.endswith("- l: v\n")
