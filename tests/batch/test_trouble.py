"""The world around a batch: full disks, places that may not be written to or read from, other batches."""

from __future__ import annotations

import ctypes
import errno
import json
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from photostrip.batch.folder import opened
from photostrip.cli.main import main
from photostrip.errors import InputError
from photostrip.formats import files
from photostrip.formats.files import write_files
from tests.batch.projects import run, tree
from tests.calls import words

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from tests.calls import Call

PROJECTS = 5
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH = 24, 1, 2


def as_anybody() -> None:
    """Give up the right of the superuser to read and write everything."""
    library = ctypes.CDLL(None)
    for right in (CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH):
        library.prctl(PR_CAPBSET_DROP, right, 0, 0, 0)


def batch(folder: Path, *arguments: str, before: Callable[[], None] = as_anybody) -> subprocess.CompletedProcess[str]:
    return run(folder, *arguments, preexec_fn=before)


def full(monkeypatch: pytest.MonkeyPatch, full_for: str) -> None:
    """Let the disk be full whenever something is written below a folder."""
    write = files._write

    def refused(path: Path, data: str | Iterable[str]) -> None:
        if full_for in str(path):
            write(path, "".join(data)[:100])
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        write(path, data)

    monkeypatch.setattr(files, "_write", refused)


@pytest.mark.slow
def test_a_disk_that_is_full_for_a_while_costs_those_projects_only(
    here: Path, monkeypatch: pytest.MonkeyPatch, call: Call
) -> None:
    with monkeypatch.context() as patch:
        full(patch, "out/s2/")
        code, out, _ = call("batch", "strips", "-o", "out")
    assert (code, "5 projects: 1 unwritten, 4 good" in out) == (2, True)
    assert "out/s2: the result cannot be written: no space left on device" in out
    assert list((here / "out" / "s2").iterdir()) == []
    assert main(["batch", "strips", "-o", "out", "-q"]) == main(["batch", "strips", "-o", "whole", "-q"]) == 0
    assert tree(here / "out") == tree(here / "whole")


@pytest.mark.slow
def test_a_disk_that_stays_full_ends_the_batch(here: Path, monkeypatch: pytest.MonkeyPatch, call: Call) -> None:
    full(monkeypatch, "out/")
    code, out, err = call("batch", "strips", "-o", "out")
    assert (code, "5 projects: 3 unwritten, 2 not run" in out) == (2, True)  # told even where it cannot be written
    assert "error: 3 results in a row could not be written; 2 projects not run" in err
    assert "no space left on device" in err
    assert [path for path in (here / "out").rglob("*") if path.is_file()] == [here / "out" / ".batch.lock"]


@pytest.mark.slow
def test_an_earlier_result_survives_a_full_disk(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert main(["batch", "strips", "-o", "out", "-q"]) == 0
    before = {name: content for name, content in tree(here / "out").items() if "/" in name}
    full(monkeypatch, "out/")
    assert main(["batch", "strips", "-o", "out", "-q", "--force"]) == 2
    assert tree(here / "out") == before


@pytest.mark.slow
def test_a_result_replaces_no_file_of_its_project(here: Path, call: Call) -> None:
    first = here / "strips" / "s1"
    (first / "control.csv").rename(first / "points.csv")
    project = first / "project.yaml"
    project.write_text(project.read_text(encoding="utf-8").replace("control.csv", "points.csv"), encoding="utf-8")
    before = tree(first)
    code, out, _ = call("batch", "strips", "-o", "strips")
    assert (code, "5 projects: 1 unwritten, 4 good" in out) == (2, True)
    assert "s1/points.csv: was read, and what is written would replace it" in words(out)
    assert tree(first) == before


@pytest.mark.slow
def test_an_output_that_must_not_be_written_to_is_refused_at_once(here: Path) -> None:
    (here / "out").mkdir(mode=0o555)
    done = batch(here, "strips", "-o", "out")
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "error: out/.batch.lock: Permission denied\n")


@pytest.mark.slow
def test_inputs_that_may_not_be_read_in_the_middle(here: Path) -> None:
    (here / "strips" / "s2" / "observations.csv").chmod(0)
    (here / "strips" / "s3" / "project.yaml").chmod(0)
    (here / "strips" / "s4" / "control.csv").write_bytes(b"\xff\xfe\x00")
    done = batch(here, "strips", "-o", "out", "-j", "1", "--format", "json")
    assert done.returncode == 2
    summary = json.loads(done.stdout)
    assert [each["status"] for each in summary["projects"]] == ["good", "faulty", "faulty", "faulty", "good"]
    codes = [each["findings"][0]["code"] for each in summary["projects"] if each["findings"]]
    assert codes == ["file-unreadable", "file-unreadable", "encoding"]
    assert {path.name for path in (here / "out").iterdir() if path.is_dir()} == {"s1", "s5"}


@pytest.mark.slow
def test_a_second_batch_on_the_same_folder_is_refused(here: Path, call: Call) -> None:
    batch = ("batch", "strips", "-o", "out", "-q")
    assert call(*batch)[0] == 0
    before = tree(here / "out")
    with opened(Path("elsewhere")):
        assert call(*batch)[0] == 0
    with opened(Path("out")) as folder:
        assert not list((here / "out").glob("summary.*"))  # it would not be true
        write_files(folder.path, {name: content.decode() for name, content in before.items() if "/" not in name})
        code, _, err = call(*batch)
        assert tree(here / "out") == before  # nothing touched, the summary of the first one neither
    assert (code, "error: out: another batch is writing into this folder" in err) == (2, True)
    assert call(*batch)[0] == 0
    with pytest.raises(InputError), opened(here / "strips" / "s1" / "project.yaml"):
        pass
