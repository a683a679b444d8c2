"""Zones joined through common points, against the formulas of two known projections."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import Transformer

from photostrip.geodesy.crs import join_zones

WEST, EAST = "EPSG:28404", "EPSG:28405"  # Gauss zones of 6 degrees, north first; they meet at 24 degrees
TO_EAST = Transformer.from_crs(WEST, EAST)


def in_both(points: int, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Points at the boundary in both zones, east first, metres."""
    rng = np.random.default_rng(points)
    middle = Transformer.from_crs("EPSG:4284", WEST).transform(42.5, 24.0)
    west = np.array(middle) + rng.uniform(-reach, reach, (points, 2))
    east = np.column_stack(TO_EAST.transform(*west.T))
    return west[:, ::-1], east[:, ::-1]


@pytest.mark.parametrize(("points", "degree", "largest"), [(2, 1, 30.0), (3, 2, 0.5), (4, 3, 0.002), (8, 3, 0.002)])
def test_each_power_brings_the_zones_together(points: int, degree: int, largest: float) -> None:
    """Errors at other points within 20 km of the boundary's middle: metres, decimetres, millimetres."""
    joint = join_zones(*in_both(points, 20_000.0))
    assert joint.degree == degree
    assert joint.redundancy == 2 * (points - degree - 1)
    west, east = in_both(50, 20_000.0)
    error = np.abs(joint(west) - east).max()
    assert largest / 1000 < error < largest
    if joint.redundancy == 0:
        assert np.abs(joint.residuals).max() < 1e-6


def test_a_wrong_point_stands_out() -> None:
    west, east = in_both(8, 20_000.0)
    east[3, 0] += 1.0
    assert int(np.linalg.norm(join_zones(west, east).residuals, axis=1).argmax()) == 3
