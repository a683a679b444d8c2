"""``photostrip check`` as a user calls it, and what run and check tell in every format."""

from __future__ import annotations

import json
import re
import shutil
from typing import TYPE_CHECKING

import numpy as np
import pyproj
import pytest

from photostrip.project.check import check_project
from photostrip.report.commands.check import check_sections
from photostrip.report.page.layout import to_text
from photostrip.report.page.parts import Table
from photostrip.result.table import rows_of
from tests.loops import nonempty
from tests.project.samples import MARKED_FILES, OBSERVATIONS, sample
from tests.results import spec, write_project

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Call
    from tests.results import Document

pytestmark = pytest.mark.usefixtures("_adjusted_once")

MILLIMETRE = 1e-3


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_project(tmp_path_factory.mktemp("project"), spec("north first", 2))


# ------------------------------------------------------------------------------------------------ what is told


def test_a_good_project_is_decoded_and_nothing_is_written(project: Path, call: Call) -> None:
    before = {path: path.read_bytes() for path in project.parent.iterdir()}
    code, out, err = call("check", project)
    assert (code, err) == (0, "")
    assert out.splitlines()[0].startswith(f"{project}: OK, ready to run")
    for title in ("Contents", "Ground frames", "Standard deviations of the control", "Rows of the tables"):
        assert f"── {title}" in out
    _, quiet, _ = call("check", project, "--quiet")
    assert all(re.match(rf"{project}: OK|(warning|note): ", line) for line in nonempty(quiet.splitlines()))
    assert {path: path.read_bytes() for path in project.parent.iterdir()} == before


def test_every_project_is_checked_and_every_fault_told(project: Path, tmp_path: Path, call: Call) -> None:
    wrong = sample(tmp_path)
    wrong.change("project.yaml", "unit: mm", "unit: cm")
    wrong.change("control.csv", "xyz", "xyy")
    code, out, err = call("check", wrong.folder / "project.yaml", tmp_path / "no.yaml", project)
    assert (code, err) == (2, "")
    lines = out.splitlines()
    assert lines[0] == f"{tmp_path}/project.yaml: FAULTY, 2 faults"
    assert lines[1].startswith(f"error: {tmp_path}/project.yaml:18:9: observations.unit: `cm` is not known")
    assert lines[2].startswith(f"error: {tmp_path}/control.csv:2:32: use: `xyy` is not known")
    assert f"error: {tmp_path}/no.yaml: does not exist" in out
    assert lines[-1] == "3 projects: 1 OK, 2 faulty"


# -------------------------------------------------------------------------------- weak geometry, before it is met


def test_pairs_joints_and_control_are_counted(tmp_path: Path) -> None:
    project = sample(tmp_path).folder / "project.yaml"
    together = {fault.code for fault in check_project(project).faults}
    assert together == {"too-few-common-points"}  # strips of a block may hang on others
    faults = check_project(project, ["processing.adjustment=polynomial"]).faults
    pairs, control = "too-few-common-points", "too-little-control"
    told = {(fault.code, fault.line): str(fault) for fault in faults}
    assert set(told) == {(pairs, 12), (pairs, 15), (control, 10), (control, 13)}
    assert "photos 1001 and 1002 have 2 points in common; expected at least 5" in told[pairs, 12]
    assert "strip B has 1 control point in plan and 1 in height" in told[control, 13]


def test_three_photos_without_a_common_point(project: Path, tmp_path: Path) -> None:
    shutil.copytree(project.parent, tmp_path / "p")
    path = tmp_path / "p" / "observations.csv"
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    third = {row.split(",")[1] for row in rows if row.startswith(rows[0].split(",")[0] + ",")}
    photos = list(dict.fromkeys(row.split(",")[0] for row in rows))
    kept = [row for row in rows if not (row.split(",")[0] == photos[2] and row.split(",")[1] in third)]
    path.write_text("\n".join([head, *kept]) + "\n", encoding="utf-8")
    faults = check_project(tmp_path / "p" / "project.yaml").faults
    assert [fault.code for fault in faults] == ["broken-joint"]
    assert f"no point is common to photos {photos[0]}, {photos[1]} and {photos[2]}" in faults[0].message


