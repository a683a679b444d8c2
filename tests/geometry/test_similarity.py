"""The similarity in space: printed examples, an optimiser that is not ours, and what holds for every similarity."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from photostrip.geometry.rotation import alpha_omega_kappa
from photostrip.geometry.similarity import Similarity, Spread, collinearity, similar, similarity_derivatives
from tests.vectors import cases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.vectors import Vector

    Floats = NDArray[np.float64]

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


# ------------------------------------------------------------------------------------------- published


@pytest.mark.parametrize("example", cases("absolute_orientation"))
def test_the_examples_of_the_formula_book(example: Vector) -> None:
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


# --------------------------------------------------------------------------------------- other routes


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


# ------------------------------------------------------------------------------------------ invariants


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


@given(SEEDS)
def test_weights_count_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    source, target = rng.normal(0, 100, (5, 3)), rng.normal(0, 100, (5, 3))
    twice = Similarity.from_points(source, target, np.array([2.0, 1, 1, 1, 0]))
    rows = [0, 0, 1, 2, 3]
    repeated = Similarity.from_points(source[rows], target[rows])
    assert np.allclose(twice(source), repeated(source), rtol=0, atol=1e-8)


def test_residuals_are_transformed_minus_given() -> None:
    shifted = Similarity(2.0, np.eye(3), np.array([1.0, 0, 0]))
    assert np.array_equal(shifted.residuals([[1, 1, 1]], [[0, 0, 5]]), [[3, 2, -3]])


# ---------------------------------------------------------------------------------------- collinearity


@given(SEEDS, st.floats(0.1, 1e4))
def test_collinearity_is_the_square_of_width_over_length(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    cross = np.array([[3.0, 0, 0], [-3, 0, 0], [0, 1, 0], [0, -1, 0]]) * size
    moved = Similarity(1.0, random_similarity(rng).rotation, rng.normal(0, 10, 3))(cross)
    assert collinearity(moved) == pytest.approx(1 / 9, rel=1e-6)
    line = rng.normal(0, 100, (5, 1)) * rng.normal(0, 1, 3) + rng.normal(0, 100, 3)
    assert collinearity(line) < 1e-12


# ------------------------------------------------------------------------------------------------- spread


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
