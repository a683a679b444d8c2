"""Plane transformations against direct least squares, scipy's optimiser, differences and invariants."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from photostrip.errors import GeometryError
from photostrip.geometry import plane
from tests.loops import nonempty

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

NANOMETRE = 1e-6  # mm
PICOMETRE = 1e-9  # mm
SQUARE = np.array([[106.0, -106.0], [-106.0, -106.0], [-106.0, 106.0], [106.0, 106.0]])
EIGHT = np.vstack([SQUARE, [[0.0, -113.0], [-113.0, 0.0], [0.0, 113.0], [113.0, 0.0]]])
SEEDS = st.integers(0, 2**32 - 1)
small = st.floats(-1, 1)
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


@kinds
@given(seed=SEEDS)
def test_no_small_change_makes_the_sum_of_squares_smaller(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    source, target, weights = noisy(kind, rng)
    found = plane.KINDS[kind].fit(source, target, weights)
    residuals = found.residuals(source, target)
    # derivatives of the fitted points by rotation, scale, shift; and by shear where the transformation has one
    centred = found(source) - found(source).mean(0)
    changes = [centred, centred @ [[0, 1], [-1, 0]], np.array([1.0, 0.0]), np.array([0.0, 1.0])]
    changes += [] if kind == "conformal" else [centred * [1, -1], centred[:, ::-1]]
    for change in nonempty(changes):
        slope = (weights[:, None] * residuals * change).sum()
        steepest = np.sqrt((weights[:, None] * residuals**2).sum() * (weights[:, None] * change**2).sum())
        assert abs(slope) < 1e-8 * steepest


@kinds
@given(seed=SEEDS)
def test_photos_in_one_array_come_out_as_alone(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    photos = [noisy(kind, rng) for _ in range(3)]
    source, target, weights = (np.stack(arrays) for arrays in zip(*photos, strict=True))
    weights[1, 5:7] = 0
    target[1, 5:7] = 9e9  # what stands in the place of a missing mark must not matter
    together = plane.KINDS[kind].fit(source, target, weights)
    for row, used in enumerate([range(8), [0, 1, 2, 3, 4, 7], range(8)]):
        rows = np.array(used)
        alone = plane.KINDS[kind].fit(source[row, rows], target[row, rows], weights[row, rows])
        expected = alone(EIGHT)
        assert np.allclose(together.take(row)(EIGHT), expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    assert np.allclose(together(source)[2], together.take([2])(source[2:])[0], rtol=1e-14)


@given(seed=SEEDS)
def test_weight_two_is_the_same_point_twice(seed: int) -> None:
    source, target, _ = noisy("affine", np.random.default_rng(seed))
    doubled = plane.KINDS["affine"].fit(np.vstack([source, source[:1]]), np.vstack([target, target[:1]]))
    weighted = plane.KINDS["affine"].fit(source, target, [2, 1, 1, 1, 1, 1, 1, 1])
    assert np.allclose(weighted(source), doubled(source), rtol=0, atol=1e-11 * np.abs(target).max())


def test_a_bilinear_transformation_keeps_the_sides_straight_and_a_projective_one_keeps_all_lines() -> None:
    target = SQUARE + np.array([[1.0, 0.5], [-0.3, 0.2], [0.4, -1.0], [0.0, 0.0]])
    middle = (SQUARE + np.roll(SQUARE, 1, 0)) / 2
    bilinear = plane.KINDS["bilinear"].fit(SQUARE, target)
    assert np.allclose(bilinear(middle), (target + np.roll(target, 1, 0)) / 2, atol=PICOMETRE)
    projective = plane.projective_from_points(SQUARE, target)
    a, b, c = projective([[-106.0, -80.0], [13.0, 11.0], [106.0, 11 + 91 * 93 / 119]])
    assert abs(np.linalg.det([b - a, c - a])) < NANOMETRE


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


@pytest.mark.parametrize(
    ("kind", "points", "expected"),
    [
        ("conformal", SQUARE, 1.0),
        ("affine", SQUARE, 1.0),
        ("affine", SQUARE[:3], np.sqrt(1 / 3)),  # right angle: second moments 1.5 and 0.5
        ("bilinear", SQUARE, 1.0),
    ],
)
def test_the_strength_of_known_patterns(kind: str, points: Floats, expected: float) -> None:
    assert plane.strength(kind, 1000 + 7 * points) == pytest.approx(expected, abs=1e-12)
    assert plane.strength(kind, np.stack([points, points])).shape == (2,)


@given(small, small)
def test_a_quarter_of_a_turn_and_a_scale(x: float, y: float) -> None:
    turn = plane.conformal_from_points([[0, 0], [1, 0]], [[10, 0], [10, 3]])
    assert np.allclose(turn([[x, y]]), [[10 - 3 * y, 3 * x]], atol=1e-14)
