"""The ellipsoid in Cartesian coordinates, the intermediate frame, curvature, zones joined through common points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod, Transformer
from scipy.spatial.transform import Rotation

from photostrip.geodesy import local_frame
from photostrip.geodesy.crs import join_zones
from photostrip.geodesy.local_frame import IntermediateFrame, axes_matrix, geocentric_from_geodetic, strip_azimuth
from tests.loops import nonempty
from tests.vectors import Vector, cases

WGS84 = (6378137.0, 6356752.314245179)
MICROMETRE = 1e-6  # m

longitude = st.floats(-np.pi, np.pi)
latitude = st.floats(-np.pi / 2, np.pi / 2)
azimuth = st.floats(-2 * np.pi, 2 * np.pi)


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
    product = Rotation.from_euler("ZYZ", [lon, np.pi / 2 - lat, np.pi - a0]).as_matrix()
    assert m == pytest.approx(product, abs=1e-14)
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    north = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
    assert m[:, 0] == pytest.approx(np.cos(a0) * north + np.sin(a0) * east, abs=1e-14)
    assert m[:, 1] == pytest.approx(np.sin(a0) * north - np.cos(a0) * east, abs=1e-14)  # azimuth A0 - 90
    assert m[:, 2] == pytest.approx(np.cross(east, north), abs=1e-14)


@given(
    lat=st.floats(-1.5, 1.5), lon=longitude, heading=st.floats(-np.pi + 1e-6, np.pi - 1e-6), length=st.floats(1.0, 1e5)
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
    photo = Rotation.from_euler("ZY", [0.3, 0.1]).as_matrix()
    turned = frame.intermediate_rotations(photo[None])
    assert frame.cartesian_rotations(turned)[0] == pytest.approx(photo, abs=1e-14)
    ray = np.array([0.2, -0.1, -1.0])
    assert turned[0] @ ray == pytest.approx((photo @ ray) @ frame.axes, abs=1e-14)


GRS80 = (6378137.0, 6378137.0 * (1.0 - 1.0 / 298.257222101))
LAT = np.radians(42.5)


def ellipsoid_named(text: str) -> tuple[float, float]:
    """Semi-axes from a text such as "Krasovsky 1940, a=6378245, 1/f=298.3"."""
    a, inverse = (float(part.split("=")[1]) for part in text.split(", ")[1:])
    return a, a * (1.0 - 1.0 / inverse)


@pytest.mark.parametrize("example", cases("earth_curvature"))
def test_vectors(example: Vector) -> None:
    inside, out = example.input, example.expected
    lat, azimuth = np.radians([inside["B_deg"], inside["azimuth_of_point_deg"]])
    ellipsoid = ellipsoid_named(inside["ellipsoid"])
    distance = np.hypot(inside["X"], inside["Y"])
    mean = local_frame.mean_radius(lat, ellipsoid)
    directed = local_frame.radius_in_azimuth(lat, azimuth, ellipsoid)
    found = {
        "D": distance,
        "M": local_frame.meridian_radius(lat, ellipsoid),
        "N": local_frame.prime_vertical_radius(lat, ellipsoid),
        "R_mean": mean,
        "R_azimuth": directed,
        "correction_mean_R": local_frame.curvature_correction(distance, mean),
        "Z_corrected_mean_R": (inside["Z"] + local_frame.curvature_correction(distance, mean)),
        "Z_corrected_azimuth_R": (inside["Z"] + local_frame.curvature_correction(distance, directed)),
    }
    assert found.keys() | {"Z_corrected_sphere_exact_azimuth_R"} == out.keys()
    for name, value in nonempty(found.items()):
        assert value == pytest.approx(out[name], rel=example.tol["rel"], abs=example.tol["abs"]), name


def errors_on_the_ellipsoid(distance_km: float, azimuth_deg: float, height: float = 0.0) -> tuple[float, float]:
    """Error of eq. 153 with the mean radius and with the radius in the azimuth, metres.

    A point at a geodesic distance and a height is seen from the tangent plane; its height is computed back.
    """
    lon, lat, _ = Geod(a=GRS80[0], b=GRS80[1]).fwd(0.0, 42.5, azimuth_deg, distance_km * 1e3)
    point = geocentric_from_geodetic([[np.radians(lon), np.radians(lat), height]], GRS80)
    tangent = IntermediateFrame(geocentric_from_geodetic([[0.0, LAT, 0.0]], GRS80)[0], axes_matrix(LAT, 0.0, 0.0))
    x, y, z = tangent.intermediate_from_cartesian(point)[0]
    distance, azimuth = np.hypot(x, y), np.arctan2(-y, x)
    radii = local_frame.mean_radius(LAT, GRS80), local_frame.radius_in_azimuth(LAT, azimuth, GRS80)
    mean, directed = (float(z + local_frame.curvature_correction(distance, radius)) - height for radius in radii)
    return abs(mean), abs(directed)


@pytest.mark.parametrize(
    ("distance_km", "size", "mean", "directed", "digits"),
    [
        (5.0, 1.96, 0.004, 0.0, (2, 3, 3)),
        (10.0, 7.84, 0.014, 0.0, (2, 3, 3)),
        (20.0, 31.4, 0.06, 0.0003, (1, 2, 4)),
        (50.0, 196.0, 0.36, 0.003, (0, 2, 3)),
        (100.0, 784.0, 1.4, 0.05, (0, 1, 2)),
    ],
)
def test_table_of_the_formula_s_accuracy(
    distance_km: float, size: float, mean: float, directed: float, digits: tuple[int, int, int]
) -> None:
    """At latitude 42.5 degrees, along the meridian and across it, the larger one."""
    found = [errors_on_the_ellipsoid(distance_km, azimuth) for azimuth in (0.0, 90.0)]
    correction = local_frame.curvature_correction(distance_km * 1e3, local_frame.mean_radius(LAT, GRS80))
    assert round(float(correction), digits[0]) == size
    assert round(max(error for error, _ in found), digits[1]) == mean
    assert round(max(error for _, error in found), digits[2]) == directed


WEST, EAST = "EPSG:28404", "EPSG:28405"  # Gauss zones of 6 degrees, north first; they meet at 24 degrees
TO_EAST = Transformer.from_crs(WEST, EAST)


def in_both(points: int, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Points at the boundary in both zones, east first, metres."""
    rng = np.random.default_rng(points)
    middle = Transformer.from_crs("EPSG:4284", WEST).transform(42.5, 24.0)
    west = np.array(middle) + rng.uniform(-reach, reach, (points, 2))
    east = np.column_stack(TO_EAST.transform(*west.T))
    return west[:, ::-1], east[:, ::-1]


@pytest.mark.parametrize(("points", "degree", "largest"), [(2, 1, 30.0), (3, 2, 0.5), (4, 3, 0.002), (8, 3, 0.002)])
def test_each_power_brings_the_zones_together(points: int, degree: int, largest: float) -> None:
    """Errors at other points within 20 km of the boundary's middle: metres, decimetres, millimetres."""
    joint = join_zones(*in_both(points, 20_000.0))
    assert joint.degree == degree
    assert joint.redundancy == 2 * (points - degree - 1)
    west, east = in_both(50, 20_000.0)
    error = np.abs(joint(west) - east).max()
    assert largest / 1000 < error < largest
    if joint.redundancy == 0:
        assert np.abs(joint.residuals).max() < 1e-6


def test_a_wrong_point_stands_out() -> None:
    west, east = in_both(8, 20_000.0)
    east[3, 0] += 1.0
    assert int(np.linalg.norm(join_zones(west, east).residuals, axis=1).argmax()) == 3
