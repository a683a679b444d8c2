"""Factors of a band and of a sparse matrix, and elements of their inverses, against dense algebra."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photostrip.simulation import Flight, Points, Spec, simulate
from photostrip.triangulation.bundle.normal_equations import reduced
from photostrip.triangulation.bundle.normal_equations.band import Band
from photostrip.triangulation.bundle.normal_equations.sparse import Sparse
from photostrip.triangulation.bundle.quality.cofactors import cofactors_of
from photostrip.triangulation.bundle.solve import solve
from tests.simulated_bundle import problem_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def matrix_with_band(size: int, width: int, seed: int) -> Floats:
    """Make a positive definite matrix with a band."""
    random = np.random.default_rng(seed)
    root = np.triu(np.tril(random.normal(size=(size, size))), -width) + (width + 2.0) * np.eye(size)
    found: Floats = root @ root.T
    return found


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 160), st.integers(0, 70), st.integers(0, 1000))
def test_a_band_is_factored_solved_and_inverted(size: int, width: int, seed: int) -> None:
    width = min(width, size - 1)
    matrix = matrix_with_band(size, width, seed)
    row, column = np.tril_indices(size)
    within = row - column <= width
    row, column = row[within], column[within]
    band = Band(size, width)
    band.flat[band.place(row, column)] = matrix[row, column]
    assert band.factor()
    right = np.random.default_rng(seed).normal(size=(size, 3))
    np.testing.assert_allclose(band.solve(right), np.linalg.solve(matrix, right), rtol=1e-8, atol=1e-12)
    inverse = np.linalg.inv(matrix)
    np.testing.assert_allclose(band.inverse().at(row, column), inverse[row, column], rtol=1e-8, atol=1e-12)
    assert band.holds(row, column).all()


def test_what_is_not_positive_definite_is_told() -> None:
    band = Band(3, 1)
    band.flat[band.place(np.arange(3), np.arange(3))] = [1.0, -1.0, 1.0]
    assert not band.factor()
    for middle in (-1.0, 0.0):
        blocks = np.stack([np.eye(6), middle * np.eye(6)])
        assert not Sparse(2, np.arange(2), np.arange(2), blocks).factor()


@pytest.mark.slow
@pytest.mark.parametrize("free", [False, True])
def test_a_sparse_factor_gives_the_same_adjustment(monkeypatch: pytest.MonkeyPatch, *, free: bool) -> None:
    spec = Spec(flight=Flight(photos=20, strips=4), points=Points(rows=3, extra_per_model=3))
    problem = problem_of(simulate(spec))
    if free:
        problem = type(problem)(problem.images, problem.cameras, problem.start)
    banded = solve(problem)
    expected = cofactors_of(banded)
    monkeypatch.setattr(reduced, "WIDE", 0.0)
    sparse = solve(problem)
    found = cofactors_of(sparse)
    np.testing.assert_allclose(sparse.points, banded.points, atol=1e-7)
    for name in ("points", "photos", "image_residuals", "control_residuals"):
        one, other = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(one, other, atol=1e-8 * max(np.nanmax(np.abs(other), initial=0.0), 1e-30))
