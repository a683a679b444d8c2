"""Displacements of whole surveys: exact, with noise, with turned cameras, from one station, in many epochs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.terrestrial.camera_motion import ImagePair, OneStation, fit, one_station, turn_gradient, turned
from photostrip.terrestrial.monitoring import Monitoring, MonitoringSettings, Series, monitor
from photostrip.terrestrial.normal_case import ground_from_photo
from tests.draws import orthogonal_normal
from tests.loops import nonempty
from tests.terrestrial.simulated import (
    ARCSECOND,
    SIGMA,
    World,
    about,
    attitude,
    photo,
    repeated,
    weighted,
    with_turn,
    world,
)

FOCAL, SIGMA_XZ = 100.0, 0.005
PLACES = np.array([(-70, 45), (65, 50), (-60, -50), (72, -44), (5, 0), (-20, 30), (30, -25)], float)


def photographed(turn: tuple[float, float, float]) -> ImagePair:
    """Photograph points before and after a turn, by a rotation written apart from the program."""
    ray = np.column_stack([PLACES[:, 0], np.full(len(PLACES), FOCAL), PLACES[:, 1]]) @ attitude(*turn)
    return ImagePair(PLACES, FOCAL * ray[:, [0, 2]] / ray[:, 1:2], np.full(PLACES.shape, 2 * SIGMA_XZ**2), FOCAL)


def without(given_: ImagePair, column: int) -> ImagePair:
    after = given_.after.copy()
    after[:, column] = np.nan
    return ImagePair(given_.before, after, given_.variances, FOCAL)


ALL = np.ones(len(PLACES), bool)
angle = st.floats(-0.05, 0.05)


def test_the_gradient_is_that_of_differences() -> None:
    gradient = turn_gradient(PLACES, FOCAL)
    for column in range(3):
        step = 1e-6 * np.eye(3)[column]
        change = (turned(PLACES, FOCAL, step) - turned(PLACES, FOCAL, -step)) / 2e-6
        np.testing.assert_allclose(change, gradient[:, :, column], atol=1e-6)


@given(angle, angle, angle, st.sampled_from([None, 0, 1]))
def test_a_turn_comes_back(right: float, up: float, roll: float, missing: int | None) -> None:
    given_ = photographed((right, up, roll))
    found = fit(given_ if missing is None else without(given_, missing), ALL)
    assert found is not None
    np.testing.assert_allclose(found.values, [right, up, roll], atol=1e-12)
    assert found.dof == (14 if missing is None else 7) - 3


F, LOOK = 100.0, (0.6, 0.1, -0.03)
ROTATION = ground_from_photo(*LOOK)
SIGMA_FIRST, SIGMA_CHANGE, SIGMA_DISTANCE = 0.005, 0.003, 0.008
IDS = ("A", "B", "C", "D", "1", "2")
STABLE = np.array([True] * 4 + [False] * 2)
IMAGE = np.array([[-60.0, 30.0], [55.0, 35.0], [-50.0, -40.0], [62.0, -30.0], [5.0, 10.0], [20.0, -5.0]])
DISTANCES = np.array([80.0, 120.0, 60.0, 150.0, 95.0, 110.0])


def station(moved: Floats, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> OneStation:
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
        sigma=np.full(len(IDS), SIGMA_FIRST),
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
    found = one_station(station(MOVED, turn), F, ROTATION)
    assert found.values == pytest.approx(MOVED, abs=1e-8)
    assert found.components == (3,) * 6
    assert found.turn is not None
    # the three turns follow one another: small enough for their order not to matter
    assert found.turn.values == pytest.approx(np.array(turn) * ARCSECOND, abs=0.05 * ARCSECOND)


def drawn(count: int, *, complete: bool) -> tuple[Floats, Floats, Floats]:
    """Displacements, test values and standard deviations of models in which nothing moved."""
    exact, rng = station(np.zeros((6, 3)), (40.0, -25.0, 90.0)), np.random.default_rng(4)
    values, tests = [], []
    for of_first, of_change, of_distances in orthogonal_normal(rng, count, 36).reshape(-1, 3, 6, 2):
        measured = replace(
            exact,
            first=exact.first + SIGMA_FIRST * of_first,
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
            one_station(replace(station(MOVED), stable=stable), F, ROTATION)
    without = one_station(replace(station(MOVED), stable=np.zeros(6, bool)), F, ROTATION)
    assert without.turn is None
    assert without.values == pytest.approx(MOVED, abs=1e-8)


NANOMETRE = 1e-9  # m
TURN = (60.0, -30.0, 45.0)  # seconds of arc


def run(truth: World, seed: int = 1, sigma: float = SIGMA, **settings: str | float) -> Monitoring:
    return monitor(truth.measure(seed, sigma), truth.pair, MonitoringSettings(**settings))  # type: ignore[arg-type]


@pytest.mark.slow
@given(st.integers(1, 10_000), st.floats(0.001, 2.0), st.booleans(), st.booleans())
def test_displacements_are_the_difference_of_two_space_intersections(
    seed: int, size: float, right_z: bool, turned_camera: bool
) -> None:
    """Convergent cameras, no errors: the truth, and the difference of both points, to a nanometre."""
    truth = replace(world(seed=seed, size=size), right_z=right_z)
    truth = with_turn(truth, *TURN) if turned_camera else truth
    series = truth.measure(1, 0.0)
    weights = np.full_like(series.of_epoch, SIGMA**2)
    result = monitor(replace(series, of_epoch=weights), truth.pair, MonitoringSettings())
    (step,) = result.since_first
    np.testing.assert_allclose(step.values, truth.velocity, atol=NANOMETRE)
    np.testing.assert_allclose(result.positions[0].values, truth.points, atol=NANOMETRE)
    difference = result.positions[1].values - result.positions[0].values
    np.testing.assert_allclose(step.values, difference, atol=NANOMETRE)


FACE = world(number=90, moving=20, stable=12)
KINDS = {
    "coordinates": FACE,
    "coordinates, z right not measured, camera turned": replace(with_turn(FACE, *TURN), right_z=False),
    "pseudo-parallaxes, camera turned": replace(with_turn(FACE, *TURN), shared=0.02),
    "third epoch, camera turned": with_turn(replace(FACE, epochs=3), *TURN),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_errors_are_as_large_as_stated(kind: str) -> None:
    """Unbiased; 95 % ellipses and ellipsoids cover 93 to 97 %; 4 to 6 % of the points at rest are called moved."""
    runs = 40  # of many points each
    count = repeated(KINDS[kind], runs)
    errors = count["errors"]
    assert np.abs(errors.mean(axis=0)).max() < 4 / np.sqrt(runs)  # points of one run share the turn of the camera
    np.testing.assert_allclose(errors.std(axis=0), 1.0, atol=0.05)
    assert 0.93 < np.mean(count["plan"] < 5.9915) < 0.97
    assert 0.93 < np.mean(count["space"] < 7.8147) < 0.97
    assert 0.04 < np.mean(count["false"]) < 0.06
    assert 0.03 < np.mean(count["stable false"]) < 0.07
    for name in () if "not measured" in kind else ("parallax", "change"):
        assert count[name].std() == pytest.approx(1.0, abs=0.06), name
    assert count["squares"].mean() == pytest.approx(1.0, abs=0.12)
    found = np.mean(count["cameras"])
    if "turned" in kind:
        assert found == 1.0
    else:
        assert 0.01 < found < 0.10


def test_a_turned_camera_is_found_named_and_taken_out() -> None:
    truth = with_turn(world(moving=0), *TURN)
    result = run(truth)
    left, right = result.cameras
    assert (left.side, left.moved, left.removed, right.moved) == ("left", True, True, False)
    assert left.turn is not None
    errors = (left.turn.values * 180 * 3600 / np.pi - TURN) / (left.turn.sigma * 180 * 3600 / np.pi)
    assert np.abs(errors).max() < 4
    (note,) = [note for note in result.notes if note.code == "camera-turned"]
    assert note.message.startswith("epoch epoch 1: the left camera turned by +")
    assert result.significant(result.since_first[0]).sum() <= 4


@pytest.mark.parametrize("point", range(6))
def test_a_stable_point_that_moved_is_named_and_judged_like_the_others(point: int) -> None:
    truth = world()
    velocity = truth.velocity.copy()
    velocity[point] = (0.3, 0.0, -0.1)
    result = run(with_turn(replace(truth, velocity=velocity), *TURN))
    assert result.rejected == [(1, f"P{point}")]
    assert result.significant(result.since_first[0])[point]
    assert any(note.code == "not-stable" and note.points == (f"P{point}",) for note in result.notes)


@pytest.mark.slow
def test_rates_and_steps_are_as_precise_as_stated() -> None:
    truth = with_turn(replace(world(), epochs=4, shared=0.02), *TURN)
    rates, steps, misfits = [], [], []
    for seed in range(1, 41):
        result = run(truth, seed)
        assert result.rates is not None
        ordinary = ~result.series.stable
        rates.append(weighted(result.rates.step.values - truth.velocity, result.rates.step.covariance)[ordinary])
        last = result.since_previous[-1]
        steps.append(weighted(last.values - truth.velocity, last.covariance)[ordinary])
        misfits.append(result.rates.misfit[ordinary])
    assert 0.93 < np.mean(np.concatenate(rates) < 7.8147) < 0.97
    assert 0.93 < np.mean(np.concatenate(steps) < 7.8147) < 0.97
    assert np.mean(np.concatenate(misfits)) == pytest.approx(6.0, abs=0.25)  # chi-square: three epochs less one rate


def spoil(series: Series, epoch: int, point: int, values: float | list[float] = np.nan) -> Series:
    coordinates = series.coordinates.copy()
    coordinates[epoch, point] = values
    return replace(series, coordinates=coordinates)


def test_points_that_are_missing_are_named_with_the_reason() -> None:
    truth = replace(world(), epochs=3)
    series = spoil(spoil(truth.measure(1), 1, 20), 0, 21)
    series = spoil(series, 2, 22, [10.0, 5.0, 60.0, 5.0])
    result = monitor(series, truth.pair, MonitoringSettings())
    assert np.isnan(result.since_first[0].values[20]).all()
    assert np.isfinite(result.since_first[1].values[20]).all()
    assert np.isnan(result.since_previous[1].values[20]).all()
    assert np.isnan(result.since_first[1].values[21]).all()
    messages = [note.message for note in result.notes if note.code == "not-determined"]
    assert messages == [
        "epoch epoch 0: point P21 has no coordinates: not measured",
        "epoch epoch 1: point P20 has no displacement: not measured",
        "epoch epoch 1: point P21 has no displacement: not measured in the reference epoch",
        "epoch epoch 2: point P21 has no displacement: not measured in the reference epoch",
        "epoch epoch 2: point P22 has no displacement: x parallax too small or negative",
    ]
    assert result.rates is not None
    assert result.rates.dof[20] == 0
    assert np.isfinite(result.rates.step.values[20]).all()


def test_without_stable_points_nobody_can_know_of_the_cameras() -> None:
    result = run(replace(world(), stable=0))
    assert [note.code for note in result.notes] == ["no-stable-points"]
    assert all(state.turn is None for state in nonempty(result.cameras))
