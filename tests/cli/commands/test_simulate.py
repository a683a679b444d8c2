"""``photostrip simulate`` as a user calls it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from photostrip.cli.main import main
from photostrip.project.loading import load_project

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Capture


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    file = tmp_path / "strip.yaml"
    file.write_text("photostrip_simulation: 1\nflight: {photos: 4}\nseed: 3\n", encoding="utf-8")
    return file


def test_a_project_is_written_and_can_be_read(spec: Path, capsys: Capture) -> None:
    folder = spec.parent / "new" / "strip"
    assert main(["simulate", str(spec), "-o", str(folder)]) == 0
    assert sorted(file.name for file in folder.iterdir()) == [
        "control.csv",
        "observations.csv",
        "project.yaml",
        "truth.json",
    ]
    project = load_project(folder / "project.yaml")
    assert project.inputs.strips[0].photos == ("1001", "1002", "1003", "1004")
    assert json.loads((folder / "truth.json").read_text(encoding="utf-8"))["photostrip_truth"] == 2
    image_points = len((folder / "observations.csv").read_text(encoding="utf-8").splitlines()) - 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == (
        f"{folder}/project.yaml: 1 strip, 4 photos, scale 1:10000, 24 points, {image_points} image points,"
        " 9 control points, 7 check points, seed 3\n"
    )


def test_keys_are_set_and_nothing_is_said(spec: Path, capsys: Capture) -> None:
    folder = spec.parent / "out"
    options = ["--set", "flight.photos=6", "--set", "gnss={}", "--quiet", "--depfile", str(spec.parent / "out.d")]
    assert main(["simulate", str(spec), "-o", str(folder), *options]) == 0
    assert capsys.readouterr().err == ""
    assert (folder / "gnss.csv").is_file()
    assert len(load_project(folder / "project.yaml").inputs.observations.photo_ids) == 6
    assert (spec.parent / "out.d").read_text(encoding="utf-8").startswith(f"{folder}/project.yaml: {spec}\n")


def test_a_project_that_was_not_simulated_is_not_overwritten(spec: Path, tmp_path: Path, capsys: Capture) -> None:
    mine = tmp_path / "mine" / "project.yaml"
    mine.parent.mkdir()
    mine.write_text("photostrip: 1\n", encoding="utf-8")
    assert main(["simulate", str(spec), "-o", str(mine.parent)]) == 2
    message = "is no simulated project, and is not overwritten; choose another folder, or remove it"
    assert capsys.readouterr().err == f"error: {mine}: {message}\n"
    assert [each.name for each in mine.parent.iterdir()] == ["project.yaml"]
    again = tmp_path / "again"
    assert [main(["simulate", str(spec), "-o", str(again), "-q"]) for _ in range(2)] == [0, 0]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("flight.photos=0", "error: --set: flight.photos: 0 photos cannot make a strip; expected two or more\n"),
        ("flight.end_lap_percent=-5", "error: --set: flight.end_lap_percent: an end lap of -5 % cannot be simulated"),
        ("flights.photos=3", "the key `flights` is not known; did you mean `flight`?"),
        ("flight.photos=99999999999", "error: --set: flight.photos: 99999999999 photos are too many"),
    ],
)
def test_a_refusal_writes_nothing_and_harms_nothing(change: str, expected: str, spec: Path, capsys: Capture) -> None:
    folder = spec.parent / "out"
    assert main(["simulate", str(spec), "-o", str(folder), "-q"]) == 0
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert main(["simulate", str(spec), "-o", str(folder), "--set", change]) == 2
    assert expected in capsys.readouterr().err
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    assert main(["simulate", str(spec), "-o", str(spec.parent / "other"), "--set", change]) == 2
    assert not (spec.parent / "other").exists()


def test_a_project_is_no_specification(spec: Path, capsys: Capture) -> None:
    folder = spec.parent / "out"
    assert main(["simulate", str(spec), "-o", str(folder), "-q"]) == 0
    assert main(["simulate", str(folder / "project.yaml"), "-o", str(spec.parent / "other")]) == 2
    assert "photostrip: this is a project for `photostrip run`" in capsys.readouterr().err
