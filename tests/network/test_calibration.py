"""Self-calibration: the parameters of the table are those that the formulas correct by."""

from __future__ import annotations

import numpy as np
import pytest

from photostrip.network.calibration import corrections
from photostrip.network.settings import ASKED, CALIBRATION


def test_corrections_grow_with_the_distance_by_the_powers_of_the_table() -> None:
    xy = np.array([30.0, -50.0])
    powers = [each.power for each in CALIBRATION.values()]
    assert corrections(2 * xy) == pytest.approx(2.0 ** np.array(powers)[:, None] * corrections(xy))


def test_units_make_millimetres_of_what_a_user_asks_for() -> None:
    assert ASKED == ("principal_distance", "principal_point", "k1", "k2", "k3", "p1", "p2", "affinity", "shear")
    units = {name: (each.title, each.unit) for name, each in CALIBRATION.items()}
    assert [units[name] for name in ("c", "y0", "k2", "p1", "b2")] == [
        ("principal_distance", "mm"), ("principal_point y", "mm"), ("k2", "mm^-4"), ("p1", "mm^-1"), ("shear", "1"),
    ]  # fmt: skip
