"""Draws at right angles are normal draws, and know a variance better than independent ones."""

from __future__ import annotations

import numpy as np
import pytest

from tests.draws import orthogonal_normal


def test_rows_of_a_block_are_at_right_angles_and_all_values_normal() -> None:
    draws = orthogonal_normal(np.random.default_rng(1), 250, 100)
    assert draws.shape == (250, 100)
    for block in (draws[:100], draws[100:200], draws[200:]):
        product = block @ block.T
        assert np.abs(product - np.diag(np.diagonal(product))).max() < 1e-9
    assert (draws**2).sum(axis=1).var() == pytest.approx(200.0, rel=0.3)  # chi-square of a hundred
    assert [np.mean(np.abs(draws) < limit) for limit in (0.6745, 1.96, 2.576)] == pytest.approx(
        [0.50, 0.95, 0.99], abs=0.01
    )


def test_a_block_knows_a_variance_as_it_says() -> None:
    rng, values = np.random.default_rng(2), 30
    found = [np.mean(orthogonal_normal(rng, values, values)[:, 0] ** 2) for _ in range(400)]
    assert np.std(found) == pytest.approx(np.sqrt(6.0) / values, rel=0.15)  # independent rows: sqrt(2 / values)
