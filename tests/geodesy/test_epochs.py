"""Changes of datum are told; in frames that move, the epoch counts and is asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from photostrip.errors import InputError
from photostrip.geodesy.frame_spec import GROUND_AXES, FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Flight, Ground, Spec
from photostrip.simulation.simulation import simulate
from tests.simulated import inputs_of, settings_of

pytestmark = pytest.mark.usefixtures("_no_findings")

ETRS89, ITRF2020 = FrameSpec("EPSG:4937", GROUND_AXES), FrameSpec("EPSG:9989", GROUND_AXES)
PLACE = np.array([[11.5, 48.2, 500.0]])  # Munich
METRES_IN_DEGREE = np.array([74_300.0, 111_200.0, 1.0])


def moved(spec: FrameSpec, output: FrameSpec) -> np.ndarray:
    """Bring a place from one frame to another; east, north, up in metres from where it was."""
    (frame,), target = tie_frames([spec], output)
    there = target.ground_from_cartesian(frame.cartesian_from_ground(PLACE))
    return np.asarray((there - PLACE)[0] * METRES_IN_DEGREE)


@pytest.mark.slow
@pytest.mark.parametrize("dated", ["list", "output"])
def test_europe_moves_north_east_by_the_epoch(dated: str) -> None:
    """About 2.5 cm a year against ITRF, on whichever side the epoch stands."""
    found = []
    for epoch in (2015.0, 2025.0):
        spec, output = replace(ETRS89, epoch=epoch), ITRF2020
        if dated == "output":
            spec, output = ETRS89, replace(ITRF2020, epoch=epoch)
        found.append(moved(spec, output))
    assert (found[1] - found[0])[:2] / 10.0 == pytest.approx([0.0200, 0.0160], abs=0.006)
    assert moved(ETRS89, ITRF2020) == pytest.approx(found[0])


def test_two_epochs_are_refused() -> None:
    """Points would have to be moved from one to the other."""
    with pytest.raises(InputError, match="moves no points from one to another") as caught:
        tie_frames([replace(ETRS89, epoch=2015.0)], replace(ITRF2020, epoch=2020.0))
    assert [fault.code for fault in caught.value.faults] == ["epochs"]


def notes(crs: str, output: FrameSpec) -> dict[str, str]:
    """Notes of a run by their codes."""
    simulation = simulate(Spec(seed=3, flight=Flight(photos=4), ground=Ground(crs, center_deg=(11.5, 48.2))))
    inputs = replace(inputs_of(simulation), output=output)
    return {note.code: note.message for note in triangulate(inputs, settings_of(simulation)).notes}


@pytest.mark.slow
def test_a_change_of_datum_is_told_with_its_accuracy_and_area() -> None:
    """It was not told at all."""
    told = notes("EPSG:31468", FrameSpec("EPSG:25832", GROUND_AXES))
    assert "DHDN to ETRS89" in told["datum-change"]
    assert "accuracy 1 m" in told["datum-change"]
    assert "made for Germany" in told["datum-change"]
    assert "epoch-missing" not in told


@pytest.mark.slow
def test_an_epoch_is_asked_for_where_it_matters() -> None:
    """Ten years are 0.3 m, the control is good to 0.05 m."""
    told = notes("EPSG:25832", ITRF2020)
    assert "no `epoch` is given: that of the operation, 2015.0, is taken" in told["epoch-missing"]
    told = notes("EPSG:25832", replace(ITRF2020, epoch=2025.5))
    assert "epoch-missing" not in told
    assert told["datum-change"].endswith("coordinates of 2025.5")
