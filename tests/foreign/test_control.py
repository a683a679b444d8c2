"""``photostrip convert --control`` and ``--positions``: control with marks in one table, GNSS events beside a block."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from pyproj import Transformer

import photostrip
from photostrip.cli.main import main
from tests.calls import Capture
from tests.foreign.colmap_models import Model, name_of, simulated, small_model
from tests.foreign.converting import convert, refused, same_points
from tests.foreign.opensfm_models import ground_control

SIGMA = ("--control-sigma", "0.01,0.01,0.015")
UTM = ("--crs", "EPSG:32633")


class Block:
    """A simulated block as a COLMAP model, and its control with marks as rows."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.model: Model = simulated(folder / "native", ground={"crs": "EPSG:32633"})
        self.model.images = [(*each[:4], without_blanks(each[4]), *each[5:]) for each in self.model.images]
        self.model.write_binary(folder / "model")
        with (folder / "native" / "control.csv").open(encoding="utf-8") as file:
            self.control = {row["point"]: row for row in csv.DictReader(file)}
        with (folder / "native" / "observations.csv").open(encoding="utf-8") as file:
            self.marks = [row for row in csv.DictReader(file) if row["point"] in self.control]

    def rows(self) -> list[list[str]]:
        """Give point, photo, x, y and the three coordinates of each mark."""
        of = self.control
        return [[row["point"], f"{row['photo']}.JPG", row["x"], row["y"], *(of[row["point"]][name] for name in "xyz")]
                for row in self.marks]  # fmt: skip

    def table(self, header: str = "gcp_label,image_file_name,x,y,x_map,y_map,elev") -> Path:
        path = self.folder / "gcp.csv"
        path.write_text("\n".join([header, *map(",".join, self.rows())]) + "\n", encoding="utf-8")
        return path

    def odm(self, head: str = "WGS84 UTM 33N") -> Path:
        lines = [head]
        for point, photo, *xy in self.rows():
            name = ("CHK-" if self.control[point]["role"] == "check" else "") + point
            lines.append("\t".join([*xy[2:], *xy[:2], photo, name]))
        path = self.folder / "gcp_list.txt"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    def convert(self, control: Path, *options: str) -> int:
        return main(["convert", str(self.folder / "model"), "-o", str(self.folder / "block"), "--sigma", "0.5",
                     "--control", str(control), *options])  # fmt: skip

    def refused(self, capsys: Capture, control: Path, *options: str) -> str:
        assert self.convert(control, *options) == 2
        assert not (self.folder / "block").exists()
        return capsys.readouterr().err


def without_blanks(name: str) -> str:
    """Give a photo a name without blanks, in a folder: ``flight/1001.JPG``."""
    return f"flight/{name.rpartition(' ')[2]}"


def test_a_list_of_opendronemap_gives_the_result_of_the_native_project(tmp_path: Path, capsys: Capture) -> None:
    block = Block(tmp_path)
    assert block.convert(block.odm(), *SIGMA) == 0
    told = capsys.readouterr().out
    assert f"15 points, 6 of them check points, {len(block.marks)} marks; EPSG:32633, heights taken as ell" in told
    found, known = same_points(tmp_path / "block" / "project.yaml", tmp_path / "native", "G")
    assert found["verdict"]["verification"] == known["verdict"]["verification"]


@pytest.mark.parametrize("unknown", ["0", "NaN"])
def test_heights_of_opendronemap_that_are_not_known(tmp_path: Path, unknown: str) -> None:
    block = Block(tmp_path)
    block.control["G02"]["z"] = unknown
    assert block.convert(block.odm(), *SIGMA) == 0
    rows = (tmp_path / "block" / "control.csv").read_text(encoding="utf-8").splitlines()
    assert [re.sub(r",(5.*),,", ",,", row) for row in rows if row.startswith("G02")] == [
        "G02,,xy,control,0.01,0.01,0.015"
    ]
    assert photostrip.run(tmp_path / "block" / "project.yaml").document["verdict"]["look_at"] == []


def test_marks_of_photos_of_another_width(tmp_path: Path, capsys: Capture) -> None:
    block = Block(tmp_path)
    for row in block.marks:
        row |= {name: str(2 * float(row[name])) for name in "xy"}
    told = block.refused(capsys, block.odm(), *SIGMA)
    assert "the mark lies outside photo flight/1001.JPG, which has 5500 x 3667 px; if it was made on photos of" in told
    assert re.search(r"gcp_list\.txt:\d+:\d+: ", told)
    assert block.convert(block.odm(), *SIGMA, "--mark-width", "11000") == 0
    same_points(tmp_path / "block" / "project.yaml", tmp_path / "native", "G")


def test_what_the_table_does_not_say_is_asked_for_by_name(tmp_path: Path, capsys: Capture) -> None:
    block = Block(tmp_path)
    asked = "nothing says in which frame the control lies; give --crs CRS"
    assert asked in block.refused(capsys, block.table(), *SIGMA)
    assert "nothing says how precise the control is; give --control-sigma" in block.refused(capsys, block.table(), *UTM)
    assert asked in block.refused(capsys, block.odm("somewhere"), *SIGMA)
    assert "--crs" in block.refused(capsys, block.odm("EPSG:99999"), *SIGMA)
    assert "`1,2` is no precision" in block.refused(capsys, block.odm(), "--control-sigma", "1,2")
    assert main(["convert", str(tmp_path / "model"), "-o", str(tmp_path / "x"), "--sigma", "1", *UTM]) == 2
    assert "--crs: there is no control that it is about; give --control FILE, too" in capsys.readouterr().err


def test_contradictions_have_their_line(tmp_path: Path, capsys: Capture) -> None:
    block = Block(tmp_path)
    path = block.odm()
    lines = path.read_text(encoding="utf-8").splitlines()
    twice = [*lines, lines[1]]
    path.write_text("\n".join(twice), encoding="utf-8")
    told = block.refused(capsys, path, *SIGMA)
    assert f"gcp_list.txt:{len(twice)}" in told
    assert "is already marked on this photo, in line 2" in told
    path.write_text("\n".join([*lines[:-1], "9" + lines[-1]]), encoding="utf-8")
    told = block.refused(capsys, path, *SIGMA)
    assert f"gcp_list.txt:{len(lines)}" in told
    assert "has other coordinates than in line" in told


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
    (control := tmp_path / "gcp.json").write_text(json.dumps(ground_control(native)), encoding="utf-8")
    options = ("--control", str(control), "--control-sigma", "0.01,0.01,0.015")
    source = given.write_binary(tmp_path / "model")
    assert convert(source, tmp_path / "block", "-q", *options, "--positions", str(tmp_path / "events.pos")) == 0
    same_points(tmp_path / "block" / "project.yaml", native, to_map=utm.transform)


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
def test_wrong_events_are_refused_with_their_line(tmp_path: Path, capsys: Capture, name: str) -> None:
    source = small_model().write_text(tmp_path / "model")
    lines, expected = WRONG[name]
    (tmp_path / "events.pos").write_text("\n".join(lines), encoding="utf-8")
    told = refused(capsys, source, tmp_path / "block", "--positions", str(tmp_path / "events.pos"))
    assert f"events.pos{expected}" in told
