"""Angles in the unit that the project asks for: in every table, in text, Markdown, HTML and CSV."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.cli.main import main
from photostrip.pipeline.inputs import Settings
from photostrip.report.html import to_html
from photostrip.report.page.angles import UNITS
from photostrip.report.page.parts import Table
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.result.bundle import kinds
from photostrip.simulation.simulation import simulate
from tests.loops import nonempty
from tests.results import solved, spec, write_project
from tests.simulated import inputs_of

if TYPE_CHECKING:
    from pathlib import Path

    from tests.results import Document

pytestmark = pytest.mark.usefixtures("_adjusted_once")

ADJUSTMENTS = ("polynomial", "bundle")
PER_DEGREE = {"gon": 200 / 180, "rad": np.pi / 180}


@cache
def document(unit: str, adjustment: str = "polynomial") -> Document:
    return solved(inputs_of(simulate(spec(strips=2))), Settings(angle_unit=unit, adjustment=adjustment)).document


def tables(found: Document) -> list[Table]:
    return [part for each in sections_of(found, everything=True) for part in each.parts if isinstance(part, Table)]


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


def test_small_angles_have_small_units() -> None:
    second = np.pi / 180 / 3600
    assert UNITS["deg"].of_seconds(2.0) == 2.0
    assert UNITS["gon"].of_seconds(2.0) == pytest.approx(2.0 * second * 200e3 / np.pi)
    assert UNITS["rad"].of_seconds(2.0) == pytest.approx(2.0 * second * 1e6)
    for name, size in PER_DEGREE.items():
        assert UNITS[name].of(1.0) == pytest.approx(size)


@pytest.mark.parametrize(("unit", "size"), [("deg", 180 / np.pi), ("gon", 200 / np.pi), ("rad", 1.0)])
def test_errors_of_attitudes_have_the_unit(unit: str, size: float) -> None:
    assert (kinds(unit)["attitude"].unit, kinds(unit)["attitude"].factor) == (unit, size)


def test_the_grid_convergence_of_a_check_has_the_unit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project = write_project(tmp_path / "p", spec())
    found = {}
    for unit in ("deg", "gon"):
        assert main(["check", str(project), "--set", f"output.angles.unit={unit}"]) == 0
        line = next(line for line in capsys.readouterr().out.splitlines() if "grid convergence" in line)
        assert f" {unit} " in line
        found[unit] = float(line.split()[2])
    assert found["gon"] == pytest.approx(found["deg"] * PER_DEGREE["gon"], abs=1e-4)
