"""``photostrip convert --positions``: GNSS events of DJI, RTKLIB and Emlid beside a block."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from pyproj import Transformer

import photostrip
from photostrip.project.check import check_project
from tests.foreign.colmap_models import name_of, simulated, small_model
from tests.foreign.converting import convert, refused
from tests.foreign.opensfm_models import ground_control
from tests.loops import nonempty

if TYPE_CHECKING:
    from pathlib import Path

HEAD = "%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m)"


def mrk(number: int, place: tuple[float, float, float], offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> str:
    """Write an event of DJI: longitude, latitude, height of the antenna; offset north, east, down in millimetres."""
    longitude, latitude, height = place
    north, east, down = offset
    return (
        f"{number}\t{296288 + number}.242869\t[2211]\t{north:6g},N\t{east:6g},E\t{down:6g},V\t{latitude:.10f},Lat\t"
        f"{longitude:.10f},Lon\t{height:.4f},Ellh\t0.03, 0.02, 0.05\t{50 if number % 2 else 34},Q"
    )


def pos(number: int, place: tuple[float, float, float]) -> str:
    longitude, latitude, height = place
    return f"2022/05/25 10:18:{number:06.3f} {latitude:.10f} {longitude:.10f} {height:.4f} 1 12 0.03 0.02 0.05 0 0 0"


def small(count: int = 4) -> list[tuple[float, float, float]]:
    return [(16.475 + 0.0001 * n, 47.643, 512.9) for n in range(count)]


# ----------------------------------------------------------------------------------------------------- results


@pytest.mark.parametrize("kind", ["mrk", "pos"])
def test_a_block_comes_back_to_the_result_of_the_native_project(tmp_path: Path, kind: str) -> None:
    native = tmp_path / "native"
    sigma = [0.02, 0.03, 0.05]
    given = simulated(native, ground={"crs": "EPSG:32633"}, gnss={"sigma": sigma})
    with (native / "project.yaml").open("a", encoding="utf-8") as file:
        file.write('camera_positions: {file: gnss.csv, crs: "EPSG:32633", axes: [east, north, up]}\n')
    utm = Transformer.from_crs("EPSG:4326", "EPSG:32633", always_xy=True)
    with (native / "gnss.csv").open(encoding="utf-8") as file:
        rows = sorted(csv.DictReader(file), key=lambda row: name_of(row["photo"]))
    camera = np.array([[float(row[name]) for name in "xyz"] for row in rows])
    # the antenna of DJI is 75 mm above the camera and beside it; that of the other one is where the camera is
    longitude, latitude = utm.transform(camera[:, 0], camera[:, 1], direction="INVERSE")
    antenna = list(zip(longitude.tolist(), latitude.tolist(), camera[:, 2].tolist(), strict=True))
    if kind == "mrk":
        north, east = -0.03 / 111_230.0, 0.05 / (111_412.0 * np.cos(np.radians(49.2)))  # lengths of a degree here
        antenna = [(x + east, y + north, z + 0.075) for x, y, z in antenna]
        lines = [mrk(int(row["photo"]), place, (30, -50, 75)) for row, place in zip(rows, antenna, strict=True)]
        lines.reverse()  # numbers say which is which
    else:
        lines = [HEAD, *(pos(number, place) for number, place in enumerate(antenna))]
    (tmp_path / "events.pos").write_text("\n".join(lines) + "\n", encoding="utf-8")
    control = tmp_path / "gcp.json"
    control.write_text(json.dumps(ground_control(native)), encoding="utf-8")
    options = ("--control", str(control), "--control-sigma", "0.01,0.01,0.015")
    source = given.write_binary(tmp_path / "model")
    assert convert(source, tmp_path / "block", "-q", *options, "--positions", str(tmp_path / "events.pos")) == 0
    project = tmp_path / "block" / "project.yaml"
    assert check_project(project).faults == ()
    found, known = photostrip.run(project), photostrip.run(native / "project.yaml")
    at, expected = ({each["id"]: each for each in result.document["points"]} for result in (found, known))
    for point in nonempty([each for each in expected if each[0] in "GK"]):
        x, y = utm.transform(at[point]["x"], at[point]["y"])
        assert (x, y, at[point]["z"]) == pytest.approx([expected[point][name] for name in "xyz"], abs=5e-4)
        assert at[point]["sigma_z"] == pytest.approx(expected[point]["sigma_z"], abs=3e-4)


# ---------------------------------------------------------------------------------------------------- refusals

WRONG: dict[str, tuple[list[str], str]] = {
    "count": ([mrk(n + 7, place) for n, place in enumerate(small(5))], ": has 5 events, the block 4 photos"),
    "rtklib count": ([HEAD, pos(1, small()[0])], ": has 1 event, the block 4 photos, from DJI 0.JPG to DJI 3.JPG"),
    "twice": ([mrk(1, small()[0]), mrk(1, small()[0])], ":2: event 1 is already given"),
    "no event": ([mrk(1, small()[0]), "2\tnan"], ":2: `2\\tnan` is no event of DJI"),
    "none": (["a,b", "1,2"], ": holds no events of a receiver; expected Timestamp.MRK of DJI"),
    "binary": (["\0"], ": is not text"),
    "empty": ([], ": is empty"),
    "geocentric": ([HEAD.replace("latitude(deg)", "x-ecef(m)"), "1"], ":1: the header has no column latitude(deg)"),
    "short": ([HEAD, "2022/05/25 10:18:27 47.1"], ":2: 3 values in the line; expected 13, as in the header"),
    "nan": ([HEAD, pos(1, small()[0]).replace("512.9000", "nan")], ":2: `nan` is not a measured value"),
    "sigma": (
        [HEAD, *(pos(1, each).replace("0.02", "0") for each in small())],
        ":2: latitude, longitude or a standard",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_events_are_refused_with_their_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    source = small_model().write_text(tmp_path / "model")
    lines, expected = WRONG[name]
    (tmp_path / "events.pos").write_text("\n".join(lines), encoding="utf-8")
    told = refused(capsys, source, tmp_path / "block", "--positions", str(tmp_path / "events.pos"))
    assert f"events.pos{expected}" in told
