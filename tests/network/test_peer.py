"""The same bundle adjustments by Ceres: kept solutions, and solved anew where pyceres and pycolmap are installed."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest

from photostrip.network.adjustment import solve
from photostrip.network.reliability import cofactors_of
from tests.peer import FILE, SHAPES, problem
from tests.source_tree import ROOT

SAME = 1e-6  # of the standard deviations


def compare(name: str, expected: dict[str, list[list[float]]]) -> None:
    """Compare one problem with a solution by Ceres."""
    solution = solve(problem(name))
    cofactors = cofactors_of(solution)
    seen = ~np.isnan(cofactors.points[:, 0, 0])
    of_points = np.sqrt(np.einsum("nii->ni", cofactors.points[seen]))
    of_photos = np.sqrt(np.einsum("nii->ni", cofactors.photos[:, :3, :3]))
    points, centers = np.array(expected["points"]), np.array(expected["centers"])
    assert np.abs((solution.points - points)[seen] / of_points).max() < SAME
    assert np.abs((solution.centers - centers) / of_photos).max() < SAME


@pytest.mark.parametrize("name", SHAPES)
def test_the_estimate_is_that_of_ceres(name: str) -> None:
    compare(name, json.loads(FILE.read_text(encoding="utf-8"))[name])


@pytest.mark.slow
@pytest.mark.skipif(find_spec("pyceres") is None or find_spec("pycolmap") is None, reason="the extra peer is missing")
def test_ceres_still_finds_what_is_kept() -> None:
    command = [sys.executable, "-m", "tests.peer", "--print"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=120)
    for name, expected in json.loads(done.stdout).items():
        compare(name, expected)
