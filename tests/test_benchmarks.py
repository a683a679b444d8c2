"""The benchmark programs run and print their tables; what the numbers are is another matter."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from benchmarks import planted
from tests.loops import nonempty
from tests.source_tree import ROOT


@pytest.fixture(autouse=True)
def _copies(request: pytest.FixtureRequest) -> None:
    """Let the programs be copies of a process that has loaded the libraries, but where there is none to run."""
    if request.node.get_closest_marker("slow"):
        request.getfixturevalue("_quick_start")


def printed(program: str, *options: str, python: str = "") -> str:
    """Run a benchmark program from elsewhere and give what it prints."""
    command = [python or sys.executable, str(ROOT / "benchmarks" / program), *options]
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT.parent).stdout


@pytest.mark.slow
def test_accuracy_prints_limits_and_what_was_measured() -> None:
    out = printed("accuracy.py", "--seeds", "1", "--cases", "b", "--workers", "1")
    rows = re.findall(r"^degree 3 +0\.112/0\.230 +(\d\.\d{3})/(\d\.\d{3})", out, re.MULTILINE)
    assert len(rows) == 1
    assert all(0.05 < float(value) < 0.6 for value in nonempty(rows[0]))


@pytest.mark.slow
def test_strip_prints_seconds_memory_and_growth() -> None:
    out = printed("strip.py", "--rows", "short", "--sizes", "4", "8", "--repeat", "1")
    assert re.search(r"^20 photos +\d+\.\d\d +\d+\.\d +5 +\d+", out, re.MULTILINE)
    assert re.search(r"^exponent from 4 to 8 photos -?\d", out, re.MULTILINE)


@pytest.mark.slow
def test_bundle_prints_times_and_ratios() -> None:
    out = printed("bundle.py", "--rounds", "1", "--cases", "strip", "--largest", "100", "--alone")
    rows = re.findall(r"^(\d+) x (\d+) +\d+ +\d+ +(\d+) +(\d+) +- +- +- +3/0/0 +-$", out, re.MULTILINE)
    assert [row[:2] for row in rows] == [("100", "40"), ("100", "300")]
    assert all(int(solve) > 0 and int(covariances) > 0 for _, _, solve, covariances in nonempty(rows))
    assert len(re.findall(r"^\d+ x \d+ +- +- +- +\d\.\d\d of 1\.00 +(?:yes|no)$", out, re.MULTILINE)) == 2


@pytest.mark.slow
def test_gross_errors_prints_two_tables_for_one_project() -> None:
    out = printed("gross_errors.py", "1", "--kind", "models", "--workers", "1", "--first-seed", "2")
    assert len(re.findall(r"^models +(?:without errors|errors, \w+)(?: +\d+\.\d{3}){5} +[01]$", out, re.MULTILINE)) == 3
    assert re.search(r"^models(?: +\d\.\d{3}/\d\.\d{3}){2}(?: +\d+ of \d+){2} +0 of 0", out, re.MULTILINE)


@pytest.mark.slow
def test_causes_prints_a_row_for_each_kind_and_layout_beside_the_goals() -> None:
    options = ("--first", "43003", "short or long one way", "two neighbours", "corners", "strips held by GNSS")
    out = printed("causes.py", *options)
    rows = re.findall(r"^(film|two)[\w .%,]+? +1 +([01])((?: +(?:\d+ %|-)){3})(?: +[.1]){4}$", out, re.MULTILINE)
    assert [name for name, _, _ in rows] == ["film", "two"]
    assert rows[0][1] == "1"
    assert rows[0][2].split()[:2] == ["100", "%"]
    assert re.search(r"^true cause first: \d+\.\d % of [12] that can be told \(goal: 85 %\)$", out, re.MULTILINE)
    assert len(re.findall(r"^(?:corners|strips)[\w ,]+ +1 +0 +0 +0  $", out, re.MULTILINE)) == 2
    assert re.search(r"^alarms: 0\.00 % of 2 sound projects \(goal: at most 0\.5 %\), 0 refused", out, re.MULTILINE)


@pytest.mark.parametrize(("low", "high", "told"), [(0.001, 0.003, True), (1e-8, 1e-7, False), (3.0, 4.0, True)])
def test_a_planted_mistake_counts_where_the_sum_of_squares_grows(low: float, high: float, told: bool) -> None:
    film = planted.Mistake("film", planted.shrunk(low, high), ("P112",), columns=1)
    wrong = film.plant(film.make(43003))
    assert wrong is not None
    assert film.can_be_told(43003, wrong[0]) is told
