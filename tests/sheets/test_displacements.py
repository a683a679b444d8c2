"""The turns of cameras in the result of a survey."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np

from photostrip.sheets.displacements import camera_row

if TYPE_CHECKING:
    from photostrip.terrestrial.monitoring import CameraState, Monitoring


def test_stable_points_that_lost_all_weight_are_not_counted() -> None:
    weights = np.array([[1.0, 1.0], [0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
    turn = SimpleNamespace(values=np.zeros(3), sigma=np.ones(3), weights=weights, dof=3, statistic=1.0)
    state = SimpleNamespace(epoch=0, side="left", turn=turn, moved=False, removed=False)
    result = SimpleNamespace(series=SimpleNamespace(epochs=("1",)), settings=SimpleNamespace(significance=0.05))
    row = camera_row(cast("Monitoring", result), cast("CameraState", state))
    assert row[8:10] == (3, 3)  # stable points, redundancy
