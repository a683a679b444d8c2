"""Required accuracy of directions: the printed examples, the published formulas, and simulated measurements."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.simulation.draws import Draws, Purpose
from photostrip.terrestrial.accuracy import EXAMPLES, as_printed, required, worked
from photostrip.terrestrial.normal_case import directions_from_photo, ground_from_photo
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


@pytest.mark.parametrize(("number", "by_eq4", "by_eq5"), [(0, 5.64, 5.53), (1, 11.08, 9.68)])
def test_eq4_as_printed_has_terms_that_eq5_drops(number: int, by_eq4: float, by_eq5: float) -> None:
    example = EXAMPLES[number]
    found = worked(example)
    assert (round(found.eq4, 2), round(found.eq5, 2)) == (by_eq4, by_eq5)

    def beta(x: float, z: float, f: float) -> float:
        return math.atan(z / f * math.sqrt(1 + (x / f) ** 2))  # eq. 3 as printed

    at, step = np.array([example.x, example.z, example.f]), 1e-4
    slopes = [(beta(*(at + step * unit)) - beta(*(at - step * unit))) / (2 * step) for unit in np.eye(3)]
    assert found.eq4 == pytest.approx(example.sigma * np.linalg.norm(slopes) * RHO, rel=1e-6)


def test_required_accuracy_is_that_of_simulated_measurements() -> None:
    rotation, f, place, m = ground_from_photo(0.4, 0.3, -0.2), 100.0, np.array([70.0, -50.0]), 0.005
    noise = m * Draws(1, Purpose.IMAGE).normal(40_000, 3)
    found = np.array([directions_from_photo(place + e[:2], f + e[2], rotation) for e in noise[:4000]])
    errors = required(place, f, m, rotation)
    spread = found.std(axis=0)
    assert spread[0] == pytest.approx(errors.angle, rel=0.04)
    assert spread[1] == pytest.approx(errors.vertical, rel=0.04)
