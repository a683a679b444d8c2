"""The simulated world against PROJ's geodesics and coordinates."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod, Transformer

from photostrip.simulation import Flight, Ground, Spec, Terrain
from photostrip.simulation.flight import world

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


@given(
    st.floats(-179.0, 179.0),
    st.floats(-89.0, 89.0),
    st.floats(0.0, 360.0),
    st.floats(-5e5, 5e5),
    st.floats(-2e4, 2e4),
)
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
