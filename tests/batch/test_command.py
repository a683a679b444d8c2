"""``photostrip batch`` from outside: what it writes, prints, skips and refuses."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING

import pytest

from photostrip.cli.main import main
from photostrip.errors import PhotostripError
from photostrip.formats.files import digest
from photostrip.formats.result_json import read_result
from tests.batch.projects import PHOTOS, Alone, tree, write_projects
from tests.calls import rows, words

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Call

SUMMARIES = {"summary.txt", "summary.csv", "summary.json", "junit.xml"}


def spoil(project: Path) -> None:
    """Take a table away."""
    (project / "observations.csv").unlink()


@pytest.mark.slow
def test_every_project_gets_the_result_that_run_gives(here: Path, call: Call) -> None:
    code, out, err = call("batch", "strips", "-o", "out", "-j", "2")
    assert (code, "3 projects: 3 good" in out, err.count(" of 3  strips/s")) == (0, True, 3)
    for name in ("s1", "s2", "s3"):
        assert main(["run", f"strips/{name}/project.yaml", "-o", f"alone/{name}", "--quiet"]) == 0
        alone, together = tree(here / "alone" / name), tree(here / "out" / name)
        assert {*alone, "batch.json"} <= set(together)
        assert {file: together[file] for file in alone} == alone
    assert {path.name for path in (here / "out").iterdir()} == {"s1", "s2", "s3", ".batch.lock", *SUMMARIES}


@pytest.mark.slow
def test_strict_asks_more_of_the_same_results(here: Path, call: Call) -> None:
    control = here / "strips" / "s2" / "control.csv"
    lines = control.read_text(encoding="utf-8").splitlines(keepends=True)
    control.write_text("".join(line for line in lines if ",check" not in line), encoding="utf-8")
    code, out, _ = call("batch", "strips", "-o", "out")
    assert (code, "3 projects: 1 unverified, 2 good" in out) == (0, True)
    code, out, err = call("batch", "strips", "-o", "out", "--strict")
    assert (code, "0 computed, 3 unchanged" in err) == (1, True)
    assert "s2/project.yaml: unverified\n- no point verifies the result: hold some given points back" in out
    assert (here / "out" / "junit.xml").read_text(encoding="utf-8").count("<failure") == 1


@pytest.mark.slow
def test_a_failure_ends_no_other_project_and_the_summary_says_it_in_every_form(here: Path, call: Call) -> None:
    spoil(here / "strips" / "s2")
    code, out, _ = call("batch", "strips", "-o", "out", "-j", "1")
    assert (code, "3 projects: 1 faulty, 2 good" in out) == (2, True)
    assert "observations.file: strips/s2/observations.csv does not exist" in out
    assert not (here / "out" / "s2").exists()
    summary = json.loads((here / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["counts"] == {"faulty": 1, "good": 2}
    assert [each["exit_code"] for each in summary["projects"]] == [0, 2, 0]
    assert summary["projects"][1]["findings"][0]["code"] == "file-missing"
    files = {"json": "summary.json", "csv": "summary.csv", "junit": "junit.xml", "text": "summary.txt"}
    for form, file in files.items():
        code, out, _ = call("batch", "strips", "-o", "out", "--format", form)
        assert (code, out) == (2, (here / "out" / file).read_text(encoding="utf-8"))
    code, out, _ = call("batch", "strips", "--format", "github", "--quiet")
    (line,) = out.splitlines()
    assert (code, line.startswith("::error file=strips/s2/project.yaml,line=")) == (2, True)


def test_the_table_has_the_numbers_of_the_results(here: Path, call: Call) -> None:
    code, out, _ = call("batch", "strips/s1", "strips/s9/project.yaml", "-o", "out", "--format", "csv")
    row, missing = rows(out)
    result = read_result(str(here / "out" / "s1" / "result.json"))
    assert (code, row["status"], missing["status"]) == (2, "good", "faulty")
    assert row["project"] == "strips/s1/project.yaml"
    assert int(row["photos"]) == PHOTOS == len(result["photos"])
    assert float(row["sigma0_um"]) == result["summary"]["sigma0_um"]
    assert float(row["rms_height_m"]) == result["summary"][row["rms_at"]]["height"]["rms"]


@pytest.mark.slow
def test_a_tolerance_is_a_failure_and_a_fault_an_error(here: Path, call: Call) -> None:
    spoil(here / "strips" / "s3")
    tight = ("--set", "tolerances.sigma0_um=0.001")
    code, out, _ = call("batch", "strips", *tight, "--format", "junit")
    suite = ET.fromstring(out).find("testsuite")  # noqa: S314 (our own)
    assert code == 2
    assert suite is not None
    assert [suite.get(name) for name in ("tests", "failures", "errors", "skipped")] == ["3", "2", "1", "0"]
    kinds = {case.get("name"): [inner.tag for inner in case] for case in suite}
    assert kinds["strips/s1/project.yaml"] == ["failure"]
    assert kinds["strips/s3/project.yaml"] == ["error"]
    assert call("batch", "strips/s1", *tight, "-q")[0] == 1  # that of the worst


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
def test_a_result_that_is_not_as_it_was_written_is_computed_again(here: Path, call: Call) -> None:
    batch, folder = ["batch", "strips", "-o", "out"], here / "out" / "s2"
    assert main(batch) == 0
    before = tree(here / "out")
    for name, damage in (
        ("points.csv", lambda file: file.unlink()),
        ("points.csv", lambda file: file.write_bytes(file.read_bytes()[:100])),
        ("batch.json", lambda file: file.write_bytes(file.read_bytes()[:100])),
        ("points.csv", lambda file: file.write_bytes(file.read_bytes().replace(b"1", b"2", 1))),
    ):
        damage(folder / name)
        assert computed(call, *batch) == {"s2"}
        assert tree(here / "out") == before


@pytest.mark.slow
def test_a_record_that_names_a_device_is_not_trusted(here: Path, call: Call) -> None:
    """Most devices would be read without end."""
    batch, record = ["batch", "strips", "-o", "out"], here / "out" / "s2" / "batch.json"
    for named in ("inputs", "outputs"):
        assert main([*batch, "-q"]) == 0
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
    crs = f'"+proj=utm +zone=33 +ellps=WGS84 +nadgrids=@{name} +type=crs"'
    text, count = re.subn('"?EPSG:32633"?', crs, project.read_text(encoding="utf-8"))
    assert count
    project.write_text(text, encoding="utf-8")
    assert computed(call, "batch", "strips/s1", "-o", "out") == {"s1"}
    assert computed(call, "batch", "strips/s1", "-o", "out") == set()
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
def test_a_result_of_another_project_is_not_replaced(here: Path, call: Call) -> None:
    write_projects(here / "others", 2)
    assert call("batch", "strips/s1", "-o", "out", "--quiet")[0] == 0
    before = tree(here / "out" / "s1")
    with (here / "others" / "s1" / "project.yaml").open("a", encoding="utf-8") as changed:
        changed.write("\n# another one\n")
    code, out, _ = call("batch", "others", "-o", "out", "--quiet")
    assert (code, "replace that of another project, ../../strips/s1/project.yaml" in words(out)) == (2, True)
    assert tree(here / "out" / "s1") == before
    assert (here / "out" / "s2" / "result.json").exists()
    assert call("batch", "others", "-o", "out", "--quiet", "--force")[0] == 0


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
        (["strips", "--html"], "summary.html needs a folder: give --output as well"),
        (["nowhere/*", "--format", "csv"], "no project matches this pattern"),
    ],
)
def test_wrong_usage_is_told(here: Path, call: Call, arguments: list[str], message: str) -> None:
    (here / "empty").mkdir()
    (here / "file.txt").write_text("x", encoding="utf-8")
    code, out, err = call("batch", *arguments)
    assert (code, message in err) == (2, True)
    assert "dask:nonsense" in arguments or out == ""


def test_a_batch_that_nobody_computes_says_so(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise PhotostripError("no worker process starts")

    monkeypatch.setattr(Alone, "submit", broken)
    assert main(["batch", "strips", "-o", "out"]) == 70
    summary = json.loads((here / "out" / "summary.json").read_text(encoding="utf-8"))
    assert (summary["exit_code"], summary["finished"], summary["counts"]) == (70, False, {"not run": 3})


def test_wrong_usage_is_told_in_the_form_that_was_asked_for(call: Call) -> None:
    code, out, err = call("batch", "nowhere/*", "--format", "json")
    answer = json.loads(out)
    assert (code, err, answer["exit_code"], answer["findings"][0]["code"]) == (2, "", 2, "no-project")


@pytest.mark.slow
def test_a_page_leads_to_the_reports(here: Path, call: Call) -> None:
    asked, summary = ("batch", "strips/s1", "-o", "results"), here / "results/summary.html"
    assert call(*asked, "--quiet")[0] == 0
    assert not summary.exists()
    code, _, err = call(*asked, "--html")
    assert (code, "unchanged" in err) == (0, False), "it had no report as a page yet"
    page = summary.read_text(encoding="utf-8")
    (target,) = re.findall(r'<a href="([^"#]+)"', page)
    assert (here / "results" / target).read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    code, _, err = call(*asked, "--html")
    assert (code, "1 unchanged" in err) == (0, True)
    assert summary.read_text(encoding="utf-8") == page
