"""Fiducial marks from distances: exact figures come back, errors show, what is loose is refused."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.errors import InputError
from photostrip.strip.fiducial_marks import PLACES, solve
from tests.loops import nonempty

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

CORNERS = {"F1": "bottom-right", "F2": "bottom-left", "F3": "top-left", "F4": "top-right"}
SIDES = {"L": "left", "R": "right", "T": "top", "B": "bottom"}
ANGSTROM = 1e-7  # mm


def figure(places: dict[str, str], rng: np.random.Generator, irregular: float = 0.3) -> dict[str, Floats]:
    return {name: 106.0 * np.array(PLACES[place]) + rng.normal(0, irregular, 2) for name, place in places.items()}


def distances(marks: dict[str, Floats]) -> list[tuple[str, str, float]]:
    return [(a, b, float(np.linalg.norm(marks[a] - marks[b]))) for a, b in combinations(marks, 2)]


@given(st.integers(0, 2**32 - 1), st.sampled_from([CORNERS, SIDES, CORNERS | SIDES]))
def test_the_figure_comes_back(seed: int, places: dict[str, str]) -> None:
    truth = figure(places, np.random.default_rng(seed))
    found = solve(distances(truth), places=places)
    assert np.abs(found.residuals).max() < ANGSTROM
    assert found.redundancy == len(places) * (len(places) - 1) // 2 - (2 * len(places) - 3)
    solved = {name: np.array(xy) for name, xy in found.marks.items()}
    assert [each[2] for each in distances(solved)] == pytest.approx(
        [each[2] for each in distances(truth)], abs=ANGSTROM
    )
    for name, place in nonempty(places.items()):  # not mirrored, not turned: every mark is where its word says
        assert np.linalg.norm(solved[name] - 106.0 * np.array(PLACES[place])) < 3


def test_five_distances_fix_four_marks_and_six_check_them() -> None:
    truth = figure(CORNERS, np.random.default_rng(6))
    every = distances(truth)
    assert solve(every[:-1], places=CORNERS).redundancy == 0
    a, b, length = every[0]
    wrong = solve([(a, b, length + 0.1), *every[1:]], places=CORNERS)
    assert wrong.redundancy == 1
    assert 0.02 < wrong.sigma0 < 0.1


def messages(rows: list[tuple[str, str, float]], places: dict[str, str] = CORNERS) -> list[str]:
    with pytest.raises(InputError) as caught:
        solve(rows, places=places)
    return [str(fault) for fault in caught.value.faults]


def test_every_wrong_distance_is_named() -> None:
    lines = messages([("F1", "F2", 212.0), ("F1", "F9", 212.0), ("F2", "F2", 1.0)])
    assert lines[0].startswith("fiducial_distances[1]: the camera has no mark F9; expected one of F1, F2, F3, F4")
    assert lines[1].startswith("fiducial_distances[2]: a distance from mark F2 to itself")
    assert len(lines) == 2


def test_a_wild_distance_shows() -> None:
    rows = distances(figure(CORNERS, np.random.default_rng(9), 0.01))
    a, b, length = rows[0]
    found = solve([(a, b, length + 10.0), *rows[1:]], places=CORNERS)
    assert found.sigma0 > 2
