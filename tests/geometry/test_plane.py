"""Plane transformations against direct least squares, scipy's optimiser, differences and invariants."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from photostrip.arrays import Floats
from photostrip.errors import GeometryError
from photostrip.geometry import plane

SQUARE = np.array([[106.0, -106.0], [-106.0, -106.0], [-106.0, 106.0], [106.0, 106.0]])
EIGHT = np.vstack([SQUARE, [[0.0, -113.0], [-113.0, 0.0], [0.0, 113.0], [113.0, 0.0]]])
SEEDS = st.integers(0, 2**32 - 1)
kinds = pytest.mark.parametrize("kind", list(plane.KINDS))


def random_transform(kind: str, rng: np.random.Generator) -> plane.PlaneTransform:
    """Any rotation, scale 0.01 to 100, shear, and a bilinear or projective bend of a few per cent of the format."""
    angle, scale = rng.uniform(-np.pi, np.pi), 10 ** rng.uniform(-2, 2)
    matrix = np.zeros((3, 4))
    turn = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    matrix[:2, :2] = turn
    matrix[:2, 3] = rng.uniform(-5000, 5000, 2)
    matrix[2, 3] = 1
    if kind != "conformal":
        matrix[:2, :2] = turn @ [[rng.choice([-1, 1]) * rng.uniform(0.5, 2), rng.uniform(-0.5, 0.5)], [0, 1]]
    if kind == "bilinear":
        matrix[:2, 2] = scale * rng.uniform(-2e-4, 2e-4, 2)
    if kind == "projective":
        matrix[2, :2] = rng.uniform(-3e-4, 3e-4, 2)
    return plane.PlaneTransform(matrix)


def noisy(kind: str, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Eight marks, their images by a random transformation with 0.1 % of noise, and weights."""
    target = random_transform(kind, rng)(EIGHT)
    return EIGHT, target + rng.normal(0, 1e-3 * np.ptp(target, axis=0).max(), target.shape), rng.uniform(0.2, 5, 8)


@kinds
@given(seed=SEEDS)
def test_a_transformation_comes_back(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = random_transform(kind, rng)
    target = truth(EIGHT)
    found = plane.KINDS[kind].fit(EIGHT, target)
    points = rng.uniform(-115, 115, (20, 2))
    assert np.allclose(found(points), truth(points), rtol=0, atol=1e-11 * np.abs(target).max())
    assert np.abs(found.residuals(EIGHT, target)).max() < 1e-11 * np.abs(target).max()


@kinds
@given(seed=SEEDS)
def test_the_jacobian_agrees_with_differences(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    transform = random_transform(kind, rng)
    points = rng.uniform(-115, 115, (5, 2))
    h = 1e-3
    columns = [(transform(points + h * unit) - transform(points - h * unit)) / (2 * h) for unit in np.eye(2)]
    size = np.abs(transform.coefficients[:2, :2]).max() + 1e-5 * np.abs(transform.coefficients[:2, 3]).max()
    assert np.allclose(transform.jacobian(points), np.stack(columns, -1), rtol=0, atol=1e-5 * size)


def direct_equations(kind: str, source: Floats) -> Floats:
    """Equations of all x, then all y, written out for one photo, in plain coordinates."""
    x, y = source.T
    one, none = np.ones_like(x), np.zeros_like(x)
    if kind == "conformal":
        return np.vstack([np.stack([x, -y, one, none], 1), np.stack([y, x, none, one], 1)])
    terms = np.stack([x, y, one] if kind == "affine" else [x, y, one, x * y], 1)
    return np.kron(np.eye(2), terms)


@pytest.mark.parametrize("kind", ["conformal", "affine", "bilinear"])
@given(seed=SEEDS)
def test_linear_fits_agree_with_direct_least_squares(kind: str, seed: int) -> None:
    source, target, weights = noisy(kind, np.random.default_rng(seed))
    root = np.sqrt(np.tile(weights, 2))
    design = direct_equations(kind, source)
    solution = np.linalg.lstsq(design * root[:, None], target.T.ravel() * root, rcond=None)[0]
    expected = (design @ solution).reshape(2, -1).T
    found = plane.KINDS[kind].fit(source, target, weights)(source)
    assert np.allclose(found, expected, rtol=0, atol=1e-11 * np.abs(target).max())


@pytest.mark.slow
@given(seed=SEEDS)
@settings(max_examples=20)
def test_the_projective_fit_agrees_with_an_optimiser(seed: int) -> None:
    source, target, weights = noisy("projective", np.random.default_rng(seed))
    found = plane.projective_from_points(source, target, weights)
    center, size = target.mean(0), np.ptp(target, axis=0).max()

    def misclosures(h: Floats) -> Floats:
        top = np.c_[source / 100, np.ones(8)] @ np.append(h, 1.0).reshape(3, 3).T
        return np.asarray((np.sqrt(weights)[:, None] * (top[:, :2] / top[:, 2:] - (target - center) / size)).ravel())

    other = least_squares(misclosures, [1, 0, 0, 0, 1, 0, 0, 0], xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale=1.0)
    ours = (weights[:, None] * found.residuals(source, target) ** 2).sum() / size**2
    assert ours <= 2 * other.cost * (1 + 1e-9)


@pytest.mark.parametrize(
    ("kind", "points", "message"),
    [
        ("conformal", [[5.0, 5.0], [5.0, 5.0]], "in one place"),
        ("affine", [[0.0, 0.0], [1.0, 1.0]], "do not determine"),
        ("affine", [[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]], "do not determine"),
        ("bilinear", [[100.0, 0.0], [0.0, 100.0], [-100.0, 0.0], [0.0, -100.0]], "do not determine"),
        ("projective", [[0.0, 0.0], [1.0, 1.0], [3.0, 3.0], [0.0, 1.0]], "do not determine"),
    ],
)
def test_weak_points_are_refused(kind: str, points: list[list[float]], message: str) -> None:
    with pytest.raises(GeometryError, match=message):
        plane.KINDS[kind].fit(points, points)
    assert plane.strength(kind, points) < plane.SINGULAR


def test_points_beyond_the_horizon_are_refused() -> None:
    bend = plane.PlaneTransform(np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0.02, 0, 0, 1]]))  # x = -50 goes to infinity
    with pytest.raises(GeometryError, match="both sides"):
        plane.projective_from_points(EIGHT, bend(EIGHT))
