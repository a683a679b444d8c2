"""Displacements of whole surveys: exact, simulated with noise, with turned cameras, in many epochs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.terrestrial.monitoring import MonitoringSettings, Series, monitor
from tests.loops import nonempty
from tests.terrestrial.simulated import SIGMA, World, repeated, turned, weighted, world

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


def test_a_stable_point_that_moved_is_named_and_judged_like_the_others() -> None:
    truth = world()
    velocity = truth.velocity.copy()
    velocity[2] = (0.3, 0.0, -0.1)
    result = run(turned(replace(truth, velocity=velocity), *TURN))
    assert result.rejected == [(1, "P2")]
    assert result.significant(result.since_first[0])[2]
    assert any(note.code == "not-stable" and note.points == ("P2",) for note in result.notes)


# ------------------------------------------------------------------------------------------------- time series


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


def test_without_stable_points_nobody_can_know_of_the_cameras() -> None:
    result = run(replace(world(), stable=0))
    assert [note.code for note in result.notes] == ["no-stable-points"]
    assert all(state.turn is None for state in nonempty(result.cameras))
