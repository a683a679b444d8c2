"""Random numbers, where points and control lie, the world against PROJ, and what cannot be simulated."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from pyproj import Geod, Transformer
from scipy import stats

from photostrip.camera import Distortion
from photostrip.errors import InputError
from photostrip.points import locate
from photostrip.simulation import (
    DIGITAL,
    FILM,
    Control,
    Film,
    Flight,
    GrossError,
    Ground,
    Image,
    Points,
    Simulation,
    Spec,
    Terrain,
    simulate,
)
from photostrip.simulation.draws import Draws, Purpose
from photostrip.simulation.flight import world
from photostrip.simulation.placement import band_photos
from tests.loops import nonempty

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


def true_ground(done: Simulation, ids: tuple[str, ...]) -> np.ndarray:
    """True coordinates of points in the output frame."""
    return done.truth.ground.xyz[locate(ids, done.truth.ground.ids)]


def stations(done: Simulation) -> list[list[int]]:
    """Photos on which each control point lies."""
    o = done.observations
    number = {name: k for k, name in enumerate(o.point_ids)}
    control = [name for name, check in zip(done.control.ids, done.control.check, strict=True) if not check]
    return [sorted(o.photo[o.point == number[name]].tolist()) for name in control]


@pytest.mark.parametrize(
    ("photos", "bands", "every", "expected"),
    [
        (21, 3, None, [0, 10, 20]),
        (21, 4, None, [0, 7, 13, 20]),
        (10, 1, None, [4]),
        (10, 2, None, [0, 9]),
        (21, 3, 5, [0, 5, 10, 15, 20]),
        (20, 3, 5, [0, 5, 10, 15, 19]),
        (3, 3, None, [0, 1, 2]),
    ],
)
def test_bands(photos: int, bands: int, every: int | None, expected: list[int]) -> None:
    spec = Spec(flight=Flight(photos=photos), control=Control(bands=bands, every=every))
    assert band_photos(spec) == expected
    done = simulate(spec)
    seen = stations(done)
    assert len(seen) == 3 * len(expected)
    assert all(station in seen[3 * k + i] for k, station in nonempty(enumerate(expected)) for i in range(3))


@pytest.mark.parametrize("crs", ["EPSG:32633", "EPSG:4979", "geocentric", "local"])
def test_noise_is_normal_and_as_large_as_stated(crs: str) -> None:
    sigma = np.array([0.03, 0.06, 0.12])
    spec = Spec(
        flight=Flight(photos=150),
        ground=Ground(crs=crs, center_deg=(15.0, 0.0)),
        points=Points(extra_per_model=9),
        control=Control(layout="random", count=1500, check=0, sigma=(0.03, 0.06, 0.12)),
    )
    done = simulate(spec)
    error = done.control.enu - true_ground(done, done.control.ids)
    if crs == "EPSG:4979":
        error *= np.radians(6_378_000.0), np.radians(6_335_000.0), 1.0  # metres per degree at the equator
    for column, s in nonempty(zip(error.T, sigma, strict=True)):
        assert column.std() == pytest.approx(s, rel=4 / np.sqrt(2 * 1500))
        assert stats.kstest(column / s, "norm").pvalue > 0.01
    assert done.control.sigma == pytest.approx(np.tile(sigma, (1500, 1)))
    double = simulate(replace(spec, control=replace(spec.control, noise=(0.06, 0.12, 0.24))))
    assert double.control.sigma == pytest.approx(done.control.sigma)
    assert double.control.enu - done.control.enu == pytest.approx(
        done.control.enu - true_ground(done, done.control.ids), abs=1e-6
    )


NAN = float("nan")


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (Spec(flight=Flight(photos=1)), "flight.photos: 1 photo cannot make a strip"),
        (Spec(flight=Flight(photos=200, strips=200)), "flight.photos: 40000 photos are too many"),
        (
            Spec(flight=Flight(end_lap_percent=-10.0)),
            "an end lap of -10 % cannot be simulated: .*; expected more than 50 and at most 95",
        ),
        (Spec(flight=Flight(end_lap_percent=NAN)), "flight.end_lap_percent: an end lap of nan %"),
        (Spec(flight=Flight(scale=5000.0, flying_height=800.0)), "flight.scale: scale and flying_height are both"),
        (Spec(flight=Flight(heading_deg=NAN)), "flight.heading_deg: nan degrees is out of range"),
        (Spec(flight=Flight(attitude_sigma_deg=(1.0, 80.0, 1.0))), "flight.attitude_sigma_deg: 80 degrees"),
        (Spec(terrain=Terrain(relief=1400.0)), "terrain.relief: the terrain rises to 1400 m"),
        (Spec(points=Points(rows=1)), "points.rows: 1 is out of range; expected 2 to 50"),
        (Spec(flight=Flight(photos=20_000), points=Points(extra_per_model=9_000)), "points are too many"),
        (Spec(control=Control(layout="circle")), "control.layout: the layout 'circle' is not known; expected bands"),
        (Spec(control=Control(per_band=4)), "control.per_band: 4 is out of range; expected 1 to 3"),
        (Spec(control=Control(use={"xz": 1.0})), "control.use.xz: 'xz' is no set of coordinates; expected xyz"),
        (Spec(control=Control(sigma=(0.0, 1.0, 1.0))), "control.sigma: 0 m is out of range"),
        (Spec(control=Control(boundary_longitude_deg=3.0)), "a boundary needs a second frame"),
        (Spec(ground=Ground(crs="local"), control=Control(second_crs="EPSG:32633")), "nobody knows where `local` lies"),
        (Spec(image=Image(sigma_um=-5.0)), "image.sigma_um: -5 um is out of range"),
        (Spec(image=Image(unit="px")), "image.unit: pixels need a size; add camera.pixel_size"),
        (Spec(camera=DIGITAL, film=Film()), "film: the film is deformed, but the camera has no three fiducial marks"),
        (Spec(camera=replace(FILM, format=None)), "camera.format: the camera has no format"),
        (
            Spec(camera=replace(FILM, distortion=Distortion("brown", "image_to_ideal", k=(-1e-3, 0.0, 0.0)))),
            "camera.distortion: camera film: the distortion has no inverse",
        ),
        (Spec(gross_errors=(GrossError("typo"),)), r"gross_errors\[0\].kind: .* of kind 'typo' are not known"),
        (Spec(gross_errors=(GrossError("image", axis="z"),)), "axis: an error of kind image has no axis 'z'"),
        (Spec(gross_errors=(GrossError("control", photo="1001"),)), "control is given on the ground"),
        (Spec(ground=Ground(crs="EPSG:99999999")), "PROJ does not know the coordinate reference system"),
        (
            Spec(flight=Flight(photos=2000, flying_height=100_000.0), ground=Ground(crs="EPSG:4979")),
            "strips of 120261 km are too long for a body of 6382 km radius",
        ),
    ],
)
def test_refused(spec: Spec, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        simulate(spec)
    assert caught.value.exit_code == 2


def test_all_faults_at_once() -> None:
    spec = Spec(
        flight=Flight(photos=0, heading_deg=1e9), image=Image(unit="inch", sigma_um=-1.0), control=Control(layout="?")
    )
    with pytest.raises(InputError) as caught:
        simulate(spec)
    keys = [fault.key for fault in caught.value.faults]
    assert keys == ["flight.photos", "flight.heading_deg", "control.layout", "image.sigma_um", "image.unit"]
