"""Displacements from one station: exact recovery, scatter of drawn errors, false alarms, refusals."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import GeometryError
from photostrip.terrestrial.camera_motion import OneStation, one_station
from photostrip.terrestrial.normal_case import ground_from_photo
from tests.draws import orthogonal_normal
from tests.terrestrial.simulated import ARCSECOND, about, attitude, photo

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

F, LOOK = 100.0, (0.6, 0.1, -0.03)
ROTATION = ground_from_photo(*LOOK)
SIGMA, SIGMA_CHANGE, SIGMA_DISTANCE = 0.005, 0.003, 0.008
IDS = ("A", "B", "C", "D", "1", "2")
STABLE = np.array([True] * 4 + [False] * 2)
IMAGE = np.array([[-60.0, 30.0], [55.0, 35.0], [-50.0, -40.0], [62.0, -30.0], [5.0, 10.0], [20.0, -5.0]])
DISTANCES = np.array([80.0, 120.0, 60.0, 150.0, 95.0, 110.0])


def world(moved: Floats, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> OneStation:
    """Points that moved, seen by a camera that turned to the right, up, counter-clockwise (seconds of arc)."""
    columns = attitude(*LOOK)
    ray = np.column_stack([IMAGE[:, 0], np.full(len(IMAGE), F), IMAGE[:, 1]])
    points = DISTANCES[:, None] * (ray / np.linalg.norm(ray, axis=1, keepdims=True)) @ columns.T
    right, up, counter = np.array(turn) * ARCSECOND
    later = columns @ about(2, -right) @ about(0, up) @ about(1, -counter)
    second = photo(points + moved, np.zeros(3), later, F)
    distances = np.column_stack([DISTANCES, np.linalg.norm(points + moved, axis=1)])
    return OneStation(
        points=IDS,
        first=IMAGE,
        change=second - IMAGE,
        sigma=np.full(len(IDS), SIGMA),
        sigma_change=np.full(len(IDS), SIGMA_CHANGE),
        distances=distances,
        sigma_distance=np.full(len(IDS), SIGMA_DISTANCE),
        stable=STABLE,
    )


def across_only(measured: OneStation) -> OneStation:
    return replace(measured, distances=np.column_stack([measured.distances[:, 0], np.full(len(IDS), np.nan)]))


MOVED = np.zeros((6, 3))
MOVED[4], MOVED[5] = (0.05, -0.12, 0.03), (-0.02, 0.04, -0.06)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (40.0, -25.0, 90.0)])
def test_displacements_come_back_whether_the_camera_turned_or_not(turn: tuple[float, float, float]) -> None:
    found = one_station(world(MOVED, turn), F, ROTATION)
    assert found.values == pytest.approx(MOVED, abs=1e-8)
    assert found.components == (3,) * 6
    assert found.turn is not None
    # the three turns follow one another: small enough for their order not to matter
    assert found.turn.values == pytest.approx(np.array(turn) * ARCSECOND, abs=0.05 * ARCSECOND)


def drawn(count: int, *, complete: bool) -> tuple[Floats, Floats, Floats]:
    """Displacements, test values and standard deviations of models in which nothing moved."""
    exact, rng = world(np.zeros((6, 3)), (40.0, -25.0, 90.0)), np.random.default_rng(4)
    values, tests = [], []
    for of_first, of_change, of_distances in orthogonal_normal(rng, count, 36).reshape(-1, 3, 6, 2):
        measured = replace(
            exact,
            first=exact.first + SIGMA * of_first,
            change=exact.change + SIGMA_CHANGE * of_change,
            distances=exact.distances + SIGMA_DISTANCE * of_distances,
        )
        found = one_station(measured if complete else across_only(measured), F, ROTATION)
        values.append(found.values)
        tests.append(found.statistic > found.limit)
    return np.array(values), np.array(tests, bool), found.sigma


@pytest.mark.slow
@pytest.mark.parametrize("complete", [True, False])
def test_standard_deviations_are_the_scatter_and_the_test_keeps_its_level(*, complete: bool) -> None:
    values, moved, sigma = drawn(360, complete=complete)
    assert values.std(axis=0) / sigma == pytest.approx(np.ones((6, 3)), abs=0.05)
    assert moved.mean() == pytest.approx(0.05, abs=0.012)


def test_stable_points_that_say_nothing_of_the_turn_are_refused() -> None:
    for number in (1, 2):
        stable = np.arange(6) < number
        with pytest.raises(GeometryError, match="three are needed"):
            one_station(replace(world(MOVED), stable=stable), F, ROTATION)
    without = one_station(replace(world(MOVED), stable=np.zeros(6, bool)), F, ROTATION)
    assert without.turn is None
    assert without.values == pytest.approx(MOVED, abs=1e-8)
