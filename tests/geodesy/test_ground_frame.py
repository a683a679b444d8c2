"""Ground frames by themselves: points, directions, differences, refusals; published conversions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Proj, Transformer

from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.ground_frame import GroundFrame
from photostrip.geodesy.local_frame import (
    IntermediateFrame,
    axes_matrix,
    eccentricity_squared,
    geocentric_from_geodetic,
    mean_position,
)
from photostrip.geodesy.tying import tie_frames
from tests.geodesy.frames import ENU, NEU, columns, frame, pair, rows, spec, with_height
from tests.vectors import Vector, cases

MICROMETRE = 1e-6  # m
NANORADIAN = 1e-9
UTM33 = frame("EPSG:32633")

# crs, west, east, south, north: where each of these is in use
GRIDS = {
    "EPSG:32633": (9.0, 21.0, 0.0, 83.0),
    "EPSG:32733": (9.0, 21.0, -80.0, 0.0),
    "EPSG:32601": (-180.0, -174.0, -10.0, 70.0),
    "EPSG:32660": (174.0, 180.0, -10.0, 70.0),
    "EPSG:28407": (36.0, 42.0, 45.0, 70.0),
    "EPSG:2154": (-5.0, 10.0, 41.0, 51.0),  # Lambert conformal
    "EPSG:27572": (-4.0, 5.0, 43.0, 50.0),  # grads from Paris underneath
    "EPSG:5514": (12.0, 22.0, 48.0, 51.0),  # Krovak, negative coordinates
    "EPSG:2263": (-75.0, -72.0, 40.0, 41.5),  # US survey feet
    "EPSG:3857": (-179.0, 179.0, -80.0, 80.0),
    "EPSG:3035": (0.0, 25.0, 35.0, 65.0),  # equal area: not conformal
    "EPSG:3031": (-180.0, 180.0, -90.0, -60.0),
    "EPSG:5041": (-180.0, 180.0, 60.0, 90.0),
    "EPSG:32661": (-180.0, 180.0, 60.0, 90.0),
    "+proj=eqc +lat_ts=30 +R=1737400": (-179.9, 179.9, -80.0, 80.0),
    "+proj=stere +lat_0=-90 +lon_0=0 +a=3396190 +b=3376200": (-180.0, 180.0, -90.0, -60.0),
}
CONFORMAL = [crs for crs in GRIDS if crs not in {"EPSG:3035", "EPSG:3857"} and "eqc" not in crs]
FRAMES = {crs: frame(crs) for crs in GRIDS}
ZONES = {grid.spec.crs: grid for grid in tie_frames([spec(f"EPSG:326{zone}") for zone in ("33", "34", "01", "60")])[0]}
PROJ_ITSELF = {crs: Transformer.from_crs("EPSG:4326", crs, always_xy=True) for crs in ZONES}
fraction = st.floats(0.0, 1.0)
height = st.floats(-500.0, 9000.0)


def point_of(crs: str, u: float, v: float, up: float) -> np.ndarray:
    """Longitude, latitude (degrees from Greenwich) and height of a point in the area of a CRS."""
    west, east, south, north = GRIDS[crs]
    return np.array([west + u * (east - west), south + v * (north - south), up])


def cartesian(grid: GroundFrame, lonlath: np.ndarray) -> np.ndarray:
    """Cartesian coordinates by the ellipsoid's formulas, longitudes counted from the zero meridian of the frame."""
    assert grid.ellipsoid is not None
    a, b = grid.ellipsoid
    lon, lat = np.radians(lonlath[0]), np.radians(lonlath[1])
    n = a**2 / math.hypot(a * math.cos(lat), b * math.sin(lat))
    across = (n + lonlath[2]) * math.cos(lat)
    return np.array([[across * math.cos(lon), across * math.sin(lon), (n * (b / a) ** 2 + lonlath[2]) * math.sin(lat)]])