def test_very_many_faults_are_only_counted(tmp_path: Path) -> None:
    made = sample(tmp_path)
    made.change("project.yaml", "[1001, 1002]", f"[{', '.join(f'N{n}' for n in range(300))}]")
    made.write("observations.csv", OBSERVATIONS + "".join(f"N{n},QN{n},1,2\n" for n in range(300)))
    faults = check_project(tmp_path / "project.yaml").faults
    assert (len(faults), faults[-1].code) == (201, "more")


# --------------------------------------------------------------------------------------------- decoded frames


def test_the_decoded_point_is_that_of_proj(project: Path) -> None:
    found = check_project(project).document["frames"][0]
    north, east, height = found["given"]
    crs = re.search(r"EPSG:\d+", found["frame"])
    assert crs
    transformer = pyproj.Transformer.from_crs(crs[0], "EPSG:4326", always_xy=True)
    longitude, latitude = transformer.transform(east, north)
    assert np.abs(np.array(found["geodetic"]) - (longitude, latitude, height)).max() < 1e-8
    assert found["back_mm"] < MILLIMETRE
    factors = pyproj.Proj(crs[0]).get_factors(longitude, latitude)
    low, high = found["convergence_deg"]
    assert low - 1e-6 <= factors.meridian_convergence <= high + 1e-6
    assert high - low < 0.2
    swapped = check_project(project, ["control[0].axes=[east, north, up]"]).document["frames"][0]
    assert swapped["geodetic"][1] != pytest.approx(found["geodetic"][1], abs=1)  # is seen where it is decoded


def test_a_point_outside_the_projection_is_a_fault(tmp_path: Path) -> None:
    made = sample(tmp_path)
    made.change("control.csv", "500100.12,4649871.40", "9e9,9e9")
    faults = check_project(tmp_path / "project.yaml").faults
    assert ("ground-domain", 23) in {(fault.code, fault.line) for fault in faults}


# -------------------------------------------------------------------------------------- where sigma comes from


def test_every_control_coordinate_says_its_sigma_and_where_it_stands(tmp_path: Path) -> None:
    made = sample(tmp_path)
    table = "point,x,y,z,use,sx,sy,sz\nG1,500100,4649871,212,xyz,0.01,,\nP2,500200,4649971,,xy,,,0.7\n"
    made.write("control.csv", table)
    first, second = check_project(tmp_path / "project.yaml").document["control"]
    assert first["sigma"] == [0.01, 0.06, 0.08]
    default = ("default", "project.yaml", 26)
    places = [(each["source"], each["file"].rpartition("/")[2], each["line"]) for each in first["sigma_from"]]
    assert places == [("row", "control.csv", 2), default, default]
    assert second["sigma"] == [0.05, 0.06, None]
    assert second["sigma_from"][2] is None
    found = check_project(tmp_path / "project.yaml", ["control[0].sigma=[1, 2, 3]"]).document["control"][1]
    assert found["sigma"] == [1, 2, None]
    assert found["sigma_from"][0] == {"source": "default", "file": "--set", "line": 0, "key": "control[0].sigma"}


def crowded(path: Path) -> Document:
    """Give what a check decodes of a project with too much of everything: lists in many frames, sigmas of all kinds."""
    document = check_project(path).document
    frame, control, table = document["frames"][0], document["control"][0], document["rows"][0]
    return document | {
        "frames": [{**frame, "file": f"control-{n}.csv"} for n in range(40)],
        "control": [{**control, "id": f"G{n}", "sigma": [0.01 * (n % 20), 0.0, 0.0]} for n in range(500)],
        "rows": [{**table, "file": f"t{n}.csv", "used": table["used"] - (n == 7)} for n in range(80)],
    }


