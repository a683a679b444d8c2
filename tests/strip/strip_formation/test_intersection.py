"""Intersection of two rays: a printed example, two independent solutions, what does not meet."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from photostrip.strip.formed_strip import intersect
from tests.loops import nonempty
from tests.strips import attitude, photograph
from tests.vectors import cases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.vectors import Vector

    Floats = NDArray[np.float64]

SEEDS = st.integers(0, 2**32 - 1)
FOCAL = 100.0


def turned(xy: Floats, rotation: Floats, focal: float = FOCAL) -> Floats:
    """Rays of a photo in the frame of the base, shape (3, n)."""
    rays: Floats = rotation @ np.column_stack([xy, np.full(len(xy), -focal)]).T
    return rays


def scene(seed: int, n: int = 8) -> tuple[Floats, Floats, Floats, Floats]:
    """Points below two photos, the base between them, the rays of both."""
    rng = np.random.default_rng(seed)
    first, second = attitude(rng.uniform(-8, 8, (2, 3)))
    base = np.array([65.0, *rng.uniform(-6, 6, 2)])
    plan = rng.uniform(-40, 110, (n, 2)) - [0, 35]
    points = np.column_stack([plan, -rng.uniform(85, 115, n)])
    left = photograph(points, np.zeros(3), first, FOCAL)
    right = photograph(points, base, second, FOCAL)
    return points, base, turned(left, first), turned(right, second)


@pytest.mark.parametrize("example", cases("intersection"))
def test_the_example_of_the_formula_book(example: Vector) -> None:
    given_, expected, rel = example.input, example.expected, example.tol["rel"]
    f, base = given_["f"], np.array(given_["B_XYZ"])
    left, right = (
        turned(np.array(given_[side]), attitude(given_[eo])[0], f)
        for side, eo in (("left", "eo1_deg"), ("right", "eo2_deg"))
    )
    found = intersect(base, left, right, f)
    assert found.sound.all()
    assert np.allclose(found.ray_factor, expected["N"], rtol=rel, atol=0)
    assert np.allclose(found.ray_factor + base[2] / f, expected["N2"], rtol=rel, atol=0)
    assert np.allclose(found.xyz[:, 0], expected["dX"], rtol=1e-11, atol=0)  # from rays rounded twice
    assert np.allclose(found.xyz[:, 1], expected["dY_mean"], rtol=1e-11, atol=0)
    assert np.allclose(found.xyz[:, 2], expected["dZ"], rtol=rel, atol=0)
    assert np.allclose(found.gap, expected["dY_discrepancy"], rtol=1e-11, atol=0)
    assert np.allclose(found.xyz[:, 1] + found.gap / 2, expected["dY_left"], rtol=1e-11, atol=0)
    assert np.allclose(found.xyz[:, 1] - found.gap / 2, expected["dY_right"], rtol=1e-11, atol=0)
    assert np.allclose(found.gap / found.ray_factor, expected["q_photo_scale"], rtol=1e-11, atol=0)
    level_left = np.column_stack([found.xyz[:, 0], found.xyz[:, 1] + found.gap / 2]) / found.ray_factor[:, None]
    assert np.allclose(level_left, expected["x1h_y1h"], rtol=1e-11, atol=0)
    n2 = (found.ray_factor + base[2] / f)[:, None]
    level_right = (np.column_stack([found.xyz[:, 0], found.xyz[:, 1] - found.gap / 2]) - base[:2]) / n2
    assert np.allclose(level_right, expected["x2h_y2h"], rtol=1e-11, atol=0)


@given(SEEDS)
def test_with_errors_x_and_z_solve_the_two_equations(seed: int) -> None:
    _, base, left, right = scene(seed)
    rng = np.random.default_rng(seed)
    left = left + rng.normal(0, 0.05, left.shape)
    found = intersect(base, left, right, FOCAL)
    for n in nonempty(range(left.shape[1])):
        matrix = np.column_stack([left[[0, 2], n], -right[[0, 2], n]])
        s, t = np.linalg.solve(matrix, base[[0, 2]])
        assert np.allclose(found.xyz[n, [0, 2]], s * left[[0, 2], n], rtol=0, atol=1e-9)
        heights = s * left[1, n], base[1] + t * right[1, n]
        assert found.xyz[n, 1] == pytest.approx(np.mean(heights), abs=1e-9)
        assert found.gap[n] == pytest.approx(heights[0] - heights[1], abs=1e-9)
