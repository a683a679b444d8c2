"""``photostrip simulate`` as a user calls it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from photostrip.project.loading import load_project

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Call

FILES = ("control.csv", "observations.csv", "project.yaml", "truth.json")


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    file = tmp_path / "strip.yaml"
    file.write_text("photostrip_simulation: 1\nflight: {photos: 4}\nseed: 3\n", encoding="utf-8")
    return file


def test_a_project_is_written_and_can_be_read(spec: Path, call: Call) -> None:
    folder = spec.parent / "new" / "strip"
    code, out, err = call("simulate", spec, "-o", folder)
    assert (code, out) == (0, "")
    image_points = (folder / "observations.csv").read_text(encoding="utf-8").count("\n") - 1
    assert err == (
        f"{folder}/project.yaml: 1 strip, 4 photos, scale 1:10000, 24 points, {image_points} image points,"
        " 9 control points, 7 check points, seed 3\n"
    )
    assert {file.name for file in folder.iterdir()} == {*FILES}
    project = load_project(folder / "project.yaml")
    assert project.inputs.strips[0].photos == ("1001", "1002", "1003", "1004")
    assert json.loads((folder / "truth.json").read_text(encoding="utf-8"))["photostrip_truth"] == 2


def test_keys_are_set_and_nothing_is_said(spec: Path, call: Call) -> None:
    folder, rule = spec.parent / "out", spec.parent / "out.d"
    options = ["--set", "flight.photos=6", "--set", "gnss={}", "--quiet", "--depfile", rule]
    assert call("simulate", spec, "-o", folder, *options) == (0, "", "")
    assert (folder / "gnss.csv").is_file()
    assert len(load_project(folder / "project.yaml").inputs.observations.photo_ids) == 6
    assert rule.read_text(encoding="utf-8").startswith(f"{folder}/project.yaml: {spec}\n")


def test_a_project_that_was_not_simulated_is_not_overwritten(spec: Path, call: Call) -> None:
    mine = spec.parent / "mine" / "project.yaml"
    mine.parent.mkdir()
    mine.write_text("photostrip: 1\n", encoding="utf-8")
    message = "is no simulated project, and is not overwritten; choose another folder, or remove it"
    assert call("simulate", spec, "-o", mine.parent) == (2, "", f"error: {mine}: {message}\n")
    assert [each.name for each in mine.parent.iterdir()] == ["project.yaml"]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("flight.photos=0", "error: --set: flight.photos: 0 photos cannot make a strip; expected two or more\n"),
        ("flight.end_lap_percent=-5", "error: --set: flight.end_lap_percent: an end lap of -5 % cannot be simulated"),
        ("flights.photos=3", "the key `flights` is not known; did you mean `flight`?"),
        ("flight.photos=99999999999", "error: --set: flight.photos: 99999999999 photos are too many"),
    ],
)
def test_a_refusal_writes_nothing_and_harms_nothing(change: str, expected: str, spec: Path, call: Call) -> None:
    folder = spec.parent / "out"
    for _ in range(2):  # what was simulated is simulated again
        assert call("simulate", spec, "-o", folder, "-q")[0] == 0
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    for place in (folder, spec.parent / "other"):
        code, _, err = call("simulate", spec, "-o", place, "--set", change)
        assert (code, expected in err) == (2, True)
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    assert not (spec.parent / "other").exists()