@pytest.mark.parametrize("crs", GRIDS)
@given(u=fraction, v=fraction, up=height)
def test_round_trip(crs: str, u: float, v: float, up: float) -> None:
    grid = FRAMES[crs]
    xyz = cartesian(grid, point_of(crs, u, v, up))
    enu = grid.ground_from_cartesian(xyz)
    assert enu[0, 2] * grid.height_factor == pytest.approx(up, abs=MICROMETRE)
    assert np.abs(grid.cartesian_from_ground(enu) - xyz).max() < MICROMETRE


@pytest.mark.parametrize(
    ("first", "second", "lon"), [("EPSG:32633", "EPSG:32634", 18.0), ("EPSG:32601", "EPSG:32660", 180.0)]
)
@given(across=st.floats(-0.5, 0.5), lat=st.floats(-10.0, 70.0), up=height)
def test_two_zones_meet_in_one_point(first: str, second: str, lon: float, across: float, lat: float, up: float) -> None:
    """Coordinates of both zones by PROJ itself; on both sides of a zone boundary, one at 180 degrees."""
    point = ((lon + across + 180.0) % 360.0 - 180.0, lat)
    found = [ZONES[crs].cartesian_from_ground([[*PROJ_ITSELF[crs].transform(*point), up]]) for crs in (first, second)]
    assert np.abs(found[0] - found[1]).max() < MICROMETRE
    assert np.abs(found[0] - cartesian(UTM33, np.array([*point, up]))).max() < MICROMETRE


@pytest.mark.parametrize("crs", GRIDS)
@given(u=st.floats(0.05, 0.95), v=st.floats(0.05, 0.95), up=height)
def test_axes_are_right_angled_and_follow_the_grid(crs: str, u: float, v: float, up: float) -> None:
    grid = FRAMES[crs]
    lonlath = point_of(crs, u, v, up)
    axes = grid.axes_at(cartesian(grid, lonlath))[0]
    xyz = cartesian(grid, lonlath * (1.0, 1.0, 0.0))  # on the ellipsoid, where conformal grids have right angles
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    lon, lat = np.radians(lonlath[:2])
    normal = [math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)]
    assert axes[2] == pytest.approx(normal, abs=NANORADIAN)
    enu, step = grid.ground_from_cartesian(xyz), 10.0 / grid.plan_factor
    along = [grid.cartesian_from_ground(enu + d) - grid.cartesian_from_ground(enu - d) for d in np.eye(3)[:2] * step]
    east, north = (difference[0] / np.linalg.norm(difference) for difference in along)
    if crs in CONFORMAL:
        assert np.abs(np.array([east, north]) - axes[:2]).max() < 1e-8
    assert east @ axes[1] == pytest.approx(north @ axes[0], abs=1e-8)  # the deviation from a right angle is shared


@pytest.mark.parametrize("crs", CONFORMAL)
@given(u=st.floats(0.1, 0.9), v=st.floats(0.1, 0.9))
def test_convergence_is_that_of_proj(crs: str, u: float, v: float) -> None:
    grid = FRAMES[crs]
    lonlath = point_of(crs, u, v, 500.0)
    expected = math.radians(Proj(crs).get_factors(*lonlath[:2]).meridian_convergence)  # itself good to 1e-8 only
    turn = grid.convergence(cartesian(grid, lonlath))[0] - expected
    assert math.remainder(turn, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-7)


@given(lon=st.floats(-180.0, 180.0), lat=st.floats(-89.0, 89.0), shift=st.tuples(*[st.floats(-50.0, 50.0)] * 3))
def test_differences_of_longitudes_and_latitudes_are_metres(lon: float, lat: float, shift: tuple[float, ...]) -> None:
    grid = frame("EPSG:4979")
    here = grid.cartesian_from_ground([[lon, lat, 300.0]])
    there = grid.ground_from_cartesian(here + np.array(shift) @ grid.axes_at(here)[0])
    found = grid.difference(there, [[lon, lat, 300.0]])[0]
    # The curvature of the meridian and the convergence of two meridians over 50 m are all that may remain.
    assert found == pytest.approx(shift, abs=0.01 / math.cos(math.radians(lat)))


