"""What a run does when nothing is asked for: the network wherever it is determined, the polynomial where it is not."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import pytest

from photostrip.cli.main import main
from photostrip.formats.result_json import checked
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Capture

pytestmark = pytest.mark.usefixtures("_adjusted_once")

SAMPLE = ROOT / "sample_data" / "simulated-20" / "project.yaml"
FLAT = "flight: {photos: 5, attitude_sigma_deg: [0, 0, 0]}\nterrain: {relief: 0}\ncontrol: {bands: 3, per_band: 3}\n"
UNDETERMINED = ("--set", "processing.self_calibration=[principal_distance]")  # is flown height, over flat ground


def run(capsys: Capture, project: Path, *options: str) -> dict[str, Any]:
    """Run a project and give its result."""
    assert main(["run", str(project), "--format", "json", *options]) == 0
    return checked(json.loads(capsys.readouterr().out), "result.json")


def simulated(folder: Path, spec: str, **changes: str) -> Path:
    """Simulate a project, with changes of its file."""
    (folder / "spec.yaml").write_text(f"photostrip_simulation: 1\nname: small\n{spec}", encoding="utf-8")
    assert main(["simulate", str(folder / "spec.yaml"), "-o", str(folder / "in"), "--quiet"]) == 0
    project = folder / "in" / "project.yaml"
    text = project.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    project.write_text(text, encoding="utf-8")
    return project


def test_two_strips_of_three_photos_on_four_corners(capsys: Capture, tmp_path: Path) -> None:
    """The block of the textbooks: no strip has control enough of its own, together they have."""
    project = simulated(tmp_path, "flight: {photos: 3, strips: 2}\ncontrol: {layout: corners, check: 12}\n")
    control = project.with_name("control.csv")
    text = control.read_text(encoding="utf-8")
    for inner in ("G01", "G03", "G06", "G08"):
        text = re.sub(f"^({inner},.*),control$", r"\1,check", text, flags=re.MULTILINE)
    control.write_text(text, encoding="utf-8")
    capsys.readouterr()
    document = run(capsys, project)
    assert document["adjustment"] == "bundle"
    assert "classical" not in document
    check = document["summary"]["check"]
    assert check["plan"]["count"] == 16
    assert 2 < check["plan"]["rms_um"] < 12  # of 5 µm in the image
    assert 2 < check["height"]["rms_um"] < 20


def test_a_photo_that_is_a_strip_of_its_own(capsys: Capture, tmp_path: Path) -> None:
    spec = "flight: {photos: 4}\ncontrol: {bands: 2, per_band: 3, check: 6}\n"
    single = '"1003"]\n  - {id: B, camera: film, photos: ["1004"]}\n'
    project = simulated(tmp_path, spec, **{'"1003", "1004"]\n': single})
    capsys.readouterr()
    document = run(capsys, project)
    assert document["adjustment"] == "bundle"
    assert [photo["id"] for photo in document["photos"]] == ["1001", "1002", "1003", "1004"]


def test_the_classical_adjustment_stands_beside_it(capsys: Capture) -> None:
    classical = run(capsys, SAMPLE)["classical"]
    alone = run(capsys, SAMPLE, "--set", "processing.adjustment=polynomial")
    summary = alone["summary"]
    for role in ("control", "check"):
        assert classical[f"{role}_rms"] == {part: summary[role][part]["rms"] for part in ("plan", "height")}
    (strip,), (polynomial,) = classical["strips"], alone["polynomials"]
    assert max(strip["degree_plan"], strip["degree_height"]) == polynomial["degree"]
    assert "classical" not in alone
    assert main(["run", str(SAMPLE)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    degrees = "degree {degree_plan} in plan and {degree_height} in height".format(**strip)
    left = "{plan:.3f}/{height:.3f} m at check points".format(**classical["check_rms"])
    assert f"polynomials instead {degrees}; rms in plan/height" in said
    assert left in said


def test_where_no_bundle_can_be_had_it_is_the_polynomial_and_says_why(capsys: Capture, tmp_path: Path) -> None:
    project = simulated(tmp_path, FLAT)
    capsys.readouterr()
    document = run(capsys, project, *UNDETERMINED)
    assert document["adjustment"] == "polynomial"
    assert document["settings"]["adjustment"] == "auto"
    assert len(document["polynomials"]) == 1
    (note,) = [each for each in document["notes"] if each["code"] == "no-bundle"]
    assert "self_calibration" in note["message"]
    assert document["status"] == "look"
    assert main(["run", str(project), "--set", "processing.adjustment=bundle", *UNDETERMINED]) == 3
