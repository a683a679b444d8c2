"""The ellipsoid in Cartesian coordinates and the intermediate frame."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Transformer

from photostrip.geodesy.local_frame import IntermediateFrame, axes_matrix, geocentric_from_geodetic, strip_azimuth

WGS84 = (6378137.0, 6356752.314245179)
MICROMETRE = 1e-6  # m

longitude = st.floats(-np.pi, np.pi)
latitude = st.floats(-np.pi / 2, np.pi / 2)
azimuth = st.floats(-2 * np.pi, 2 * np.pi)


def rotation(axis: str, angle: float) -> np.ndarray:
    """Elementary rotation by the right-hand rule."""
    c, s = np.cos(angle), np.sin(angle)
    matrix = {
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }[axis]
    return np.array(matrix)


@given(lon=longitude, lat=latitude, height=st.floats(-11000.0, 100000.0))
def test_geocentric_coordinates_are_those_of_proj(lon: float, lat: float, height: float) -> None:
    cart = Transformer.from_pipeline("+proj=cart +ellps=WGS84")
    xyz = geocentric_from_geodetic([[lon, lat, height]], WGS84)[0]
    assert xyz == pytest.approx(cart.transform(lon, lat, height, radians=True), abs=MICROMETRE)


@given(lat=latitude, lon=longitude, a0=azimuth)
def test_axes_matrix_is_a_rotation_with_the_right_axes(lat: float, lon: float, a0: float) -> None:
    m = axes_matrix(lat, lon, a0)
    assert m.T @ m == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(m) == pytest.approx(1.0)
    product = rotation("z", lon) @ rotation("y", np.pi / 2 - lat) @ rotation("z", np.pi - a0)
    assert m == pytest.approx(product, abs=1e-14)
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    north = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
    assert m[:, 0] == pytest.approx(np.cos(a0) * north + np.sin(a0) * east, abs=1e-14)
    assert m[:, 1] == pytest.approx(np.sin(a0) * north - np.cos(a0) * east, abs=1e-14)  # azimuth A0 - 90
    assert m[:, 2] == pytest.approx(np.cross(east, north), abs=1e-14)


def test_the_printed_signs_of_eq_143_do_not_make_a_rotation() -> None:
    lat, lon, a0 = 0.74, 0.4, 1.2
    printed = axes_matrix(lat, lon, a0)
    printed[0, 1] -= 2.0 * np.sin(lon) * np.cos(a0)  # the last term of a2, and below of b1, with a minus sign
    printed[1, 0] -= 2.0 * np.cos(lon) * np.sin(a0)
    assert np.abs(printed.T @ printed - np.eye(3)).max() > 0.1


@given(
    lat=st.floats(-1.5, 1.5),
    lon=longitude,
    heading=st.floats(-np.pi + 1e-6, np.pi - 1e-6),
    length=st.floats(1.0, 1e5),
)
def test_strip_azimuth_turns_x_along_the_strip(lat: float, lon: float, heading: float, length: float) -> None:
    control = geocentric_from_geodetic([[lon, lat, 0.0], [lon, lat, 200.0]], WGS84)
    north_frame = IntermediateFrame.at_centre(control, lat, lon, 0.0)
    along = np.array([np.cos(heading), -np.sin(heading), 0.0])  # X north, Y west
    first, last = np.array([300.0, -20.0, 1500.0]), np.array([300.0, -20.0, 1500.0]) + length * along
    a0 = strip_azimuth(first, last)
    assert a0 == pytest.approx(heading, abs=1e-9)
    for turned in (north_frame.with_azimuth(a0), IntermediateFrame.at_centre(control, lat, lon, a0)):
        base = (last - first) @ north_frame.axes.T @ turned.axes
        assert base == pytest.approx((length, 0.0, 0.0), abs=1e-9 * length)
        assert turned.axes[:, 2] == pytest.approx(north_frame.axes[:, 2], abs=1e-14)


@given(a0=azimuth)
def test_points_vectors_and_rotations_go_there_and_back(a0: float) -> None:
    frame = IntermediateFrame.at_local_centre([[1000.0, 2000.0, 30.0], [3000.0, 2600.0, 50.0]], a0)
    assert frame.origin == pytest.approx((2000.0, 2300.0, 40.0))
    points = np.array([[1500.0, 2500.0, 35.0], [0.0, 0.0, 0.0]])
    there = frame.intermediate_from_cartesian(points)
    assert frame.cartesian_from_intermediate(there) == pytest.approx(points, abs=1e-9)
    assert there[0] - there[1] == pytest.approx((points[0] - points[1]) @ frame.axes, abs=1e-9)
    photo = rotation("z", 0.3) @ rotation("y", 0.1)
    turned = frame.intermediate_rotations(photo[None])
    assert frame.cartesian_rotations(turned)[0] == pytest.approx(photo, abs=1e-14)
    ray = np.array([0.2, -0.1, -1.0])
    assert turned[0] @ ray == pytest.approx((photo @ ray) @ frame.axes, abs=1e-14)
