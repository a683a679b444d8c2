"""Tables of a page: heads, units and decimals from the descriptions of a result; angles in the unit of the project."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.cli.main import main
from photostrip.pipeline.inputs import Settings
from photostrip.report.html import to_html
from photostrip.report.page.parts import DASH, Column, Table
from photostrip.report.page.tables import Field, keyed, tabulated
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.result.table import Table as ResultTable
from photostrip.simulation.simulation import simulate
from tests.loops import nonempty
from tests.reports import saved
from tests.results import solved, spec, write_project
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from pathlib import Path

    from tests.results import Document

pytestmark = pytest.mark.usefixtures("_adjusted_once")

ADJUSTMENTS = ("polynomial", "bundle")
PER_DEGREE = {"gon": 200 / 180, "rad": np.pi / 180}


def test_columns_by_their_keys_have_the_heads_units_and_decimals_of_their_descriptions() -> None:
    rows = {
        "left": ["1", "2"], "right": ["2", None], "base": [897.4912, None], "points_used": [7, 0],
        "sigma0_um": [4.26, -0.04], "elements_kappa1": [1.23456, 0.0], "redundancy": [1, 2],
    }  # fmt: skip
    table = keyed(
        ResultTable.of("models", rows),
        "left+right base:1 points_used extra sigma0_um elements_* absent",
        "note",
        foot=[{"left+right": "all", "points_used": "7"}],
        extra=(Field("", "m +2", "more"), [1.0, None]),
    )
    assert table.columns == (
        Column("photos", left=True),
        Column("base", "m", rank=1),
        Column("points"),
        Column("more", "m"),
        Column("σ0", "µm"),
        Column("κ1", "deg"),
    )
    assert table.rows == (("1 – 2", "897.49", "7", "+1.00", "4.3", "1.2346"), ("2", DASH, "0", DASH, "0.0", "0.0000"))
    assert (table.foot, table.note) == ((("all", "", "7", "", "", ""),), "note")


def test_a_value_by_unit_a_list_a_flag_and_a_probability() -> None:
    rows = {"value": [3.456, 2.0], "unit": ["um", ""], "reason": ["a", None], "readmitted": [True, False]}
    assert keyed(ResultTable.of("rejected", rows), "value unit reason readmitted").rows == (
        ("3.5", "µm", "a", "yes"),
        ("2.00", "", DASH, "no"),
    )
    evidence = {"p": [0.0004, 0.25], "accepted": [True, False], "f": [11.111, None]}
    shown = keyed(ResultTable.of("polynomial_evidence", evidence), "f p accepted")
    assert shown.rows == (("11.11", "<0.001", "yes"), (DASH, "0.250", "no"))
    columns = (Field("photo_id", rank=1), Field("base", "um 2", "b"), Field("n", "count"), Field("x", shown=False))
    table = tabulated(columns, [("1", 0.5, 7, 0), ("2", None, None, 0)], "note")
    assert table.columns == (Column("photo id", left=True, rank=1), Column("b", "µm"), Column("n"))
    assert (table.rows, table.note) == ((("1", "0.50", "7"), ("2", DASH, DASH)), "note")
    links = ResultTable.of("links", {"points_rejected": [["a", "b"], []]})
    assert keyed(links, "points_rejected").rows == (("2",), ("0",))


def test_a_column_of_points_reaches_the_report_by_its_description_alone() -> None:
    """Nothing else names it: neither a section of the report nor the comparison."""
    document, points = saved(), saved()["points"]
    entry = replace(points.quantities["image_rms_um"], head="brand new", compared="statistics")
    columns = {key: points[key] for key in points.columns} | {"brand_new_um": np.arange(len(points)) + 0.25}
    document = document | {"points": ResultTable("points", columns, points.quantities | {"brand_new_um": entry})}
    tables = [
        part
        for each in sections_of(document)
        for part in each.parts
        if isinstance(part, Table) and any(column.name == "brand new" for column in part.columns)
    ]
    assert [column.unit for table in tables for column in table.columns if column.name == "brand new"] == ["µm"]
    assert all(row[-1].endswith((".2", ".3")) for row in tables[0].rows)


@cache
def document(unit: str, adjustment: str = "polynomial") -> Document:
    return solved(inputs_of(simulate(spec(strips=2))), Settings(angle_unit=unit, adjustment=adjustment)).document


def tables(found: Document) -> list[Table]:
    return [part for each in sections_of(found) for part in each.parts if isinstance(part, Table)]


@pytest.mark.slow
@pytest.mark.parametrize("adjustment", ADJUSTMENTS)
@pytest.mark.parametrize("unit", PER_DEGREE)
def test_every_angle_of_every_table_has_the_unit(unit: str, adjustment: str) -> None:
    columns = 0
    in_degrees, in_unit = (tables(document(each, adjustment)) for each in ("deg", unit))
    for degrees, others in nonempty(zip(in_degrees, in_unit, strict=True)):
        assert all("deg" not in column.unit for column in others.columns)
        for number, column in enumerate(degrees.columns):
            if column.unit != "deg":
                continue
            assert others.columns[number].unit == unit
            shown, wanted = ([row[number] for row in table.rows] for table in (others, degrees))
            decimals = len(wanted[0].partition("e")[0].partition(".")[2])
            half = 0.51 * 10.0**-decimals
            for one, other in nonempty(zip(shown, wanted, strict=True)):
                size = abs(float(other)) if "e" in other else 1.0
                assert abs(float(one) - float(other) * PER_DEGREE[unit]) < 3 * half * size, column.name
            columns += 1
    assert columns >= (10 if adjustment == "polynomial" else 9)


@pytest.mark.parametrize("adjustment", ADJUSTMENTS)
def test_the_page_has_no_other_unit(adjustment: str) -> None:
    page = to_html(document("gon", adjustment))
    assert "gon" in page
    assert re.findall(r"\bdeg\b|″", page) == []


def test_the_grid_convergence_of_a_check_has_the_unit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project = write_project(tmp_path / "p", spec())
    found = {}
    for unit in ("deg", "gon"):
        assert main(["check", str(project), "--set", f"output.angles.unit={unit}"]) == 0
        line = next(line for line in capsys.readouterr().out.splitlines() if "grid convergence" in line)
        assert f" {unit} " in line
        found[unit] = float(line.split()[2])
    assert found["gon"] == pytest.approx(found["deg"] * PER_DEGREE["gon"], abs=1e-4)
