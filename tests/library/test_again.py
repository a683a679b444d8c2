"""Results made again from their certificates: what is the same, what has changed, what was edited."""

from __future__ import annotations

import json
import shutil
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

import photostrip
from photostrip.formats.files import digest
from photostrip.formats.result_json import read_result, to_json
from photostrip.library.comparison import compare_again
from photostrip.result.certificate import result_hash
from tests.calls import Answer, Call, words
from tests.loops import nonempty
from tests.results import by_rows, in_tables
from tests.source_tree import ROOT

pytestmark = pytest.mark.usefixtures("_adjusted_once")

SAMPLE = ROOT / "sample_data" / "sxb-strasbourg"
FILES = sorted(path.name for path in SAMPLE.iterdir() if path.suffix in {".yaml", ".csv"})


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a project and its result."""
    folder = tmp_path_factory.mktemp("certified")
    for name in nonempty(FILES):
        shutil.copy(SAMPLE / name, folder / name)
    photostrip.run(folder / "project.yaml").write(folder / "result")
    return folder


@pytest.fixture
def copied(made: Path, tmp_path: Path) -> Path:
    shutil.copytree(made, tmp_path / "copy")
    return tmp_path / "copy"


def document(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = by_rows(read_result(str(folder / "result" / "result.json")))
    return found


def edited(folder: Path, found: dict[str, Any]) -> Path:
    (path := folder / "edited.json").write_text(to_json(in_tables(found)), encoding="utf-8")
    return path


def test_a_certificate_has_the_hash_of_every_file_and_no_path(made: Path) -> None:
    block = document(made)["certificate"]
    assert {each["file"]: each["sha256"] for each in block["inputs"]} == {
        name: sha256((SAMPLE / name).read_bytes()).hexdigest()
        for name in ("project.yaml", "observations.csv", "control.csv")
    }
    assert str(made) not in json.dumps(block)
    assert block["result_sha256"] == result_hash(in_tables(document(made)))


def test_the_bytes_do_not_depend_on_where_a_project_is_run_from(
    made: Path, copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(copied)
    here = photostrip.run("project.yaml").files()["result.json"]
    assert here == (made / "result" / "result.json").read_text(encoding="utf-8")


def test_presets_and_overrides_stand_in_the_certificate(copied: Path) -> None:
    preset = copied.parent / "preset.yaml"
    preset.write_text("processing: {polynomial: {degree: 1}}\n", encoding="utf-8")
    project = copied / "project.yaml"
    project.write_text(project.read_text(encoding="utf-8") + "\nextends: ../preset.yaml\n", encoding="utf-8")
    block = photostrip.load(project, name="other").run().document["certificate"]
    assert "../preset.yaml" in [each["file"] for each in block["inputs"]]
    assert block["set"] == ['name="other"']


@pytest.mark.slow
@pytest.mark.usefixtures("_adjusted_each_time")
@pytest.mark.parametrize("adjustment", ["polynomial", "bundle"])
def test_what_has_not_changed_comes_out_again(copied: Path, adjustment: str) -> None:
    photostrip.run(copied / "project.yaml", processing={"adjustment": adjustment}).write(copied / "result")
    compared = compare_again(copied / "result")
    assert (compared["status"], compared["again"]) == ("same", {"edited": False, "files": [], "versions": []})


@pytest.mark.slow
@pytest.mark.parametrize(("working", "result"), [("result", "."), ("result", "result.json"), (".", "result/bundle")])
def test_the_project_is_found_above_the_result(
    copied: Path, monkeypatch: pytest.MonkeyPatch, working: str, result: str
) -> None:
    shutil.copytree(copied / "result", copied / "result" / "bundle")  # as --compare-methods writes them
    monkeypatch.chdir(copied / working)
    assert compare_again(Path(result))["status"] == "same"


def test_a_file_that_has_changed_is_named(copied: Path, call: Call) -> None:
    with (copied / "control.csv").open("a", encoding="utf-8") as file:
        file.write("\n")  # changes the content and no number
    code, out, _ = call("compare", copied / "result", "--again")
    assert (code, "differ: changed: control.csv." in words(out)) == (1, True)
    (copied / "control.csv").unlink()
    code, _, err = call("compare", copied / "result", "--again")
    assert (code, "control.csv" in err) == (2, True)


@pytest.mark.slow
def test_a_certificate_must_name_the_files_that_are_read_and_no_others(copied: Path, call: Call) -> None:
    """What a certificate names is not opened for that: a device would be read without end."""
    project, saved = copied / "project.yaml", document(copied)
    inputs = saved["certificate"]["inputs"]
    saved["certificate"]["inputs"] = [*inputs, {"file": "/dev/zero", "sha256": digest(b"")}]
    code, out, _ = call("compare", edited(copied, saved), "--again", "--project", project, "--quiet")
    assert (code, "not read: /dev/zero." in words(out)) == (1, True)
    saved["certificate"]["inputs"] = []
    files = compare_again(edited(copied, saved), project)["again"]["files"]
    assert {(row["file"], row["state"]) for row in files} == {
        (name, "not in the certificate") for name in ("control.csv", "observations.csv", "project.yaml")
    }


@pytest.mark.slow
def test_an_edited_result_is_told(copied: Path) -> None:
    project, saved = copied / "project.yaml", document(copied)
    saved["points"][0]["x"] += 0.5
    compared = compare_again(edited(copied, saved), project)
    assert (compared["status"], compared["again"]["edited"], len(compared["differences"])) == ("different", True, 1)
    saved["certificate"]["result_sha256"] = result_hash(in_tables(saved))  # edited by someone who knows of the hash
    compared = compare_again(edited(copied, saved), project)
    assert (compared["status"], compared["again"]["edited"]) == ("different", False)


@pytest.mark.slow
def test_other_versions_are_named_and_are_no_difference(copied: Path, answer: Answer) -> None:
    saved = document(copied)
    saved["certificate"]["versions"]["numpy"] = "1.0"
    project = (copied / "project.yaml").rename(copied / "renamed.yaml")  # it may have another name
    assert "it was 1.0" in answer("compare", edited(copied, saved), "--again", "--project", project)


@pytest.mark.parametrize(
    "options", [[], ["other", "--again"], ["other", "--project", "p.yaml"], ["--again", "--update"]]
)
def test_a_baseline_or_again_and_not_both(options: list[str], call: Call) -> None:
    code, _, err = call("compare", "result", *options)
    assert (code, "give a BASELINE, or --again" in words(err)) == (2, True)


def test_a_result_without_its_project_ends_with_2(
    copied: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Call
) -> None:
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    shutil.copy(copied / "result" / "result.json", "result.json")
    code, _, err = call("compare", "result.json", "--again")
    assert (code, "its project is not found" in err) == (2, True)
    saved = document(copied)
    del saved["certificate"]
    code, out, _ = call("compare", edited(copied, saved), "--again", "--format", "json")
    assert (code, "no-certificate" in out) == (2, True)
