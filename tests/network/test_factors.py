"""The factor of a band, and the elements of its inverse, against dense algebra."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from photostrip.network.normal_equations import Band

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
    band = Band(size, width, 6)
    band.flat[band.place(row, column)] = matrix[row, column]
    assert band.factor()
    right = np.random.default_rng(seed).normal(size=(size, 3))
    np.testing.assert_allclose(band.solve(right), np.linalg.solve(matrix, right), rtol=1e-8, atol=1e-12)
    inverse = np.linalg.inv(matrix).reshape(photos, 6, photos, 6).swapaxes(1, 2)
    one, other = np.indices((photos, photos))
    held = band.holds(one, other)
    assert (held == (np.abs(one - other) <= near)).all()
    np.testing.assert_allclose(band.inverse().blocks(one[held], other[held]), inverse[held], rtol=1e-8, atol=1e-12)


def test_what_is_not_positive_definite_is_told() -> None:
    band = Band(3, 1, 1)
    band.flat[band.place(np.arange(3), np.arange(3))] = [1.0, -1.0, 1.0]
    assert not band.factor()
