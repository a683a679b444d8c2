"""Sections by themselves: the verdict and its findings, what was decided automatically, what control weighed."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.plausibility import found as finding
from photostrip.report.page.messages import MOST_OF_A_KIND, finding_of
from photostrip.report.page.parts import Facts, Table, Words
from photostrip.report.sections import points
from photostrip.report.sections.project import decisions
from photostrip.report.sections.verdict import cures, findings, verdict
from photostrip.result.verdict import POOR_CONTROL, _control
from tests.loops import nonempty
from tests.reports import saved
from tests.results import by_rows, case, in_tables

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
    rest = f"{more} more things: --section verdict, or `verdict` in result.json"
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


def test_what_was_asked_for_is_no_decision() -> None:
    document = by_rows(case("local").document)
    document["polynomials"][0]["asked"] = "2"
    document["settings"]["relative"]["screening"] = "tau"
    document["corrections"]["earth_curvature"]["asked"] = "none"
    assert facts(document) == {}


def test_an_automatic_limit_and_automatic_heights_are_said() -> None:
    document = by_rows(case("local").document)
    document["settings"]["relative"]["screening"] = "parallax+grubbs"
    document["settings"]["refinement"]["refraction"] = True
    document["settings"]["interior"]["transform"] = "auto"
    document["corrections"]["interior"] = {"transforms": ["affine", "conformal"]}
    found = facts(document)
    assert "four times its standard deviation" in found["limit of y parallax"]
    assert "flying height above ground" in found["heights for refraction"]
    assert found["fiducial marks"].startswith("affine and conformal transformation")


def test_a_weight_is_that_of_the_fit() -> None:
    """The standard deviation in the fit is that of the given coordinate together with that of a point of a model."""
    document = case("projected").document
    table = weights(document)
    plan, height = (document["strips"][0][f"precision_{part}"] for part in ("plan", "height"))
    point = np.array([plan, plan, height])
    assert len(table.rows) == sum(row["role"] == "control" for row in document["control"])
    for row in nonempty(table.rows):
        given, fit = np.array(row[2:5], float), np.array(row[5:8], float)
        assert np.abs(np.hypot(given, point) - fit).max() < 0.0011


def test_coordinates_that_do_not_count_weigh_nothing() -> None:
    document = by_rows(case("projected").document)
    row = next(each for each in document["control"] if each["role"] == "control")
    row["use"] = "xy"
    first = weights(document).rows[0]
    assert (first[1], first[4], first[7]) == ("xy", "–", "–")
    row["use"] = "z"
    first = weights(document).rows[0]
    assert (first[2], first[3], first[5], first[6]) == ("–",) * 4
    assert first[4] != "–"
