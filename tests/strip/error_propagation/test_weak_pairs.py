"""Weak pairs: what six standard points give, what a narrow band costs, and that sound strips have none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.strip.relative_orientation import Pairs, base_rays, orient_pairs, solve_elements, turns
from photostrip.strip.strip_errors import times_a_good_pair

if TYPE_CHECKING:
    from photostrip.arrays import Floats


FOCAL, BASE = 100.0, 70.0
DRAWS = 2000
NOISE = 0.001  # mm


def band(spread: float, kappa: float = 0.0) -> tuple[Floats, Floats]:
    """Six points of two level photos, in rows as far apart as `spread`, the camera turned by `kappa`."""
    left = np.array([[x, y] for x in (0.0, BASE) for y in (-spread, 0.0, spread)])
    turn = np.array([[np.cos(kappa), -np.sin(kappa)], [np.sin(kappa), np.cos(kappa)]])
    return left @ turn, (left - [BASE, 0.0]) @ turn


def repeated(left: Floats, right: Floats, times: int = 1, noise: float = 0.0) -> Pairs:
    """Pairs of the same points, each measured anew."""
    rng, n = np.random.default_rng(3), len(left)
    rows = np.arange(times * n)
    return Pairs(
        starts=np.arange(times) * n,
        pair=rows // n,
        left=np.tile(left, (times, 1)) + rng.normal(0.0, noise, (times * n, 2)),
        right=np.tile(right, (times, 1)) + rng.normal(0.0, noise, (times * n, 2)),
        weight=np.ones(times * n),
        focal=FOCAL,
        point=rows % n,
        rows=np.column_stack([rows, rows]),
    )


def of(left: Floats, right: Floats) -> float:
    (found,) = times_a_good_pair(orient_pairs(repeated(left, right), ("1", "2")))
    return float(found)


def scatter(elements: Floats, pairs: Pairs) -> float:
    """Rms scatter of points intersected with given elements, as the left photo sees them."""
    (x1, y1, z1), (x2, y2, z2) = base_rays(elements, pairs)
    x1, y1, x2, y2 = -x1 / z1, -y1 / z1, -x2 / z2, -y2 / z2
    in_base = np.column_stack([x1, (y1 + y2) / 2, -np.ones(len(x1))]) / (x1 - x2)[:, None]
    rotations = turns(elements)[0][pairs.pair]
    points = np.einsum("mi,mij->mj", in_base, rotations).reshape(pairs.size, -1, 3)
    return float(np.sqrt(points.var(axis=0).sum(axis=1).mean()))


@pytest.mark.parametrize(("spread", "kappa"), [(BASE / 8, 0.0), (BASE / 3, 2.0), (1.3 * BASE, 1.0)])
def test_points_scatter_as_many_times_as_in_a_good_pair(spread: float, kappa: float) -> None:
    """Pairs measured anew, their points intersected with their own elements and with those of good pairs."""
    measured = repeated(*band(spread, kappa), DRAWS, NOISE)
    good = repeated(*band(BASE, kappa), DRAWS, NOISE)
    by_itself, by_good = (scatter(solve_elements(pairs).elements, measured) for pairs in (measured, good))
    assert of(*band(spread, kappa)) == pytest.approx(by_itself / by_good, rel=0.05)
