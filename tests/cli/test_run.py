"""``photostrip run`` and ``photostrip report`` as a user calls them."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from photostrip.cli.main import main
from photostrip.formats import files
from photostrip.formats.result_json import read_result
from photostrip.report.sections.accuracy_report import sections_of
from photostrip.report.sections.overview import MOST_LINES
from tests.calls import words
from tests.loops import nonempty
from tests.results import spec, write_project
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from tests.calls import Call


pytestmark = pytest.mark.usefixtures("_adjusted_once")

TABLES = ("points", "photos", "given_points", "residuals", "rejected", "refined")
FILES = {*(f"{name}.csv" for name in TABLES), "project.resolved.yaml", "result.json"}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_project(tmp_path_factory.mktemp("project"), spec("north first", 2))


@pytest.fixture(scope="module")
def result(project: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("result")
    assert main(["run", str(project), "-o", str(folder), "--quiet"]) == 0
    return folder


# --------------------------------------------------------------------------------------------- what comes out where


def test_a_result_replaces_no_file_of_its_project(tmp_path: Path, call: Call) -> None:
    file = write_project(tmp_path, spec("north first", 2))
    (tmp_path / "control.csv").rename(tmp_path / "points.csv")
    file.write_text(file.read_text(encoding="utf-8").replace("control.csv", "points.csv"), encoding="utf-8")
    before = {each.name: each.read_bytes() for each in tmp_path.iterdir()}
    code, _, err = call("run", file, "-o", tmp_path)
    assert code == 2
    message = "was read, and what is written would replace it; choose another place"
    assert err == f"error: {tmp_path}/points.csv: {message}\n"
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == before
    assert call("run", file, "-o", tmp_path / "out", "-q")[0] == 0


@pytest.mark.slow
def test_the_report_goes_to_stdout_and_talk_to_stderr(project: Path, tmp_path: Path, call: Call) -> None:
    before = sorted(project.parent.iterdir())
    code, report, err = call("run", project)
    assert (code, err) == (0, "")
    assert report.startswith("Accuracy report: small\n\n── Verdict ──")
    assert report.count("── Check points ──") == 1
    assert sorted(project.parent.iterdir()) == before
    code, out, err = call("run", project, "-o", tmp_path / "out")
    assert (code, out) == (0, report)
    assert err == f"wrote {len(list((tmp_path / 'out').iterdir()))} files to {tmp_path / 'out'}\n"
    _, _, err = call("run", project, "-o", tmp_path / "out", "--verbose")
    assert [line.split()[0] for line in err.splitlines()] == ["read", "adjusted", "wrote"]
    code, out, err = call("run", project, "-o", tmp_path / "out", "--quiet")
    assert (code, err, len(out.splitlines()) < 5) == (0, "", True)
    assert out.startswith(("GOOD: ", "LOOK "))
    assert out.count("Rms ") == 1


@pytest.mark.slow
def test_strict_refuses_what_nothing_verifies(tmp_path: Path, call: Call) -> None:
    """Without check points every number looks as good as before: a job that asks for more must hear of it."""
    project = write_project(tmp_path, spec())
    assert call("run", project, "--strict", "--quiet")[0] == 0
    control = tmp_path / "control.csv"
    lines = control.read_text(encoding="utf-8").splitlines(keepends=True)
    control.write_text("".join(line for line in lines if ",check" not in line), encoding="utf-8")
    for options, code in (["--quiet"], 0), (["--strict", "--quiet"], 1):
        found, out, _ = call("run", project, "-o", tmp_path / "out", *options)
        assert (found, out.split(":")[0]) == (code, "UNVERIFIED")
    assert call("report", tmp_path / "out")[0] == 0
    assert call("report", tmp_path / "out", "--strict")[0] == 1
    code, out, _ = call("run", project, "--strict", "--cross-validate", "-o", tmp_path / "turned")
    assert (code, out.splitlines()[3].split(":")[0]) == (0, "GOOD")
    assert out.count("── Cross-validation ──") == 1
    text = call("report", tmp_path / "turned", "--section", "cross-validation")[1]
    document = read_result(str(tmp_path / "turned" / "result.json"))
    assert text.count("\nG") == document["cross_validation"]["plan"]["count"]
    assert "cross_validation: true" in (tmp_path / "turned" / "project.resolved.yaml").read_text(encoding="utf-8")


@pytest.mark.slow
def test_json_is_the_content_of_result_json(project: Path, result: Path, call: Call) -> None:
    for quiet in ([], ["--quiet"]):
        code, out, _ = call("run", project, "--format", "json", *quiet)
        assert code == 0
        assert out == (result / "result.json").read_text(encoding="utf-8")


# -------------------------------------------------------------------------------------------------- exit codes


@pytest.mark.slow
def test_a_tolerance_that_is_not_kept_gives_1_and_the_whole_result(project: Path, tmp_path: Path, call: Call) -> None:
    for form in ("text", "json", "md", "github"):
        arguments = ["run", project, "-o", tmp_path / form, "--format", form, "--set", "tolerances.check_rms_xy=0.001"]
        code, out, _ = call(*arguments)
        assert code == 1
        assert {path.name for path in (tmp_path / form).iterdir()} > FILES
    assert out.startswith("::error title=photostrip tolerance::tolerances.check_rms_xy: ")
    verdict = call(*arguments[:2], "--quiet", *arguments[-2:])[1]
    assert verdict.startswith("FAILED: 1 of 1 tolerance not kept.")
    assert call("report", tmp_path / "text", "-q") == (0, verdict, "")  # the report of a failed result is a report


METHODS = ["run", "{project}", "--compare-methods"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["run", "nowhere.yaml"], "nowhere.yaml: does not exist"),
        (["run"], "Missing argument 'PROJECT'"),
        (["run", "{project}", "--format", "xml"], "'xml' is not one of"),
        (["run", "{project}", "--depfile", "x.d"], "give --output as well"),
        (["run", "{project}", "--width", "wide"], "--width"),
        (["run", "{project}", "--width", "10"], "10 characters; the text is 60 to 200 wide"),
        (["run", "{project}", "--width", "201"], "201 characters; the text is 60 to 200 wide"),
        (["run", "{project}", "--set", "processing.nonsense=1"], "nonsense"),
        (["run", "{project}", "-o", "{project}"], "project.yaml: is a file; expected a folder"),
        (["run", "{project}", "--trace", "t.pdf"], "Invalid value for --trace: nothing is written as '.pdf'"),
        ([*METHODS, "--section", "check"], "not a comparison of methods"),
        ([*METHODS, "--html"], "--output"),
        ([*METHODS, "-o", "out", "--depfile", "d"], "no --depfile"),
        ([*METHODS, "--strict"], "a comparison of methods has no verdict"),
        (["report", "{result}", "--section", "check", "-o", "r.html"], "has sections, not html"),
        (["report", "{result}", "--section", "check", "--format", "json"], "has sections, not json"),
        (["report", "{result}", "-o", "r.doc"], "nothing is written as '.doc'"),
        (["report", "{result}", "--section", "chek"], "the report has no section 'chek', but verdict, findings"),
    ],
)
def test_wrong_usage_is_told(project: Path, result: Path, arguments: list[str], told: str, call: Call) -> None:
    code, out, err = call(*(argument.format(project=project, result=result) for argument in arguments))
    assert (code, out) == (2, "")
    assert told in words(err)
    assert "Traceback" not in err


# ----------------------------------------------------------------------------------------------- whole or not at all


@pytest.mark.slow
def test_two_runs_write_the_same_bytes_wherever_they_are(project: Path, result: Path, tmp_path: Path) -> None:
    """Other processes, another folder, another order of sets, another name of the folder of the project."""
    (moved := tmp_path / "elsewhere").mkdir()
    for path in project.parent.iterdir():
        (moved / path.name).write_bytes(path.read_bytes())
    environment = {**os.environ, "PYTHONHASHSEED": "7", "PYTHONPATH": str(ROOT), "TZ": "Asia/Tokyo", "COLUMNS": "60"}
    subprocess.run(
        [sys.executable, "-m", "photostrip", "run", "elsewhere/project.yaml", "-o", "again"],
        cwd=tmp_path, env=environment, check=True, capture_output=True,
    )  # fmt: skip
    for name in FILES:
        assert (tmp_path / "again" / name).read_bytes() == (result / name).read_bytes(), name
        assert str(tmp_path) not in (tmp_path / "again" / name).read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_run_that_fails_leaves_the_earlier_result(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Call
) -> None:
    out = tmp_path / "out"
    assert call("run", project, "-o", out)[0] == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    write = files._write

    def full(self: Path, data: str | Iterable[str]) -> None:
        if "result.json" in self.name:
            raise OSError(28, "No space left on device", str(self))
        write(self, data)

    monkeypatch.setattr(files, "_write", full)
    code, _, err = call("run", project, "-o", out, "--set", "processing.adjustment=similarity")
    assert code == 2
    assert "No space left on device" in err
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_the_rule_for_make_names_every_file_read(project: Path, tmp_path: Path, call: Call) -> None:
    out, rule = tmp_path / "out", tmp_path / "deps" / "out.d"
    assert call("run", project, "-o", out, "--depfile", rule)[0] == 0
    first = rule.read_text(encoding="utf-8").splitlines()[0]
    sources = [str(project.parent / name) for name in ("project.yaml", "observations.csv", "control.csv")]
    assert first == f"{out / 'result.json'}: {' '.join(sources)}"


# ----------------------------------------------------------------------------------------------- photostrip report


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [[], ["--width", "60"], ["--format", "md"], ["--quiet"], ["--verbose"], ["--section", "check"]]
)
def test_report_prints_what_run_printed(project: Path, result: Path, options: list[str], call: Call) -> None:
    _, expected, _ = call("run", project, *options)
    for place in (result, result / "result.json"):
        assert call("report", place, *options) == (0, expected, "")


def test_report_into_a_file(result: Path, tmp_path: Path, call: Call) -> None:
    title = "Accuracy report"
    for name, option, begin in (
        ("r.md", (), f"# {title}"),
        *((name, (), title) for name in ("r.txt", "R.TXT", "report")),
        ("r.html", ("--format", "text"), title),
        ("r.json", (), '{\n"photostrip_result": 2'),
    ):
        assert call("report", result, "-o", tmp_path / name, *option) == (0, "", "")
        assert (tmp_path / name).read_text(encoding="utf-8").startswith(begin)


def test_a_section_is_printed_alone(result: Path, call: Call) -> None:
    code, out, err = call("report", result, "--section", "rejected", "--section", "check")
    assert (code, err) == (0, "")
    assert [line.split(" ─")[0] for line in out.splitlines() if "──" in line] == ["── Check points", "── Rejected"]
    assert call("report", result, "--section", "polynomial")[1] == "This result has no section `polynomial`.\n"
    assert call("report", result, "--section", "check", "--format", "md")[1].startswith("## Check points\n")


def test_verbose_prints_every_section(result: Path, call: Call) -> None:
    titles = [each.title for each in sections_of(read_result(str(result / "result.json")))]
    _, out, _ = call("report", result, "--verbose")
    assert [line.strip("─ ") for line in out.splitlines() if line.startswith("── ")] == titles
    _, out, _ = call("report", result)
    assert len(out.splitlines()) <= MOST_LINES < len(titles) * 10


def test_what_a_killed_run_left_behind_is_removed_by_the_next(project: Path, tmp_path: Path) -> None:
    dying = "import os; from photostrip.formats import files; from photostrip.cli.main import main\n"
    dying += "files._rename = lambda _: os.kill(os.getpid(), 9)\n"
    dying += f"main(['run', {str(project)!r}, '-o', 'out', '--html'])"
    done = subprocess.run([sys.executable, "-c", dying], cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == -9
    left = [path.name for path in (tmp_path / "out").iterdir()]
    assert len(left) > 5
    assert all(name.endswith(".tmp") for name in nonempty(left))
    at_work = tmp_path / f"out/.points.csv.{os.getppid()}.tmp"  # of a process that is there
    at_work.write_text("half", encoding="utf-8")
    assert main(["run", str(project), "-o", str(tmp_path / "out"), "-q"]) == 0
    assert [path for path in (tmp_path / "out").iterdir() if path.suffix == ".tmp"] == [at_work]


@pytest.mark.slow
def test_report_reads_no_project(result: Path) -> None:
    code = (
        "import sys\nfrom photostrip.cli.main import main\n"
        f"assert main(['report', {str(result)!r}]) == 0\n"
        "sys.exit(str({'pyproj', 'yaml', 'rich'} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stderr.strip() == "set()"


@pytest.mark.slow
def test_ascii_terminals_get_ascii(project: Path, result: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    for arguments in (["run", str(project)], ["report", str(result), "--format", "md"]):
        done = subprocess.run(
            [sys.executable, "-m", "photostrip", *arguments], env=environment, capture_output=True, check=True
        )
        assert done.stdout.isascii()
        assert b"sigma0" in done.stdout
        assert b"?" not in done.stdout