@pytest.mark.parametrize(
    ("crs", "axes", "order"),
    [
        ("EPSG:32633", ("east", "north", "up"), (0, 1, 2)),
        ("EPSG:28405", ("north", "east", "up"), (1, 0, 2)),
        ("EPSG:32633", ("up", "north", "east"), (2, 1, 0)),
        ("local", ("north", "up", "east"), (1, 2, 0)),
        ("geocentric", ("x", "y", "z"), (0, 1, 2)),
        ("geocentric", ("z", "x", "y"), (2, 0, 1)),
        ("geocentric", ("north", "east", "up"), (1, 0, 2)),
    ],
)
def test_order_of_columns(crs: str, axes: tuple[str, str, str], order: tuple[int, int, int]) -> None:
    grid = frame(crs, axes=axes)
    assert (grid.axes, grid.order) == (axes, order)
    internal = np.array([[10.0, 20.0, 30.0]])
    user = grid.user_from_internal(internal)
    assert all((user[:, i] == internal[:, order[i]]).all() for i in range(3))
    assert (user[..., np.argsort(grid.order)] == internal).all()


def test_the_curvature_of_a_level_lake_bends_it_away_from_the_tangent_plane() -> None:
    """An independent case for the sign: points at one height, 10 km away, lie 7.8 m below the plane."""
    grid = frame("local", curvature_radius=6376234.66).with_origin((0.0, 0.0))
    lake = grid.cartesian_from_ground([[0.0, 0.0, 100.0], [10000.0, 0.0, 100.0], [0.0, -10000.0, 100.0]])
    assert lake[:, 2] == pytest.approx((100.0, 92.16, 92.16), abs=0.005)


def test_points_outside_the_domain_are_named() -> None:
    points = np.array([[500000.0, 5e6, 0.0], [1e9, 5e6, 0.0], [500000.0, 1e12, 0.0]])
    with pytest.raises(InputError, match=r"^rows 1, 2: outside the domain of EPSG:32633$"):
        UTM33.cartesian_from_ground(points)
    with pytest.raises(InputError, match=r"^point B7: outside the domain of EPSG:32633$"):
        UTM33.cartesian_from_ground(points[:2], ids=["A1", "B7"])


@pytest.mark.parametrize("point", [(15.0, 95.0, 0.0), (400.0, 45.0, 0.0), (500000.0, 4600000.0, 200.0)])
def test_longitudes_and_latitudes_that_do_not_exist(point: tuple[float, ...]) -> None:
    with pytest.raises(
        InputError, match=r"^row 0: no such longitude and latitude \(are the axes in the right order\?\)$"
    ):
        frame("EPSG:4979").cartesian_from_ground([point])


def test_a_polar_grid_works_at_its_pole() -> None:
    for crs, normal in (("EPSG:3031", -1.0), ("EPSG:5041", 1.0), ("EPSG:32661", 1.0)):
        grid = FRAMES[crs]
        xyz = cartesian(grid, np.array([0.0, normal * 90.0, 100.0]))
        axes = grid.axes_at(xyz)[0]
        assert axes[2] == pytest.approx((0.0, 0.0, normal), abs=NANORADIAN)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        enu = grid.ground_from_cartesian(xyz)
        assert np.abs(grid.cartesian_from_ground(enu) - xyz).max() < MICROMETRE
        with pytest.raises(GeometryError, match="row 0: at a pole there is no east and no north"):
            grid.convergence(xyz)


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
def test_gigs_projections_there_and_back(table: str, crs: str, geographic: str) -> None:
    data = rows(table)
    assert len(data) >= 23
    lonlat, plan = columns(data, "lon_deg", "lat_deg"), columns(data, "E_m", "N_m")
    given_frame, output = pair(geographic, crs)
    there = given_frame.cartesian_from_ground(with_height(lonlat))
    found = output.ground_from_cartesian(there)
    assert np.abs(found[:, :2] - plan).max() < GIGS
    assert np.abs(found[:, 2]).max() < MILLIMETRE
    assert np.linalg.norm(output.cartesian_from_ground(with_height(plan)) - there, axis=1).max() < GIGS


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
