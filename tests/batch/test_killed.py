"""A batch that is killed, at any moment, leaves whole results only, loses none, and goes on where it was."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import time
import warnings
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from subprocess import DEVNULL
from typing import TYPE_CHECKING, Any

import pytest

from photostrip.cli.main import main
from photostrip.formats import files
from photostrip.formats.batch import parsed_record
from photostrip.formats.files import digest
from tests.batch.projects import run, started, tree, write_projects

if TYPE_CHECKING:
    from collections.abc import Callable


PROJECTS = 4
WHOLE_RUNS = 2  # killed as whole commands with their workers
SUMMARIES = {"summary.txt", "summary.csv", "summary.json", "junit.xml"}
BATCH = ["batch", "strips", "-o", "out", "-j", "2"]


def in_a_child(act: Callable[[], object]) -> int:
    """Run something in a copy of this process, and give how it ended."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # newer interpreters warn of threads, which the copy does not use
        child = os.fork()
    if not child:
        with (
            suppress(BaseException),
            Path(os.devnull).open("w") as nowhere,
            redirect_stdout(nowhere),
            redirect_stderr(nowhere),
        ):
            act()
            os._exit(0)
        os._exit(99)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status)


def trusted(out: Path) -> set[str]:
    """Give the projects whose result is whole, judged without the program: by the digests of the record."""
    found = set()
    for folder in out.iterdir() if out.exists() else ():
        record = parsed_record((folder / "batch.json").read_bytes()) if (folder / "batch.json").exists() else None
        if record is not None:
            assert all(digest((folder / name).read_bytes()) == given for name, given in record["outputs"].items())
            found.add(folder.name)
    return found


def check_nothing_half(out: Path, whole: dict[str, bytes]) -> None:
    """Every file that has its name has all of its content; of a summary there is all or nothing."""
    for name, content in tree(out).items() if out.exists() else ():
        assert name.endswith(".tmp") or content == whole[name], name


@pytest.mark.slow
def test_killed_at_every_third_step_of_writing(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Die before the first, fourth, ... file that is written or renamed; then go on."""
    shutil.rmtree(here / "strips")
    write_projects(here / "strips", 1)
    assert main([*BATCH[:3], "whole", "--quiet"]) == 0
    whole = tree(here / "whole")
    steps = 0

    def dying(act: Callable[..., object], last: int) -> Callable[..., object]:
        def step(*arguments: Any) -> object:  # noqa: ANN401
            nonlocal steps
            steps += 1
            if steps > last:
                if act is write:
                    path, content = arguments
                    text = content if isinstance(content, bytes) else "".join(content).encode()
                    write(path, text[: len(text) // 2])  # a half file
                os.kill(os.getpid(), signal.SIGKILL)
            return act(*arguments)

        return step

    write, rename = files._write, Path.replace
    last, code = 0, -signal.SIGKILL
    while code:
        shutil.rmtree(here / "out", ignore_errors=True)
        with monkeypatch.context() as patch:
            patch.setattr(files, "_write", dying(write, last))
            patch.setattr(Path, "replace", dying(rename, last))
            code = in_a_child(lambda: main(BATCH))
        check_nothing_half(here / "out", whole)
        assert main([*BATCH, "--quiet"]) == 0
        assert tree(here / "out") == whole  # temporary files gone, too
        last += 3  # some are in the middle of a file, some before it has its name
    assert last > 2 * (len(whole) - 1)  # each file is written, then renamed


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_whole_commands_killed_with_their_workers(tmp_path: Path) -> None:
    write_projects(tmp_path / "strips", PROJECTS)
    begin = time.perf_counter()
    assert run(tmp_path, "strips", "-o", "whole", "-j", "2").returncode == 0
    duration = time.perf_counter() - begin
    whole, draw = tree(tmp_path / "whole"), random.Random(9)
    mark = f"PHOTOSTRIP_TEST_{os.getpid()}"
    for _ in range(WHOLE_RUNS):
        before = trusted(tmp_path / "out")
        again = ("strips", "-o", "out", "-j", "2", "--force")
        with started(tmp_path, *again, mark=mark, stdout=DEVNULL, stderr=DEVNULL) as process:
            time.sleep(draw.uniform(0.3 * duration, duration))
            process.kill()
        check_nothing_half(tmp_path / "out", whole)
        assert before <= trusted(tmp_path / "out")
    assert gone(mark)
    assert run(tmp_path, "strips", "-o", "out", "-j", "2").returncode == 0
    assert tree(tmp_path / "out") == whole


def marked(mark: str) -> list[str]:
    """Give the living processes that have a variable in their environment."""
    found = []
    for place in Path("/proc").glob("[0-9]*/environ"):
        with suppress(OSError):
            if f"{mark}=".encode() in place.read_bytes():
                found.append(place.parent.name)
    return found


def gone(mark: str) -> bool:
    """Wait until no such process is left."""
    for _ in range(100):
        if not marked(mark):
            return True
        time.sleep(0.1)
    return False


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_in_good_order(tmp_path: Path, number: signal.Signals) -> None:
    """As a terminal does on Ctrl-C: every process of the group gets the signal."""
    write_projects(tmp_path / "strips", 40)
    mark = f"PHOTOSTRIP_TEST_{os.getpid()}"
    with started(tmp_path, "strips", "-o", "out", "-j", "2", mark=mark, start_new_session=True) as process:
        assert process.stderr is not None
        for _ in range(3):
            process.stderr.readline()
        while len(marked(mark)) < 2:  # on a busy machine one worker has done three before the other is there
            assert process.poll() is None
            time.sleep(0.01)
        os.killpg(process.pid, number)
        out, err = process.communicate(timeout=20.0)
    assert process.returncode == 128 + number
    assert "Traceback" not in err
    assert "the same command goes on from here" in err
    assert gone(mark)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    done = {each["output"] for each in summary["projects"] if each["status"] == "good"}
    assert done == trusted(tmp_path / "out")
    assert 3 <= len(done) < 40
    assert summary["counts"] == {"good": len(done), "not run": 40 - len(done)}
    assert not summary["finished"]
    assert f"40 projects: {40 - len(done)} not run, {len(done)} good" in out


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_a_worker_killed_from_outside_costs_nothing(tmp_path: Path) -> None:
    write_projects(tmp_path / "strips", 6)
    mark = f"PHOTOSTRIP_TEST_{os.getpid()}"
    with started(tmp_path, "strips", "-o", "out", "-j", "2", mark=mark) as process:
        assert process.stderr is not None
        process.stderr.readline()
        worker = next(each for each in marked(mark) if int(each) != process.pid)
        os.kill(int(worker), signal.SIGKILL)
        out, _ = process.communicate()
    assert process.returncode == 0
    assert "6 projects: 6 good" in out
    assert trusted(tmp_path / "out") == {f"s{n}" for n in range(1, 7)}
