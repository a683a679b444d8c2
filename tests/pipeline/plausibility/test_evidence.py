"""Heights of the photos above what they show."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from photostrip.pipeline.plausibility import evidence

if TYPE_CHECKING:
    from photostrip.pipeline.strips.photos import FormedPhotos
    from photostrip.strip.relative_orientation.orientation import Orientation


def test_the_depth_is_the_height_above_the_mean_of_the_points_of_a_model() -> None:
    """Two models: three points, one of them without coordinates; one point."""
    centers = np.array([[0.0, 0.0, 10.0], [1.0, 0.0, 11.0], [2.0, 0.0, 12.0]])
    points = np.array([[0.0, 1.0, 2.0], [0.0, -1.0, 4.0], [np.nan] * 3, [1.5, 0.0, 6.0]])
    pairs = SimpleNamespace(pair=np.array([0, 0, 0, 1]), size=2)
    orientation = cast("Orientation", SimpleNamespace(pairs=pairs, used=np.ones(4, bool)))
    formed = SimpleNamespace(rotations=np.tile(np.eye(3), (3, 1, 1)), model_xyz=points, xyz=points, centers=centers)
    stage = cast("FormedPhotos", SimpleNamespace(orientation=orientation, formed=formed))
    assert evidence.depth(stage) == pytest.approx([10.0 - 3.0, 11.0 - 3.0, 12.0 - 6.0])
