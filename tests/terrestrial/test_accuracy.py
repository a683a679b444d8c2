"""Required accuracy of directions: the printed examples, the published formulas, and simulated measurements."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.simulation.draws import Draws, Purpose
from photostrip.terrestrial.accuracy import EXAMPLES, as_printed, grid, required, rounds_for, supported, worked
from photostrip.terrestrial.normal_case import directions_from_photo, ground_from_photo
from photostrip.units import ARCSECONDS
from tests.loops import nonempty
from tests.vectors import cases

if TYPE_CHECKING:
    from tests.vectors import Vector

RHO = 206265.0  # of the vectors and of the source
LEVEL = ground_from_photo(0.0)


@pytest.mark.parametrize("vector", cases("phototheodolite"))
def test_standard_errors_of_the_vectors(vector: Vector) -> None:
    f, x, z, m = (vector.input[name] for name in "fxzm")
    expected, rel = vector.expected, vector.tol["rel"]
    exact, printed = required([x, z], f, m, LEVEL), as_printed([x, z], f, m)
    found = {
        "m_lambda_prime_arcsec": exact.angle,
        "m_lambda_arcsec": exact.horizontal,
        "m_beta_arcsec_correct": exact.vertical,
        "m_beta_arcsec_eq6_as_printed": printed.vertical_eq6,
        "m_beta_arcsec_eq5_as_printed": printed.vertical_eq5,
    }
    for name, value in nonempty(found.items()):
        assert value * RHO == pytest.approx(expected[name], rel=rel), name
    assert printed.horizontal == pytest.approx(float(exact.horizontal), rel=1e-14)


@pytest.mark.parametrize(
    ("number", "exact", "with_printed_factor", "with_own_factor", "printed"),
    [(0, (3.54, 4.80), 5.13, 5.13, (3.5, 5.0)), (1, (5.69, 7.29), 8.64, 8.18, (6.0, 8.5))],
)
def test_the_worked_examples(
    number: int,
    exact: tuple[float, float],
    with_printed_factor: float,
    with_own_factor: float,
    printed: tuple[float, float],
) -> None:
    example = EXAMPLES[number]
    found = worked(example)
    assert (example.horizontal, example.vertical) == printed
    assert (round(found.horizontal, 2), round(found.vertical, 2)) == exact
    assert (round(found.printed_factor, 2), round(found.eq6, 2)) == (with_printed_factor, with_own_factor)
    assert abs(found.printed_factor - example.vertical) < 0.25  # the print rounds to half a second


def test_the_misprint_shows() -> None:
    first, second = map(worked, EXAMPLES)
    assert round(first.factor, 2) == 1.18
    assert round(second.factor, 2) == 1.64
    assert round(first.returned_z, 1) == 70.6  # printed eq. 3 put into eq. 2 does not give back 60 mm
    beta = np.arctan(60.0 / 190.0 / np.cos(np.arctan(80.0 / 190.0)))
    assert 190.0 * np.tan(beta) / np.cos(np.arctan(80.0 / 190.0)) == pytest.approx(first.returned_z)
    shortfall = [100 * (1 - each.eq6 / each.eq5) for each in (first, second)]
    assert [round(each) for each in shortfall] == [7, 16]


@given(
    st.floats(-np.pi, np.pi),
    st.floats(-0.6, 0.6),
    st.floats(-np.pi, np.pi),
    st.floats(60, 400),
    st.tuples(st.floats(-80, 80), st.floats(-60, 60)),
)
def test_vertical_directions_depend_on_the_ray_alone(
    alpha: float, omega: float, kappa: float, f: float, place: tuple[float, float]
) -> None:
    """x, z and f with the same error make a ray uncertain alike in all directions, however the camera is held."""
    errors = required(place, f, 0.005, ground_from_photo(alpha, omega, kappa))
    beta = directions_from_photo(place, f, ground_from_photo(alpha, omega, kappa))[1]
    length = np.sqrt(f**2 + place[0] ** 2 + place[1] ** 2)
    assert errors.vertical == pytest.approx(0.005 / length, rel=1e-9)
    assert errors.angle == pytest.approx(0.005 / length / np.cos(beta), rel=1e-9)
    assert errors.horizontal == pytest.approx(errors.angle / np.sqrt(2), rel=1e-14)


def test_required_accuracy_is_that_of_simulated_measurements() -> None:
    rotation, f, place, m = ground_from_photo(0.4, 0.3, -0.2), 100.0, np.array([70.0, -50.0]), 0.005
    noise = m * Draws(1, Purpose.IMAGE).normal(40_000, 3)
    found = np.array([directions_from_photo(place + e[:2], f + e[2], rotation) for e in noise[:4000]])
    errors = required(place, f, m, rotation)
    spread = found.std(axis=0)
    assert spread[0] == pytest.approx(errors.angle, rel=0.04)
    assert spread[1] == pytest.approx(errors.vertical, rel=0.04)


# ---------------------------------------------------------------------------------------------------- theodolite


def test_two_seconds_and_four_rounds() -> None:
    mean = 2.0 / np.sqrt(4)  # of four rounds
    image = supported([80.0, 60.0], 100.0, mean / ARCSECONDS, mean / ARCSECONDS, LEVEL)
    assert image[0] == pytest.approx(np.sqrt(2 * (100**2 + 80**2)) / 206264.806, rel=1e-6)  # 0.88 um
    assert image[1] == pytest.approx(np.sqrt(100**2 + 80**2 + 60**2) / 206264.806, rel=1e-6)  # 0.69 um


@given(st.floats(1, 20), st.floats(60, 400), st.tuples(st.floats(-80, 80), st.floats(-60, 60)), st.floats(-0.5, 0.5))
def test_what_is_supported_is_what_requires_it(
    micrometres: float, f: float, place: tuple[float, float], omega: float
) -> None:
    rotation = ground_from_photo(0.2, omega, 0.1)
    m = micrometres * 1e-3
    needed = required(place, f, m, rotation)
    both = supported(place, f, float(needed.horizontal), float(needed.vertical), rotation)
    np.testing.assert_allclose(both, m, rtol=1e-12)


@pytest.mark.parametrize(("sigma", "wanted", "rounds"), [(2, 1, 4), (2, 0.99, 5), (2, 2, 1), (2, 5, 1), (3, 1, 9)])
def test_rounds(sigma: float, wanted: float, rounds: int) -> None:
    assert rounds_for(sigma, wanted) == rounds
    assert sigma / np.sqrt(rounds) <= wanted


@pytest.mark.parametrize(
    ("level", "x", "z"),
    [
        (True, [0, 30, 60, 80], [0, 30, 60]),
        (False, [-80, -60, -30, 0, 30, 60, 80], [-60, -30, 0, 30, 60]),
    ],
)
def test_the_grid_ends_at_the_edges(level: bool, x: list[float], z: list[float]) -> None:
    found = grid((160.0, 120.0), 30.0, level=level)
    assert found[0].tolist() == x
    assert found[1].tolist() == z


def test_a_step_larger_than_the_photo_leaves_centre_and_edge() -> None:
    assert grid((160.0, 120.0), 500.0)[0].tolist() == [0.0, 80.0]
