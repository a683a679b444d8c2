"""Projects of independent models on the command line: run, report, compare, batch, exit codes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from photostrip.cli.main import main
from photostrip.foreign.simulated import project_files
from photostrip.formats.files import write_files
from photostrip.formats.result_json import read_result
from photostrip.simulation import Flight, Models, Spec, simulate
from tests.loops import nonempty

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Capture

pytestmark = pytest.mark.usefixtures("_adjusted_once")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    write_files(tmp_path / "plotted", project_files(simulate(Spec(flight=Flight(photos=6), models=Models()))))
    return tmp_path / "plotted" / "project.yaml"


@pytest.mark.slow
def test_everything_that_is_written(project: Path, capsys: Capture) -> None:
    folder = project.parent.parent
    assert main(["run", str(project), "-o", str(folder / "a"), "--html"]) == 0
    assert main(["run", str(project), "-o", str(folder / "b"), "--quiet"]) == 0
    assert (folder / "a" / "result.json").read_bytes() == (folder / "b" / "result.json").read_bytes()
    printed = capsys.readouterr().out
    document = read_result(str(folder / "a" / "result.json"))
    assert document["photos"].values("r11") == document["photos"].values("angle_1") == [None] * 6
    assert all(photo["x"] is not None and photo["sigma_x"] > 0 for photo in nonempty(document["photos"]))
    assert [len(document[name]) for name in ("links", "models", "junctions", "residuals")] == [4, 5, 0, 0]
    assert (document["summary"]["photo_scale"], document["cameras"]) == (None, [])
    lines = (folder / "a" / "link_residuals.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "strip,before,after,point,vx_um,vy_um,vz_um,test,used"
    assert len(lines) == 1 + len(document["link_residuals"])
    assert "links of the models" in printed
    assert "at model scale" in printed
    assert "Links of the models" in (folder / "a" / "report.html").read_text(encoding="utf-8")
    for form in ("text", "md", "json"):
        assert main(["report", str(folder / "a" / "result.json"), "--format", form]) == 0
    assert main(["compare", str(folder / "a" / "result.json"), str(folder / "b" / "result.json")]) == 0


@pytest.mark.slow
def test_batch_and_check_take_models_and_a_trace_shows_the_way_to_the_ground(project: Path) -> None:
    assert main(["check", str(project)]) == 0
    assert main(["batch", str(project), "-o", str(project.parent / "all"), "-j", "1"]) == 0
    assert (project.parent / "all").is_dir()
    trace = project.parent / "trace.json"
    assert main(["run", str(project), "--quiet", "--trace", str(trace)]) == 0
    found = json.loads(trace.read_text(encoding="utf-8"))
    assert len(found["absolute"]) == 1
    assert found["polynomial_terms"]


def test_exit_codes(project: Path, capsys: Capture) -> None:
    run = ["run", str(project), "--quiet"]
    assert main([*run, "--set", "processing.adjustment=polynomial"]) == 0
    assert main([*run, "--set", "processing.refraction=true"]) == 2
    assert "needs image coordinates" in capsys.readouterr().err
    table = project.parent / "models.csv"
    lines = table.read_text(encoding="utf-8").splitlines()
    exchanged = [f"{m},{p},{y},{x},{z}" for m, p, x, y, z in (line.split(",") for line in lines[1:])]
    table.write_text("\n".join([lines[0], *exchanged]) + "\n", encoding="utf-8")
    assert main(run) == 2
    assert "left-handed" in capsys.readouterr().err
    assert main([*run, "--set", "models.axes=left-handed"]) == 0
    second, third = ({line.split(",")[1] for line in lines if line.startswith(model)} for model in ("M2,", "M3,"))
    shared = second & third
    kept = [line for line in lines if not (line.startswith("M3,") and line.split(",")[1] in shared - {"1003"})]
    table.write_text("\n".join(kept) + "\n", encoding="utf-8")
    assert main(run) == 3
    assert "models M2 and M3 have 1 point in common" in capsys.readouterr().err
