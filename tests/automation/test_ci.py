"""The shell script and the workflow for CI do what docs/ci.md says."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import pytest
import yaml

from tests.pages import Scratch
from tests.results import spec, write_project
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

WORKFLOW = ROOT / "configs/ci/github-workflow.yaml"


def workflow() -> Any:  # noqa: ANN401 (any YAML)
    return yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))


def test_the_workflow_installs_a_fixed_commit() -> None:
    steps = workflow()["jobs"]["regress"]["steps"]
    (install,) = [step for step in steps if "pip" in step.get("run", "")]
    assert install["env"]["PHOTOSTRIP"].startswith("git+https://")
    assert install["env"]["PHOTOSTRIP"].endswith("@COMMIT")
    assert install["run"] == 'python -m pip install "photostrip @ $PHOTOSTRIP"'


@pytest.mark.slow
def test_the_steps_of_the_workflow_run_and_annotate(tmp_path: Path, forked: Path) -> None:
    scratch = Scratch(tmp_path, forked)
    shutil.copy(ROOT / "configs/ci/regress.sh", scratch.folder)
    for name in ("line-07", "line-08"):
        write_project(scratch.folder / "strips" / name, spec())
    update = "for n in 07 08; do photostrip compare r strips/line-$n/baseline.json --update; done"
    outcome = scratch.shell(f"photostrip run strips/line-07/project.yaml -o r -q && {update}")
    assert outcome.code == 0, outcome.err
    commands = [step["run"] for step in workflow()["jobs"]["regress"]["steps"] if "run" in step]
    assert len(commands) == 3
    check, regress = (command.partition("#")[0] for command in commands[1:])
    assert scratch.shell(check).code == 0
    assert scratch.shell(regress).code == 0
    spoil(scratch.folder / "strips/line-08/baseline.json")
    failed = scratch.shell(regress)
    assert failed.code == 1
    found = [line for line in failed.out if line.startswith("::error")]
    assert len(found) == 1
    assert found[0].startswith("::error file=strips/line-08/baseline.json,line=")
    line = int(found[0].split("line=")[1].split(",")[0])
    text = (scratch.folder / "strips/line-08/baseline.json").read_text(encoding="utf-8").splitlines()[line - 1]
    assert text == '"points": {'
    for name, failures in (("line-07", "0"), ("line-08", "1")):
        suite = ET.parse(scratch.folder / f"build/{name}/compare.xml").getroot()  # noqa: S314 (we wrote it)
        assert suite.get("failures") == failures


def spoil(baseline: Path) -> None:
    """Move one point by a metre."""
    text = baseline.read_text(encoding="utf-8")
    points = json.loads(text)["points"]
    heights = points["z"].copy()
    heights[points["id"].index("1002-3")] += 1.0
    before, after = (json.dumps(each, separators=(",", ":")) for each in (points["z"], heights))
    assert text.count(before) == 1
    baseline.write_text(text.replace(before, after), encoding="utf-8")


def run_script(folder: Path, command: object) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PHOTOSTRIP": str(command), "PYTHONPATH": str(ROOT)}
    script = str(ROOT / "configs/ci/regress.sh")
    return subprocess.run(["bash", script], cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_script_goes_on_after_a_failure_and_ends_with_the_worst_code(tmp_path: Path, forked: Path) -> None:
    for name in ("a", "b", "c"):
        write_project(tmp_path / name, spec())
    (tmp_path / "a/observations.csv").unlink()
    with (tmp_path / "b/project.yaml").open("a", encoding="utf-8") as opened:
        opened.write("tolerances: {check_rms_xy: 0.0001}\n")
    done = run_script(tmp_path, forked)
    assert done.returncode == 2
    assert [line for line in done.stdout.splitlines() if line.startswith("==")] == ["== a", "== b", "== c"]
    assert "a/observations.csv does not exist" in done.stderr
    assert {path.parent.name for path in tmp_path.glob("build/*/result.json")} == {"b", "c"}
    shutil.rmtree(tmp_path / "a")
    shutil.rmtree(tmp_path / "c")
    assert run_script(tmp_path, f"{sys.executable} -m photostrip").returncode == 1


def test_the_script_refuses_an_empty_folder(tmp_path: Path) -> None:
    done = run_script(tmp_path, "photostrip")
    assert (done.returncode, done.stderr) == (2, "no ./*/project.yaml\n")


@pytest.mark.slow
def test_the_script_writes_junit(tmp_path: Path, forked: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_project(tmp_path / "line", spec())
    write = [str(forked), "run", str(tmp_path / "line/project.yaml"), "-o", str(tmp_path / "whole"), "-q"]
    subprocess.run(write, capture_output=True, check=True)
    shutil.copy(tmp_path / "whole/result.json", tmp_path / "line/baseline.json")
    monkeypatch.setenv("FORMAT", "junit")
    done = run_script(tmp_path, forked)
    assert (done.returncode, done.stderr.startswith("GOOD")) == (0, True), done.stderr
    assert done.stdout == (tmp_path / "build/line/compare.xml").read_text(encoding="utf-8")
    assert ET.fromstring(done.stdout).get("failures") == "0"  # noqa: S314 (our own)
