"""Rotations: printed examples, a library that is not ours, and what holds for every rotation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from photostrip.errors import EXIT_GEOMETRY, GeometryError
from photostrip.geometry.rotation import (
    SYSTEMS,
    alpha_omega_kappa,
    angles,
    cross_matrix,
    from_alpha_omega_kappa,
    from_angles,
    from_vector,
    to_vector,
)
from tests.vectors import cases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.vectors import Vector

    Floats = NDArray[np.float64]

ROUNDING = 1e-14
ANGLES = st.floats(-np.pi, np.pi)
MIDDLE = st.floats(np.radians(-89), np.radians(89))
NUMBERS = st.floats(-1e3, 1e3)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS)
LOOKING = np.array([0.0, 0.0, -1.0])  # of the camera, in the photo's frame


def random_rotation(seed: int, count: int = 50) -> Floats:
    matrices: Floats = Rotation.random(count, random_state=seed).as_matrix()
    return matrices


# ------------------------------------------------------------------------------------------- published


@pytest.mark.parametrize("example", cases("rotation"))
def test_the_examples_of_the_formula_book(example: Vector) -> None:
    given_angles = np.radians([example.input[f"{name}_deg"] for name in ("alpha", "omega", "kappa")])
    expected, tol = example.expected, example.tol["abs"]
    matrix = from_alpha_omega_kappa(*given_angles)
    assert np.allclose(matrix, expected["A"], rtol=0, atol=tol)
    degrees = {system: np.degrees(angles(matrix, system)) for system in SYSTEMS}
    assert np.allclose(np.degrees(alpha_omega_kappa(matrix)), expected["alpha_omega_kappa_back_deg"], rtol=0, atol=tol)
    assert np.allclose(degrees["alpha-omega-kappa"], expected["alpha_omega_kappa_back_deg"], rtol=0, atol=tol)
    assert np.allclose(degrees["omega-phi-kappa"], expected["opk_deg"], rtol=0, atol=tol)
    assert np.allclose(degrees["omega-phi-kappa"] / 0.9, expected["opk_gon"], rtol=0, atol=tol / 0.9)
    assert np.allclose(degrees["phi-omega-kappa"], expected["pok_deg"], rtol=0, atol=tol)
    difference = degrees["omega-phi-kappa"][2] - degrees["alpha-omega-kappa"][2]
    difference = (difference + 180) % 360 - 180
    assert difference == pytest.approx(expected["kappa_difference_opk_minus_aok_deg"], abs=tol)


# ----------------------------------------------------------------------------------- another library


@pytest.mark.parametrize(
    ("system", "order", "signs"),
    [
        ("alpha-omega-kappa", "YXZ", (-1, 1, 1)),
        ("phi-omega-kappa", "YXZ", (1, 1, 1)),
        ("omega-phi-kappa", "XYZ", (1, 1, 1)),
        ("yaw-pitch-roll", "ZXY", (-1, 1, 1)),
    ],
)
def test_systems_are_intrinsic_turns_of_scipy(system: str, order: str, signs: tuple[int, int, int]) -> None:
    turns = np.random.default_rng(1).uniform(-np.pi, np.pi, (200, 3))
    turns[:, 1] /= 2
    theirs = Rotation.from_euler(order, turns * signs).as_matrix()
    assert np.allclose(from_angles(turns, system), theirs, rtol=0, atol=ROUNDING)
    assert np.allclose(angles(theirs, system), turns, rtol=0, atol=1e-9)


@given(VECTORS)
def test_a_rotation_vector_turns_as_scipy_says(vector: tuple[float, float, float]) -> None:
    short = np.array(vector) / 250  # up to two turns
    theirs = Rotation.from_rotvec(short).as_matrix()
    assert np.allclose(from_vector(short), theirs, rtol=0, atol=1e-13)
    assert np.allclose(to_vector(theirs), Rotation.from_rotvec(short).as_rotvec(), rtol=0, atol=1e-7)


# ------------------------------------------------------------------------------------------ invariants


@given(ANGLES, MIDDLE, ANGLES)
def test_phi_is_minus_alpha_and_nothing_else_changes(alpha: float, omega: float, kappa: float) -> None:
    assert np.array_equal(
        from_angles([-alpha, omega, kappa], "phi-omega-kappa"), from_alpha_omega_kappa(alpha, omega, kappa)
    )


def test_signs_of_the_angles() -> None:
    small = 0.1
    assert (from_alpha_omega_kappa(small, 0, 0) @ LOOKING)[0] > 0  # alpha positive: the camera looks forward
    assert (from_alpha_omega_kappa(0, small, 0) @ LOOKING)[1] > 0  # omega positive: it looks to the left
    assert (from_alpha_omega_kappa(0, 0, small) @ [1, 0, 0])[1] > 0  # kappa positive: x turns counter-clockwise


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-12, 0.99e-9, 1.01e-9, 1e-8, 1e-5])
def test_tiny_rotations_lose_nothing(size: float) -> None:
    vector = np.array([0.6, 0.0, 0.8]) * size
    matrix = from_vector(vector)
    first_order = np.eye(3) + cross_matrix(vector) + cross_matrix(vector) @ cross_matrix(vector) / 2
    assert np.allclose(matrix, first_order, rtol=0, atol=2e-16 + size**3)
    assert Rotation.from_matrix(matrix).magnitude() == pytest.approx(size, rel=1e-6, abs=1e-300)


# ---------------------------------------------------------------------------------------------- refused


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("system", SYSTEMS)
def test_a_middle_angle_of_ninety_degrees_is_refused_by_name(system: str, sign: int) -> None:
    first, middle, last = system.split("-")
    matrix = from_angles([0.3, sign * np.pi / 2, 0.2], system)
    with pytest.raises(GeometryError) as caught:
        angles(np.stack([np.eye(3), matrix]), system)  # one bad photo among good ones is enough
    assert caught.value.code == "gimbal"
    assert caught.value.exit_code == EXIT_GEOMETRY
    assert f"{middle} is 90 degrees" in str(caught.value)
    assert f": {first} and {last} cannot be separated" in str(caught.value)
