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
from photostrip.triangulation.bundle.normal_equations.factored import Inverse
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
@given(st.integers(1, 27), st.integers(0, 12), st.integers(0, 1000))
def test_a_band_is_factored_solved_and_inverted(photos: int, near: int, seed: int) -> None:
    size, near = 6 * photos, min(near, photos - 1)
    width = 6 * (near + 1) - 1
    matrix = matrix_with_band(size, width, seed)
    row, column = np.tril_indices(size)
    within = row - column <= width
    row, column = row[within], column[within]
    band = Band(size, width)
    band.flat[band.place(row, column)] = matrix[row, column]
    assert band.factor()
    right = np.random.default_rng(seed).normal(size=(size, 3))
    np.testing.assert_allclose(band.solve(right), np.linalg.solve(matrix, right), rtol=1e-8, atol=1e-12)
    inverse = np.linalg.inv(matrix).reshape(photos, 6, photos, 6).swapaxes(1, 2)
    one, other = np.indices((photos, photos))
    held = band.holds(one, other)
    assert (held == (np.abs(one - other) <= near)).all()
    np.testing.assert_allclose(band.inverse().blocks(one[held], other[held]), inverse[held], rtol=1e-8, atol=1e-12)


def test_photos_beyond_the_band_have_their_cofactors_too() -> None:
    """Points of which rays are outside may lie on photos that no point joins any more."""
    photos, near = 9, 2
    matrix = matrix_with_band(6 * photos, 6 * (near + 1) - 1, 5)
    band = Band(6 * photos, 6 * (near + 1) - 1)
    row, column = np.tril_indices(6 * photos)
    within = row - column <= band.width
    band.flat[band.place(row[within], column[within])] = matrix[row[within], column[within]]
    assert band.factor()
    nothing = np.zeros((photos, 6, 0))
    inverse = Inverse(band=band.inverse(), cross=nothing, common=np.zeros((0, 0)), factor=band)
    sets = np.array([[0, 1, 2], [7, 0, 4], [3, 8, 5]])
    dense = np.linalg.inv(matrix).reshape(photos, 6, photos, 6).swapaxes(1, 2)
    expected = dense[sets[:, :, None], sets[:, None, :]]
    np.testing.assert_allclose(inverse.blocks(sets), expected, rtol=1e-8, atol=1e-12)
    whole = inverse.cofactors(sets, 0)
    np.testing.assert_allclose(whole, expected.swapaxes(2, 3).reshape(3, 18, 18), rtol=1e-8, atol=1e-12)


def test_a_sparse_inverse_gives_blocks_of_both_halves() -> None:
    matrix = matrix_with_band(30, 11, 3)  # five photos, each with its neighbours
    rows, columns = np.array([0, 1, 1, 2, 2, 3, 3, 4, 4]), np.array([0, 0, 1, 1, 2, 2, 3, 3, 4])
    blocks = matrix.reshape(5, 6, 5, 6).swapaxes(1, 2)
    matrix = np.where(np.abs(np.subtract.outer(np.arange(30) // 6, np.arange(30) // 6)) < 2, matrix, 0.0)
    sparse = Sparse(5, rows, columns, blocks[rows, columns])
    assert sparse.factor()
    inverse, dense = sparse.inverse(), np.linalg.inv(matrix).reshape(5, 6, 5, 6).swapaxes(1, 2)
    one, other = np.append(rows, columns), np.append(columns, rows)
    assert inverse.holds(one, other).all()
    assert not inverse.holds(np.array([0, 4]), np.array([2, 1])).any()
    np.testing.assert_allclose(inverse.blocks(one, other), dense[one, other], rtol=1e-8, atol=1e-12)


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
