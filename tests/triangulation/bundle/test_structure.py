"""The order of photos that makes the normal equations a narrow band."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from photostrip.triangulation.bundle.structure import _narrower


def block(strips: int, photos: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of photos of a block, mixed: two apart along a strip, and neighbours across."""
    strip, place = np.divmod(np.arange(strips * photos), photos)
    one, other = np.tril_indices(strips * photos)
    near = (np.abs(strip[one] - strip[other]) <= 1) & (np.abs(place[one] - place[other]) <= 2)
    return one[near], other[near]


@pytest.mark.parametrize("seed", range(4))
def test_mixed_photos_come_into_as_narrow_a_band_as_scipy_finds(seed: int) -> None:
    rows, columns = block(4, 15)
    mixed = np.random.default_rng(seed).permutation(60)
    rows, columns = mixed[rows], mixed[columns]
    rank = _narrower(rows, columns, 60)
    ones = np.ones(2 * len(rows))
    both = np.concatenate([rows, columns]), np.concatenate([columns, rows])
    other = np.argsort(reverse_cuthill_mckee(coo_array((ones, both)).tocsr(), symmetric_mode=True))
    assert rank is not None
    assert sorted(rank) == list(range(60))
    assert np.abs(rank[rows] - rank[columns]).max() <= np.abs(other[rows] - other[columns]).max() + 2


def test_parts_without_common_points_stand_one_after_the_other() -> None:
    place = np.arange(0, 40, 2)
    rows, columns = np.concatenate([place[1:], place[1:] + 1]), np.concatenate([place[:-1], place[:-1] + 1])
    rank = _narrower(rows, columns, 40)
    assert rank is not None
    assert np.abs(rank[rows] - rank[columns]).max() == 1
    assert sorted(rank) == list(range(40))


def test_a_band_that_is_as_narrow_as_any_stays() -> None:
    assert _narrower(np.arange(1, 9), np.arange(8), 9) is None
