"""The examples for CI, make and Snakemake do what docs/ci.md says; --depfile lists what is read."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import yaml

from photostrip.cli.main import main
from tests.geodesy.frames import write_gtx
from tests.pages import Scratch
from tests.results import spec, write_project
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

WORKFLOW = ROOT / "configs/ci/github-workflow.yaml"


def workflow() -> Any:  # noqa: ANN401 (any YAML)
    return yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_the_steps_of_the_workflow_install_a_fixed_commit_run_and_annotate(tmp_path: Path, forked: Path) -> None:
    scratch = Scratch(tmp_path, forked)
    shutil.copy(ROOT / "configs/ci/regress.sh", scratch.folder)
    for name in ("line-07", "line-08"):
        write_project(scratch.folder / "strips" / name, spec())
    update = "for n in 07 08; do photostrip compare r strips/line-$n/baseline.json --update; done"
    outcome = scratch.shell(f"photostrip run strips/line-07/project.yaml -o r -q && {update}")
    assert outcome.code == 0, outcome.err
    install, *others = (step for step in workflow()["jobs"]["regress"]["steps"] if "run" in step)
    assert install["env"]["PHOTOSTRIP"].startswith("git+https://")
    assert install["env"]["PHOTOSTRIP"].endswith("@COMMIT")
    assert install["run"] == 'python -m pip install "photostrip @ $PHOTOSTRIP"'
    check, regress = (step["run"].partition("#")[0] for step in others)
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


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_the_script_and_make_refuse_an_empty_folder(tmp_path: Path) -> None:
    done = run_script(tmp_path, "photostrip")
    assert (done.returncode, done.stderr) == (2, "no ./*/project.yaml\n")
    done = Folder(tmp_path).make()
    assert (done.returncode, "no ./*/project.yaml" in done.stderr) == (2, True)


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


COMMON = "photostrip: 1\nextends: deeper.yaml\nprocessing: {refraction: false}\n"
DEEPER = "photostrip: 1\nprocessing: {scale_transfer: least_squares}\n"
GEOID = '"+proj=utm +zone=33 +datum=WGS84 +geoidgrids=own.gtx"'
# Prints what the command opens below a folder.
SPY = """
import os, sys
seen = set()
def spy(event, arguments):
    if event == "open" and isinstance(arguments[0], str):
        path = os.path.realpath(arguments[0])
        if path.startswith(os.path.realpath(".") + os.sep):
            seen.add(os.path.relpath(path))
