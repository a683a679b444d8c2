"""Random numbers, the world against PROJ, and where points lie: enough for every pair and triple of photos."""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from pyproj import Geod, Transformer
from scipy import stats

from photostrip.simulation import DIGITAL, FILM, Flight, Ground, Simulation, Spec, Terrain, simulate
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.flight import world

COUNT = 200_000
FIRST_UNIFORM = [0.8540335896190759, 0.4272927861607856, 0.8629217443697507]
FIRST_NORMAL = [-1.7606477915568635, 1.9928484588802229, 0.1449612161854251]


def test_uniform_numbers_are_those_of_numpys_generator_on_the_same_bits() -> None:
    bits = np.random.PCG64(np.random.SeedSequence(7, spawn_key=(int(Purpose.IMAGE), 0)))
    assert np.array_equal(Draws(7, Purpose.IMAGE).uniform(50), np.random.Generator(bits).random(50))


def test_the_first_numbers_never_change() -> None:
    assert Draws(1, Purpose.FLIGHT).uniform(3).tolist() == FIRST_UNIFORM
    assert Draws(1, Purpose.FLIGHT).normal(3) == pytest.approx(FIRST_NORMAL, rel=1e-14)


def test_normal_numbers_are_normal() -> None:
    drawn = Draws(3, Purpose.IMAGE).normal(COUNT)
    assert stats.kstest(drawn, "norm").pvalue > 0.01
    assert abs(np.corrcoef(drawn[:-1], drawn[1:])[0, 1]) < 4 / np.sqrt(COUNT)


GRS80 = (6378137.0, 6356752.314140356)
ELLIPSOID_SHAPE = 0.004  # a flight on normals against a geodesic: the ellipsoid is not a sphere
PLACES = [(15.3, 49.2), (-70.0, -45.0), (179.99, 5.0), (10.0, 89.0), (0.0, 0.0)]


def geodetic(xyz: np.ndarray) -> np.ndarray:
    """Longitude, latitude (degrees) and height by PROJ."""
    to_geodetic = Transformer.from_crs(
        "+proj=geocent +ellps=GRS80 +type=crs", "+proj=longlat +ellps=GRS80 +type=crs", always_xy=True
    )
    return np.stack(to_geodetic.transform(*xyz.T), axis=-1)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("heading", [0.0, 33.0, 90.0, 215.0])
def test_distances_and_directions_are_those_flown(place: tuple[float, float], heading: float) -> None:
    spec = Spec(ground=Ground(center_deg=place), flight=Flight(heading_deg=heading), terrain=Terrain(height=0.0))
    space = world(spec, GRS80)
    distances = np.array([0.0, -20_000.0, 5_000.0, 20_000.0])
    lon, lat, _ = geodetic(space.cartesian(distances, np.zeros(4), np.zeros(4))).T
    assert (lon[0], lat[0]) == pytest.approx(place, abs=1e-9)
    azimuth, _, length = Geod(ellps="GRS80").inv([place[0]] * 3, [place[1]] * 3, lon[1:], lat[1:])
    assert length == pytest.approx(np.abs(distances[1:]), rel=ELLIPSOID_SHAPE)
    turned = (np.array(azimuth) - heading - np.array([180.0, 0.0, 0.0]) + 180.0) % 360.0 - 180.0
    assert np.abs(turned).max() < np.degrees(ELLIPSOID_SHAPE)


@pytest.mark.parametrize("place", PLACES)
def test_left_is_left_and_heights_are_ellipsoidal(place: tuple[float, float]) -> None:
    space = world(Spec(ground=Ground(center_deg=place), flight=Flight(heading_deg=40.0)), GRS80)
    across, height = np.array([3_000.0, -3_000.0]), np.array([250.0, -30.0])
    lon, lat, h = geodetic(space.cartesian(np.zeros(2), across, height)).T
    assert h == pytest.approx(height, abs=1e-6)
    azimuth, _, length = Geod(ellps="GRS80").inv([place[0]] * 2, [place[1]] * 2, lon, lat)
    assert length == pytest.approx(np.abs(across), rel=ELLIPSOID_SHAPE)
    assert (np.array(azimuth) - (-50.0, 130.0) + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.25)


@given(*map(st.floats, (-179.0, -89.0, 0.0, -5e5, -2e4), (179.0, 89.0, 360.0, 5e5, 2e4)))
def test_frames_are_rotations_with_the_normal_up(lon: float, lat: float, heading: float, s: float, t: float) -> None:
    space = world(Spec(ground=Ground(center_deg=(lon, lat)), flight=Flight(heading_deg=heading)), GRS80)
    place = np.array([s]), np.array([t])
    frame = space.frames(*place)[0]
    assert frame.T @ frame == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-12)
    low, high = (space.cartesian(*place, np.array([h]))[0] for h in (0.0, 1000.0))
    assert (high - low) / 1000.0 == pytest.approx(frame[:, 2], abs=1e-8)
    ahead = space.cartesian(place[0] + 1.0, place[1], np.zeros(1))[0] - low
    assert ahead @ frame[:, 0] == pytest.approx(1.0 * np.cos(t / space.radius), rel=ELLIPSOID_SHAPE)
    assert abs(ahead @ frame[:, 1]) < ELLIPSOID_SHAPE


def photos_of(done: Simulation) -> list[set[int]]:
    """Points of each photo."""
    observations = done.observations
    return [set(observations.point[observations.photo == k].tolist()) for k in range(len(observations.photo_ids))]


@pytest.mark.slow
@hypothesis_settings(max_examples=25)
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
