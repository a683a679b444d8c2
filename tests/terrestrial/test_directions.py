"""Photo coordinates and directions: the published equations, written out, and numbers computed apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.terrestrial.normal_case import (
    direction_gradient,
    directions_from_photo,
    directions_of,
    ground_from_photo,
    partials,
    photo_from_directions,
)
from tests.terrestrial.simulated import attitude
from tests.vectors import cases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.vectors import Vector

    Floats = NDArray[np.float64]

DIFFERENCE = 1e-6  # step of differences, mm or rad

azimuths = st.floats(-np.pi, np.pi)
tilts = st.floats(-1.4, 1.4)
distances = st.floats(50.0, 400.0)
places = st.tuples(st.floats(-90.0, 90.0), st.floats(-65.0, 65.0))


# ------------------------------------------------------------------------------------------------------- rotation


@given(azimuths, tilts, azimuths)
def test_the_rotation_is_roll_then_elevation_then_azimuth(alpha: float, omega: float, kappa: float) -> None:
    columns = attitude(alpha, omega, kappa)
    rotation = ground_from_photo(alpha, omega, kappa)
    np.testing.assert_allclose(rotation, np.column_stack([columns[:, 0], columns[:, 2], -columns[:, 1]]), atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


@given(st.tuples(*[st.floats(-5, 5)] * 3).filter(lambda v: np.hypot(v[0], v[1]) > 0.1))
def test_the_gradient_of_directions_is_that_of_differences(vector: tuple[float, float, float]) -> None:
    gradient = direction_gradient(vector)
    for axis in range(3):
        step = DIFFERENCE * np.eye(3)[axis]
        change = directions_of(vector + step) - directions_of(vector - step)
        change[0] = np.angle(np.exp(1j * change[0]))
        np.testing.assert_allclose(change / (2 * DIFFERENCE), gradient[:, axis], rtol=1e-5, atol=1e-7)


# ----------------------------------------------------------------------------------------------------- both ways


@pytest.mark.parametrize("vector", cases("phototheodolite"))
def test_coordinates_directions_and_partials_of_the_vectors(vector: Vector) -> None:
    given_, expected, rel = vector.input, vector.expected, vector.tol["rel"]
    f, level = given_["f"], ground_from_photo(0.0)
    direction = np.radians([given_["lambda_deg"], given_["beta_deg"]])
    xz = photo_from_directions(direction, f, ground_from_photo(np.radians(given_["alpha_deg"])))
    np.testing.assert_allclose(xz, [expected["x_from_directions"], expected["z_from_directions"]], rtol=rel)
    point = [given_["x"], given_["z"]]
    found = np.degrees(directions_from_photo(point, f, level))
    np.testing.assert_allclose(found, [expected["lambda_prime_deg"], expected["beta_deg_corrected_eq3"]], rtol=rel)
    by = partials(point, f, level)
    want = expected["partials"]
    np.testing.assert_allclose(by.by_xz[0], [want["dlambda_dx"], 0.0], rtol=rel, atol=1e-18)
    np.testing.assert_allclose(by.by_xz[1], [want["dbeta_dx"], want["dbeta_dz"]], rtol=rel)
    np.testing.assert_allclose(by.by_f, [want["dlambda_df"], want["dbeta_df"]], rtol=rel)


@given(distances, places, azimuths)
def test_a_level_camera_follows_equations_2_and_3(f: float, place: tuple[float, float], alpha: float) -> None:
    x, z = place
    lam, beta = directions_from_photo(place, f, ground_from_photo(alpha))
    turned = np.angle(np.exp(1j * (lam - alpha)))
    assert turned == pytest.approx(np.arctan(x / f), abs=1e-12)
    assert beta == pytest.approx(np.arctan(z / f * np.cos(turned)), abs=1e-12)  # cos where sec is printed
    assert f * np.tan(beta) / np.cos(turned) == pytest.approx(z, abs=1e-9)


@pytest.mark.parametrize("beyond", [np.pi / 2, np.pi, -2.0])
def test_what_is_behind_the_camera_has_no_place_in_the_photo(beyond: float) -> None:
    xz = photo_from_directions([[0.3 + beyond, 0.1], [0.3, 0.1]], 100.0, ground_from_photo(0.3))
    assert np.isnan(xz[0]).all()
    assert np.isfinite(xz[1]).all()
