"""The benchmark of terrestrial surveys runs and prints its tables; the numbers of many runs stand in the docs."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from tests.source_tree import ROOT


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_the_benchmark_prints_coverage_and_false_movements() -> None:
    command = [sys.executable, str(ROOT / "benchmarks" / "terrestrial.py"), "--runs", "3"]
    out = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT.parent).stdout
    assert out.startswith("3 surveys of each kind\n")
    (row,) = re.findall(r"^left camera turned +(.*)$", out, re.MULTILINE)
    bias, error, ellipse, solid, false, stable, found, sigma = map(float, row.split())
    assert 0.5 < error < 1.5
    assert 80 < ellipse <= 100
    assert 80 < solid <= 100
    assert max(bias, false / 100, stable / 100) < 1
    assert found == 100
    assert 1 < sigma < 20
    assert len(re.findall(r"^ +\d+″ (?:always|auto|never)", out, re.MULTILINE)) == 18
