"""``photostrip init``, ``schema`` and ``info`` as a user calls them."""

from __future__ import annotations

import importlib.metadata
import json
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip import __version__
from photostrip.cli import about
from photostrip.project.check import check_project
from photostrip.project.template import template_files
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Call

SAMPLE = ROOT / "sample_data" / "simulated-20"
FILLED = {
    "principal_distance:": "principal_distance: 153.0",
    "photos: []": f"photos: [{', '.join(str(1001 + i) for i in range(20))}]",
    "\n  sigma:   ": "\n  sigma: 0.005   ",
    "    crs:  ": "    crs: EPSG:32633  ",
    "    sigma:  ": "    sigma: [0.03, 0.03, 0.05]  ",
}


def test_the_template_asks_for_what_is_missing_and_for_nothing_else(tmp_path: Path, call: Call) -> None:
    folder = tmp_path / "deep" / "strip a"
    assert call("init", folder)[0] == 0
    assert {path.name for path in folder.iterdir()} == set(template_files("x"))
    faults = check_project(folder / "project.yaml").faults
    assert [(fault.key, fault.code) for fault in faults] == [
        ("cameras.camera-1.principal_distance", "no-value"),
        ("strips[0].photos", "length"),
        ("observations.sigma", "no-value"),
        ("control[0].crs", "no-value"),
        ("control[0].sigma", "type"),
        ("", "no-rows"),
        ("", "no-rows"),
    ]


@pytest.mark.slow
def test_the_template_runs_when_it_is_filled_in(tmp_path: Path, call: Call) -> None:
    folder = tmp_path / "strip"
    call("init", folder)
    path = folder / "project.yaml"
    text = path.read_text(encoding="utf-8")
    for empty, filled in FILLED.items():
        assert text.count(empty) == 1, empty
        text = text.replace(empty, filled)
    path.write_text(text, encoding="utf-8")
    for name in ("observations.csv", "control.csv"):
        head = (SAMPLE / name).read_text(encoding="utf-8").splitlines(keepends=True)[0]
        assert (folder / name).read_text(encoding="utf-8") == head
        (folder / name).write_bytes((SAMPLE / name).read_bytes())
    code, out, _ = call("run", path)
    assert code == 0
    assert out.startswith("Accuracy report: strip\n")


def test_keys_that_are_commented_out_are_keys(tmp_path: Path) -> None:
    text = template_files("x")["project.yaml"]
    opened = re.sub(r"(?m)^( *)# (?=(format|pixel_size|fiducials|processing|tolerances):)", r"\1", text)
    opened = re.sub(r"(?m)^#   (?=(adjustment|polynomial|earth_curvature|refraction):)", "  ", opened)
    (tmp_path / "project.yaml").write_text(opened, encoding="utf-8")
    codes = {fault.code for fault in check_project(tmp_path / "project.yaml").faults}
    assert "unknown-key" not in codes
    assert "refraction: false" in opened


@pytest.mark.parametrize("name", ["NO", "1:20", "a: b", "'", '"', "Полоса 7", "{x}", "#1", "🛩️"])
def test_any_name_of_a_folder_does(tmp_path: Path, name: str) -> None:
    (tmp_path / "p.yaml").write_text(template_files(name)["project.yaml"], encoding="utf-8")
    assert "name" not in {fault.key for fault in check_project(tmp_path / "p.yaml").faults}


@pytest.mark.parametrize("name", sorted(template_files("x")))
def test_nothing_is_overwritten(tmp_path: Path, name: str, call: Call) -> None:
    (tmp_path / name).write_text("mine", encoding="utf-8")
    code, _, err = call("init", tmp_path)
    assert code == 2
    assert err.startswith(f"error: {tmp_path}/{name}: already exists and is not overwritten")
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text(encoding="utf-8") == "mine"


def test_the_schema_goes_into_a_file(tmp_path: Path, call: Call) -> None:
    assert call("schema", "-o", tmp_path / "s.json") == (0, "", "")
    assert (tmp_path / "s.json").read_text(encoding="utf-8") == call("schema")[1]


def test_info_names_versions_threads_and_formats(call: Call) -> None:
    code, out, err = call("info")
    assert (code, err) == (0, "")
    for text in (f"photostrip  {__version__}", f"numpy {np.__version__}", "OMP_NUM_THREADS=", "result.json"):
        assert text in out
    assert json.loads(call("info", "--format", "json")[1])["libraries"]["numpy"] == np.__version__


def test_info_says_how_to_get_an_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = ["numpy>=1", "plotter-of-nothing>=3; extra == 'plots'", "pytest>=8; extra == 'test'"]
    monkeypatch.setattr(importlib.metadata, "requires", lambda _: lines)
    found = about.installation()
    assert set(found["extras"]) == {"plots"}
    assert found["extras"]["plots"]["missing"] == ["plotter-of-nothing"]
    assert "pip install 'photostrip[plots]'" in "".join(about._lines(found))
