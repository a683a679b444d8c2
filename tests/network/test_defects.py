"""The names of what is not determined: axes of the flight, lines of control."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from photostrip.geometry.rotation import from_vector
from photostrip.network import defects

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from photostrip.network.problem import Parameters


def state(centers: NDArray[np.float64], heading: float = 0.0) -> Parameters:
    turn = from_vector([0.0, 0.0, heading])
    return cast("Parameters", SimpleNamespace(centers=centers, rotations=np.tile(turn, (len(centers), 1, 1))))


def flown(heading: float) -> NDArray[np.float64]:
    """Five centres in a direction, far from the origin."""
    way = np.array([np.cos(heading), np.sin(heading), 0.0])
    return np.asarray(np.array([40_000.0, -90_000.0, 1500.0]) + np.arange(5)[:, None] * 900.0 * way)


def test_the_flight_goes_from_photo_to_photo_wherever_it_is() -> None:
    flight, across, up = defects._flight_axes(state(flown(0.5)), np.arange(5))
    assert abs(flight @ [np.cos(0.5), np.sin(0.5), 0.0]) == pytest.approx(1.0, abs=1e-12)
    assert up == pytest.approx([0.0, 0.0, 1.0])
    assert across == pytest.approx(np.cross(up, flight))


@pytest.mark.parametrize(
    ("degrees", "name"),
    [
        (18.0, "roll about the flight line"),
        (22.0, "the rotation about the line of control"),
        (68.0, "the rotation about the line of control"),
        (72.0, "pitch"),
    ],
)
def test_a_line_of_control_within_20_degrees_of_an_axis_has_its_name(degrees: float, name: str) -> None:
    line = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
    none = np.zeros((7, 7))
    places = np.arange(3)[:, None] * 1000.0 * line
    held = defects.Held(photos=np.arange(5), normal=none, control=places, motion=none, sigma=1.0)
    loose = np.concatenate([np.zeros(3), line, [0.0]])[:, None]
    assert defects._moves(state(flown(0.0)), held, loose).split(", ")[0] == name
