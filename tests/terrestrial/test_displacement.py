"""Displacements in the normal case: the vectors, the difference of two intersections, errors, tests."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.simulation.draws import Draws, Purpose
from photostrip.terrestrial.normal_case import displacements, ellipses, intersect
from tests.vectors import cases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.vectors import Vector

    Floats = NDArray[np.float64]


def epochs(given_: dict[str, float]) -> tuple[Floats, Floats]:
    """Coordinates of both epochs from what the vectors give."""
    x, z, p = (given_[name] for name in ("x_left", "z_left", "p"))
    first = np.array([[x, z, x - p, z]])
    change = [given_["dx_left"], given_["dz_left"], given_["dx_right"], given_["dz_left"]]
    return first, first + change


def standard_errors(second: Floats, sigma: float, principal_distance: float, base: float) -> Floats:
    """Give m_dX, m_dY, m_dZ, metres, for pseudo-parallaxes of equal accuracy, z of the right photo not measured.

    second: (n, 4), coordinates of the second epoch in mm.
    sigma: standard deviation of each pseudo-parallax in mm.
    """
    x, z, p = second[:, 0], second[:, 1], second[:, 0] - second[:, 2]
    depth = base * principal_distance / p
    across = depth / principal_distance * sigma
    return np.column_stack(
        [
            across * np.hypot(1 - x / p, x / p),
            depth**2 / (base * principal_distance) * sigma * np.sqrt(2.0),
            across * np.sqrt(1 + 2 * (z / p) ** 2),
        ]
    )


@pytest.mark.parametrize("vector", cases("pseudo_parallax"))
def test_the_vectors(vector: Vector) -> None:
    given_, expected, rel = vector.input, vector.expected, vector.tol["rel"]
    f, base = given_["f"], given_["B"]
    first, second = epochs(given_)
    (point,), _ = intersect(first, f, base)
    np.testing.assert_allclose(point, [expected[name] for name in "XYZ"], rtol=rel)
    (moved,) = displacements(first, second, f, base)
    np.testing.assert_allclose(moved, [expected[name] for name in ("dX", "dY", "dZ")], rtol=rel)
    np.testing.assert_allclose(point + moved, [expected[f"{name}_new"] for name in "XYZ"], rtol=rel)
    assert second[0, 0] - second[0, 2] == pytest.approx(expected["p_new"], rel=rel)
    (errors,) = standard_errors(second, given_["m_pseudoparallax"], f, base)
    np.testing.assert_allclose(errors, [expected[name] for name in ("m_dX", "m_dY", "m_dZ")], rtol=rel)


coordinate = st.floats(-80.0, 80.0)
parallax = st.floats(5.0, 80.0)
change = st.floats(-2.0, 2.0)


@given(coordinate, coordinate, parallax, change, change, change)
def test_a_displacement_is_the_difference_of_two_points(
    x: float, z: float, p: float, dx: float, dz: float, dr: float
) -> None:
    first = np.array([[x, z, x - p, z]])
    second = first + np.array([dx, dz, dr, dz])
    f, base = 190.0, 50.0
    before, after = (
        f * base / (e[0, 0] - e[0, 2]) * np.array([e[0, 0] / f, 1.0, e[0, 1] / f]) for e in (first, second)
    )
    np.testing.assert_allclose(displacements(first, second, f, base)[0], after - before, rtol=1e-9, atol=1e-9)


def test_standard_errors_are_the_scatter_of_simulated_pseudo_parallaxes() -> None:
    first, second = np.array([[30.0, -12.0, -50.0, -12.0]]), np.array([[30.35, -12.2, -49.9, -12.2]])
    noise = 0.005 * Draws(3, Purpose.IMAGE).normal(40_000, 3)
    noisy = second + noise[:, [0, 1, 2, 1]]
    found = displacements(np.repeat(first, len(noise), axis=0), noisy, 1000.0, 50.0)
    np.testing.assert_allclose(found.std(axis=0), standard_errors(second, 0.005, 1000.0, 50.0)[0], rtol=0.015)


# ------------------------------------------------------------------------------------------------------------ test


def covariance(seed: int) -> Floats:
    root = Draws(seed, Purpose.POINTS).normal(3, 3)
    return np.asarray(root @ root.T)


@given(st.integers(0, 1000))
def test_ellipses_are_those_of_the_eigenvectors(seed: int) -> None:
    c = covariance(seed)[:2, :2]
    major, minor, azimuth = ellipses(c, 0.95)
    size, axes = np.linalg.eigh(c)
    np.testing.assert_allclose([minor, major], np.sqrt(5.991464547 * size), rtol=1e-6, atol=1e-6)
    direction = np.array([np.sin(azimuth), np.cos(azimuth)])
    assert abs(direction @ axes[:, 1]) == pytest.approx(1.0, abs=1e-6)
    assert 0 <= azimuth < np.pi
