"""Displacements of whole surveys: exact, simulated with noise, with turned cameras, in many epochs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.terrestrial.frame import small_turn
from photostrip.terrestrial.monitoring import MonitoringSettings, Series, Step, monitor
from photostrip.terrestrial.normal_case import intersect, to_normal
from tests.loops import nonempty
from tests.terrestrial.simulated import CENTERS, SIGMA, World, repeated, turned, weighted, world

if TYPE_CHECKING:
    from photostrip.terrestrial.monitoring import Monitoring

NANOMETRE = 1e-9  # m
TURN = (60.0, -30.0, 45.0)  # seconds of arc


def run(truth: World, seed: int = 1, sigma: float = SIGMA, **settings: str | float) -> Monitoring:
    return monitor(truth.measure(seed, sigma), truth.pair, MonitoringSettings(**settings))  # type: ignore[arg-type]


# --------------------------------------------------------------------------------------------------------- exact


@pytest.mark.slow
@given(st.integers(1, 10_000), st.floats(0.001, 2.0), st.booleans(), st.booleans())
def test_displacements_are_the_difference_of_two_space_intersections(
    seed: int, size: float, right_z: bool, turned_camera: bool
) -> None:
    """Convergent cameras, no errors: the truth, and the difference of both points, to a nanometre."""
    truth = replace(world(seed=seed, size=size), right_z=right_z)
    truth = turned(truth, *TURN) if turned_camera else truth
    series = truth.measure(1, 0.0)
    weights = np.full_like(series.of_epoch, SIGMA**2)
    result = monitor(replace(series, of_epoch=weights), truth.pair, MonitoringSettings())
    (step,) = result.since_first
    np.testing.assert_allclose(step.values, truth.velocity, atol=NANOMETRE)
    np.testing.assert_allclose(result.positions[0].values, truth.points, atol=NANOMETRE)
    difference = result.positions[1].values - result.positions[0].values
    np.testing.assert_allclose(step.values, difference, atol=NANOMETRE)


def test_without_turns_displacements_are_differences_of_two_intersections_also_of_noisy_rays() -> None:
    truth = world(size=0.5)
    series = truth.measure(5)
    result = monitor(series, truth.pair, MonitoringSettings(moved_camera="never"))
    rotations = np.broadcast_to(truth.pair.rotations, (30, 2, 3, 3))
    points = [
        intersect(to_normal(each, series.of_epoch[0], truth.pair, rotations).coordinates, 190.0, truth.pair.base)[0]
        for each in series.coordinates
    ]
    ground = truth.pair.ground_from_normal()
    np.testing.assert_allclose(result.since_first[0].values, (points[1] - points[0]) @ ground.T, atol=NANOMETRE)


# ----------------------------------------------------------------------------------------------------- simulated

FACE = world(number=90, moving=20, stable=12)
KINDS = {
    "coordinates": FACE,
    "coordinates, z right not measured, camera turned": replace(turned(FACE, *TURN), right_z=False),
    "pseudo-parallaxes, camera turned": replace(turned(FACE, *TURN), shared=0.02),
    "third epoch, camera turned": turned(replace(FACE, epochs=3), *TURN),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_errors_are_as_large_as_stated(kind: str) -> None:
    """Unbiased; 95 % ellipses and ellipsoids cover 93 to 97 %; 4 to 6 % of the points at rest are called moved."""
    runs = 40  # of many points each
    count = repeated(KINDS[kind], runs)
    errors = np.concatenate(count.errors)
    assert np.abs(errors.mean(axis=0)).max() < 4 / np.sqrt(runs)  # points of one run share the turn of the camera
    np.testing.assert_allclose(errors.std(axis=0), 1.0, atol=0.05)
    assert 0.93 < np.mean(np.concatenate(count.plan) < 5.9915) < 0.97
    assert 0.93 < np.mean(np.concatenate(count.space) < 7.8147) < 0.97
    assert 0.04 < np.mean(np.concatenate(count.false)) < 0.06
    assert 0.03 < np.mean(np.concatenate(count.stable_false)) < 0.07
    found = np.mean(count.cameras)
    if "turned" in kind:
        assert found == 1.0
    else:
        assert 0.01 < found < 0.10


def test_a_turned_camera_is_found_named_and_taken_out() -> None:
    truth = turned(world(moving=0), *TURN)
    result = run(truth)
    left, right = result.cameras
    assert (left.side, left.moved, left.removed, right.moved) == ("left", True, True, False)
    assert left.turn is not None
    errors = (left.turn.values * 180 * 3600 / np.pi - TURN) / (left.turn.sigma * 180 * 3600 / np.pi)
    assert np.abs(errors).max() < 4
    (note,) = [note for note in result.notes if note.code == "camera-turned"]
    assert note.message.startswith("epoch epoch 1: the left camera turned by +")
    assert result.significant(result.since_first[0]).sum() <= 4


def test_a_turn_left_in_moves_every_point() -> None:
    truth = turned(world(moving=0), *TURN)
    result = run(truth, moved_camera="never")
    assert result.significant(result.since_first[0]).sum() > 25
    assert [note.severity for note in result.notes if note.code == "camera-turned"] == ["warning"]


def test_auto_takes_out_what_is_significant_only() -> None:
    result = run(turned(world(moving=0), *TURN), moved_camera="auto")
    assert [(state.moved, state.removed) for state in result.cameras] == [(True, True), (False, False)]


def test_both_cameras_may_turn() -> None:
    truth = replace(world(moving=0), turns={(1, 0): TURN, (1, 1): (-40.0, 50.0, 0.0)})
    result = run(truth)
    assert [state.moved for state in result.cameras] == [True, True]
    assert result.significant(result.since_first[0]).sum() <= 4


def test_a_stable_point_that_moved_is_named_and_judged_like_the_others() -> None:
    truth = world()
    velocity = truth.velocity.copy()
    velocity[2] = (0.3, 0.0, -0.1)
    result = run(turned(replace(truth, velocity=velocity), *TURN))
    assert result.rejected == [(1, "P2")]
    assert result.significant(result.since_first[0])[2]
    assert any(note.code == "not-stable" and note.points == ("P2",) for note in result.notes)


def test_a_camera_that_left_its_place_is_noticed() -> None:
    truth = replace(world(stable=12, moving=10), shifts={(1, 0): np.array([0.1, 0.05, -0.08])})
    codes = {note.code for note in run(truth).notes}
    assert {"stable-scatter", "not-stable"} & codes


def test_a_point_does_not_testify_for_itself() -> None:
    """The turn that a stable point gets does not change when the point itself is measured elsewhere."""
    truth = turned(world(moving=0), *TURN)
    series = truth.measure(4)
    other = series.coordinates.copy()
    other[1, 3] += [0.004, -0.003, 0.0, 0.0]
    first = monitor(series, truth.pair, MonitoringSettings())
    second = monitor(replace(series, coordinates=other), truth.pair, MonitoringSettings())
    np.testing.assert_allclose(  # its covariance and the displacement that the measurement itself makes
        second.since_first[0].covariance[3], first.since_first[0].covariance[3], rtol=1e-3
    )
    plain = MonitoringSettings(moved_camera="never")
    by = [
        monitor(replace(series, coordinates=each), truth.pair, plain).since_first[0].values[3]
        for each in (series.coordinates, other)
    ]
    change = second.since_first[0].values[3] - first.since_first[0].values[3]
    np.testing.assert_allclose(change, by[1] - by[0], atol=2e-3 * np.abs(change).max())


# ------------------------------------------------------------------------------------------------- time series


def test_steps_add_up_and_their_covariances_too() -> None:
    truth = turned(replace(world(), epochs=4, shared=0.01), *TURN)
    result = run(truth, seed=3)
    total = sum(step.values for step in result.since_previous)
    np.testing.assert_allclose(total, result.since_first[-1].values, atol=1e-9)
    first, second = result.since_previous[0], result.since_first[0]
    np.testing.assert_allclose(first.covariance, second.covariance, atol=1e-18)


@pytest.mark.slow
def test_rates_and_steps_are_as_precise_as_stated() -> None:
    truth = turned(replace(world(), epochs=4, shared=0.02), *TURN)
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


def test_a_motion_that_is_not_uniform_has_a_large_misfit() -> None:
    truth = replace(world(moving=5), epochs=4)
    series = truth.measure(1)
    jumped = truth.exact(3)[-1] + 0.1
    coordinates = series.coordinates.copy()
    coordinates[3, -1] = jumped
    result = monitor(replace(series, coordinates=coordinates), truth.pair, MonitoringSettings())
    assert result.rates is not None
    assert result.rates.misfit[-1] > 100
    assert result.rates.misfit[10] < 30
    assert result.rates.dof[-1] == 6


# ------------------------------------------------------------------------------------------------ what is missing


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


def test_z_of_the_right_photo_counts_in_all_epochs_or_in_none() -> None:
    truth = replace(world(), epochs=2)
    series = truth.measure(1)
    coordinates = series.coordinates.copy()
    coordinates[1, 7, 3] = np.nan
    result = monitor(replace(series, coordinates=coordinates), truth.pair, MonitoringSettings())
    assert np.isnan(result.parallax[:, 7]).all()
    assert np.isfinite(result.since_first[0].values[7]).all()
    assert np.isfinite(result.parallax[:, 8]).all()


def test_without_stable_points_nobody_can_know_of_the_cameras() -> None:
    result = run(replace(world(), stable=0))
    assert [note.code for note in result.notes] == ["no-stable-points"]
    assert all(state.turn is None for state in nonempty(result.cameras))


def test_one_stable_point_is_too_few() -> None:
    result = run(replace(world(), stable=1))
    assert [note.code for note in result.notes] == ["turn-not-determined"] * 2


def test_points_that_a_turn_rests_on_are_not_tested() -> None:
    result = run(replace(world(), stable=2))
    assert np.isnan(result.since_first[0].statistic[:2]).all()
    assert np.isfinite(result.since_first[0].statistic[2:]).all()
    assert "not tested, because the turn of a camera depends on them: points P0, P1" in result.notes[-1].message


def test_a_wrong_measurement_shows_in_the_vertical_parallax() -> None:
    truth = world(moving=0)
    series = truth.measure(1)
    coordinates = series.coordinates.copy()
    coordinates[1, 25, 1] += 0.08
    result = monitor(replace(series, coordinates=coordinates), truth.pair, MonitoringSettings())
    (note,) = [note for note in result.notes if note.code == "parallax-change"]
    assert note.points == ("P25",)
    assert "standard deviations" in note.message


def test_a_wrong_orientation_shows_and_cancels() -> None:
    truth = world()
    pair = truth.pair
    rotations = pair.rotations.copy()
    rotations[1] = rotations[1] @ small_turn(np.array([0.0, 3e-4, 0.0]))
    result = monitor(truth.measure(1), replace(pair, rotations=rotations), MonitoringSettings())
    assert [note.code for note in result.notes if note.severity == "warning"] == ["orientation"]
    error = (result.since_first[0].values - truth.velocity) / result.since_first[0].sigma
    assert np.abs(error).max() < 5


@pytest.mark.slow
def test_vertical_parallaxes_are_as_large_as_stated() -> None:
    truth = turned(world(), *TURN)
    ratios, changes = [], []
    for seed in range(60):
        result = run(truth, seed)
        ratios.append(result.parallax / result.parallax_sigma)
        changes.append(result.parallax_change[1, 6:] / result.parallax_change_sigma[1, 6:])
    assert np.std(ratios) == pytest.approx(1.0, abs=0.04)
    assert np.std(changes) == pytest.approx(1.0, abs=0.05)


def test_a_survey_without_noise_and_without_motion_has_no_displacement() -> None:
    truth = world(moving=0)
    series = truth.measure(1, 0.0)
    result = monitor(
        replace(series, of_epoch=np.full_like(series.of_epoch, SIGMA**2)), truth.pair, MonitoringSettings()
    )
    step: Step = result.since_first[0]
    assert np.abs(step.values).max() < 1e-9
    assert np.nanmax(step.statistic) < 1e-9


def test_everything_moves_with_the_stations() -> None:
    """Displacements do not depend on where the origin of the ground is."""
    truth = world()
    series = truth.measure(2)
    here = monitor(series, truth.pair, MonitoringSettings())
    away = np.array([5000.0, -7000.0, 900.0])
    there = monitor(series, replace(truth.pair, centers=CENTERS + away), MonitoringSettings())
    np.testing.assert_allclose(there.since_first[0].values, here.since_first[0].values, atol=1e-9)
    np.testing.assert_allclose(there.positions[0].values - here.positions[0].values, [away] * 30, atol=1e-8)
