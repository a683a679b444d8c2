"""Where the points lie: enough for every pair and every triple of photos, named, and as many as asked for."""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from photostrip.simulation import DIGITAL, FILM, Flight, Ground, Simulation, Spec, Terrain, simulate


def photos_of(done: Simulation) -> list[set[int]]:
    """Points of each photo."""
    observations = done.observations
    return [set(observations.point[observations.photo == k].tolist()) for k in range(len(observations.photo_ids))]


@pytest.mark.slow
@hypothesis_settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    lap=st.floats(62.0, 85.0),
    heading=st.floats(0.0, 360.0),
    rotation=st.floats(-180.0, 180.0),
    relief=st.floats(0.0, 150.0),
    camera=st.sampled_from([FILM, DIGITAL]),
    latitude=st.floats(-75.0, 75.0),
)
def test_every_pair_and_triple_has_its_points(
    seed: int, lap: float, heading: float, rotation: float, relief: float, camera: object, latitude: float
) -> None:
    done = simulate(
        Spec(
            seed=seed,
            camera=FILM if camera is FILM else DIGITAL,
            ground=Ground(crs="EPSG:4979", center_deg=(20.0, latitude)),
            flight=Flight(end_lap_percent=lap, heading_deg=heading, photo_rotation_deg=rotation),
            terrain=Terrain(relief=relief),
        )
    )
    on = photos_of(done)
    assert min(len(a & b) for a, b in itertools.pairwise(on)) >= 9
    assert min(len(a & b & c) for a, b, c in zip(on, on[1:], on[2:], strict=False)) >= 3
    assert min(Counter(done.observations.point.tolist()).values()) >= 2


def test_overlaps_are_those_asked_for() -> None:
    flight = Flight(
        strips=2, end_lap_percent=62.0, side_lap_percent=25.0, position_sigma=(0.0, 0.0, 0.0), flying_height=1530.0
    )
    centers = simulate(Spec(ground=Ground(crs="local"), flight=flight)).truth.centers.reshape(2, 10, 3)
    assert np.diff(centers[0, :, 0]) == pytest.approx(0.38 * 2300.0)
    assert centers[1, :, 1] - centers[0, :, 1] == pytest.approx(0.75 * 2300.0)
    assert centers[..., 2] == pytest.approx(1830.0)


def test_points_that_nobody_can_see_refuse_the_strip() -> None:
    from photostrip.errors import InputError

    with pytest.raises(
        InputError, match=r"no point lies on photos 1\d\d\d, 1\d\d\d and 1\d\d\d; raise end_lap_percent"
    ) as caught:
        simulate(Spec(flight=Flight(attitude_sigma_deg=(9.0, 9.0, 9.0), photos=30)))
    assert caught.value.exit_code == 2