def test_a_check_is_short_with_too_much_of_everything(project: Path) -> None:
    document = crowded(project)
    printed = to_text("", check_sections(document), 100).splitlines()
    assert len(printed) <= 60
    for text in ("38 more frames; --verbose decodes all", "350 more points; --verbose prints every point"):
        assert text in printed
    assert "75 more tables: all rows used" in printed
    everything = to_text("", check_sections(document, everything=True), 100).splitlines()
    assert sum("control-" in line for line in everything) == 40
    assert sum(line.startswith("G") for line in everything) == 500
    assert sum("rows used" in line for line in everything) == 80


def test_points_with_the_same_standard_deviations_share_a_line(project: Path) -> None:
    document = check_project(project).document
    control, check = (
        {**document["control"][0], "role": role, "photos": photos} for role, photos in (("control", 2), ("check", 5))
    )
    document["control"] = [
        {**row, "id": f"{n}"} for n in range(10) for row in (control, {**control, "photos": 3}, check)
    ]
    section = next(each for each in check_sections(document) if each.title.startswith("Standard"))
    (table,) = (part for part in section.parts if isinstance(part, Table))
    assert [(row[0], row[1], row[2], row[6]) for row in table.rows] == [
        ("0, …", "20", "control", "2 to 3"),
        ("0, …", "10", "check", "5"),
    ]


# -------------------------------------------------------------------------------------------- rows of the tables


def test_every_row_is_accounted_for(tmp_path: Path) -> None:
    made = sample(tmp_path, MARKED_FILES)
    made.write("observations.csv", OBSERVATIONS + "9999,P1,1,2\n1001,lonely,3,4\n1001,apart,5,6\n2001,apart,7,8\n")
    made.write("fiducials.csv", MARKED_FILES["fiducials.csv"] + "9999,F1,1,2\n")
    made.change("control.csv", "P2,", "N1,1,2,3,off,control\nN2,1,2,3,,check\nP2,")
    checked = check_project(tmp_path / "project.yaml", ["processing.adjustment=polynomial"])
    rows = {each["file"].rpartition("/")[2]: (each["rows"], each["used"]) for each in checked.document["rows"]}
    assert rows == {"observations.csv": (12, 8), "fiducials.csv": (9, 8), "control.csv": (4, 2)}
    told = {note.code: note.message for note in checked.notes if note.code != "unused-camera"}
    for code, words in [
        ("photo-in-no-strip", "9999"),
        ("measured-once", "lonely"),
        ("no-neighbour", "1 point is not on two neighbouring photos of one strip and cannot be used: apart"),
        ("control-off", "N1"),
        ("control-not-measured", "N2"),
    ]:
        assert words in told[code]


# ------------------------------------------------------------------------------------- the same in every format


FINDING = {
    "severity", "code", "file", "line", "column", "key", "message", "expected", "fix", "photos", "points",
}  # fmt: skip


@pytest.mark.parametrize("command", ["run", "check"])
def test_findings_as_json(tmp_path: Path, command: str, call: Call) -> None:
    made = sample(tmp_path)
    made.change("project.yaml", "y_axis: up", "y_axes: up")
    made.change("observations.csv", "-20.25", "-20,25")
    code, out, err = call(command, made.folder / "project.yaml", "--format", "json")
    document = json.loads(out)
    assert (code, err) == (2, "")
    told = document if command == "run" else document["projects"][0]
    findings = told["findings"]
    assert command == "run" or told["status"] == "faulty"
    assert all(each.keys() == FINDING for each in nonempty(findings))
    assert [(each["file"], each["line"], each["column"], each["key"], each["code"]) for each in findings] == [
        (f"{tmp_path}/project.yaml", 19, 3, "observations.y_axes", "unknown-key"),
        (f"{tmp_path}/observations.csv", 2, 0, "", "row-length"),
    ]


