"""``photostrip run --compare-methods`` as a user calls it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from photostrip.cli.main import main
from photostrip.formats.result_json import read_result
from photostrip.pipeline.inputs import METHODS
from photostrip.result.table import plain_of, rows_of
from tests.loops import nonempty
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Call, Capture

pytestmark = pytest.mark.usefixtures("_adjusted_once")

PROJECT = str(ROOT / "sample_data" / "simulated-20" / "project.yaml")
BUNDLE = ("--set", "processing.adjustment=bundle")


def single_photos(folder: Path) -> Path:
    """Simulate three photos, each a strip of its own."""
    spec = "photostrip_simulation: 1\nname: singles\nflight: {photos: 3}\ncontrol: {bands: 3, per_band: 3}\n"
    (folder / "sim.yaml").write_text(spec, encoding="utf-8")
    assert main(["simulate", str(folder / "sim.yaml"), "-o", str(folder / "in")]) == 0
    project = folder / "in" / "project.yaml"
    text = project.read_text(encoding="utf-8")
    start, end = text.index("strips:"), text.index("observations:")
    strips = "".join(f'  - {{id: S{n}, camera: film, photos: ["100{n}"]}}\n' for n in (1, 2, 3))
    project.write_text(f"{text[:start]}strips:\n{strips}{text[end:]}", encoding="utf-8")
    return project


@pytest.mark.slow
def test_all_methods_stand_side_by_side(call: Call) -> None:
    code, out, _ = call("run", PROJECT, "--compare-methods", "--format", "json")
    document = json.loads(out)
    assert code == 0
    assert [row["adjustment"] for row in document["methods"]] == list(METHODS)
    by_name = {row["adjustment"]: row for row in document["methods"]}
    rms = {name: row["check_plan_rms"] for name, row in by_name.items()}
    assert rms["bundle"] < rms["polynomial"] < rms["similarity"]
    assert document["best"] == {"plan": "bundle", "height": "bundle"}
    single = json.loads(call("run", PROJECT, *BUNDLE, "--format", "json")[1])
    assert single["summary"]["check"]["plan"]["rms"] == rms["bundle"]


@pytest.mark.slow
def test_text_and_files(call: Call, tmp_path: Path) -> None:
    code, out, err = call("run", PROJECT, "--compare-methods", "-o", str(tmp_path / "out"))
    assert code == 0
    assert out.startswith("Methods: simulated-20\n")
    assert "Smallest at check points: bundle." in out
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(METHODS)
    assert "polynomials.csv" in {path.name for path in (tmp_path / "out" / "polynomial").iterdir()}
    assert "polynomials.csv" not in {path.name for path in (tmp_path / "out" / "bundle").iterdir()}
    assert "wrote the result of bundle" in err


@pytest.mark.slow
def test_a_method_that_is_refused_is_told(call: Call, tmp_path: Path) -> None:
    """Two control points are too few for any method; one adjustment alone fails with its own exit code."""
    folder = ROOT / "sample_data" / "simulated-20"
    lines = (folder / "control.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    for name in ("project.yaml", "observations.csv"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    control = [line for line in lines[1:] if ",check" not in line]
    (tmp_path / "control.csv").write_text("".join([lines[0], *control[:2]]), encoding="utf-8")
    code, out, err = call("run", str(tmp_path / "project.yaml"), "--compare-methods")
    assert (code, out) == (3, "")
    assert "control" in err


@pytest.mark.slow
def test_a_method_that_does_not_take_the_project_is_told_with_its_reason(
    call: Call, capsys: Capture, tmp_path: Path
) -> None:
    """Single photos are for bundles only: the project itself is refused by three methods of four."""
    project = single_photos(tmp_path)
    capsys.readouterr()
    code, out, err = call(
        "run", str(project), "--compare-methods", "--format", "json", "-o", str(tmp_path / "out"), "--html"
    )
    assert (code, "error" in err) == (0, False)
    document = json.loads(out)
    assert document["name"] == "singles"
    status = {row["adjustment"]: row["status"] for row in document["methods"]}
    assert {name for name, each in status.items() if each == "refused"} == {*METHODS} - {"bundle"}
    for row in nonempty([row for row in document["methods"] if row["status"] == "refused"]):
        assert "there is only one photo" in row["reason"]
    assert document["best"]["plan"] == "bundle"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["bundle", "methods.html"]
    assert (tmp_path / "out" / "bundle" / "report.html").is_file()
    page = (tmp_path / "out" / "methods.html").read_text(encoding="utf-8")
    assert "Methods: singles" in page
    assert "there is only one photo" in page


@pytest.mark.slow
@pytest.mark.usefixtures("_adjusted_each_time")
def test_where_the_bundle_does_not_converge_auto_takes_the_polynomial(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("photostrip.network.adjustment.MOST_STEPS", 1)
    code, _, err = call("run", PROJECT, *BUNDLE)
    assert code == 3
    (refused,) = (line for line in err.splitlines() if line.startswith("error: the bundle adjustment did not converge"))
    code, text, _ = call("run", PROJECT, "--format", "json")
    assert (code, json.loads(text)["adjustment"]) == (0, "polynomial")
    assert refused.removeprefix("error: ") in " ".join(json.loads(text)["notes"]["message"])


@pytest.mark.slow
def test_points_of_single_photos_that_stand_out_are_told_without_precision(
    call: Call, capsys: Capture, tmp_path: Path
) -> None:
    project = single_photos(tmp_path)
    control = project.parent / "control.csv"
    lines = control.read_text(encoding="utf-8").splitlines()
    row = next(number for number, line in enumerate(lines) if line.endswith(",check"))
    point, x, y, z, *rest = lines[row].split(",")
    lines[row] = ",".join([point, x, y, f"{float(z) + 8.0:.4f}", *rest])
    control.write_text("\n".join(lines) + "\n", encoding="utf-8")
    capsys.readouterr()
    code, out, _ = call("run", str(project), *BUNDLE, "--set", "processing.precision=false", "--format", "json")
    assert code == 0
    assert f"check point {point} (" in json.loads(out)["verdict"]["look_at"][0]


# ------------------------------------------------------------------------------------ what is wrong, by its exit code


def small(folder: Path, control: str, more: str = "") -> str:
    """Write the simulated sample with other control, and something more in the project file; give its path."""
    source = ROOT / "sample_data" / "simulated-20"
    text = (source / "project.yaml").read_text(encoding="utf-8")
    text = "\n".join(line for line in text.splitlines() if not line.startswith("tolerances"))
    (folder / "project.yaml").write_text(f"{text}\n{more}", encoding="utf-8")
    (folder / "observations.csv").write_bytes((source / "observations.csv").read_bytes())
    (folder / "control.csv").write_text(control, encoding="utf-8")
    return str(folder / "project.yaml")


def given(rows: int) -> str:
    """Give the first control points of the sample."""
    lines = (ROOT / "sample_data" / "simulated-20" / "control.csv").read_text(encoding="utf-8").splitlines()
    return "\n".join([lines[0], *[line for line in lines[1:] if ",check" not in line][:rows]]) + "\n"


def test_a_free_network_from_the_command_line(call: Call, tmp_path: Path) -> None:
    path = small(tmp_path, given(20).replace(",control", ",check") if ",control" in given(20) else given(0))
    code, out, _ = call("run", path, *BUNDLE, "--format", "json")
    document = json.loads(out)
    assert code == 0
    assert document["bundle"]["free_network"] is True
    assert document["frame"]["crs"] == "local"
    assert "free-network" in document["notes"]["code"]


SPEC = """\
photostrip_simulation: 1
name: block
flight: {photos: 6, strips: 2}
gnss: {use: true}
"""


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("simulated")
    (folder / "spec.yaml").write_text(SPEC, encoding="utf-8")
    assert main(["simulate", str(folder / "spec.yaml"), "-o", str(folder / "project"), "--quiet"]) == 0
    return folder / "project" / "project.yaml"


@pytest.mark.slow
def test_a_simulated_project_with_positions_from_end_to_end(
    simulated: Path, call: Call, capsys: Capture, tmp_path: Path
) -> None:
    """Everything a run can write, of a bundle; the positions take part and the project checks clean."""
    assert main(["check", str(simulated), *BUNDLE]) == 0
    capsys.readouterr()
    arguments = (str(simulated), *BUNDLE, "-o", str(tmp_path / "out"), "--trace", str(tmp_path / "trace.txt"))
    code, _, _ = call("run", *arguments)
    assert code == 0
    document = read_result(str(tmp_path / "out" / "result.json"))
    assert document["bundle"]["observations"]["position"] == 3 * 12
    assert len(document["bundle"]["positions"]) == 12
    assert all(photo["sigma_z"] > 0 for photo in nonempty(document["photos"]))
    assert (tmp_path / "trace.txt").read_text(encoding="utf-8").startswith("Trace: block\n")
    resolved = tmp_path / "out" / "project.resolved.yaml"
    (simulated.parent / "again.yaml").write_bytes(resolved.read_bytes())
    again = json.loads(call("run", str(simulated.parent / "again.yaml"), "--format", "json")[1])
    assert again["points"] == plain_of(document["points"])


@pytest.mark.slow
def test_the_photos_of_a_result_are_orientations(simulated: Path, call: Call, capsys: Capture, tmp_path: Path) -> None:
    """photos.csv read again as approximate orientations gives the frame of a network without control."""
    assert call("run", str(simulated), "-o", str(tmp_path), "--quiet")[0] == 0
    text = simulated.read_text(encoding="utf-8")
    section = (
        f'orientations:\n  file: {tmp_path / "photos.csv"}\n  crs: "EPSG:32633"\n  axes: [east, north, up]\n'
        "  role: approximate\nprocessing: {adjustment: bundle}\n"
    )
    path = simulated.parent / "free.yaml"
    path.write_text(text[: text.index("control:")] + section, encoding="utf-8")
    assert main(["check", str(path)]) == 0
    capsys.readouterr()
    code, out, _ = call("run", str(path), "--format", "json")
    document = json.loads(out)
    assert code == 0
    assert document["bundle"]["free_network"] is True
    assert document["frame"]["crs"] == "EPSG:32633"
    first = read_result(str(tmp_path / "result.json"))
    place = {photo["id"]: (photo["x"], photo["y"], photo["z"]) for photo in first["photos"]}
    for photo in nonempty(rows_of(document["photos"])):
        assert (photo["x"], photo["y"], photo["z"]) == pytest.approx(place[photo["id"]], abs=3.0)
