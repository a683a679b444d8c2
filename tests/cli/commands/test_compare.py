"""``photostrip compare`` as it is typed: forms, exit codes, the baseline written anew, tolerance profiles."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import pytest

from photostrip.cli.main import main
from photostrip.comparison import Tolerances, baseline_of
from photostrip.comparison.comparison import SETS, UNITS
from photostrip.errors import InputError
from photostrip.formats.result_json import line_finder, to_json
from photostrip.project.tolerances import load_tolerances
from photostrip.report.page.messages import Case, to_junit
from tests.loops import nonempty
from tests.results import by_rows, case, in_tables
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from pathlib import Path

    from tests.calls import Answer, Call

pytestmark = pytest.mark.usefixtures("_adjusted_once")

PROFILES = ROOT / "configs" / "tolerances"


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a result and its baseline; the baseline has a point and a model that differ."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    document = case().document
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "result.json").write_text(to_json(document), encoding="utf-8")
    baseline: dict[str, Any] = by_rows(baseline_of(document))
    (tmp_path / "same.json").write_text(to_json(in_tables(baseline)), encoding="utf-8")
    baseline["points"][5]["z"] += 0.05
    baseline["models"][1]["scale_factor"] *= 1 + 1e-5
    (tmp_path / "other.json").write_text(to_json(in_tables(baseline)), encoding="utf-8")
    return tmp_path


def parsed(text: str) -> ET.Element:
    """Give the suite of a JUnit file."""
    return ET.fromstring(text.encode("utf-8"))[0]  # noqa: S314 (we wrote it)


def moved() -> str:
    name: str = case().document["points"][5]["id"]
    return name


def compare(call: Call, *arguments: str, code: int) -> str:
    """Compare; give what is printed, errors last."""
    found, out, err = call("compare", *arguments)
    assert found == code
    return out + err


@pytest.mark.usefixtures("files")
def test_the_exit_code_says_what_agrees_and_the_report_names_the_worst(call: Call) -> None:
    assert "SAME: " in compare(call, "result", "same.json", code=0)
    out = compare(call, "result/result.json", "other.json", code=1)
    assert "DIFFERENT: result/result.json and other.json differ: 2 numbers beyond tolerance." in out
    height = next(line for line in out.splitlines() if line.startswith("height"))
    assert re.search(rf"1\s+0\.05  m\s+point {moved()}\s+0\.0002 m", height)
    assert re.search(r"scale factors .* +(1e-05|9\.\d+e-06)\s+model .*, scale_", out)
    assert "--update writes it" in compare(call, "result", "none.json", code=2)


def test_a_profile_decides(files: Path, call: Call) -> None:
    own = "photostrip_tolerances: 1\nextends: survey.yaml\nheight: {absolute: 0.06}\n"
    (files / "survey.yaml").write_text((PROFILES / "survey.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    (files / "own.yaml").write_text(own, encoding="utf-8")
    compare(call, "result", "other.json", "--tol", "survey.yaml", code=1)
    assert "0.06 m" in compare(call, "result", "other.json", "--tol", "own.yaml", code=0)


@pytest.mark.parametrize("form", ["text", "json", "md", "junit", "github"])
@pytest.mark.parametrize(("baseline", "code"), [("same.json", 0), ("other.json", 1), ("none.json", 2)])
@pytest.mark.usefixtures("files")
def test_the_exit_code_is_the_same_in_every_form(form: str, baseline: str, code: int) -> None:
    assert main(["compare", "result", baseline, "--format", form]) == code


def test_every_form_says_what_differs(files: Path, call: Call) -> None:
    found = json.loads(compare(call, "result", "other.json", "--format", "json", code=1))
    assert (found["photostrip_compare"], found["status"]) == (1, "different")
    assert [(row["kind"], row["id"]) for row in found["differences"]][1] == ("height", moved())
    assert found["differences"][0]["kind"] == "scale"
    suite = parsed(compare(call, "result", "other.json", "--format", "junit", code=1))
    assert (suite.get("tests"), suite.get("failures")) == ("12", "2")
    failed = {case.get("name"): case[0] for case in suite if len(case)}
    assert set(failed) == {"height", "scale factors"}
    assert moved() in (failed["height"].text or "")
    line = line_finder((files / "other.json").read_text(encoding="utf-8"))("points", "")
    annotation = f"::error file=other.json,line={line},title=photostrip different::point {moved()}, height"
    assert annotation in compare(call, "result", "other.json", "--format", "github", code=1)


def test_junit_holds_any_text() -> None:
    text = to_junit('a "suite" <&>\x00', [Case("one\x1b", "<failed> & 'so'", "]]>\ud800"), Case("two", skipped="x")])
    suite = parsed(text)
    assert suite.get("name") == 'a "suite" <&>\\x00'
    assert suite[0][0].get("message") == "<failed> & 'so'"
    assert suite[0][0].text == "]]>?"
    assert suite[1][0].tag == "skipped"


def test_many_differences_are_counted(files: Path, call: Call) -> None:
    document = json.loads((files / "same.json").read_text(encoding="utf-8"))
    for axis in "xz":
        document["points"][axis] = [value + 1.0 for value in document["points"][axis]]
    (files / "other.json").write_text(to_json(document), encoding="utf-8")
    assert "more; --verbose prints all" in compare(call, "result", "other.json", code=1)
    last = compare(call, "result", "other.json", "--format", "github", code=1).splitlines()[-1]
    assert last.endswith("more differences; photostrip compare --verbose lists them")


# ------------------------------------------------------------------------------------------- the baseline anew


def test_update_writes_a_baseline_that_agrees_and_says_what_changes(files: Path, call: Call) -> None:
    assert compare(call, "result", "new/baseline.json", "--update", code=0) == "wrote new/baseline.json\n"
    compare(call, "result", "new", code=0)
    assert (files / "new/baseline.json").read_bytes() == (files / "same.json").read_bytes()
    said = compare(call, "result", "other.json", "--update", code=0)
    assert "; DIFFERENT: result/result.json and the baseline before differ: 2 numbers" in said
    compare(call, "result", "other.json", code=0)
    (files / "other.json").write_text("{", encoding="utf-8")
    assert "could not be compared" in compare(call, "result", "other.json", "--update", code=0)


def test_a_result_is_no_baseline_of_itself(files: Path, call: Call) -> None:
    before = (files / "result/result.json").read_bytes()
    assert "is the result itself" in compare(call, "result", "result/result.json", "--update", code=2)
    compare(call, "result", "result", "--update", code=0)
    assert (files / "result/result.json").read_bytes() == before
    assert (files / "result/baseline.json").read_bytes() == (files / "same.json").read_bytes()


def test_a_baseline_that_cannot_be_written_stays_whole(files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = (files / "other.json").read_bytes()

    def full(*_: object) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("photostrip.formats.files._write", full)
        assert main(["compare", "result", "other.json", "--update"]) == 2
    (files / "result/result.json").write_text('{"photostrip_result": 2}', encoding="utf-8")  # is never a baseline
    assert main(["compare", "result", "other.json", "--update"]) == 2
    assert (files / "other.json").read_bytes() == before
    assert sorted(path.name for path in files.iterdir()) == ["other.json", "result", "same.json"]


# ------------------------------------------------------------------------------------------- whole folders


@pytest.fixture
def folders(files: Path) -> Path:
    """A folder of three results, and of their baselines, which agree."""
    for name in ("a", "b", "deep/c"):
        for folder, source, called in (("all", "result/result.json", "result"), ("base", "same.json", "baseline")):
            place = files / folder / name
            place.mkdir(parents=True)
            (place / f"{called}.json").write_bytes((files / source).read_bytes())
    return files


@pytest.mark.usefixtures("folders")
def test_folders_agree_when_every_result_does(call: Call) -> None:
    assert "SAME: 3 results of all and base agree" in compare(call, "all", "base", code=0)
    found = json.loads(compare(call, "all", "base", "--format", "json", code=0))
    assert [each["folder"] for each in found["results"]] == ["a", "b", "deep/c"]
    assert compare(call, "all", "base", "-q", code=0).count("\n") == 1


def test_a_folder_that_differs_or_stands_alone_is_named(folders: Path, call: Call) -> None:
    (folders / "base/a/baseline.json").write_bytes((folders / "other.json").read_bytes())
    (folders / "base/b").rename(folders / "base/d")
    printed = compare(call, "all", "base", code=1)
    assert "1 result of 2 beyond tolerance; no result for d; no baseline for b" in printed
    found = json.loads(compare(call, "all", "base", "--format", "json", code=1))
    assert (found["status"], found["missing"], found["new"]) == ("different", ["d"], ["b"])
    assert [each["status"] for each in found["results"]] == ["different", "same"]
    suite = parsed(compare(call, "all", "base", "--format", "junit", code=1))
    bad = {each.get("name") for each in nonempty(suite) if len(each)}
    assert {"b", "d", "a: height", "a: scale factors"} <= bad
    assert not any(name.startswith("deep/c") for name in bad if name)
    line = line_finder((folders / "other.json").read_text(encoding="utf-8"))("points", "")
    annotations = compare(call, "all", "base", "--format", "github", code=1)
    assert f"::error file=base/a/baseline.json,line={line}," in annotations


@pytest.mark.slow
def test_a_broken_baseline_does_not_hide_the_others(folders: Path, call: Call) -> None:
    (folders / "base/a/baseline.json").write_text("{", encoding="utf-8")
    (folders / "base/b/baseline.json").write_bytes((folders / "other.json").read_bytes())
    printed = compare(call, "all", "base", code=2)
    assert "REFUSED: all and base differ: 1 result that cannot be compared; 1 result of 2 beyond tolerance." in printed
    assert "- base/a/baseline.json:1:2: is not JSON" in printed
    found = json.loads(compare(call, "all", "base", "--format", "json", code=2))
    assert found["status"] == "refused"
    assert [(each["folder"], each["code"]) for each in found["refused"]] == [("a", "result-json")]
    assert [(each["folder"], each["status"]) for each in found["results"]] == [("b", "different"), ("deep/c", "same")]
    suite = parsed(compare(call, "all", "base", "--format", "junit", code=2))
    cases = {each.get("name"): each for each in suite}
    assert cases["a"].find("error") is not None
    assert cases["deep/c: height"].find("failure") is None
    annotations = compare(call, "all", "base", "--format", "github", code=2)
    assert "::error file=base/a/baseline.json,line=1,title=photostrip result-json::" in annotations


@pytest.mark.slow
def test_update_writes_the_baselines_of_a_folder(folders: Path, call: Call) -> None:
    (folders / "base/b/baseline.json").write_bytes((folders / "other.json").read_bytes())
    said = compare(call, "all", "base", "--update", code=0).splitlines()
    assert [line.partition(";")[0] for line in said] == [
        f"wrote base/{name}/baseline.json" for name in ("a", "b", "deep/c")
    ]
    assert "wrote base/b/baseline.json; DIFFERENT" in said[1]
    compare(call, "all", "base", code=0)


def test_folders_without_results_are_refused(folders: Path, call: Call) -> None:
    (folders / "empty").mkdir()
    (folders / "base/b").rename(folders / "b")
    assert "no baseline for b" in compare(call, "all", "base", code=1)  # new alone is a difference, too
    for given, words in (
        (("empty", "base"), "empty: holds no result.json, nor does a folder in it"),
        (("all", "none"), "none: is no folder, and all is one of 3 results"),
        (("all", "same.json"), "same.json: is no folder, and all is one of 3 results"),
    ):
        assert words in compare(call, *given, code=2)
    assert "no baseline for a, b, deep/c" in compare(call, "all", "empty", code=1)


# ------------------------------------------------------------------------------------------- profiles


def test_profiles_grow_from_the_default() -> None:
    exact, numerical, survey = (
        load_tolerances(PROFILES / f"{name}.yaml")[0] for name in ("exact", "numerical", "survey")
    )
    assert numerical == Tolerances()
    for kind in ("plan", "height", "rotation", "sigma0", "statistics"):
        sizes = [profile.of(kind).absolute for profile in (exact, numerical, survey)]
        assert sizes[0] == 0 < sizes[1] < sizes[2]
    assert [profile.scale.relative for profile in (exact, numerical, survey)] == [0.0, 1e-8, 2e-5]


def test_a_faulty_profile_is_told_by_line(tmp_path: Path) -> None:
    path = tmp_path / "tol.yaml"
    path.write_text(
        "photostrip_tolerances: 2\nplan: {absolut: 1}\nheight: {absolute: -1}\nids: {new: 0.5}\nscale: {relative: x}\n",
        encoding="utf-8",
    )
    with pytest.raises(InputError) as refused:
        load_tolerances(path)
    faults = [(fault.line, fault.key, fault.code) for fault in refused.value.faults]
    assert faults == [
        (1, "photostrip_tolerances", "schema-number"),
        (2, "plan.absolut", "unknown-key"),
        (3, "height.absolute", "range"),
        (4, "ids.new", "number"),
        (5, "scale.relative", "number"),
    ]
    assert "did you mean `absolute`?" in str(refused.value)


def test_the_schema_of_profiles_has_their_defaults(answer: Answer) -> None:
    schema = json.loads(answer("schema", "--tolerances"))
    for name in (*UNITS, *SETS):
        default = schema["properties"][name]["default"]
        assert {key: getattr(getattr(Tolerances(), name), key) for key in default} == default
    assert (schema["additionalProperties"], schema["required"]) == (False, ["photostrip_tolerances"])
