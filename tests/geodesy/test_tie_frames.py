"""Frames tied to one Cartesian frame: datums, geoids, and everything that is refused."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.tying import tie_frames
from tests.geodesy.frames import frame, pair, refused, spec, write_gtx

if TYPE_CHECKING:
    from pathlib import Path

    from photostrip.geodesy.frame_spec import FrameSpec

MICROMETRE = 1e-6  # m
ARC_SECOND = math.pi / 180.0 / 3600.0
UTM33 = np.array([[500000.0, 5000000.0, 100.0], [501000.0, 4999000.0, 250.0]])
BULGARIA = "+proj=tmerc +lon_0=27 +x_0=500000 +ellps=krass +towgs84=23.57,-140.95,-79.8,0,0.35,0.79,-0.22"
PULKOVO = np.array([[370000.0, 4710000.0, 550.0], [371000.0, 4713000.0, 700.0]])

# --------------------------------------------------------------------------------------------- one datum


def test_the_output_is_the_first_control_list_unless_it_is_given() -> None:
    frames, output = tie_frames([spec("EPSG:32634"), spec("EPSG:32633")])
    assert output is frames[0]
    frames, output = tie_frames([spec("EPSG:32634"), spec("EPSG:32633")], spec("EPSG:32633"))
    assert output is frames[1]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("EPSG:32633", "EPSG:32634"),
        ("EPSG:32633", "EPSG:4979"),
        ("EPSG:32633", "geocentric"),
        ("EPSG:25833", "EPSG:4258"),
        ("EPSG:28404", "EPSG:28405"),
        ("+proj=tmerc +lon_0=27 +ellps=krass", "+proj=longlat +ellps=krass"),
        (BULGARIA, BULGARIA.replace("lon_0=27", "lon_0=21")),
        ("+proj=utm +zone=33 +datum=WGS84", "+proj=utm +zone=34 +datum=WGS84"),
        ("+proj=eqc +R=1737400", "IAU_2015:30100"),
    ],
)
def test_within_one_datum_nothing_is_shifted(first: str, second: str) -> None:
    for given, output in (pair(first, second), pair(second, first)):
        assert (given.datum_shift, given.datum_accuracy) == ("", 0.0)
        assert "datum shift" not in given.describe() + output.describe()


# ------------------------------------------------------------------------------------------ between datums


def helmert(xyz: np.ndarray, towgs84: tuple[float, ...]) -> np.ndarray:
    """Seven parameters in the sense of +towgs84: shift, small rotations of the position vector, parts per million."""
    x, y, z = np.array(towgs84[3:6]) * ARC_SECOND
    rotation = np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])
    return np.asarray(np.array(towgs84[:3]) + (1.0 + towgs84[6] * 1e-6) * xyz @ rotation.T)


@pytest.mark.parametrize(
    "towgs84",
    [
        (23.57, -140.95, -79.8, 0.0, 0.35, 0.79, -0.22),
        (570.8, 85.7, 462.8, 4.998, 1.587, 5.261, 3.56),
        (100.0, -50.0, 70.0, 30.0, -40.0, 50.0, 20.0),  # rotations of nearly a minute
    ],
)
def test_seven_parameters_there_and_back(towgs84: tuple[float, ...]) -> None:
    text = "+proj=tmerc +lon_0=27 +x_0=500000 +ellps=krass"
    given, output = pair(f"{text} +towgs84={','.join(map(str, towgs84))}", "EPSG:32635")
    xyz = given.cartesian_from_ground(PULKOVO)
    expected = helmert(frame(text).cartesian_from_ground(PULKOVO), towgs84)
    assert np.abs(xyz - expected).max() < 1e-5
    assert np.abs(given.ground_from_cartesian(xyz) - PULKOVO).max() < MICROMETRE
    assert output.geodetic(xyz)[0, 0] == pytest.approx(math.radians(25.4), abs=0.01)


@pytest.mark.slow
def test_all_points_of_a_datum_are_shifted_by_one_operation() -> None:
    """PROJ would take another one for a point in the North Sea than for a point in Spain, and tear a strip apart."""
    south, north = [[500000.0, 4510000.0, 0.0]], [[500000.0, 6010000.0, 0.0]]
    alone = [pair("EPSG:23030", "EPSG:32630")[0].cartesian_from_ground(point)[0] for point in (south, north)]
    together = pair("EPSG:23030", "EPSG:32630")[0].cartesian_from_ground(np.vstack([north, south]))  # row 1 decides
    assert together[1] == pytest.approx(alone[0], abs=MICROMETRE)
    assert 0.1 < np.linalg.norm(together[0] - alone[1]) < 100.0
    (first, second), _ = tie_frames([spec("EPSG:23030"), spec("EPSG:23031")], spec("EPSG:32630"))
    first.cartesian_from_ground(south)
    assert second.datum_shift == first.datum_shift  # both zones hang on one datum


@pytest.mark.parametrize(
    ("first", "second", "reason"),
    [
        (
            "+proj=tmerc +lon_0=27 +ellps=krass",
            "EPSG:32635",
            (
                "+proj=tmerc +lon_0=27 +ellps=krass to that of EPSG:32635: +proj=tmerc +lon_0=27 +ellps=krass states an"
                " ellipsoid but no datum; add +towgs84=... (or +datum=...) to it, or use an authority code"
            ),
        ),
        (
            "IAU_2015:30110",
            "EPSG:32635",
            "IAU_2015:30110 to that of EPSG:32635: they lie on different bodies; give both in one datum",
        ),
        (
            "+proj=utm +zone=33 +ellps=bessel +nadgrids=@nowhere.gsb",
            "EPSG:32633",
            (
                "+proj=utm +zone=33 +ellps=bessel +nadgrids=@nowhere.gsb to that of EPSG:32633: the grid nowhere.gsb"
                " is not installed; put the grid beside the project file or into PROJ's data directory (`projsync`),"
                " or give both in one datum"
            ),
        ),
    ],
)
def test_datums_without_a_sound_way_between_them(first: str, second: str, reason: str) -> None:
    expected = f"control[0].crs: there is no known way from the datum of {reason}"
    assert refused(first, output=spec(second)) == [expected]


# ------------------------------------------------------------------------------------------------- heights


def test_a_constant_undulation_lifts_heights_to_the_ellipsoid() -> None:
    given, output = pair(spec("EPSG:32633", height="orthometric", geoid_undulation=45.5), "EPSG:32633")
    lifted = UTM33 + np.array([0.0, 0.0, 45.5])
    assert given.cartesian_from_ground(UTM33) == pytest.approx(output.cartesian_from_ground(lifted), abs=1e-9)
    assert given.ground_from_cartesian(output.cartesian_from_ground(lifted)) == pytest.approx(UTM33, abs=MICROMETRE)
    assert given.describe().endswith("plan in metres, orthometric heights in metres, geoid undulation +45.500 m")


@pytest.fixture
def geoid(tmp_path: Path) -> Path:
    """Write a geoid that rises by 1 m per degree to the east and by 2 m per degree to the north, 40 m at 10 E, 40 N."""
    lat, lon = np.meshgrid(np.arange(11.0), np.arange(11.0), indexing="ij")
    return write_gtx(tmp_path / "own_geoid.gtx", 40.0 + lon + 2.0 * lat, south=40.0, west=10.0, step=1.0)


@pytest.mark.parametrize("how", ["path", "beside the project", "if there is one"])
def test_heights_above_a_geoid_grid(geoid: Path, how: str) -> None:
    name = {"path": str(geoid), "beside the project": geoid.name, "if there is one": f"@{geoid.name}"}[how]
    text = f"+proj=utm +zone=33 +datum=WGS84 +geoidgrids={name}"
    directory = None if how == "path" else geoid.parent
    (given,), _ = tie_frames([spec(text, height="orthometric")], directory=directory)
    flat = frame("+proj=utm +zone=33 +datum=WGS84")
    xyz = given.cartesian_from_ground(UTM33)
    lon, lat, height = flat.geodetic(xyz).T
    undulation = 40.0 + (np.degrees(lon) - 10.0) + 2.0 * (np.degrees(lat) - 40.0)
    assert height == pytest.approx(UTM33[:, 2] + undulation, abs=1e-5)
    assert flat.ground_from_cartesian(xyz)[:, :2] == pytest.approx(UTM33[:, :2], abs=MICROMETRE)
    assert np.abs(given.ground_from_cartesian(xyz) - UTM33).max() < MICROMETRE
    assert given.describe().endswith(f"orthometric heights in metres (geoid grid {name})")


def test_points_outside_a_geoid_grid_are_named(geoid: Path) -> None:
    text = f"+proj=utm +zone=33 +datum=WGS84 +geoidgrids={geoid}"
    grid = frame(text, height="orthometric")
    points = np.array([[500000.0, 5000000.0, 0.0], [500000.0, 3000000.0, 0.0]])
    with pytest.raises(InputError, match=r"^point C: outside the geoid grid of \+proj=utm"):
        grid.cartesian_from_ground(points, ids=["A", "C"])
    xyz = frame("+proj=utm +zone=33 +datum=WGS84").cartesian_from_ground(points)
    with pytest.raises(GeometryError, match=r"^row 1: outside the geoid grid of \+proj=utm"):
        grid.ground_from_cartesian(xyz)


NO_GRID = (
    "; put the grid beside the project file or into PROJ's data directory (`projsync`), or give the CRS without heights"
    " and a constant `geoid_undulation`"
)


@pytest.mark.parametrize(
    ("crs", "reason"),
    [
        (
            "EPSG:32633+5773",
            "(EGM96 height) cannot be brought to the ellipsoid: the geoid grid us_nga_egm96_15.tif is not installed",
        ),
        ("EPSG:28405+5705", "(Baltic 1977 height) cannot be brought to the ellipsoid: PROJ knows no geoid for them"),
        (
            "+proj=utm +zone=33 +datum=WGS84 +geoidgrids=nowhere.gtx",
            "(geoid grid nowhere.gtx) cannot be brought to the ellipsoid: the geoid grid nowhere.gtx is not installed",
        ),
    ],
)
def test_a_geoid_that_is_not_there_is_refused_by_name(crs: str, reason: str) -> None:
    expected = f"control[0].crs: the heights of {crs} {reason}{NO_GRID}"
    assert refused(spec(crs, height="orthometric")) == [expected]


def test_a_file_that_is_no_grid_is_refused(tmp_path: Path) -> None:
    (tmp_path / "broken.gtx").write_text("this is not a grid", encoding="utf-8")
    crs = f"+proj=utm +zone=33 +datum=WGS84 +geoidgrids={tmp_path / 'broken.gtx'}"
    with pytest.raises(
        InputError, match=r"PROJ cannot read the grid|outside the geoid grid"
    ):  # it says so late, or early
        frame(crs, height="orthometric").cartesian_from_ground(UTM33)


@pytest.mark.parametrize(
    ("description", "expected"),
    [
        (
            spec("EPSG:32633", height="orthometric"),
            (
                "control[0].height: EPSG:32633 with orthometric heights does not say how high the geoid lies above the"
                " ellipsoid; expected geoid_undulation: metres, or a vertical CRS in `crs` (such as EPSG:32633+5773);"
                " a constant undulation does for a strip of a few kilometres"
            ),
        ),
        (
            spec("EPSG:32633+5773"),
            (
                "control[0].height: EPSG:32633+5773 brings heights above a geoid (EGM96 height), but they are said to"
                " be ellipsoidal; say `height: orthometric`, or leave the vertical part out of `crs`"
            ),
        ),
        (
            spec("EPSG:32633+5773", height="orthometric", geoid_undulation=40.0),
            (
                "control[0].geoid_undulation: EPSG:32633+5773 brings its own geoid (EGM96 height), and"
                " geoid_undulation is given as well; drop `geoid_undulation`, or the vertical part of `crs`"
            ),
        ),
        (
            spec("EPSG:4979", height="orthometric", geoid_undulation=40.0),
            (
                "control[0].height: the heights of EPSG:4979 are ellipsoidal by definition, but they are said to be"
                " orthometric; use the two-dimensional CRS with `geoid_undulation`, or a compound CRS"
            ),
        ),
        (
            spec("EPSG:32633", geoid_undulation=40.0),
            (
                "control[0].geoid_undulation: geoid_undulation is given for EPSG:32633, but its heights are said to be"
                " ellipsoidal; drop it, or say `height: orthometric`"
            ),
        ),
        (
            spec("EPSG:32633", height="above sea level"),
            "control[0].height: height: above sea level is not understood; expected ellipsoidal or orthometric",
        ),
    ],
)
def test_one_statement_about_heights_and_one_only(description: FrameSpec, expected: str) -> None:
    assert refused(description) == [expected]


# --------------------------------------------------------------------------------------------- other refusals

KINDS = "expected a projected, geographic or geocentric CRS, with heights or without"
OWN = "for a system of your own write `crs: local` (right-handed, metres)"
EAST_NORTH = (
    "expected axes that point east and north, in any order; use the east-north form of the grid, with the signs of the"
    " coordinates changed"
)


@pytest.mark.parametrize(
    ("crs", "expected"),
    [
        ("EPSG:2053", f"the axes of EPSG:2053 point west and south; {EAST_NORTH}"),
        (
            'LOCAL_CS["site",UNIT["metre",1]]',
            (
                'LOCAL_CS["site",UNIT["metre",1]] cannot carry ground control: it is of the kind '
                f"'Engineering CRS'; {KINDS}; {OWN}"
            ),
        ),
        ("EPSG:5703", f"EPSG:5703 cannot carry ground control: it is of the kind 'Vertical CRS'; {KINDS}; {OWN}"),
        (
            "IAU_2015:49902",
            (
                "IAU_2015:49902 cannot carry ground control: it is of the kind 'Geodetic CRS with planetocentric"
                f" latitudes'; {KINDS}; use geodetic latitudes (a PROJ string with +a and +b), or `geocentric` with"
                f" `ellipsoid`"
            ),
        ),
        ("+init=epsg:32633", "+init=epsg:32633: PROJ has given up `+init=`; expected a code such as EPSG:32633"),
        (
            " ",
            (
                "no coordinate reference system is given; expected an authority code (EPSG:32633), a PROJ string, WKT,"
                " `geocentric` or `local`"
            ),
        ),
    ],
)
def test_a_crs_that_cannot_be_used(crs: str, expected: str) -> None:
    assert refused(crs) == [f"control[0].crs: {expected}"]


def test_a_crs_that_proj_does_not_know() -> None:
    (found,) = refused("EPSG:99999")
    assert found.startswith(
        "control[0].crs: PROJ does not know the coordinate reference system 'EPSG:99999' (crs not fou"
    )
    assert found.endswith(
        "; expected an authority code (EPSG:32633), a PROJ string, WKT, `geocentric` or `local`; for a system of your"
        " own write `crs: local` (right-handed, metres)"
    )


@pytest.mark.parametrize(
    ("description", "expected"),
    [
        (
            spec("EPSG:4326", axes=("lat", "lon", "h")),
            (
                "control[0].axes: axes [lat, lon, h] of EPSG:4326 are not understood; expected a permutation of"
                " [east, north, up]; longitude is east, latitude is north"
            ),
        ),
        (
            spec("geocentric", axes=("x", "y", "y")),
            (
                "control[0].axes: axes [x, y, y] of geocentric (WGS 84) are not understood; expected a permutation of"
                " [x, y, z] or of [east, north, up]"
            ),
        ),
        (
            spec("EPSG:32633", curvature_radius=6.37e6),
            (
                "control[0].crs: the curvature correction of eq. 153 is asked for, but EPSG:32633 carries the curvature"
                " already: it would count twice; drop `earth_curvature: model`, or give plane coordinates of an unknown"
                " projection as `crs: local`"
            ),
        ),
        (
            spec("EPSG:32633", ellipsoid=(6378245.0, 6356863.019)),
            (
                "control[0].ellipsoid: `ellipsoid` belongs to `crs: geocentric`; EPSG:32633 has its own or none; drop"
                " `ellipsoid`, or write the radii into a PROJ string (+a=... +b=...)"
            ),
        ),
        (
            spec("geocentric", ellipsoid=(6378245.0, 298.3)),
            (
                "control[0].ellipsoid: a = 6378245.0, b = 298.3 are not the semi-axes of an ellipsoid; expected both"
                " semi-axes in metres, for example a: 6378245, b: 6356863.019"
            ),
        ),
    ],
)
def test_keys_that_do_not_belong_together(description: FrameSpec, expected: str) -> None:
    assert refused(description) == [expected]


def test_local_and_geodetic_frames_do_not_mix() -> None:
    message = (
        "cannot be tied to {} of control[0]: nobody knows where `local` lies; give all of them as `local`, or none"
    )
    assert refused("local", "EPSG:32633") == [f"control[1].crs: EPSG:32633 {message.format('local')}"]
    assert refused("EPSG:32633", output=spec("local")) == [f"output.crs: local {message.format('EPSG:32633')}"]


@pytest.mark.slow
def test_all_faults_come_at_once_each_at_its_key() -> None:
    found = refused(
        "EPSG:99999",
        spec("EPSG:32633", axes=("n", "e", "u"), height="orthometric", ellipsoid=(6378137.0, 6356752.3)),
        "EPSG:99999",
        output=spec("EPSG:2053"),
    )
    keys = [line.split(":")[0] for line in found]
    assert keys == ["control[0].crs", "control[1].axes", "control[1].ellipsoid", "control[1].height", "output.crs"]
    grids = refused(spec("EPSG:32633+5773", height="orthometric"), "IAU_2015:30110", output=spec("EPSG:32633"))
    assert [line.split(":")[0] for line in grids] == ["control[0].crs", "control[1].crs"]


# --------------------------------------------------------------------------------------- what is not loaded


def run(program: str, **environment: str) -> str:
    """Run a program in a process of its own and give what it prints."""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=os.environ | environment
    )
    return done.stdout.strip()


@pytest.mark.slow
def test_the_network_stays_off() -> None:
    program = """
from photostrip.geodesy.frame_spec import FrameSpec
from photostrip.geodesy.tying import tie_frames
tie_frames([FrameSpec("EPSG:32633", ("east", "north", "up"))])
import pyproj.network
print(pyproj.network.is_network_enabled())
"""
    assert run(program, PROJ_NETWORK="ON") == "False"
