"""``photostrip batch`` from outside: what it writes, prints, skips and refuses."""

from __future__ import annotations

import csv
import json
import re
import xml.etree.ElementTree as ET
from io import StringIO
from typing import TYPE_CHECKING

import pytest

from photostrip.cli.main import main
from photostrip.errors import PhotostripError
from photostrip.formats.files import digest
from photostrip.formats.result_json import read_result
from tests.batch.projects import PHOTOS, Alone, run, tree, write_projects

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Call, Capture

RESULT = {
    "batch.json", "photos.csv", "points.csv", "project.resolved.yaml", "refined.csv", "rejected.csv",
    "residuals.csv", "result.json",
}  # fmt: skip
SUMMARIES = {"summary.txt", "summary.csv", "summary.json", "junit.xml"}


def spoil(project: Path) -> None:
    """Take a table away."""
    (project / "observations.csv").unlink()


@pytest.mark.slow
def test_every_project_gets_the_result_that_run_gives(here: Path, capsys: Capture) -> None:
    assert main(["batch", "strips", "-o", "out", "-j", "2"]) == 0
    captured = capsys.readouterr()
    assert "3 projects: 3 good" in captured.out
    assert captured.err.count(" of 3  strips/s") == 3
    for name in ("s1", "s2", "s3"):
        assert main(["run", f"strips/{name}/project.yaml", "-o", f"alone/{name}", "--quiet"]) == 0
        alone = tree(here / "alone" / name)
        together = tree(here / "out" / name)
        assert set(together) > RESULT
        assert {file: together[file] for file in alone} == alone
    assert {path.name for path in (here / "out").iterdir()} == {"s1", "s2", "s3", ".batch.lock", *SUMMARIES}


@pytest.mark.slow
def test_strict_asks_more_of_the_same_results(here: Path, capsys: Capture) -> None:
    control = here / "strips" / "s2" / "control.csv"
    lines = control.read_text(encoding="utf-8").splitlines(keepends=True)
    control.write_text("".join(line for line in lines if ",check" not in line), encoding="utf-8")
    assert main(["batch", "strips", "-o", "out"]) == 0
    assert "3 projects: 1 unverified, 2 good" in capsys.readouterr().out
    assert main(["batch", "strips", "-o", "out", "--strict"]) == 1
    captured = capsys.readouterr()
    assert "0 computed, 3 unchanged" in captured.err
    assert "s2/project.yaml: unverified\n- no point verifies the result: hold some given points back" in captured.out
    junit = (here / "out" / "junit.xml").read_text(encoding="utf-8")
    assert junit.count("<failure") == 1


