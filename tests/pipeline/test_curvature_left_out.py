"""Local coordinates of a long strip may be plane map coordinates: what they would leave out is said."""

from __future__ import annotations

from dataclasses import replace

import pytest

from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, Spec
from photostrip.simulation.simulation import simulate
from tests.simulated import inputs_of, settings_of


def remarks(photos: int, curvature: str = "auto") -> list[str]:
    """Remarks on curvature of a strip whose map coordinates are given as local ones."""
    simulation = simulate(Spec(seed=2, flight=Flight(photos=photos), control=Control(bands=3)))
    inputs, settings = inputs_of(simulation), settings_of(simulation)
    inputs = replace(inputs, frames=(replace(inputs.frames[0], crs="local"),))
    settings = replace(settings, absolute=replace(settings.absolute, earth_curvature=curvature))
    return [note.message for note in triangulate(inputs, settings).notes if note.code == "curvature-left-out"]


def test_what_is_left_out_is_said_with_the_key_that_takes_it_in() -> None:
    """Eleven bases of 920 m: the middle lies 5.1 km from the ends."""
    (message,) = remarks(12)
    assert "2.1" in message
    assert "`earth_curvature: model`" in message


@pytest.mark.parametrize(("photos", "curvature"), [(3, "auto"), (12, "model"), (12, "none")])
def test_nothing_is_said_where_it_is_small_or_decided(photos: int, curvature: str) -> None:
    """A strip of 2 km falls by 0.1 m."""
    assert remarks(photos, curvature) == []
