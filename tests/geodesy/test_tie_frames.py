"""Frames tied to one Cartesian frame: datums, geoids, epochs, the examples of docs/frames.md, what is refused."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from photostrip.errors import GeometryError, InputError
from photostrip.geodesy.frame_spec import GROUND_AXES, FrameSpec
from photostrip.geodesy.tying import tie_frames
from photostrip.pipeline.run import triangulate
from photostrip.simulation import Flight, Ground, Spec
from photostrip.simulation.simulation import simulate
from tests.geodesy.frames import frame, pair, refused, spec, write_gtx
from tests.simulated import inputs_of, settings_of

MICROMETRE = 1e-6  # m
ARC_SECOND = math.pi / 180.0 / 3600.0
UTM33 = np.array([[500000.0, 5000000.0, 100.0], [501000.0, 4999000.0, 250.0]])
BULGARIA = "+proj=tmerc +lon_0=27 +x_0=500000 +ellps=krass +towgs84=23.57,-140.95,-79.8,0,0.35,0.79,-0.22"
PULKOVO = np.array([[370000.0, 4710000.0, 550.0], [371000.0, 4713000.0, 700.0]])


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
        ("+proj=tmerc +lon_0=27 +ellps=krass", "EPSG:32635", "states an ellipsoid but no datum; add +towgs84=... (or"),
        ("IAU_2015:30110", "EPSG:32635", "they lie on different bodies; give both in one datum"),
        (
            "+proj=utm +zone=33 +ellps=bessel +nadgrids=@nowhere.gsb",
            "EPSG:32633",
            "the grid nowhere.gsb is not installed; put the grid beside the project file or into PROJ's data directory",
        ),
    ],
)
def test_datums_without_a_sound_way_between_them(first: str, second: str, reason: str) -> None:
    (told,) = refused(first, output=spec(second))
    assert told.startswith(f"control[0].crs: there is no known way from the datum of {first} to that of {second}: ")
    assert reason in told


OWN = "+proj=utm +zone=33 +datum=WGS84 +geoidgrids=nowhere.gtx"
BESIDE = "put the grid beside the project file or into PROJ's data directory"
KINDS = "expected a projected, geographic or geocentric CRS"
UP = {"height": "orthometric"}
BOTH = {"height": "orthometric", "geoid_undulation": 40.0}
SAID: list[tuple[str, dict[str, Any], str, str, str]] = [  # what is described, key of the fault, what is said, the cure
    ("EPSG:32633+5773", UP, "crs", "the geoid grid us_nga_egm96_15.tif is not installed", BESIDE),
    ("EPSG:28405+5705", UP, "crs", "(Baltic 1977 height) cannot be brought to the ellipsoid", BESIDE),
    (OWN, UP, "crs", "the geoid grid nowhere.gtx is not installed", BESIDE),
    (
        "EPSG:32633",
        UP,
        "height",
        "does not say how high the geoid lies",
        "expected geoid_undulation: metres, or a vert",
    ),
    ("EPSG:32633+5773", {}, "height", "but they are said to be ellipsoidal", "say `height: orthometric`, or leave"),
    ("EPSG:32633+5773", BOTH, "geoid_undulation", "brings its own geoid (EGM96 height)", "drop `geoid_undulation`, or"),
    (
        "EPSG:4979",
        BOTH,
        "height",
        "ellipsoidal by definition",
        "use the two-dimensional CRS with `geoid_undulation`, or",
    ),
    (
        "EPSG:32633",
        {"geoid_undulation": 40.0},
        "geoid_undulation",
        "said to be ellipsoidal",
        "drop it, or say `height: ",
    ),
    (
        "EPSG:32633",
        {"height": "high"},
        "height",
        "height: high is not understood",
        "expected ellipsoidal or orthometric",
    ),
    ("EPSG:2053", {}, "crs", "the axes of EPSG:2053 point west and south", "use the east-north form of the grid, with"),
    ('LOCAL_CS["site",UNIT["metre",1]]', {}, "crs", "of the kind 'Engineering CRS'", KINDS),
    ("EPSG:5703", {}, "crs", "of the kind 'Vertical CRS'", KINDS),
    ("IAU_2015:49902", {}, "crs", "planetocentric latitudes'", "use geodetic latitudes (a PROJ string with +a and +b)"),
    ("+init=epsg:32633", {}, "crs", "PROJ has given up `+init=`", "expected a code such as EPSG:32633"),
    (" ", {}, "crs", "no coordinate reference system is given", "expected an authority code (EPSG:32633)"),
    ("EPSG:99999", {}, "crs", "PROJ does not know the coordinate reference system 'EPSG:99999'", "write `crs: local`"),
    ("EPSG:4326", {"axes": ("lat", "lon", "h")}, "axes", "axes [lat, lon, h]", "longitude is east, latitude is north"),
    (
        "geocentric",
        {"axes": ("x", "y", "y")},
        "axes",
        "axes [x, y, y] of geocentric",
        "expected a permutation of [x, y, z]",
    ),
    ("EPSG:32633", {"ellipsoid": (6378245.0, 6356863.019)}, "ellipsoid", "has its own or none", "drop `ellipsoid`, or"),
    (
        "geocentric",
        {"ellipsoid": (6378245.0, 298.3)},
        "ellipsoid",
        "are not the semi-axes",
        "expected both semi-axes in met",
    ),
]


@pytest.mark.parametrize(("crs", "rest", "key", "said", "cure"), SAID)
def test_what_describes_no_frame_is_refused_with_the_way_out(
    crs: str, rest: dict[str, Any], key: str, said: str, cure: str
) -> None:
    (told,) = refused(spec(crs, **rest))
    assert told.startswith(f"control[0].{key}: ")
    assert said in told
    assert cure in told[told.index(said) :]


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


def test_a_file_that_is_no_grid_is_refused(tmp_path: Path) -> None:
    (tmp_path / "broken.gtx").write_text("this is not a grid", encoding="utf-8")
    crs = f"+proj=utm +zone=33 +datum=WGS84 +geoidgrids={tmp_path / 'broken.gtx'}"
    with pytest.raises(
        InputError, match=r"PROJ cannot read the grid|outside the geoid grid"
    ):  # it says so late, or early
        frame(crs, height="orthometric").cartesian_from_ground(UTM33)


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


pytestmark = pytest.mark.usefixtures("_no_findings")

ETRS89, ITRF2020 = FrameSpec("EPSG:4937", GROUND_AXES), FrameSpec("EPSG:9989", GROUND_AXES)
PLACE = np.array([[11.5, 48.2, 500.0]])  # Munich
METRES_IN_DEGREE = np.array([74_300.0, 111_200.0, 1.0])


def moved(spec: FrameSpec, output: FrameSpec) -> np.ndarray:
    """Bring a place from one frame to another; east, north, up in metres from where it was."""
    (frame,), target = tie_frames([spec], output)
    there = target.ground_from_cartesian(frame.cartesian_from_ground(PLACE))
    return np.asarray((there - PLACE)[0] * METRES_IN_DEGREE)


@pytest.mark.slow
@pytest.mark.parametrize("dated", ["list", "output"])
def test_europe_moves_north_east_by_the_epoch(dated: str) -> None:
    """About 2.5 cm a year against ITRF, on whichever side the epoch stands."""
    found = []
    for epoch in (2015.0, 2025.0):
        spec, output = replace(ETRS89, epoch=epoch), ITRF2020
        if dated == "output":
            spec, output = ETRS89, replace(ITRF2020, epoch=epoch)
        found.append(moved(spec, output))
    assert (found[1] - found[0])[:2] / 10.0 == pytest.approx([0.0200, 0.0160], abs=0.006)
    assert moved(ETRS89, ITRF2020) == pytest.approx(found[0])


def test_two_epochs_are_refused() -> None:
    """Points would have to be moved from one to the other."""
    with pytest.raises(InputError, match="moves no points from one to another") as caught:
        tie_frames([replace(ETRS89, epoch=2015.0)], replace(ITRF2020, epoch=2020.0))
    assert [fault.code for fault in caught.value.faults] == ["epochs"]


def notes(crs: str, output: FrameSpec) -> dict[str, str]:
    """Notes of a run by their codes."""
    simulation = simulate(Spec(seed=3, flight=Flight(photos=4), ground=Ground(crs, center_deg=(11.5, 48.2))))
    inputs = replace(inputs_of(simulation), output=output)
    return {note.code: note.message for note in triangulate(inputs, settings_of(simulation)).notes}


@pytest.mark.slow
def test_a_change_of_datum_is_told_with_its_accuracy_and_area() -> None:
    """It was not told at all."""
    told = notes("EPSG:31468", FrameSpec("EPSG:25832", GROUND_AXES))
    assert "DHDN to ETRS89" in told["datum-change"]
    assert "accuracy 1 m" in told["datum-change"]
    assert "made for Germany" in told["datum-change"]
    assert "epoch-missing" not in told


@pytest.mark.slow
def test_an_epoch_is_asked_for_where_it_matters() -> None:
    """Ten years are 0.3 m, the control is good to 0.05 m."""
    told = notes("EPSG:25832", ITRF2020)
    assert "no `epoch` is given: that of the operation, 2015.0, is taken" in told["epoch-missing"]
    told = notes("EPSG:25832", replace(ITRF2020, epoch=2025.5))
    assert "epoch-missing" not in told
    assert told["datum-change"].endswith("coordinates of 2025.5")


PAGE = Path(__file__).parents[2] / "docs" / "frames.md"
EXAMPLES = re.findall(r"^```yaml\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def description(entry: dict[str, Any]) -> FrameSpec:
    """Give the frame that one entry of a project file describes."""
    rest = {key: value for key, value in entry.items() if key in {"height", "geoid_undulation"}}
    if "ellipsoid" in entry:
        rest["ellipsoid"] = (entry["ellipsoid"]["a"], entry["ellipsoid"]["b"])
    return FrameSpec(entry["crs"], tuple(entry["axes"]), **rest)


@pytest.mark.parametrize("example", EXAMPLES)
def test_example(example: str, tmp_path: Path) -> None:
    write_gtx(tmp_path / "own_geoid.gtx", np.full((11, 11), 45.0), south=40.0, west=10.0, step=1.0)
    project = yaml.safe_load(example)
    control = [description(entry) for entry in project["control"]]
    output = description(project["output"]) if "output" in project else None
    frames, out = tie_frames(control, output, directory=tmp_path)
    assert [frame.spec for frame in frames] == control
    assert out.spec == (output or control[0])


def test_the_page_has_examples() -> None:
    assert len(EXAMPLES) >= 5
