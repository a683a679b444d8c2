"""Turned cameras: what a turn does to a photo, its fit, its precision, and points that moved themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.simulation.draws import Draws, Purpose
from photostrip.terrestrial.camera_motion import ImagePair, find_motion, fit, turn_gradient, turned
from tests.draws import orthogonal_normal
from tests.terrestrial.simulated import ARCSECOND, attitude

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

F, SIGMA = 100.0, 0.005
PLACES = np.array([(-70, 45), (65, 50), (-60, -50), (72, -44), (5, 0), (-20, 30), (30, -25)], float)


def pair(
    turn: tuple[float, float, float], seed: int | None = None, places: Floats = PLACES, drawn: Floats | None = None
) -> ImagePair:
    """Photograph points before and after a turn, by a rotation written apart from the program."""
    columns = attitude(*turn)
    ray = np.column_stack([places[:, 0], np.full(len(places), F), places[:, 1]]) @ columns
    after = F * ray[:, [0, 2]] / ray[:, 1:2]
    noise = np.zeros((2, *places.shape)) if seed is None else Draws(seed, Purpose.IMAGE).normal(2, *places.shape)
    noise = noise if drawn is None else drawn.reshape(noise.shape)
    variances = np.full(places.shape, 2 * SIGMA**2)
    return ImagePair(places + SIGMA * noise[0], after + SIGMA * noise[1], variances, F)


def without(given_: ImagePair, column: int) -> ImagePair:
    after = given_.after.copy()
    after[:, column] = np.nan
    return ImagePair(given_.before, after, given_.variances, F)


ALL = np.ones(len(PLACES), bool)
angle = st.floats(-0.05, 0.05)


@pytest.mark.parametrize(
    ("turn", "change"), [((1e-4, 0, 0), (-0.01, 0)), ((0, 1e-4, 0), (0, -0.01)), ((0, 0, 1e-4), (0, 0))]
)
def test_what_turns_right_sees_the_object_go_left(
    turn: tuple[float, float, float], change: tuple[float, float]
) -> None:
    np.testing.assert_allclose(turned(np.zeros((1, 2)), F, np.array(turn))[0], change, atol=1e-9)


def test_the_gradient_is_that_of_differences() -> None:
    gradient = turn_gradient(PLACES, F)
    for column in range(3):
        step = 1e-6 * np.eye(3)[column]
        change = (turned(PLACES, F, step) - turned(PLACES, F, -step)) / 2e-6
        np.testing.assert_allclose(change, gradient[:, :, column], atol=1e-6)


@given(angle, angle, angle, st.sampled_from([None, 0, 1]))
def test_a_turn_comes_back(right: float, up: float, roll: float, missing: int | None) -> None:
    given_ = pair((right, up, roll))
    found = fit(given_ if missing is None else without(given_, missing), ALL)
    assert found is not None
    np.testing.assert_allclose(found.values, [right, up, roll], atol=1e-12)
    assert found.dof == (14 if missing is None else 7) - 3


@pytest.mark.slow
def test_precision_and_test_value_are_those_of_repeated_measurements() -> None:
    turn, draws = (40 * ARCSECOND, -25 * ARCSECOND, 60 * ARCSECOND), 16 * PLACES.size  # in two epochs: eight blocks
    rows = orthogonal_normal(np.random.default_rng(1), draws, 2 * PLACES.size)
    found = [fit(pair(turn, drawn=row), ALL) for row in rows]
    errors = np.array([(each.values - turn) / each.sigma for each in found if each is not None])
    assert len(errors) == draws
    assert np.abs(errors.mean(axis=0)).max() < 0.16
    np.testing.assert_allclose(errors.std(axis=0), 1.0, atol=0.1)
    still = [fit(pair((0, 0, 0), drawn=row), ALL) for row in rows]
    assert np.mean([each.statistic for each in still if each is not None]) == pytest.approx(3.0, abs=0.4)
    assert np.mean([each.weighted_sum for each in still if each is not None]) == pytest.approx(11.0, abs=0.6)


# ------------------------------------------------------------------------------------------------- moved points


def moved(given_: ImagePair, point: int, change: tuple[float, float]) -> ImagePair:
    after = given_.after.copy()
    after[point] += change
    return ImagePair(given_.before, after, given_.variances, F)


@pytest.mark.parametrize("point", range(len(PLACES)))
@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (100 * ARCSECOND, -80 * ARCSECOND, 200 * ARCSECOND)])
def test_a_stable_point_that_moved_is_found(point: int, turn: tuple[float, float, float]) -> None:
    left, right = moved(pair(turn, 1), point, (0.05, -0.02)), moved(pair((0, 0, 0), 2), point, (0.04, -0.02))
    motion = find_motion(left, right)
    assert [each.row for each in motion.rejected] == [point]
    assert not motion.used[point]
    assert motion.turns[0] is not None
    assert np.abs((motion.turns[0].values - turn) / motion.turns[0].sigma).max() < 4
