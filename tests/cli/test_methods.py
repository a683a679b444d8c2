"""By which method a run adjusts: the network wherever it is determined, else the polynomial; all side by side."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import pytest

from photostrip.formats.result_json import checked, read_result
from photostrip.pipeline.inputs import METHODS
from tests.loops import nonempty
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.calls import Answer, Call

    Document = dict[str, Any]
    Run = Callable[..., Document]

pytestmark = pytest.mark.usefixtures("_adjusted_once")

SAMPLE = ROOT / "sample_data" / "simulated-20" / "project.yaml"
BUNDLE = ("--set", "processing.adjustment=bundle")
FLAT = "flight: {photos: 5, attitude_sigma_deg: [0, 0, 0]}\nterrain: {relief: 0}\ncontrol: {bands: 3, per_band: 3}\n"
UNDETERMINED = ("--set", "processing.self_calibration=[principal_distance]")  # is flown height, over flat ground
BANDS = "flight: {photos: 3}\ncontrol: {bands: 3, per_band: 3}\n"
SINGLES = {'"1001", "1002", "1003"]\n': "".join(['"1001"]\n', *(
    f'- {{id: S{n}, camera: film, photos: ["100{n}"]}}\n' for n in (2, 3)
)])}  # each photo a strip of its own  # fmt: skip


@pytest.fixture
def run(answer: Answer) -> Run:
    """Give a function that runs a project and gives its result."""
    return lambda *arguments: checked(json.loads(answer("run", *arguments, "--format", "json")), "result.json")


def simulated(answer: Answer, folder: Path, spec: str, **changes: str) -> Path:
    """Simulate a project, with changes of its file."""
    (folder / "spec.yaml").write_text(f"photostrip_simulation: 1\nname: small\n{spec}", encoding="utf-8")
    answer("simulate", folder / "spec.yaml", "-o", folder / "in", "--quiet")
    project = folder / "in" / "project.yaml"
    text = project.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    project.write_text(text, encoding="utf-8")
    return project


def edit(file: Path, change: Callable[[list[str]], list[str]]) -> None:
    """Change the rows of a table."""
    head, *rows = file.read_text(encoding="utf-8").splitlines()
    file.write_text("\n".join([head, *change(rows)]) + "\n", encoding="utf-8")


# ----------------------------------------------------------------------------------------------- nothing asked for


def test_two_strips_of_three_photos_on_four_corners(answer: Answer, run: Run, tmp_path: Path) -> None:
    """The block of the textbooks: no strip has control enough of its own, together they have."""
    project = simulated(answer, tmp_path, "flight: {photos: 3, strips: 2}\ncontrol: {layout: corners, check: 12}\n")
    inner = ("G01,", "G03,", "G06,", "G08,")
    edit(
        project.with_name("control.csv"),
        lambda rows: [row.replace(",control", ",check") if row.startswith(inner) else row for row in rows],
    )
    document = run(project)
    assert document["adjustment"] == "bundle"
    assert "classical" not in document
    check = document["summary"]["check"]
    assert check["plan"]["count"] == 16
    assert 2 < check["plan"]["rms_um"] < 12  # of 5 µm in the image
    assert 2 < check["height"]["rms_um"] < 20


def test_a_photo_that_is_a_strip_of_its_own(answer: Answer, run: Run, tmp_path: Path) -> None:
    spec = "flight: {photos: 4}\ncontrol: {bands: 2, per_band: 3, check: 6}\n"
    single = '"1003"]\n- {id: B, camera: film, photos: ["1004"]}\n'
    document = run(simulated(answer, tmp_path, spec, **{'"1003", "1004"]\n': single}))
    assert document["adjustment"] == "bundle"
    assert [photo["id"] for photo in document["photos"]] == ["1001", "1002", "1003", "1004"]


def test_the_classical_adjustment_stands_beside_it(answer: Answer, run: Run) -> None:
    classical = run(SAMPLE)["classical"]
    alone = run(SAMPLE, "--set", "processing.adjustment=polynomial")
    summary = alone["summary"]
    for role in ("control", "check"):
        assert classical[f"{role}_rms"] == {part: summary[role][part]["rms"] for part in ("plan", "height")}
    (strip,), (polynomial,) = classical["strips"], alone["polynomials"]
    assert max(strip["degree_plan"], strip["degree_height"]) == polynomial["degree"]
    assert "classical" not in alone
    said = " ".join(answer("run", SAMPLE).split())
    degrees = "degree {degree_plan} in plan and {degree_height} in height".format(**strip)
    left = "{plan:.3f}/{height:.3f} m at check points".format(**classical["check_rms"])
    assert f"by polynomials {degrees}; rms in plan/height" in said
    assert left in said


def test_where_no_bundle_can_be_had_it_is_the_polynomial_and_says_why(
    answer: Answer, run: Run, call: Call, tmp_path: Path
) -> None:
    project = simulated(answer, tmp_path, FLAT)
    document = run(project, *UNDETERMINED)
    assert (document["adjustment"], document["settings"]["adjustment"]) == ("polynomial", "auto")
    assert len(document["polynomials"]) == 1
    (note,) = [each for each in document["notes"] if each["code"] == "no-bundle"]
    assert "self_calibration" in note["message"]
    assert document["status"] == "look"
    assert call("run", project, *BUNDLE, *UNDETERMINED)[0] == 3


@pytest.mark.slow
@pytest.mark.usefixtures("_adjusted_each_time")
def test_where_the_bundle_does_not_converge_it_is_the_polynomial(
    run: Run, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("photostrip.network.adjustment.MOST_STEPS", 1)
    code, _, err = call("run", SAMPLE, *BUNDLE)
    assert code == 3
    (refused,) = (line for line in err.splitlines() if line.startswith("error: the bundle adjustment did not converge"))
    document = run(SAMPLE)
    assert document["adjustment"] == "polynomial"
    assert refused.removeprefix("error: ") in " ".join(note["message"] for note in document["notes"])


@pytest.mark.slow
def test_points_of_single_photos_that_stand_out_are_told_without_precision(
    answer: Answer, run: Run, tmp_path: Path
) -> None:
    project = simulated(answer, tmp_path, BANDS, **SINGLES)
    raised: list[str] = []

    def raise_one(rows: list[str]) -> list[str]:
        row = next(number for number, line in enumerate(rows) if line.endswith(",check"))
        point, x, y, z, *rest = rows[row].split(",")
        raised.append(point)
        return [*rows[:row], ",".join([point, x, y, f"{float(z) + 8.0:.4f}", *rest]), *rows[row + 1 :]]

    edit(project.with_name("control.csv"), raise_one)
    document = run(project, *BUNDLE, "--set", "processing.precision=false")
    assert f"check point {raised[0]} (" in document["verdict"]["look_at"][0]


def test_a_free_network_from_the_command_line(answer: Answer, run: Run, tmp_path: Path) -> None:
    project = simulated(answer, tmp_path, BANDS)
    edit(project.with_name("control.csv"), lambda rows: [row.replace(",control", ",check") for row in rows])
    document = run(project, *BUNDLE)
    assert (document["bundle"]["free_network"], document["frame"]["crs"]) == (True, "local")
    assert "free-network" in [note["code"] for note in document["notes"]]


@pytest.mark.slow
def test_a_block_with_positions_from_end_to_end(answer: Answer, run: Run, tmp_path: Path) -> None:
    """Positions take part; the resolved project gives the same, photos.csv the frame of a network without control."""
    project = simulated(answer, tmp_path, "flight: {photos: 6, strips: 2}\ngnss: {use: true}\n")
    answer("check", project, *BUNDLE)
    answer("run", project, *BUNDLE, "-o", tmp_path / "out", "--trace", tmp_path / "trace.txt")
    document = read_result(str(tmp_path / "out" / "result.json"))
    assert document["bundle"]["observations"]["position"] == 3 * 12
    assert len(document["positions"]) == 12
    assert all(photo["sigma_z"] > 0 for photo in nonempty(document["photos"]))
    assert (tmp_path / "trace.txt").read_text(encoding="utf-8").startswith("Trace: small\n")
    again = project.with_name("again.yaml")
    again.write_bytes((tmp_path / "out" / "project.resolved.yaml").read_bytes())
    assert run(again)["points"] == document["points"]
    text = project.read_text(encoding="utf-8")
    section = (
        f'orientations:\n  file: {tmp_path / "out" / "photos.csv"}\n  crs: "EPSG:32633"\n  axes: [east, north, up]\n'
        "  role: approximate\nprocessing: {adjustment: bundle}\n"
    )
    again.write_text(text[: text.index("control:")] + section, encoding="utf-8")
    answer("check", again)
    free = run(again)
    assert free["bundle"]["free_network"] is True
    assert free["frame"]["crs"] == "EPSG:32633"
    place = {photo["id"]: (photo["x"], photo["y"], photo["z"]) for photo in document["photos"]}
    for photo in nonempty(free["photos"]):
        assert (photo["x"], photo["y"], photo["z"]) == pytest.approx(place[photo["id"]], abs=3.0)


# --------------------------------------------------------------------------------------------------- side by side


@pytest.mark.slow
def test_all_methods_stand_side_by_side(answer: Answer, run: Run, call: Call, tmp_path: Path) -> None:
    document = json.loads(answer("run", SAMPLE, "--compare-methods", "--format", "json"))
    assert [row["adjustment"] for row in document["methods"]] == list(METHODS)
    rms = {row["adjustment"]: row["check_plan_rms"] for row in document["methods"]}
    assert rms["bundle"] < rms["polynomial"] < rms["similarity"]
    assert document["best"] == {"plan": "bundle", "height": "bundle"}
    assert run(SAMPLE, *BUNDLE)["summary"]["check"]["plan"]["rms"] == rms["bundle"]
    _, out, err = call("run", SAMPLE, "--compare-methods", "-o", tmp_path / "out")
    assert out.startswith("Methods: simulated-20\n")
    assert "Smallest at check points: bundle." in out
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(METHODS)
    assert (tmp_path / "out" / "polynomial" / "polynomials.csv").exists()
    assert not (tmp_path / "out" / "bundle" / "polynomials.csv").exists()
    assert "wrote the result of bundle" in err


@pytest.mark.slow
def test_a_method_that_does_not_take_the_project_is_told_with_its_reason(
    answer: Answer, call: Call, tmp_path: Path
) -> None:
    """Single photos are for bundles only; with two control points every method refuses, and the command with them."""
    project = simulated(answer, tmp_path, BANDS, **SINGLES)
    out = tmp_path / "out"
    command = ("run", project, "--compare-methods", "--format", "json")
    document = json.loads(answer(*command, "-o", out, "--html"))
    assert document["name"] == "small"
    refused = {row["adjustment"]: row["reason"] for row in document["methods"] if row["status"] == "refused"}
    assert refused.keys() == {*METHODS} - {"bundle"}
    assert all("there is only one photo" in reason for reason in refused.values())
    assert document["best"]["plan"] == "bundle"
    assert sorted(path.name for path in out.iterdir()) == ["bundle", "methods.html"]
    assert (out / "bundle" / "report.html").is_file()
    page = (out / "methods.html").read_text(encoding="utf-8")
    assert re.search("Methods: small(.|\n)*there is only one photo", page)
    project = simulated(answer, tmp_path, BANDS)
    edit(project.with_name("control.csv"), lambda rows: [row for row in rows if ",check" not in row][:2])
    code, _, err = call("run", project, "--compare-methods")
    assert (code, "control" in err) == (3, True)
