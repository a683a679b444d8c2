"""Wrong projects and tables on the command line: words, place and exit code, whatever kind of file is at fault."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from photostrip.formats import files
from tests.loops import nonempty
from tests.project.samples import FILES, MARKED_FILES, PROJECT, sample
from tests.project.test_faults import MARKS, ONE_FAULT
from tests.results import spec, write_project
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.calls import Call

pytestmark = pytest.mark.usefixtures("_adjusted_once")

WRONG = [*((FILES, *case) for case in ONE_FAULT), *((MARKED_FILES, *case) for case in MARKS)]


@pytest.mark.parametrize("case", WRONG[::5], ids=lambda case: f"{case[2]!r:.20}-{case[3]!r:.20}")
def test_a_wrong_value_ends_with_2_and_its_words(tmp_path: Path, case: tuple[Any, ...], call: Call) -> None:
    files, file, old, new, place, *told = case
    sample(tmp_path, files).change(file, old, new)
    code, printed, err = call("run", tmp_path / "project.yaml", "-o", tmp_path / "out")
    lines = err.replace(f"{tmp_path}/", "").splitlines()
    assert (code, printed) == (2, "")
    assert all(line.startswith("error: ") for line in nonempty(lines))
    assert [line for line in lines if line.startswith(f"error: {place}") and all(word in line for word in told)]
    assert not (tmp_path / "out").exists()
    code, printed, _ = call("check", tmp_path / "project.yaml", "--format", "json")
    findings = [each for each in json.loads(printed)["projects"][0]["findings"] if each["severity"] == "error"]
    number = int((place.split(":")[1:2] or ["0"])[0] or 0)
    assert (code, number in {0, *(each["line"] for each in findings)}) == (2, True)


# ---------------------------------------------------------------------------------------------- other exit codes

GEOMETRY = [
    ("observations.csv", lambda rows: [row for row in rows if not row.startswith("1003,")] + ["1003,X1,1,2"], "1003"),
    ("observations.csv", lambda rows: rows[:1] + [row.rpartition(",")[0] + ",0" for row in rows[1:]], "1001"),
    ("control.csv", lambda rows: rows[:3], "at least 2 control points in plan and 3 in height"),
    ("control.csv", lambda rows: [row.replace("xyz", "z") for row in rows], "plan"),
    ("control.csv", lambda rows: [row.replace("xyz", "xy") for row in rows], "0 in height"),
    ("control.csv", lambda rows: [row.replace(",control", ",check") for row in rows], "control"),
    ("control.csv", lambda rows: [rows[0]] + ["N" + row for row in rows[1:]], "control"),
]


@pytest.mark.parametrize(("file", "harm", "words"), GEOMETRY)
def test_weak_geometry_ends_with_3(
    tmp_path: Path, file: str, harm: Callable[[list[str]], list[str]], words: str, call: Call
) -> None:
    path = write_project(tmp_path / "p", spec())
    table = path.parent / file
    table.write_text("\n".join(harm(table.read_text(encoding="utf-8").splitlines())) + "\n", encoding="utf-8")
    code, out, err = call("run", path, "-o", tmp_path / "out")
    assert (code, out) == (3, "")
    assert err.startswith("error: ")
    assert words in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("east", ["43520059", "1e15"])
def test_a_wild_coordinate_is_told_in_its_row_and_not_as_another_crs(tmp_path: Path, east: str, call: Call) -> None:
    path = write_project(tmp_path / "p", spec())
    table = path.parent / "control.csv"
    rows = [row.split(",") for row in table.read_text(encoding="utf-8").splitlines()]
    rows[3][1] = east
    table.write_text("\n".join(map(",".join, rows)) + "\n", encoding="utf-8")
    code, _, err = call("run", path)
    assert code == 2
    first, *others = err.splitlines()
    assert first == f"error: {table}:4: point {rows[3][0]}: outside the domain of EPSG:32633"
    assert not any("P402" in line or "P403" in line for line in others)


def test_a_cause_in_the_data_is_told_before_what_comes_of_it(tmp_path: Path, call: Call) -> None:
    path = write_project(tmp_path / "p", spec())
    order = ("--set", "strips[0].photos=[1001, 1003, 1002, 1004, 1005]")
    code, _, err = call("run", path, *order)
    assert code == 3
    first, second = err.splitlines()
    assert "P201 strip A: photos 1003 and 1002 are listed in the wrong order" in first
    assert second.startswith("error: relative orientation of photos 1001 and 1003")
    code, printed, err = call("run", path, *order, "--format", "json")
    document = json.loads(printed)
    assert (code, err, document["exit_code"], document["findings"][0]["code"]) == (3, "", 3, "P201")


@pytest.mark.parametrize(("old", "new"), [("unit: mm", "unti: mm"), ("observations:", "observatons:")])
def test_a_misspelled_key_is_not_missing_besides(tmp_path: Path, old: str, new: str, call: Call) -> None:
    path = write_project(tmp_path / "p", spec())
    path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    code, _, err = call("run", path)
    assert code == 2
    (line,) = err.splitlines()
    assert line.endswith(f"is not known; did you mean `{old.partition(':')[0]}`?")


@pytest.mark.parametrize(
    ("command", "key", "words"),
    [
        ("run", "photostrip_simulation", "a specification for `photostrip simulate`"),
        ("run", "photostrip_plan_strip", "a plan for `photostrip plan strip`"),
        ("check", "photostrip_result", "a result for `photostrip report`"),
        ("simulate", "photostrip", "a project for `photostrip run`"),
    ],
)
def test_a_file_for_another_command_is_told_as_such(
    tmp_path: Path, command: str, key: str, words: str, call: Call
) -> None:
    (file := tmp_path / "a.yaml").write_text(f"{key}: 1\nname: a\n", encoding="utf-8")
    code, out, err = call(command, file, *(["-o", tmp_path / "out"] if command == "simulate" else []))
    assert code == 2
    (line,) = (line for line in (out + err).splitlines() if line.startswith("error: "))
    assert f"{key}: this is {words}" in line


# ------------------------------------------------------------------------------------ files as such, in one form


def folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def binary(path: Path) -> None:
    path.write_bytes(b"PK\x03\x04" + bytes(100))


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


HARMS = [
    (Path.unlink, "file-missing", "does not exist"),
    (folder, "file-directory", "is a folder; expected a file"),
    (lambda path: path.write_bytes(b""), "file-empty", "is empty"),
    (lambda path: os.truncate(path, 2_000_000_000), "file-size", "has 2000 MB; expected at most"),  # a hole
    (binary, "binary", "is a zip archive or a spreadsheet; expected text"),
    (pipe, "file-kind", "is a device or a pipe; expected a file"),
]


@pytest.mark.parametrize("name", ["project.yaml", "preset.yaml", "observations.csv", "fiducials.csv", "control.csv"])
@pytest.mark.parametrize(("harm", "kind", "words"), HARMS)
def test_every_file_is_refused_in_the_same_words(
    tmp_path: Path, name: str, harm: Callable[[Path], None], kind: str, words: str, call: Call
) -> None:
    project = sample(tmp_path, MARKED_FILES | {"preset.yaml": "photostrip: 1\n"})
    project.change("project.yaml", "name: sample", "name: sample\nextends: preset.yaml")
    harm(tmp_path / name)
    code, printed, _ = call("check", tmp_path / "project.yaml", "--format", "json")
    findings = json.loads(printed)["projects"][0]["findings"]
    found = [each for each in findings if each["code"] == kind]
    assert code == 2
    assert len(found) == 1
    assert (found[0]["line"] > 0) == (name != "project.yaml")  # a file that another one names is told where it is named
    line = next(each for each in call("run", tmp_path / "project.yaml")[2].splitlines() if words in each)
    assert line.startswith(f"error: {tmp_path}/project.yaml:")


@pytest.mark.usefixtures("_quick_start")
@pytest.mark.parametrize(("harm", "words"), [(folder, "is a folder"), (pipe, "is a device or a pipe")])
def test_a_grid_that_is_no_file_is_refused_in_the_same_words(
    tmp_path: Path, harm: Callable[[Path], None], words: str
) -> None:
    """PROJ, which reads grids by itself, would wait at a pipe for ever."""
    project, grid = sample(tmp_path), tmp_path / "grid.gsb"
    grid.touch()
    harm(grid)
    project.change("project.yaml", "crs: EPSG:32633", f'crs: "+proj=utm +zone=33 +ellps=bessel +nadgrids={grid}"')
    project.change("project.yaml", "output:", "output:\n  crs: EPSG:4326")
    command = [sys.executable, "-m", "photostrip", "check", str(tmp_path / "project.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2
    assert f"the grid {grid} {words}; expected a file" in done.stdout


@pytest.mark.parametrize(("command", "options"), [("simulate", ["-o", "out"]), ("report", []), ("run", [])])
@pytest.mark.parametrize(("harm", "kind", "words"), HARMS)
def test_every_command_refuses_its_file_in_the_same_words(
    tmp_path: Path, command: str, options: list[str], harm: Callable[[Path], None], kind: str, words: str, call: Call
) -> None:
    (path := tmp_path / "file").write_text(PROJECT, encoding="utf-8")
    harm(path)
    code, out, err = call(command, path, *options)
    assert (code, out) == (2, "")
    if (command, harm) == ("report", folder):  # a folder stands for the result.json in it
        assert err.startswith(f"error: {path}/result.json: does not exist")
    elif (command, harm) == ("report", binary):
        assert err.startswith(f"error: {path}: ")
    else:
        assert err.startswith(f"error: {path}: {words}"), kind


@pytest.mark.parametrize("form", ["text", "json", "github"])
def test_a_full_disk_takes_the_same_form(
    tmp_path: Path, form: str, monkeypatch: pytest.MonkeyPatch, call: Call
) -> None:
    path = write_project(tmp_path / "p", spec())

    def full(self: Path, _data: str) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(self))

    monkeypatch.setattr(files, "_write", full)
    code, out, err = call("run", path, "-o", tmp_path / "out", "--format", form)
    assert code == 2
    assert "no space left on device" in (out + err).lower()
    if form == "json":
        assert json.loads(out)["findings"][0]["code"] == "system"
    assert out.startswith({"text": "", "json": "{", "github": "::error file="}[form])
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("output", "name", "expected"),
    [("1>&-", "project.yaml", 0), ("2>&-", "nothing.yaml", 2), (">/dev/full", "project.yaml", 2)],
)
def test_an_output_that_the_caller_closed_takes_everything_and_a_full_one_is_told(
    tmp_path: Path, output: str, name: str, expected: int
) -> None:
    """As ``photostrip check project.yaml >&-`` in a job that wants no output; what is short waits in a buffer."""
    path = write_project(tmp_path / "p", spec()).with_name(name)
    command = f'exec env -u PYTHONUNBUFFERED "{sys.executable}" -m photostrip check "{path}" {output}'
    done = subprocess.run(["sh", "-c", command], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == expected
    assert done.stderr == ("error: No space left on device\n" if "full" in output else "")
    assert "internal" not in done.stdout