@pytest.mark.parametrize("command", ["run", "check"])
def test_findings_as_annotations(tmp_path: Path, command: str, call: Call) -> None:
    sample(tmp_path).change("project.yaml", "unit: mm", "unit: 100%,cm")
    code, out, _ = call(command, tmp_path / "project.yaml", "--format", "github")
    assert code == 2
    assert out == (
        f"::error file={tmp_path}/project.yaml,line=18,col=9,title=photostrip word"
        "::observations.unit: `100%25,cm` is not known; expected one of mm, um, 0.1um, px\n"
    )


@pytest.mark.slow
def test_notes_of_a_run_know_their_place(tmp_path: Path, project: Path, call: Call) -> None:
    shutil.copytree(project.parent, tmp_path / "p")
    table = tmp_path / "p" / "observations.csv"
    text = table.read_text(encoding="utf-8").replace("\n", "\nIMG_1,P1,1,2\n", 1)
    table.write_text(text, encoding="utf-8")
    project = tmp_path / "p" / "project.yaml"
    _, out, _ = call("run", project, "--format", "json")
    note = rows_of(json.loads(out)["notes"])[0]
    assert (note["code"], note["file"], note["line"]) == ("photo-in-no-strip", "observations.csv", 2)
    assert str(tmp_path) not in out
    assert call("run", project, "--format", "github")[1].startswith(
        "::warning file=observations.csv,line=2,title=photostrip photo-in-no-strip::"
    )
    assert "observations.csv:2: 1 row of 1 photo in no strip is not used: IMG_1" in call("run", project)[1]


# ----------------------------------------------------------------------------------------- the environment


@pytest.mark.slow
def test_variables_stand_in_for_options(project: Path, monkeypatch: pytest.MonkeyPatch, call: Call) -> None:
    monkeypatch.setenv("PHOTOSTRIP_FORMAT", "json")
    assert json.loads(call("check", project)[1])["photostrip_check"] == 1
    monkeypatch.setenv("PHOTOSTRIP_FORMAT", "text")
    monkeypatch.setenv("PHOTOSTRIP_WIDTH", "60")
    assert max(map(len, call("run", project)[1].splitlines())) <= 60
    assert call("run", project, "--width", "70")[1].splitlines()[2] == "── Verdict ".ljust(70, "─")
    monkeypatch.setenv("PHOTOSTRIP_QUIET", "1")
    assert len(call("run", project)[1].splitlines()) < 6
    monkeypatch.setenv("PHOTOSTRIP_FORMAT", "xml")
    code, _, err = call("check", project)
    assert (code, "PHOTOSTRIP_FORMAT" in err) == (2, True)


def test_debug_by_variable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Call) -> None:
    monkeypatch.setenv("PHOTOSTRIP_DEBUG", "1")
    assert "Traceback" in call("run", tmp_path / "no.yaml")[2]
    monkeypatch.setenv("PHOTOSTRIP_DEBUG", "0")
    assert "Traceback" not in call("run", tmp_path / "no.yaml")[2]


@pytest.mark.slow
def test_what_the_pipeline_would_refuse_is_told_with_its_place(tmp_path: Path, project: Path, call: Call) -> None:
    made = sample(tmp_path)
    made.change("project.yaml", "crs: EPSG:32633", "crs: geocentric")
    made.change("project.yaml", "axes: [east, north, up]", "axes: [x, y, z]")
    made.change("project.yaml", "    height: ellipsoidal\n", "")
    faults = {fault.code: fault for fault in check_project(tmp_path / "project.yaml").faults}
    assert (faults["geocentric-use"].line, faults["geocentric-use"].key) == (22, "control[0]")
    arguments = [project, "--set", "processing.relative.drop=[9/9]"]
    assert call("check", *arguments)[0] == 2
    code, _, err = call("run", *arguments)
    assert code == 2
    assert err.startswith("error: --set: processing.relative.drop: `9/9` names no measurement")
