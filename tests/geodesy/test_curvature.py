"""Radii of the ellipsoid and the curvature correction, against the ellipsoid itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod

from photostrip.geodesy import local_frame
from photostrip.geodesy.local_frame import IntermediateFrame, axes_matrix, geocentric_from_geodetic
from tests.loops import nonempty
from tests.vectors import Vector, cases

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

GRS80 = (6378137.0, 6378137.0 * (1.0 - 1.0 / 298.257222101))
LAT = np.radians(42.5)


def ellipsoid_named(text: str) -> tuple[float, float]:
    """Semi-axes from a text such as "Krasovsky 1940, a=6378245, 1/f=298.3"."""
    a, inverse = (float(part.split("=")[1]) for part in text.split(", ")[1:])
    return a, a * (1.0 - 1.0 / inverse)


def height_on_sphere(z: ArrayLike, distance: ArrayLike, radius: ArrayLike) -> NDArray[np.float64]:
    """Height above a sphere, h = sqrt(D^2 + (R + Z)^2) - R, without the difference of two numbers of the size of R."""
    up = np.asarray(z, dtype=np.float64)
    square = np.square(np.asarray(distance, dtype=np.float64))
    level = np.asarray(radius) + up
    return np.asarray(up + square / (np.sqrt(square + level**2) + level))


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
        "Z_corrected_sphere_exact_azimuth_R": height_on_sphere(inside["Z"], distance, directed),
    }
    assert found.keys() == out.keys()
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


def test_radius_of_the_meridian_is_the_derivative_of_its_arc() -> None:
    arc = Geod(a=GRS80[0], b=GRS80[1]).inv(10.0, 42.49, 10.0, 42.51)[2]
    assert local_frame.meridian_radius(LAT, GRS80) == pytest.approx(arc / np.radians(0.02), rel=1e-7)


@given(
    height=st.floats(-500.0, 9000.0),
    distance=st.floats(0.0, 1e5),
    radius=st.floats(1e6, 1e7),
)
def test_there_and_back_and_the_sphere(height: float, distance: float, radius: float) -> None:
    z = height - local_frame.curvature_correction(distance, radius)
    assert z <= height
    assert (z + local_frame.curvature_correction(distance, radius)) == pytest.approx(height, abs=1e-8)
    exact = np.sqrt(np.longdouble(distance) ** 2 + (np.longdouble(radius) + np.longdouble(z)) ** 2) - radius
    assert float(height_on_sphere(z, distance, radius)) == pytest.approx(float(exact), abs=1e-8)
