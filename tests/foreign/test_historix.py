"""``photostrip convert`` of projects of HISTORIX, as a user calls it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from photostrip.cli.main import main
from photostrip.formats.result_json import read_result
from tests.calls import Capture
from tests.foreign.converting import convert, refused
from tests.foreign.historix_blocks import FILES, OPTIONS, copied, plane, simulated, with_ties


@pytest.mark.slow
def test_casa_grande_runs_with_tie_points_on_its_stations(tmp_path: Path) -> None:
    """Its real camera, marks and rough positions: only the tie points are simulated, on orientations that fit these."""
    assert convert(copied(tmp_path / "historix"), tmp_path / "block", *OPTIONS, "-q") == 0
    tied = simulated()
    project = with_ties(tmp_path / "block", tied)
    assert main(["check", str(project), "-q"]) == 0
    assert main(["run", str(project), "-o", str(tmp_path / "run"), "-q"]) == 0
    result = read_result(str(tmp_path / "run" / "result.json"))
    assert (len(result["photos"]), len(result["rejected"])) == (37, 0)
    found = [each for each in result["points"] if each["id"] in tied.xyz]
    assert len(found) == len(tied.xyz)
    away = plane(found, "x y z") - [tied.xyz[each["id"]] for each in found]
    # control of 2 m holds the block to some decimetres, as its real marks are fitted; half a pixel is 0.3 m
    assert np.sqrt((away**2).mean(axis=0)) == pytest.approx([0.0, 0.0, 0.0], abs=0.8)
    normed = away / [[each["sigma_x"], each["sigma_y"], each["sigma_z"]] for each in found]
    assert 0.5 < np.sqrt((normed**2).mean()) < 1.1
    assert np.abs(normed).max() < 4.0


def test_the_camera_keeps_its_numbers_and_its_marks(tmp_path: Path, capsys: Capture) -> None:
    assert convert(copied(tmp_path / "historix"), tmp_path / "block", *OPTIONS) == 0
    text = (tmp_path / "block" / "project.yaml").read_text(encoding="utf-8")
    assert "    principal_distance: 152.865\n    principal_point: [-0.03, -0.001]\n    format: [250.0, 250.0]\n" in text
    assert '      "midside_left": [-110.004, -0.009]\n' in text
    assert text.count("midside_") == text.count("corner_") == 4
    said = capsys.readouterr().out
    assert "HISTORIX project: 37 photos of 1 camera, 0 points, 0 rays" in said
    assert "34 points, 68 marks; EPSG:4979" in said
    assert "37 rough positions, standard deviations 300, 300, 500 m; WGS 84" in said
    rows = (tmp_path / "block" / "positions.csv").read_text(encoding="utf-8").splitlines()
    assert rows[1] == "ARBCSRD00010006.tif,-111.716543,32.91516,3810.0,300.0,300.0,500.0"
    rows = (tmp_path / "block" / "observations.csv").read_text(encoding="utf-8").splitlines()
    assert rows[1] == "ARBCSRD00010006.tif,cg01,4703.34,2196.9"


@pytest.mark.parametrize(
    ("missing", "expected"),
    [
        ("--image-size", f"{FILES[0]}: --image-size: does not say how large the photos are; give --image-size"),
        ("--positions-sigma", f"{FILES[1]}: --positions-sigma: does not say how precise its positions are"),
        ("--crs", f"{FILES[2]}: --crs: nothing says in which frame the control lies; give --crs"),
    ],
)
def test_what_the_files_do_not_carry_is_asked_for(tmp_path: Path, capsys: Capture, missing: str, expected: str) -> None:
    place = OPTIONS.index(missing)
    options = OPTIONS[:place] + OPTIONS[place + 2 :]
    assert expected in refused(capsys, copied(tmp_path / "historix"), tmp_path / "block", *options)


WRONG: dict[str, tuple[str, str, str, str]] = {
    "no focal length": (FILES[0], "focal_length", "focus", f"{FILES[0]}:1: focal_length: there is no column"),
    "negative": (FILES[0], "152.865", "-152.865", f"{FILES[0]}:2:1: focal_length: "),
    "no principal point": (FILES[0], "-0.030,-0.001", ",", f"{FILES[0]}:2"),
    "y down": (FILES[0], ",109.999", ",-109.999", f"{FILES[0]}:2:38: midside_top_y_mm: midside_top has no place"),
    "half a mark": (FILES[0], "-105.998,", ",", "corner_top_left_x_mm: corner_top_left has no place on its side"),
    "small photos": (FILES[0], "0.025,", "0.015,", "midside_left lies outside photos of 10000 x 10000 px of 0.015 mm"),
    "no column": (FILES[0], "principal_point_y_mm", "k1", f"{FILES[0]}:1: principal_point_y_mm: there is no column"),
    "latitude": (FILES[1], "32.894945", "132.894945", f"{FILES[1]}:3:33: lat: 132.895 is no angle in degrees"),
    "twice": (FILES[1], "00010007", "00010006", f"{FILES[1]}:3:1: image_file_name: photo ARBCSRD00010006.tif is al"),
    "no height": (FILES[1], "32.91516,3810", "32.91516,", f"{FILES[1]}:2"),
    "mark outside": (FILES[2], "4703.34", "14703.34", f"{FILES[2]}:2:26: x: the mark lies outside photo"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_refused_with_its_place(tmp_path: Path, capsys: Capture, name: str) -> None:
    file, old, new, expected = WRONG[name]
    source = copied(tmp_path / "historix")
    text = (source / file).read_text(encoding="utf-8")
    assert old in text
    (source / file).write_text(text.replace(old, new, 1), encoding="utf-8")
    assert expected in refused(capsys, source, tmp_path / "block", *OPTIONS)
