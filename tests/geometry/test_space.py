"""Rotations and similarities: printed examples, libraries that are not ours, and what holds for each of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from photostrip.arrays import Floats
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
from photostrip.geometry.similarity import Similarity, Spread, collinearity, similar, similarity_derivatives
from tests.vectors import Vector, cases

ROUNDING = 1e-14
NUMBERS = st.floats(-1e3, 1e3)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS)


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


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-12, 0.99e-9, 1.01e-9, 1e-8, 1e-5])
def test_tiny_rotations_lose_nothing(size: float) -> None:
    vector = np.array([0.6, 0.0, 0.8]) * size
    matrix = from_vector(vector)
    first_order = np.eye(3) + cross_matrix(vector) + cross_matrix(vector) @ cross_matrix(vector) / 2
    assert np.allclose(matrix, first_order, rtol=0, atol=2e-16 + size**3)
    assert Rotation.from_matrix(matrix).magnitude() == pytest.approx(size, rel=1e-6, abs=1e-300)


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


SEEDS = st.integers(0, 2**32 - 1)
OPTIMISER = 1e-7  # where a sum of squares is flat to rounding, an optimiser that looks at it stops


def random_similarity(rng: np.random.Generator) -> Similarity:
    rotation = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    return Similarity(float(np.exp(rng.uniform(-5, 9))), rotation, rng.uniform(-1e5, 1e5, 3))


def largest(similarity: Similarity, source: Floats) -> float:
    """Size of what a similarity makes of points, to judge rounding by."""
    return float(np.abs(similarity(source)).max() + similarity.scale * np.abs(source).max())


def optimised(source: Floats, target: Floats, weights: Floats) -> Similarity:
    """Least squares over seven parameters by scipy, started beside the closed form."""
    center, size = target.mean(axis=0), float(np.ptp(target))
    start, middle = Similarity.from_points(source, target), source.mean(axis=0)

    def transform(p: Floats) -> Similarity:
        turn = Rotation.from_rotvec(p[:3]).as_matrix() @ start.rotation
        scale = start.scale * float(np.exp(p[3]))
        return Similarity(scale, turn, size * p[4:] - scale * turn @ middle)  # to the target's centre

    def residuals(p: Floats) -> Floats:
        return (np.sqrt(weights)[:, None] * transform(p).residuals(source, target - center) / size).ravel()

    begin = np.array([0.02, -0.01, 0.03, 0.01, 1e-3, -1e-3, 1e-3])
    found = transform(least_squares(residuals, begin, jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15).x)
    return Similarity(found.scale, found.rotation, found.shift + center)


@pytest.mark.parametrize("example", cases("absolute_orientation"))
def test_the_similarities_of_the_formula_book(example: Vector) -> None:
    source, target = np.array(example.input["model"]), np.array(example.input["target"])
    expected, rel = example.expected, example.tol["rel"]
    found = Similarity.from_points(source, target)
    assert found.scale == pytest.approx(expected["scale"], rel=rel)
    assert np.allclose(found.rotation, expected["rotation"], rtol=0, atol=rel)
    degrees = np.degrees(alpha_omega_kappa(found.rotation))
    assert np.allclose(degrees, expected["angles_xi_eta_theta_deg"], rtol=0, atol=example.tol["angles_deg"])
    size = np.abs(target).max()
    assert np.allclose(found.shift, expected["translation"], rtol=0, atol=rel * size)
    residuals = found.residuals(source, target)
    assert np.allclose(residuals, expected["residuals_computed_minus_given"], rtol=0, atol=rel * size)
    sigma0 = np.sqrt((residuals**2).sum() / (residuals.size - 7))
    assert sigma0 == pytest.approx(expected["sigma0"], rel=1e-8)
    assert np.allclose(found(np.array([example.input["new_model_point"]]))[0], expected["new_point"], rtol=rel, atol=0)
    assert np.allclose(found(np.array([expected["centroid_model"]]))[0], expected["centroid_target"], rtol=rel, atol=0)


@pytest.mark.parametrize("seed", range(5))
def test_an_optimiser_finds_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    source, weights = rng.uniform(-100, 100, (7, 3)), rng.uniform(0.2, 5, 7)
    truth = random_similarity(rng)
    target = truth(source) + rng.normal(0, truth.scale, (7, 3))
    found, theirs = Similarity.from_points(source, target, weights), optimised(source, target, weights)
    assert found.scale == pytest.approx(theirs.scale, rel=OPTIMISER)
    assert np.allclose(found.rotation, theirs.rotation, rtol=0, atol=OPTIMISER)
    assert np.allclose(found(source), theirs(source), rtol=0, atol=OPTIMISER * truth.scale * 100)


def test_many_at_once_are_what_each_is_alone() -> None:
    rng = np.random.default_rng(1)
    source, target, points = rng.normal(0, 1, (4, 5, 3)), rng.normal(9, 3, (4, 5, 3)), rng.normal(0, 2, (6, 3))
    alone = [Similarity.from_points(one, other)(points) for one, other in zip(source, target, strict=True)]
    assert np.allclose(similar(source, target, points), alone, rtol=0, atol=1e-12)


@given(SEEDS, st.integers(3, 12))
def test_exact_points_give_the_similarity_back(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    source, truth = rng.normal(0, 1, (n, 3)), random_similarity(rng)
    weights = rng.uniform(0.1, 10, n)
    assume(collinearity(source) > 1e-2)  # three points nearly on a line amplify rounding
    found = Similarity.from_points(source, truth(source), weights)
    assert found.scale == pytest.approx(truth.scale, rel=1e-7)
    assert np.allclose(found.rotation, truth.rotation, rtol=0, atol=1e-6)
    assert np.abs(found.residuals(source, truth(source))).max() < 1e-12 * largest(truth, source)


@given(SEEDS)
def test_points_are_never_mirrored(seed: int) -> None:
    rng = np.random.default_rng(seed)
    source = rng.normal(0, 1, (6, 3))
    found = Similarity.from_points(source, source * [1, 1, -1])
    assert np.linalg.det(found.rotation) == pytest.approx(1, abs=1e-12)
    assert found.scale > 0


@given(SEEDS, st.floats(0.1, 1e4))
def test_collinearity_is_the_square_of_width_over_length(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    cross = np.array([[3.0, 0, 0], [-3, 0, 0], [0, 1, 0], [0, -1, 0]]) * size
    moved = Similarity(1.0, random_similarity(rng).rotation, rng.normal(0, 10, 3))(cross)
    assert collinearity(moved) == pytest.approx(1 / 9, rel=1e-6)
    line = rng.normal(0, 100, (5, 1)) * rng.normal(0, 1, 3) + rng.normal(0, 100, 3)
    assert collinearity(line) < 1e-12


@given(SEEDS)
def test_the_motion_of_points_is_that_of_the_derivatives_summed_point_by_point(seed: int) -> None:
    rng = np.random.default_rng(seed)
    similarity, points = random_similarity(rng), rng.normal(0, 1, (30, 3))
    center, unit = similarity(rng.normal(0, 1, 3)), 3.0 * similarity.scale
    root = Spread.of(points).motion(similarity, center, unit)
    moved = similarity_derivatives(similarity(points), center) / ([1.0] * 3 + [unit] * 4)
    assert np.allclose(root @ root.T, np.einsum("nci,ncj->ij", moved, moved) / len(points), rtol=1e-6, atol=1e-6)


def test_collinearity_of_too_few_points() -> None:
    assert collinearity(np.zeros((0, 3))) == 0
    assert collinearity([[0, 0, 0], [1, 0, 0]]) == 0
    assert collinearity(np.ones((4, 3))) == 0
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert collinearity(square) == pytest.approx(1)
