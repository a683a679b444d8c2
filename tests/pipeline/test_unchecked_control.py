"""Control that cannot check itself says so, whatever its residuals."""

from __future__ import annotations

from dataclasses import replace

import pytest

from photostrip.pipeline.run import triangulate
from photostrip.simulation import Control, Flight, Spec
from photostrip.simulation.simulation import simulate
from tests.simulated import inputs_of, settings_of


def remarks(control: Control, method: str, photos: int = 8, strips: int = 1) -> list[str]:
    """Messages on control that does not check itself."""
    simulation = simulate(Spec(seed=4, flight=Flight(photos=photos, strips=strips), control=control))
    result = triangulate(inputs_of(simulation), replace(settings_of(simulation), adjustment=method))
    return [each.message for each in result.notes if each.code == "unchecked-control"]


@pytest.mark.parametrize(("method", "photos"), [("polynomial", 8), ("bundle", 15)])
def test_five_points_hardly_check_each_other(method: str, photos: int) -> None:
    """One of them may be wrong by metres in height: the strip bends with it."""
    (message,) = remarks(Control(layout="corners+centre"), method, photos)
    assert "m in height" in message


@pytest.mark.parametrize("method", ["polynomial", "bundle"])
def test_three_bands_of_three_check_each_other(method: str) -> None:
    """An error of any of them stands out."""
    assert remarks(Control(bands=3), method) == []
