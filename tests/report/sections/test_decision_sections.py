"""What was decided automatically is said, with its reason; every control coordinate shows what it weighed."""

from __future__ import annotations

import numpy as np
import pytest

from photostrip.report.page.parts import Facts, Table
from photostrip.report.page.tables import ALL_SHOWN
from photostrip.report.sections.points import weights_section
from photostrip.report.sections.project import decisions_section
from tests.loops import nonempty
from tests.results import by_rows, case, in_tables


def facts(document: dict[str, object]) -> dict[str, str]:
    (part,) = decisions_section(in_tables(document)).parts
    return dict(part.rows) if isinstance(part, Facts) else {}


def weights(document: dict[str, object], *, everything: bool = False) -> Table:
    (part,) = weights_section(in_tables(document), everything=everything).parts
    assert isinstance(part, Table)
    return part


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


def test_long_lists_are_cut_and_say_so() -> None:
    document = by_rows(case("projected").document)
    row = next(each for each in document["control"] if each["role"] == "control")
    document["control"] = [row | {"id": f"G{n}", "list": 1 + n % 2} for n in range(40)]
    table = weights(document)
    assert len(table.rows) == ALL_SHOWN
    assert "16 more points: --section weights, or `control` in result.json" in table.note
    assert "axes of each list" in table.note
    assert len(weights(document, everything=True).rows) == 40