sys.addaudithook(spy)
from photostrip.cli.main import main
code = main(sys.argv[1:])
sys.stderr.write("\\n".join(sorted(seen)))
sys.exit(code)
"""


def two_strips(folder: Path) -> None:
    """Write two strips that extend one file, which extends another; the heights of the second stand above a geoid."""
    (folder / "common.yaml").write_text(COMMON, encoding="utf-8")
    (folder / "deeper.yaml").write_text(DEEPER, encoding="utf-8")
    for name in ("a", "b"):
        write_project(folder / name, spec(), "extends: ../common.yaml\n")
    project = folder / "b/project.yaml"
    text = project.read_text(encoding="utf-8").replace('"EPSG:32633"', f"{GEOID}\n  height: orthometric")
    project.write_text(text, encoding="utf-8")
    write_gtx(folder / "b/own.gtx", np.full((41, 41), 45.0), south=30.0, west=0.0, step=1.0)


def listed(depfile: Path) -> set[str]:
    """Give the files of a rule for make."""
    rule = depfile.read_text(encoding="utf-8").splitlines()[0].split(": ", 1)[1]
    return {os.path.normpath(re.sub(r"\\(.)", r"\1", name)) for name in re.split(r"(?<!\\) ", rule)}


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
@pytest.mark.parametrize(
    ("strip", "more"), [("a", set()), ("b", {"b/own.gtx"})], ids=["tables and presets", "a geoid grid"]
)
def test_the_depfile_lists_every_file_that_is_read(tmp_path: Path, strip: str, more: set[str]) -> None:
    two_strips(tmp_path)
    done = subprocess.run(
        [sys.executable, "-c", SPY, "run", f"{strip}/project.yaml", "-o", "out", "--depfile", "out/d.mk", "--quiet"],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    opened = {name for name in done.stderr.splitlines() if not name.startswith("out")}
    names = {f"{strip}/{name}" for name in ("project.yaml", "observations.csv", "control.csv")}
    names |= {"common.yaml", "deeper.yaml"}
    assert opened == names | more == listed(tmp_path / "out/d.mk")
    assert done.returncode == 0


@pytest.mark.slow
def test_a_grid_that_is_far_away_is_listed_by_its_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    two_strips(tmp_path)
    grid = (tmp_path / "b/own.gtx").rename(tmp_path / "far.gtx")
    project = tmp_path / "b/project.yaml"
    project.write_text(project.read_text(encoding="utf-8").replace("own.gtx", str(grid)), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert main(["run", "b/project.yaml", "-o", "out", "--depfile", "d.mk", "--quiet"]) == 0
    assert str(grid) in (tmp_path / "d.mk").read_text(encoding="utf-8")


# ------------------------------------------------------------------------------------------------------- make


class Folder:
    """A folder of strips with the example Makefile; `command` is the ``photostrip`` that it calls."""

    def __init__(self, path: Path, command: object = f"{sys.executable} -m photostrip") -> None:
        self.path, self.command = path, command
        shutil.copy(ROOT / "configs/Makefile.example", path / "Makefile")

    def make(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run make, as a user would type it."""
        flags = dict.fromkeys(("MAKEFLAGS", "MFLAGS", "MAKELEVEL"), "")
        environment = os.environ | flags | {"PYTHONPATH": str(ROOT)}
        return subprocess.run(
            ["make", f"PHOTOSTRIP={self.command}", *arguments],
            cwd=self.path, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip

    def times(self) -> dict[str, int]:
        """Give the time of each result."""
        return {path.parent.name: path.stat().st_mtime_ns for path in self.path.glob("build/*/result.json")}

    def renewed(self, *arguments: str) -> set[str]:
        """Give the strips that make adjusted."""
        before = self.times()
        done = self.make(*arguments)
        assert done.returncode == 0, done.stderr
        return {name for name, when in self.times().items() if when != before.get(name)}

    def touch(self, name: str) -> None:
        """Give a file a time after everything else."""
        now = time.time_ns()
        os.utime(self.path / name, ns=(now, now))


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_adjusts_what_changed_and_nothing_else(tmp_path: Path, forked: Path) -> None:
    two_strips(tmp_path)
    folder = Folder(tmp_path, forked)
    assert folder.renewed("-j2") == {"a", "b"}
    assert folder.renewed("-j2") == set()
    for touched, expected in (("a/control.csv", {"a"}), ("b/own.gtx", {"b"}), ("deeper.yaml", {"a", "b"})):
        folder.touch(touched)
        assert folder.renewed("-j2") == expected, touched
    assert folder.renewed("RUN_FLAGS=--set processing.polynomial.degree=1") == {"a", "b"}
    assert folder.renewed() == {"a", "b"}
    (tmp_path / "build/a/depends.mk").unlink()
    assert folder.renewed() == {"a"}
    assert folder.renewed() == set()
    # a table that is gone is named, and the result kept
    before = (tmp_path / "build/a/result.json").read_bytes()
    (tmp_path / "a/control.csv").unlink()
    folder.touch("b/control.csv")
    times = folder.times()
    done = folder.make("-k", "-j2")
    assert done.returncode == 2
    assert re.search(
        r"error: a/project\.yaml:\d+:\d+: control\[0\]\.file: .*a/control\.csv does not exist", done.stderr
    )
    assert (tmp_path / "build/a/result.json").read_bytes() == before
    assert folder.times()["b"] > times["b"]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_check_compares_and_watches_tolerances(tmp_path: Path, forked: Path) -> None:
    two_strips(tmp_path)
    folder = Folder(tmp_path, forked)
    first = folder.make("-j2", "check")
    assert first.returncode == 0
    assert first.stdout.count("no baseline.json") == 2
    assert folder.make("baselines").returncode == 0
    again = folder.make("-j2", "check")
    assert (again.returncode, again.stdout.count("SAME:")) == (0, 2)
    baseline = json.loads((tmp_path / "a/baseline.json").read_text(encoding="utf-8"))
    baseline["points"]["z"][0] += 1.0
    (tmp_path / "a/baseline.json").write_text(json.dumps(baseline), encoding="utf-8")
    with (tmp_path / "b/project.yaml").open("a", encoding="utf-8") as opened:
        opened.write("tolerances: {check_rms_xy: 0.0001}\n")
    for _ in range(2):  # a tolerance that failed is told again, though nothing is adjusted again
        failed = folder.make("-k", "-j2", "check")
        assert failed.returncode == 2
        assert "DIFFERENT: " in failed.stdout
        assert "FAILED: 1 of 1 tolerance not kept." in failed.stdout
    assert folder.renewed() == set()


def test_make_regress_is_the_example_on_the_samples() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert re.search(r"(?m)^regress: .*\n\t.*-f configs/Makefile\.example STRIPS=sample_data .* check$", text)
    assert {path.parent for path in (ROOT / "sample_data").glob("*/baseline.json")} == {
        path.parent for path in (ROOT / "sample_data").glob("*/project.yaml")
    }


# -------------------------------------------------------------------------------------------------- Snakemake


def snakefile() -> str:
    return (ROOT / "configs/Snakefile.example").read_text(encoding="utf-8")


def test_the_snakefile_reads_what_the_depfile_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The one function of ours in it, without Snakemake: blanks in names, and the first run."""
    from photostrip.formats.files import make_rule

    monkeypatch.chdir(tmp_path)
    text = snakefile()
    room: dict[str, object] = {}
    exec(compile(text[: text.index("rule all")], "Snakefile", "exec"), room)  # noqa: S102

    class Wildcards:
        strip = "a"

    sources = room["sources"]
    assert callable(sources)
    (tmp_path / "strips/a").mkdir(parents=True)
    (tmp_path / "strips/a/project.yaml").touch()
    assert sources(Wildcards) == "strips/a/project.yaml"
    names = ["strips/a/project.yaml", "strips/a/my points.csv", "common.yaml"]
    (tmp_path / "build/a").mkdir(parents=True)
    (tmp_path / "build/a/depends.mk").write_text(make_rule("build/a/result.json", names), encoding="utf-8")
    for name in names[1:]:
        with pytest.raises(FileNotFoundError, match=name):
            sources(Wildcards)
        (tmp_path / name).touch()
    assert sources(Wildcards) == names
    later = time.time_ns() + 10**9
    os.utime(tmp_path / "strips/a/project.yaml", ns=(later, later))
    assert sources(Wildcards) == names[0]
