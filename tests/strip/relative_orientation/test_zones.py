"""Standard zones, whatever way the photos are turned, and what may be taken from them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.strip.relative_orientation import zones
from tests.strips import true_pairs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


def zone_of(counts: Sequence[int]) -> NDArray[np.int64]:
    return np.repeat(np.arange(1, 7), counts)


@pytest.mark.parametrize("counts", [(1,) * 6, (2, 2, 3, 3, 3, 3), (5,) * 6])
def test_points_around_the_standard_positions_have_their_zones(counts: Sequence[int]) -> None:
    # 50 pairs with tilts up to 5 degrees, any azimuth: the zones are those of the base frame, not of the photo
    flown = true_pairs(np.random.default_rng(1), 50, counts=counts)
    oriented = flown.orient()
    found = zones(oriented.elements, oriented.pairs).reshape(50, -1)
    assert (found == zone_of(counts)).mean() > 0.995
