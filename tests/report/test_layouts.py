"""Every layout of photos that can be simulated, and every sample, is written with its report, and reported again."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
import yaml

import photostrip
from photostrip.cli.main import main

if TYPE_CHECKING:
    from pathlib import Path

FOUR, TWO = {"photos": 4}, {"photos": 4, "strips": 2}
FIRST, SECOND = ["1001", "1002", "1003", "1004"], ["2001", "2002", "2003", "2004"]
POSITIONS = {"flight": FOUR, "gnss": {"use": True}}


def strips(*photos: list[str]) -> list[dict[str, Any]]:
    return [{"id": f"S{number}", "camera": "film", "photos": each} for number, each in enumerate(photos)]


def by(adjustment: str, **asked: object) -> dict[str, Any]:
    return {"processing": {"adjustment": adjustment}, **asked}


SINGLE = [[photo] for photo in (*FIRST, *SECOND)]
# what is simulated, and keys of its project that are then put in place of others; None: are left out
LAYOUTS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "strip": ({"flight": FOUR}, {}),
    "strip by polynomials": ({"flight": FOUR}, by("polynomial")),
    "pair": ({"flight": {"photos": 2}, "control": {"bands": 2}}, {}),
    "strips": ({"flight": TWO}, {}),
    "single photos": ({"flight": TWO}, by("bundle", strips=strips(*SINGLE))),
    "strip and single photos": ({"flight": TWO}, by("bundle", strips=strips(FIRST, *SINGLE[4:]))),
    "one photo and strip": ({"flight": TWO}, by("bundle", strips=strips(["2002"], FIRST))),
    "models": ({"flight": FOUR, "models": {}}, {}),
    "models without centres": ({"flight": FOUR, "models": {"centers": False}}, {}),
    "camera positions": (POSITIONS, by("bundle")),
    "camera positions alone": (POSITIONS, by("bundle", control=None)),
    "nothing given": ({"flight": FOUR}, by("bundle", control=None)),
    "failed": ({"flight": FOUR}, {"tolerances": {"check_rms_xy": 0.001}}),
    "film": ({"flight": FOUR, "film": {}}, {}),
    "cross-validated": ({"flight": FOUR}, {"processing": {"cross_validation": True}}),
    "gross errors": ({"flight": {"photos": 5}, "gross_errors": [{"kind": "image"}, {"kind": "control"}]}, {}),
    "local": ({"flight": TWO, "ground": {"crs": "local"}}, by("bundle")),
    "geocentric": ({"flight": TWO, "ground": {"crs": "geocentric", "axes": ["x", "y", "z"]}}, {}),
    "two zones": (
        {"flight": FOUR, "ground": {"center_deg": [18.0, 49.2]}, "control": {"second_crs": "EPSG:32634"}},
        {},
    ),
    "digital": ({"flight": FOUR, "camera": {"preset": "digital"}, "image": {"unit": "px", "y_axis": "down"}}, {}),
    "geographic": ({"flight": TWO, "ground": {"crs": "EPSG:4326"}}, {}),
}


def written(folder: Path, specification: dict[str, Any], changed: dict[str, Any]) -> Path:
    """Simulate a project, and change its keys."""
    photostrip.simulate(specification).write(folder)
    project = folder / "project.yaml"
    keys = yaml.safe_load(project.read_text(encoding="utf-8")) | changed
    kept = {key: value for key, value in keys.items() if value is not None}
    project.write_text(json.dumps(kept), encoding="utf-8")
    return project


def check_reports(result: photostrip.Result, folder: Path) -> None:
    """Write a result with its page, and print it again from its file in every form."""
    assert "report.html" in result.write(folder, html=True)
    again = photostrip.read_result(folder)
    assert again.report("html") == (folder / "report.html").read_text(encoding="utf-8")
    assert again.report("text") == result.report("text")
    assert again.report("md") == result.report("md")
    assert "plan" in dir(again.plot)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_is_reported(tmp_path: Path, layout: str) -> None:
    result = photostrip.run(written(tmp_path, *LAYOUTS[layout]))
    assert (result.status == "failed") == (layout == "failed")
    check_reports(result, tmp_path / "result")


@pytest.mark.parametrize("command", ["run", "report"])
def test_a_mistake_of_the_report_is_no_fault_of_the_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    project = written(tmp_path, *LAYOUTS["strip"])
    assert main(["run", str(project), "-o", str(tmp_path / "result"), "-q", "--html"]) == 0
    whole = {path.name: path.read_bytes() for path in (tmp_path / "result").iterdir()}
    monkeypatch.setattr("photostrip.report.html.pictures_of", lambda _: {}["1004"])
    if command == "run":
        code = main(["run", str(project), "-o", str(tmp_path / "new"), "-q", "--html"])
        whole.pop("report.html")
    else:
        code = main(["report", str(tmp_path / "result"), "-o", str(tmp_path / "page.html")])
    assert code == 70
    assert "internal error (a bug): KeyError: '1004'" in capsys.readouterr().err
    there = tmp_path / ("new" if command == "run" else "result")
    assert {path.name: path.read_bytes() for path in there.iterdir()} == whole  # the result is written all the same


def test_the_report_of_an_edited_result_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    photostrip.run(written(tmp_path, *LAYOUTS["strip"])).write(tmp_path)
    file = tmp_path / "result.json"
    assert main(["report", str(file), "--strict"]) == 0
    document = json.loads(file.read_text(encoding="utf-8"))
    document["points"]["x"][0] += 0.01
    file.write_text(json.dumps(document), encoding="utf-8")
    capsys.readouterr()
    for form in ("text", "md"):
        assert main(["report", str(file), "--strict", "--format", form]) == 1
        printed = " ".join(capsys.readouterr().out.split())
        assert "LOOK at 1 thing before you use this." in printed
        assert "its numbers are not those of its certificate: it was edited after it was written" in printed
    document["bundle"]["screening"]["test"] = "no such test"
    file.write_text(json.dumps(document), encoding="utf-8")
    assert main(["report", str(file), "-o", str(tmp_path / "page.html")]) == 2
    assert f"error: {file}: cannot be reported: its numbers are not those" in capsys.readouterr().err
