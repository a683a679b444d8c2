"""Conversions against published numbers (GIGS, EPSG guidance note 7-2) and against examples computed elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from photostrip.geodesy.local_frame import (
    IntermediateFrame,
    axes_matrix,
    eccentricity_squared,
    geocentric_from_geodetic,
    mean_position,
)
from tests.geodesy.frames import ENU, NEU, XYZ, columns, frame, pair, rows, spec, with_height
from tests.loops import nonempty
from tests.vectors import Vector, cases

GIGS = 0.03  # m, tolerance of the GIGS projection tests
GIGS_GEOCENTRIC = 0.01  # m
MILLIMETRE = 1e-3
CENTIMETRE = 1e-2

OSGB_ON_WGS84 = "+proj=tmerc +lat_0=49 +lon_0=-2 +k=0.9996012717 +x_0=400000 +y_0=-100000 +datum=WGS84"
PROJECTIONS = [
    pytest.param("gigs5101_1_tm_osgb_params_on_wgs84.csv", OSGB_ON_WGS84, "+proj=longlat +datum=WGS84", id="tm-osgb"),
    pytest.param("gigs5101_2_utm31_wgs84.csv", "EPSG:32631", "EPSG:4326", id="utm31"),
    pytest.param("gigs5101_3_mga54_grs80.csv", "EPSG:28354", "EPSG:4283", id="mga54"),
]


@pytest.mark.parametrize(("table", "crs", "geographic"), PROJECTIONS)
def test_gigs_projections_there(table: str, crs: str, geographic: str) -> None:
    given, output = pair(geographic, crs)
    data = rows(table)
    found = output.ground_from_cartesian(given.cartesian_from_ground(with_height(columns(data, "lon_deg", "lat_deg"))))
    assert len(data) >= 23
    assert np.abs(found[:, :2] - columns(data, "E_m", "N_m")).max() < GIGS
    assert np.abs(found[:, 2]).max() < MILLIMETRE


@pytest.mark.parametrize(("table", "crs", "geographic"), PROJECTIONS)
def test_gigs_projections_back(table: str, crs: str, geographic: str) -> None:
    projected, output = pair(crs, geographic)
    data = rows(table)
    here = projected.cartesian_from_ground(with_height(columns(data, "E_m", "N_m")))
    there = output.cartesian_from_ground(with_height(columns(data, "lon_deg", "lat_deg")))
    assert np.linalg.norm(here - there, axis=1).max() < GIGS


def test_gigs_geocentric_there_and_back() -> None:
    data = rows("gigs5201_geocentric_geographic.csv")
    geocentric, output = pair("geocentric", "EPSG:4979")
    xyz, lonlath = columns(data, "X_m", "Y_m", "Z_m"), columns(data, "lon_deg", "lat_deg", "h_m")
    assert np.abs(output.cartesian_from_ground(lonlath) - xyz).max() < GIGS_GEOCENTRIC
    found = output.ground_from_cartesian(geocentric.cartesian_from_ground(xyz))
    assert np.abs(output.difference(found, lonlath)).max() < GIGS_GEOCENTRIC


def test_epsg_topocentric() -> None:
    origin = np.array([3652755.3058, 319574.6799, 5201547.3536])  # 55 N, 5 E, 200 m
    north_west_up = IntermediateFrame(origin, axes_matrix(np.radians(55.0), np.radians(5.0), 0.0))
    xyz = frame("EPSG:4979").cartesian_from_ground([[2.12955, 53.80939444444444, 73.0]])
    for point in ([3771793.968, 140253.342, 5124304.349], xyz[0]):
        x, y, z = north_west_up.intermediate_from_cartesian(point)
        assert (-y, x, z) == pytest.approx((-189013.869, -128642.040, -4220.171), abs=2 * MILLIMETRE)


def test_epsg_transverse_mercator_on_airy() -> None:
    airy = "+a=6377563.396 +rf=299.32496"
    tm = f"+proj=tmerc +lat_0=49 +lon_0=-2 +k=0.9996013 +x_0=400000 +y_0=-100000 {airy}"
    given, output = pair(f"+proj=longlat {airy}", tm)
    found = output.ground_from_cartesian(given.cartesian_from_ground([[0.5, 50.5, 0.0]]))
    assert found[0] == pytest.approx((577274.99, 69740.50, 0.0), abs=CENTIMETRE)


@pytest.mark.parametrize(
    ("own", "shifted_to", "xyz", "expected"),
    [
        pytest.param(
            "+proj=geocent +ellps=intl +towgs84=-84.87,-96.49,-116.95",
            "EPSG:4978",
            (3771878.84, 140349.83, 5124421.30),
            (3771793.97, 140253.34, 5124304.35),
            id="3-parameters-ed50",
        ),
        pytest.param(
            "+proj=geocent +a=6378135 +rf=298.26 +towgs84=0,0,4.5,0,0,0.554,0.219",
            "EPSG:4978",
            (3657660.66, 255768.55, 5201382.11),
            (3657660.77, 255778.43, 5201387.75),
            id="7-parameters-wgs72",
        ),
    ],
)
def test_epsg_datum_shifts(own: str, shifted_to: str, xyz: tuple[float, ...], expected: tuple[float, ...]) -> None:
    given, output = pair(spec(own, axes=XYZ), spec(shifted_to))
    cartesian = given.cartesian_from_ground([xyz])
    assert output.ground_from_cartesian(cartesian)[0] == pytest.approx(expected, abs=CENTIMETRE)
    assert given.ground_from_cartesian(cartesian)[0] == pytest.approx(xyz, abs=MILLIMETRE)


@pytest.mark.parametrize("crs", ["EPSG:284{zone:02.0f}", "+proj=tmerc +lon_0={meridian} +x_0={east} +ellps=krass"])
def test_krassovsky_gauss_krueger_with_the_zone_in_front(crs: str) -> None:
    geographic = "EPSG:4284" if crs.startswith("EPSG") else "+proj=longlat +ellps=krass"
    for row in nonempty(rows("krassovsky_gk_PROJ_GENERATED.csv")):
        zone = row["zone"]
        name = crs.format(zone=zone, meridian=row["central_meridian_deg"], east=zone * 1e6 + 5e5)
        given, grid = pair(geographic, spec(name, axes=NEU))
        found = grid.ground_from_cartesian(given.cartesian_from_ground([[row["lon_deg"], row["lat_deg"], 0.0]]))
        user = grid.user_from_internal(found)[0]
        assert user == pytest.approx((row["x_north_m"], row["y_east_with_zone_m"], 0.0), abs=MILLIMETRE)
        assert user[..., np.argsort(grid.order)] == pytest.approx(found[0])


@pytest.mark.parametrize("example", cases("gauss_kruger"))
def test_gauss_krueger_vectors(example: Vector) -> None:
    given = example.input
    ellipsoid = "+ellps=krass" if given["ellipsoid"].startswith("Krasovsky") else "+ellps=GRS80"
    crs = f"+proj=tmerc +lon_0={given['L0_deg']} +k={given['k0']} +x_0={given['false_easting']} {ellipsoid}"
    geographic, grid = pair(f"+proj=longlat {ellipsoid}", spec(crs, axes=NEU))
    found = grid.ground_from_cartesian(geographic.cartesian_from_ground([[given["L_deg"], given["B_deg"], 0.0]]))
    expected = (example.expected["x_north"], example.expected["y_east"])
    assert grid.user_from_internal(found)[0, :2] == pytest.approx(expected, abs=example.tol["abs_m"], rel=0.0)


@pytest.mark.parametrize("example", cases("geodesy_intermediate"))
def test_geocentric_and_intermediate_vectors(example: Vector) -> None:
    points = np.array(example.input["points_B_deg_L_deg_H_m"])
    crs = "+proj=longlat +ellps=krass" if "Krasovsky" in example.input["ellipsoid"] else "+proj=longlat +ellps=GRS80"
    expected, tol = example.expected, example.tol
    ground = frame(crs, axes=("north", "east", "up"))
    xyz = ground.cartesian_from_ground(points[..., np.argsort(ground.order)])
    assert np.abs(xyz - expected["geocentric"]).max() < tol["geocentric_m"]

    lat, lon, height = mean_position(np.radians(points[:, 0]), np.radians(points[:, 1]), points[:, 2])
    assert np.degrees([lat, lon]) == pytest.approx(expected["B0_L0_H0"][:2], abs=1e-12)
    assert height == pytest.approx(expected["B0_L0_H0"][2])
    local = IntermediateFrame.at_centre(xyz, lat, lon, np.radians(example.input["A0_deg"]))
    assert local.origin == pytest.approx(expected["X0_Y0_Z0_geocentric"], abs=tol["geocentric_m"])
    assert np.abs(local.axes - expected["M_columns_are_axes"]).max() < tol["cosines"]
    assert np.linalg.det(local.axes) == pytest.approx(expected["determinant"])
    assert np.abs(local.intermediate_from_cartesian(xyz) - expected["intermediate"]).max() < tol["intermediate_m"]
    assert np.abs(local.cartesian_from_intermediate(expected["intermediate"]) - xyz).max() < tol["intermediate_m"]


def test_the_ellipsoids_of_proj_are_those_of_the_literature() -> None:
    for name, a, flattening in (("krass", 6378245.0, 298.3), ("GRS80", 6378137.0, 298.257222101)):
        found = frame(f"+proj=longlat +ellps={name}", axes=ENU).ellipsoid
        assert found is not None
        assert found[0] == a
        assert eccentricity_squared(found) == pytest.approx(2 / flattening - 1 / flattening**2, rel=1e-12)
        assert geocentric_from_geodetic([[0.0, np.pi / 2, 0.0]], found)[0, 2] == pytest.approx(found[1])
