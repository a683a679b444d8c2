"""``photostrip convert --control``: control with its image marks in one table, beside a COLMAP model."""

from __future__ import annotations

import csv
import re
from typing import TYPE_CHECKING, Any

import pytest

import photostrip
from photostrip.cli.main import main
from photostrip.project.check import check_project
from tests.foreign.colmap_models import simulated

if TYPE_CHECKING:
    from pathlib import Path

    from tests.foreign.colmap_models import Model

SIGMA = ("--control-sigma", "0.01,0.01,0.015")
UTM = ("--crs", "EPSG:32633")


class Block:
    """A simulated block as a COLMAP model, and its control with marks as rows."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.model: Model = simulated(folder / "native", ground={"crs": "EPSG:32633"})
        self.model.images = [(*each[:4], name_of(each[4]), *each[5:]) for each in self.model.images]
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

    def odm(self, head: str = "WGS84 UTM 33N", *, named: bool = True) -> Path:
        lines = [head]
        for point, photo, *xy in self.rows():
            name = ("CHK-" if self.control[point]["role"] == "check" else "") + point
            lines.append("\t".join([*xy[2:], *xy[:2], photo, *([name] if named else [])]))
        path = self.folder / "gcp_list.txt"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    def convert(self, control: Path, *options: str) -> int:
        return main(["convert", str(self.folder / "model"), "-o", str(self.folder / "block"), "--sigma", "0.5",
                     "--control", str(control), *options])  # fmt: skip

    def refused(self, capsys: pytest.CaptureFixture[str], control: Path, *options: str) -> str:
        assert self.convert(control, *options) == 2
        assert not (self.folder / "block").exists()
        return capsys.readouterr().err

    def run(self) -> dict[str, Any]:
        project = self.folder / "block" / "project.yaml"
        assert check_project(project).faults == ()
        return photostrip.run(project).document

    def native(self) -> dict[str, Any]:
        return photostrip.run(self.folder / "native" / "project.yaml").document

    def without_checks(self) -> dict[str, Any]:
        """Leave the check points out, whose role a table cannot say; give the result by a list of OpenDroneMap."""
        self.marks = [row for row in self.marks if row["point"].startswith("G")]
        assert self.convert(self.odm(), *SIGMA) == 0
        found = self.run()
        (self.folder / "block" / "project.yaml").unlink()
        return found


def name_of(name: str) -> str:
    """Give a photo a name without blanks, in a folder: ``flight/1001.JPG``."""
    return f"flight/{name.rpartition(' ')[2]}"


def places(document: dict[str, Any], prefix: str = "") -> dict[str, list[float]]:
    return {f"{prefix}{each['id']}": [each[name] for name in "xyz"] for each in document["points"]}


def agree(found: dict[str, list[float]], known: dict[str, list[float]], names: list[str]) -> None:
    assert names
    for name in names:
        assert found[name] == pytest.approx(known[name], abs=2e-4)


def test_a_list_of_opendronemap_gives_the_result_of_the_native_project(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    block = Block(tmp_path)
    assert block.convert(block.odm(), *SIGMA) == 0
    told = capsys.readouterr().out
    assert f"15 points, 6 of them check points, {len(block.marks)} marks; EPSG:32633, heights taken as ell" in told
    found, known = block.run(), block.native()
    assert found["verdict"]["verification"] == known["verdict"]["verification"]
    agree(places(found), places(known), [name for name in block.control if name.startswith("G")])


@pytest.mark.parametrize("unknown", ["0", "NaN"])
def test_heights_of_opendronemap_that_are_not_known(tmp_path: Path, unknown: str) -> None:
    block = Block(tmp_path)
    block.control["G02"]["z"] = unknown
    assert block.convert(block.odm(), *SIGMA) == 0
    rows = (tmp_path / "block" / "control.csv").read_text(encoding="utf-8").splitlines()
    assert [re.sub(r",(5.*),,", ",,", row) for row in rows if row.startswith("G02")] == [
        "G02,,xy,control,0.01,0.01,0.015"
    ]
    assert block.run()["verdict"]["look_at"] == []


def told(document: dict[str, Any]) -> str:
    """Give what is to be looked at, in one text."""
    return " ".join(each if isinstance(each, str) else each["message"] for each in document["verdict"]["look_at"])


def test_marks_of_photos_of_another_width(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    block = Block(tmp_path)
    for row in block.marks:
        row |= {name: str(2 * float(row[name])) for name in "xy"}
    told = block.refused(capsys, block.odm(), *SIGMA)
    assert "the mark lies outside photo flight/1001.JPG, which has 5500 x 3667 px; if it was made on photos of" in told
    assert re.search(r"gcp_list\.txt:\d+:\d+: ", told)
    assert block.convert(block.odm(), *SIGMA, "--mark-width", "11000") == 0
    agree(places(block.run()), places(block.native()), [name for name in block.control if name.startswith("G")])


def test_what_the_table_does_not_say_is_asked_for_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    block = Block(tmp_path)
    asked = "nothing says in which frame the control lies; give --crs CRS"
    assert asked in block.refused(capsys, block.table(), *SIGMA)
    assert "nothing says how precise the control is; give --control-sigma" in block.refused(capsys, block.table(), *UTM)
    assert asked in block.refused(capsys, block.odm("somewhere"), *SIGMA)
    assert "--crs" in block.refused(capsys, block.odm("EPSG:99999"), *SIGMA)
    assert "`1,2` is no precision" in block.refused(capsys, block.odm(), "--control-sigma", "1,2")
    assert main(["convert", str(tmp_path / "model"), "-o", str(tmp_path / "x"), "--sigma", "1", *UTM]) == 2
    assert "--crs: there is no control that it is about; give --control FILE, too" in capsys.readouterr().err


def test_contradictions_have_their_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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
