"""Heights of the photos above what they show."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from photostrip.pipeline.plausibility.evidence import EvidenceStrip

if TYPE_CHECKING:
    from photostrip.pipeline.inputs import Strip
    from photostrip.strip.relative_orientation.orientation import Orientation
    from photostrip.strip.strip_formation.strip import FormedStrip


def test_the_depth_is_the_height_above_the_mean_of_the_points_of_a_model() -> None:
    """Two models: three points, one of them without coordinates; one point."""
    centers = np.array([[0.0, 0.0, 10.0], [1.0, 0.0, 11.0], [2.0, 0.0, 12.0]])
    points = np.array([[0.0, 1.0, 2.0], [0.0, -1.0, 4.0], [np.nan] * 3, [1.5, 0.0, 6.0]])
    pairs = SimpleNamespace(pair=np.array([0, 0, 0, 1]), size=2)
    orientation = cast("Orientation", SimpleNamespace(pairs=pairs, used=np.ones(4, bool)))
    formed = SimpleNamespace(rotations=np.tile(np.eye(3), (3, 1, 1)), model_xyz=points, xyz=points, centers=centers)
    strip = EvidenceStrip(cast("Strip", None), orientation, cast("FormedStrip", formed))
    assert strip.depth == pytest.approx([10.0 - 3.0, 11.0 - 3.0, 12.0 - 6.0])


@pytest.mark.parametrize(("degrees", "by_ground"), [(10.0, False), (45.0, True)])
def test_control_is_laid_on_the_normal_of_the_ground_under_an_oblique_mount(degrees: float, *, by_ground: bool) -> None:
    """Cameras that look aside do not say what is upwards; those that are tilted a little do."""
    side = np.radians(degrees)
    turn = np.array([[1, 0, 0], [0, np.cos(side), -np.sin(side)], [0, np.sin(side), np.cos(side)]])
    points = np.array([[0.0, 0.0, 0.1], [4.0, 0.0, 0.0], [0.0, 2.0, 0.0], [4.0, 2.0, 0.1], [2.0, 1.0, -0.1]])
    formed = SimpleNamespace(rotations=np.tile(turn, (3, 1, 1)), xyz=points)
    strip = EvidenceStrip(cast("Strip", None), cast("Orientation", None), cast("FormedStrip", formed))
    wanted = np.array([0.0, 0.0, 1.0]) if by_ground else turn[:, 2]
    assert strip.axes == pytest.approx(np.tile(wanted, (3, 1)), abs=0.03)