@pytest.mark.slow
def test_a_failure_ends_no_other_project(here: Path, capsys: Capture) -> None:
    spoil(here / "strips" / "s2")
    assert main(["batch", "strips", "-o", "out", "-j", "1"]) == 2
    out = capsys.readouterr().out
    assert "3 projects: 1 faulty, 2 good" in out
    assert "observations.file: strips/s2/observations.csv does not exist" in out
    assert not (here / "out" / "s2").exists()
    summary = json.loads((here / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["counts"] == {"faulty": 1, "good": 2}
    assert [each["exit_code"] for each in summary["projects"]] == [0, 2, 0]
    assert summary["projects"][1]["findings"][0]["code"] == "file-missing"


@pytest.mark.slow
def test_the_summary_is_the_same_on_paper_and_on_the_terminal(here: Path, capsys: Capture) -> None:
    spoil(here / "strips" / "s2")
    for form, file in (
        ("json", "summary.json"),
        ("csv", "summary.csv"),
        ("junit", "junit.xml"),
        ("text", "summary.txt"),
    ):
        assert main(["batch", "strips", "-o", "out", "--format", form]) == 2
        assert capsys.readouterr().out == (here / "out" / file).read_text(encoding="utf-8")


def test_the_table_has_the_numbers_of_the_results(here: Path, capsys: Capture) -> None:
    assert main(["batch", "strips/s1", "-o", "out", "--format", "csv"]) == 0
    (row,) = csv.DictReader(StringIO(capsys.readouterr().out))
    result = read_result(str(here / "out" / "s1" / "result.json"))
    assert row["project"] == "strips/s1/project.yaml"
    assert int(row["photos"]) == PHOTOS == len(result["photos"])
    assert float(row["sigma0_um"]) == result["summary"]["sigma0_um"]
    assert float(row["rms_height_m"]) == result["summary"][row["rms_at"]]["height"]["rms"]


@pytest.mark.slow
def test_a_tolerance_is_a_failure_and_a_fault_an_error(here: Path, capsys: Capture) -> None:
    spoil(here / "strips" / "s3")
    assert main(["batch", "strips", "--set", "tolerances.sigma0_um=0.001", "--format", "junit"]) == 2
    suite = ET.fromstring(capsys.readouterr().out).find("testsuite")  # noqa: S314 (our own)
    assert suite is not None
    assert [suite.get(name) for name in ("tests", "failures", "errors", "skipped")] == ["3", "2", "1", "0"]
    kinds = {case.get("name"): [inner.tag for inner in case] for case in suite}
    assert kinds["strips/s1/project.yaml"] == ["failure"]
    assert kinds["strips/s3/project.yaml"] == ["error"]
    assert main(["batch", "strips/s1", "--set", "tolerances.sigma0_um=0.001", "-q"]) == 1  # that of the worst


@pytest.mark.slow
def test_annotations_name_file_and_line(here: Path, capsys: Capture) -> None:
    spoil(here / "strips" / "s2")
    assert main(["batch", "strips", "--format", "github", "--quiet"]) == 2
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("::error file=strips/s2/project.yaml,line=")


@pytest.mark.slow
def test_a_rule_for_make_lists_what_was_read(here: Path) -> None:
    assert main(["batch", "strips", "-o", "out", "--depfile", "out.d", "--quiet"]) == 0
    first = (here / "out.d").read_text(encoding="utf-8").splitlines()[0]
    target, _, sources = first.partition(": ")
    tables = ("project.yaml", "observations.csv", "control.csv")
    assert target == "out/summary.json"
    assert set(sources.split()) == {f"strips/s{n}/{table}" for n in (1, 2, 3) for table in tables}


# --------------------------------------------------------------------------------------------------- again


def computed(call: Call, *arguments: str) -> set[str]:
    """Run a batch that must succeed; give the projects that the lines on stderr say were computed."""
    code, _, text = call(*arguments)
    assert code == 0
    lines = [line.split("  ", 1)[1] for line in text.splitlines() if " of " in line and "project.yaml" in line]
    return {line.split("/")[1] for line in lines if not line.endswith(", unchanged")}


@pytest.mark.slow
def test_only_what_changed_is_computed_again(here: Path, call: Call) -> None:
    batch = ["batch", "strips", "-o", "out"]
    assert computed(call, *batch) == {"s1", "s2", "s3"}
    before = tree(here / "out")
    assert computed(call, *batch) == set()
    assert tree(here / "out") == before
    table = here / "strips" / "s2" / "control.csv"
    table.write_text(table.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert computed(call, *batch) == {"s2"}
    assert computed(call, *batch, "--set", "processing.relative.grubbs_alpha=0.01") == {"s1", "s2", "s3"}
    assert computed(call, *batch, "--set", "processing.relative.grubbs_alpha=0.01", "--force") == {"s1", "s2", "s3"}


@pytest.mark.slow
@pytest.mark.parametrize("damage", ["cut", "edited", "removed", "record"])
def test_a_result_that_is_not_as_it_was_written_is_computed_again(here: Path, call: Call, damage: str) -> None:
    batch = ["batch", "strips", "-o", "out"]
    assert main(batch) == 0
    before = tree(here / "out")
    points = here / "out" / "s2" / ("batch.json" if damage == "record" else "points.csv")
    content = points.read_bytes()
    if damage == "removed":
        points.unlink()
    else:
        points.write_bytes(content.replace(b"1", b"2", 1) if damage == "edited" else content[:100])
    assert computed(call, *batch) == {"s2"}
    assert tree(here / "out") == before


@pytest.mark.slow
@pytest.mark.parametrize("named", ["inputs", "outputs"])
def test_a_record_that_names_a_device_is_not_trusted(here: Path, call: Call, named: str) -> None:
    """Most devices would be read without end."""
    batch = ["batch", "strips", "-o", "out"]
    assert main(batch) == 0
    record = here / "out" / "s2" / "batch.json"
    content = json.loads(record.read_text(encoding="utf-8"))
    content[named]["/dev/null"] = digest(b"")
    record.write_text(json.dumps(content), encoding="utf-8")
    assert computed(call, *batch) == {"s2"}


@pytest.mark.slow
def test_a_file_that_two_projects_share_changes_both(here: Path, call: Call) -> None:
    shared = here / "preset.yaml"
    shared.write_text("processing: {relative: {grubbs_alpha: 0.05}}\n", encoding="utf-8")
    for name in ("s1", "s3"):
        project = here / "strips" / name / "project.yaml"
        project.write_text("extends: ../../preset.yaml\n" + project.read_text(encoding="utf-8"), encoding="utf-8")
    assert main(["batch", "strips", "-o", "out"]) == 0
    shared.write_text("processing: {relative: {grubbs_alpha: 0.02}}\n", encoding="utf-8")
    assert computed(call, "batch", "strips", "-o", "out") == {"s1", "s3"}


@pytest.mark.slow
def test_a_grid_file_that_appears_changes_its_project(here: Path, call: Call) -> None:
    name = "made-up-grid.gsb"
    project = here / "strips" / "s1" / "project.yaml"
    text = project.read_text(encoding="utf-8")
    assert '"EPSG:32633"' in text or "EPSG:32633" in text
    crs = f'"+proj=utm +zone=33 +ellps=WGS84 +nadgrids=@{name} +type=crs"'
    project.write_text(text.replace('"EPSG:32633"', crs).replace("EPSG:32633", crs), encoding="utf-8")
    assert main(["batch", "strips/s1", "-o", "out"]) == 0
    assert main(["batch", "strips/s1", "-o", "out"]) == 0
    (here / "strips" / "s1" / name).write_bytes(b"no grid")
    assert computed(call, "batch", "strips/s1", "-o", "out") == {"s1"}


@pytest.mark.slow
def test_a_result_stays_when_its_project_fails_later(here: Path) -> None:
    assert main(["batch", "strips", "-o", "out", "--quiet"]) == 0
    before = tree(here / "out" / "s2")
    spoil(here / "strips" / "s2")
    assert main(["batch", "strips", "-o", "out", "--quiet"]) == 2
    assert tree(here / "out" / "s2") == before
    summary = json.loads((here / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["projects"][1]["output"] is None


@pytest.mark.slow
def test_a_result_of_another_project_is_not_replaced(here: Path, capsys: Capture) -> None:
    write_projects(here / "others", 2)
    assert main(["batch", "strips/s1", "-o", "out", "--quiet"]) == 0
    before = tree(here / "out" / "s1")
    capsys.readouterr()
    changed = here / "others" / "s1" / "project.yaml"
    changed.write_text(changed.read_text(encoding="utf-8") + "\n# another one\n", encoding="utf-8")
    assert main(["batch", "others", "-o", "out", "--quiet"]) == 2
    assert "replace that of another project, ../../strips/s1/project.yaml" in " ".join(capsys.readouterr().out.split())
    assert tree(here / "out" / "s1") == before
    assert (here / "out" / "s2" / "result.json").exists()
    assert main(["batch", "others", "-o", "out", "--quiet", "--force"]) == 0


@pytest.mark.slow
def test_projects_may_move_together_with_their_results(here: Path, call: Call) -> None:
    assert main(["batch", "strips", "-o", "out"]) == 0
    (here / "archive").mkdir()
    for name in ("strips", "out"):
        (here / name).rename(here / "archive" / name)
    assert computed(call, "batch", "archive/strips", "-o", "archive/out") == set()


# ----------------------------------------------------------------------------------------------- wrong usage


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere/*"], "nowhere/*: no project matches this pattern"),
        (["empty"], "empty: there is no project.yaml in this folder or below it"),
        (["@list.txt"], "list.txt: does not exist"),
        (["strips", "--depfile", "x.d"], "a rule for make needs a target"),
        (["strips", "--executor", "slurm"], "'slurm' is not 'local'"),
        (["strips", "--executor", "dask:nonsense"], "no Dask scheduler answers at nonsense"),
        (["strips", "-j", "0"], "greater than or equal to 1"),
        (["strips", "-o", "file.txt"], "is a file; expected a folder"),
    ],
)
def test_wrong_usage_is_told(here: Path, capsys: Capture, arguments: list[str], message: str) -> None:
    (here / "empty").mkdir()
    (here / "file.txt").write_text("x", encoding="utf-8")
    assert main(["batch", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_a_batch_that_nobody_computes_says_so(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise PhotostripError("no worker process starts")

    monkeypatch.setattr(Alone, "submit", broken)
    assert main(["batch", "strips", "-o", "out"]) == 70
    summary = json.loads((here / "out" / "summary.json").read_text(encoding="utf-8"))
    assert (summary["exit_code"], summary["finished"], summary["counts"]) == (70, False, {"not run": 3})


@pytest.mark.usefixtures("here")
def test_wrong_usage_is_told_in_the_form_that_was_asked_for(capsys: Capture) -> None:
    assert main(["batch", "nowhere/*", "--format", "json"]) == 2
    answer = json.loads(capsys.readouterr().out)
    assert (answer["exit_code"], answer["findings"][0]["code"]) == (2, "no-project")
    assert main(["batch", "nowhere/*", "--format", "csv"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "no project matches this pattern" in captured.err


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_a_project_that_is_not_there_is_a_fault_among_others(here: Path) -> None:
    done = run(here, "strips/s1", "strips/s9/project.yaml", "--format", "csv", "--quiet")
    assert done.returncode == 2
    assert [row["status"] for row in csv.DictReader(StringIO(done.stdout))] == ["good", "faulty"]


@pytest.mark.slow
def test_a_page_leads_to_the_reports(here: Path, capsys: Capture) -> None:
    asked = ["batch", "strips/s1", "-o", "results"]
    assert main([*asked, "--quiet"]) == 0
    assert not (here / "results/summary.html").exists()
    assert main([*asked, "--html"]) == 0
    assert "unchanged" not in capsys.readouterr().err, "it had no report as a page yet"
    page = (here / "results/summary.html").read_text(encoding="utf-8")
    (target,) = re.findall(r'<a href="([^"#]+)"', page)
    assert (here / "results" / target).read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert main([*asked, "--html"]) == 0
    assert "1 unchanged" in capsys.readouterr().err
    assert (here / "results/summary.html").read_text(encoding="utf-8") == page
    assert main(["batch", "strips/s1", "--html"]) == 2
