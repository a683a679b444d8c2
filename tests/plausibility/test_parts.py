"""The parts of the gate on their own: slips of digits, flight, layout of the control, angles, fits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from photostrip.plausibility import flight
from photostrip.plausibility.given_points import slip
from photostrip.plausibility.ids import TiesOfStrips, odd_ties

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


# --------------------------------------------------------------------------------------------------------- digits


@given(
    value=st.integers(100_000_000, 999_999_999),
    place=st.integers(1, 5),
    digit=st.integers(0, 9),
    noise=st.floats(-0.05, 0.05),
)
@settings(max_examples=60)
def test_any_single_wrong_digit_is_put_right(value: int, place: int, digit: int, noise: float) -> None:
    text = str(value)
    wrong = text[:place] + str(digit) + text[place + 1 :]
    found = slip(int(wrong) / 1000, value / 1000 + noise, 0.05, 0.2)
    if wrong == text:
        assert found is None
    else:
        assert found is not None
        assert found.meant == pytest.approx(value / 1000, abs=1e-6)


@pytest.mark.parametrize(
    ("written", "meant", "words"),
    [
        (434733.71, 443733.71, "the second and the third digit exchanged"),
        (-1203.5, 1203.5, "the sign is wrong"),
        (43473.371, 434733.71, "the decimal point is 1 place"),
        (4733.71, 34733.71, "a leading 3 is missing"),
        (434733.71, 435733.71, "a typing error in the third digit (4 for 5)"),
    ],
)
def test_other_slips_are_named(written: float, meant: float, words: str) -> None:
    found = slip(written, meant + 0.01, 0.05, 0.2)
    assert found is not None
    assert words in found.text
    assert found.meant == pytest.approx(meant, abs=1e-6)


@given(st.floats(-0.29, 0.29))
def test_what_is_within_noise_is_no_slip(off: float) -> None:
    assert slip(434733.71, 434733.71 + off, 0.05, 0.2) is None


# --------------------------------------------------------------------------------------------------------- flight


def straight(photos: int = 8) -> Floats:
    """Give perspective centres of a straight level flight, base 100, at height 150."""
    return np.column_stack([100.0 * np.arange(photos), np.zeros(photos), np.full(photos, 150.0)])


def flown(centers: Floats, depth: Floats | None = None) -> list[tuple[str, tuple[str, ...]]]:
    """Examine a flight."""
    names = [f"{number}" for number in range(len(centers))]
    height = np.full(len(centers), 150.0) if depth is None else depth
    up = np.array([0.0, 0.0, 1.0])
    return [(each.code, each.photos) for each in flight.find_odd_centers(centers, height, up, names, "A")]


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_a_usual_flight_has_no_finding(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centers = straight(10) + rng.normal(0.0, [5.0, 5.0, 3.0], (10, 3)).clip(-12, 12)
    assert flown(centers) == []


# --------------------------------------------------------------------------------------------------------- angles


def attitudes(count: int = 6) -> tuple[Floats, Floats]:
    """Give omega, phi, kappa and the rotations they stand for, by a library that is not ours."""
    rng = np.random.default_rng(4)
    values = np.column_stack([rng.normal(0, np.radians(2), (count, 2)), rng.uniform(-3, 3, count)])
    return values, Rotation.from_euler("XYZ", values).as_matrix()


def test_yaw_pitch_roll_of_a_gimbal() -> None:
    """Where a camera that is stated to look down looks ahead, pitch lies about -90 degrees."""
    _, matrices = attitudes()
    names = [f"{number}" for number in range(len(matrices))]
    gimbal = Rotation.from_matrix(matrices) * Rotation.from_euler("x", -90, degrees=True)
    stated = gimbal.as_euler("ZXY") * [-1, 1, 1]
    (finding,) = flight.find_wrong_angles(stated, "yaw-pitch-roll", matrices, names)
    assert finding.code == "P602"
    assert "of a camera that looks ahead where pitch and roll are zero" in finding.message


# --------------------------------------------------------------------------------------------------------- ties


@given(st.integers(0, 10_000), st.integers(0, 2))
@settings(max_examples=30, deadline=None)
def test_ties_of_two_points_are_found_beside_the_bend_of_two_strips(seed: int, degree: int) -> None:
    """And none beside them; a tenth of the ties is wrong, by metres or by kilometres."""
    rng = np.random.default_rng(seed)
    count = 30
    plan = rng.uniform(-1000, 1000, (count, 2))
    x, y = (plan / 1000).T
    columns = np.column_stack([np.ones(count), x, y, x**2, x * y, y**2])[:, : (1, 3, 6)[degree]]
    off = columns @ rng.normal(0, 3.0, (columns.shape[1], 2)) + rng.normal(0, 0.1, (count, 2))
    wrong = rng.choice(count, 3, replace=False)
    turned = rng.uniform(0, 2 * np.pi, 3)
    off[wrong] += np.column_stack([np.cos(turned), np.sin(turned)]) * rng.uniform(20, 1e4, 3)[:, None]
    ties = TiesOfStrips(
        points=np.arange(count),
        names=tuple(f"T{number}" for number in range(count)),
        plan=plan,
        difference=off,
        rays=np.full(count, 3),
        sigma=0.1,
        depth=1500.0,
        strips=("A", "B"),
    )
    odd = odd_ties(ties)
    assert odd is not None
    assert odd.rows.tolist() == sorted(wrong.tolist())
    assert odd.far[wrong].min() > 10.0
    assert np.delete(odd.far, wrong).max() < 1.0
