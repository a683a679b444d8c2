"""The same work on a Dask cluster: a real scheduler and real workers, on this machine, without a disk in common."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.batch import cluster as clusters
from photostrip.batch.evaluation import evaluate
from photostrip.batch.parcel import pack
from photostrip.batch.result_folder import opened, program
from photostrip.batch.run import Run, Stop
from photostrip.batch.selection import choose
from photostrip.batch.tasks import Limits, Task
from photostrip.cli.main import main
from photostrip.errors import InputError
from tests.batch import faulty
from tests.batch.projects import environment, run, tree, write_projects
from tests.geodesy.frames import write_gtx

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

    from tests.forked import Forks

DASK = ("distributed.cli.dask_scheduler", "distributed.cli.dask_worker")
QUICK = {  # a lost worker is noticed at once
    "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "5s",
    "DASK_DISTRIBUTED__COMM__RETRY__COUNT": "0",
}


@contextmanager
def started(folder: Path, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a part of a cluster in a folder of its own, where none of the projects' paths leads anywhere."""
    folder.mkdir(parents=True)
    with (folder / "log.txt").open("w") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]],
            cwd=folder,
            env=environment(),
            stdout=log,
            stderr=log,
            text=True,
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


@contextmanager
def two_workers(folder: Path) -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """Start a scheduler and two workers; give its address and the workers."""
    address = f"tcp://127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        port = address.rpartition(":")[2]
        options = ("--host", "127.0.0.1", "--port", port, "--no-dashboard")
        stack.enter_context(started(folder / "scheduler", "dask_scheduler", *options))
        options = (address, "--nthreads", "1", "--no-nanny", "--no-dashboard")
        workers = [
            stack.enter_context(started(folder / name, "dask_worker", *options, "--name", name))
            for name in ("w1", "w2")
        ]
        wait_for(folder / "scheduler" / "log.txt", "Register worker", 2)
        yield address, workers


def wait_for(log: Path, words: str, times: int) -> None:
    for _ in range(300):
        if log.read_text(encoding="utf-8").count(words) >= times:
            return
        time.sleep(0.1)
    raise AssertionError(log.read_text(encoding="utf-8"))


class Count:
    """Counts how often each project is told to be done."""

    def __init__(self) -> None:
        self.times: dict[str, int] = {}
        self.statuses: dict[str, str] = {}

    def finished(self, outcome: dict[str, Any], _: object) -> None:
        name = Path(outcome["project"]).parent.name
        self.times[name] = self.times.get(name, 0) + 1
        self.statuses[name] = outcome["status"]


@pytest.fixture(scope="module")
def dask_forks(forks: Forks) -> Iterator[Forks]:
    """Give a ``python`` that has loaded Dask and its settings."""
    with forks.with_libraries(*DASK, **QUICK) as with_dask:
        yield with_dask


@pytest.fixture
def _quick_start(dask_forks: Forks, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", str(dask_forks.python))


@pytest.fixture(scope="module")
def cluster(dask_forks: Forks, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "executable", str(dask_forks.python))
        with two_workers(tmp_path_factory.mktemp("cluster") / "machines") as (address, _):
            yield address


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_all_executors_write_the_same_bytes(tmp_path: Path, cluster: str) -> None:
    """One process, two processes, a cluster; a fault, a preset beside the projects and an absolute path among them."""
    projects = write_projects(tmp_path / "strips", 4)
    (tmp_path / "preset.yaml").write_text("processing: {relative: {grubbs_alpha: 0.02}}\n", encoding="utf-8")
    for n, change in (
        (1, ("photostrip: 1", "photostrip: 1\nextends: ../../preset.yaml")),
        (2, ("control.csv", "none.csv")),
    ):
        path = Path(projects[n])
        path.write_text(path.read_text(encoding="utf-8").replace(*change), encoding="utf-8")
    text = Path(projects[3]).read_text(encoding="utf-8")
    elsewhere = tmp_path / "elsewhere.csv"
    (tmp_path / "strips" / "s4" / "control.csv").rename(elsewhere)
    Path(projects[3]).write_text(text.replace("control.csv", str(elsewhere)), encoding="utf-8")
    ways = {"one": ("-j", "1"), "two": ("-j", "2"), "dask": ("--executor", f"dask:{cluster}")}
    told = {way: run(tmp_path, "strips", "-o", way, *options) for way, options in ways.items()}
    assert {way: done.returncode for way, done in told.items()} == dict.fromkeys(ways, 2)
    assert len({done.stdout for done in told.values()}) == 1
    assert "4 projects: 1 faulty, 3 good" in told["dask"].stdout
    assert tree(tmp_path / "one") == tree(tmp_path / "two") == tree(tmp_path / "dask")
    again = run(tmp_path, "strips", "-o", "one", "--executor", f"dask:{cluster}")
    assert again.stderr.count(", unchanged") == 3  # a result of one executor is a result for the others


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_one_of_two_machines_dies_in_the_middle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    number = 10
    write_projects(tmp_path / "strips", number)
    monkeypatch.chdir(tmp_path)
    count = Count()
    with two_workers(tmp_path / "machines") as (address, workers):

        class Killing(Count):
            def finished(self, outcome: dict[str, Any], answer: object) -> None:
                count.finished(outcome, answer)
                if len(count.times) == 3:
                    workers[0].send_signal(signal.SIGKILL)

        with opened(Path("out")) as folder, clusters.cluster(address, Limits()) as executor:
            batch = Run(choose(["strips"]), (), folder, force=False).go(executor, Killing().finished, Stop())
    assert workers[0].returncode == -signal.SIGKILL
    assert [each["status"] for each in batch.outcomes] == ["good"] * number  # nothing lost
    assert set(count.times.values()) == {1}  # nothing written twice
    assert run(tmp_path, "strips", "-o", "whole", "-q").returncode == 0
    results = {name: content for name, content in tree(tmp_path / "out").items() if "/" in name}
    assert results == {name: content for name, content in tree(tmp_path / "whole").items() if "/" in name}


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_a_project_that_crashes_or_hangs_leaves_the_machine_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cluster: str
) -> None:
    names = ("segfault", "hang", "memory", "good")
    write_projects(tmp_path, 1)
    for name in names:
        (tmp_path / "strips" / name).mkdir(parents=True)
        for path in (tmp_path / "s1").iterdir():
            (tmp_path / "strips" / name / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    count = Count()
    limits = Limits(seconds=2.5, megabytes=500.0)
    with clusters.cluster(cluster, limits, work=faulty.evaluate) as executor:
        Run(choose(["strips"]), (), None, force=False).go(executor, count.finished, Stop())
    assert count.statuses == {"segfault": "crashed", "hang": "timeout", "memory": "memory", "good": "good"}


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_a_scheduler_that_goes_away_ends_the_batch_in_good_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_projects(tmp_path / "strips", 12)
    monkeypatch.chdir(tmp_path)
    with (
        two_workers(tmp_path / "machines") as (address, _),
        subprocess.Popen(
            [sys.executable, "-m", "photostrip", "batch", "strips", "-o", "out", "--executor", f"dask:{address}"],
            env=environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as process,
    ):
        assert process.stderr is not None
        process.stderr.readline()
        scheduler = next(iter(_listening(int(address.rpartition(":")[2]))))
        os.kill(scheduler, signal.SIGKILL)
        out, err = process.communicate(timeout=60.0)
    assert process.returncode == 2
    assert "the connection to the cluster is lost" in err
    assert "Traceback" not in err
    found = re.search(r"12 projects: (\d+) not run, (\d+) good", out)
    assert found is not None
    done = [path for path in (tmp_path / "out").iterdir() if (path / "batch.json").exists()]
    assert len(done) == int(found[2])
    assert run(tmp_path, "strips", "-o", "out", "-q").returncode == 0


def _listening(port: int) -> Iterator[int]:
    """Give the process of the scheduler, by its command line."""
    for place in Path("/proc").glob("[0-9]*/cmdline"):
        words = place.read_bytes().split(b"\0") if place.exists() else []
        if b"--port" in words and str(port).encode() in words:
            yield int(place.parent.name)


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_a_cluster_without_workers_is_waited_for_aloud(tmp_path: Path) -> None:
    """As on a busy queue: the scheduler is there, the machines come later."""
    write_projects(tmp_path / "strips", 2)
    port = str(free_port())
    address, options = f"tcp://127.0.0.1:{port}", ("--host", "127.0.0.1", "--port", port, "--no-dashboard")
    with started(tmp_path / "scheduler", "dask_scheduler", *options):
        wait_for(tmp_path / "scheduler" / "log.txt", "Scheduler at", 1)
        with subprocess.Popen(
            [sys.executable, "-m", "photostrip", "batch", "strips", "--executor", f"dask:{address}"],
            cwd=tmp_path,
            env=environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as process:
            assert process.stderr is not None
            assert process.stderr.readline() == "the cluster has no workers yet; waiting for them\n"
            with started(tmp_path / "late", "dask_worker", address, "--nthreads", "1", "--no-dashboard"):
                out, _ = process.communicate(timeout=60.0)
    assert process.returncode == 0
    assert "2 projects: 2 good" in out


# ----------------------------------------------------------------------------------------------- no cluster


@pytest.mark.slow
@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("tcp://127.0.0.1:{port}", "no Dask scheduler answers at tcp://127.0.0.1:{port}"),
        ("tcp://127.0.0.1:port", "no Dask scheduler answers at tcp://127.0.0.1:port"),
    ],
)
def test_a_scheduler_that_is_not_there_is_told_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], address: str, message: str
) -> None:
    write_projects(tmp_path, 1)
    port = str(free_port())
    begin = time.perf_counter()
    assert main(["batch", str(tmp_path), "--executor", f"dask:{address.format(port=port)}"]) == 2
    assert time.perf_counter() - begin < clusters.CONNECT_SECONDS + 5.0  # not the half minute of the library
    assert message.format(port=port) in capsys.readouterr().err


def test_dask_is_asked_for_when_it_is_not_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_projects(tmp_path, 1)
    monkeypatch.setitem(sys.modules, "dask", None)
    assert main(["batch", str(tmp_path), "--executor", "dask:tcp://127.0.0.1:1"]) == 2
    assert "Dask is not installed; pip install 'photostrip[dask]'" in capsys.readouterr().err


def test_answers_of_another_program_are_refused() -> None:
    clusters.require_same(program())
    with pytest.raises(InputError, match=r"numpy 1\.0 there and .* here; install the same versions there"):
        clusters.require_same({**program(), "numpy": "1.0"})


# ------------------------------------------------------------------------------------------------ the parcel


@pytest.mark.slow
def test_a_parcel_is_all_that_is_needed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same answer, to the last byte and digest, where none of the files exists any more."""
    (project,) = write_projects(tmp_path / "strips", 1)
    monkeypatch.chdir(tmp_path)
    path = Path(project).relative_to(tmp_path)
    head, *rows = (path.parent / "observations.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    for name, some in (("first.csv", rows[:20]), ("second.csv", rows[20:])):  # a list of files travels as a whole
        (path.parent / name).write_text(head + "".join(some), encoding="utf-8")
    several = path.read_text(encoding="utf-8").replace("observations.csv", "[first.csv, second.csv]")
    path.write_text(several, encoding="utf-8")
    here = evaluate(Task(0, str(path)))
    parcel = pack(path)
    (tmp_path / "away").mkdir()
    monkeypatch.chdir(tmp_path / "away")
    there = evaluate(Task(0, str(path), parcel=parcel))
    assert here.files
    assert (there.files, there.inputs, there.outcome) == (here.files, here.inputs, here.outcome)


@pytest.mark.slow
def test_a_grid_travels_with_its_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (project,) = write_projects(tmp_path / "strips", 1)
    monkeypatch.chdir(tmp_path)
    path = Path(project).relative_to(tmp_path)
    crs = '"+proj=utm +zone=33 +datum=WGS84 +geoidgrids=own.gtx +type=crs"\n    height: orthometric'
    path.write_text(path.read_text(encoding="utf-8").replace('"EPSG:32633"', crs), encoding="utf-8")
    write_gtx(path.parent / "own.gtx", np.full((11, 11), 45.0), south=40.0, west=10.0, step=1.0)
    parcel = pack(path)
    assert parcel.grids == {"own.gtx": (path.parent / "own.gtx").read_bytes()}
    here = evaluate(Task(0, str(path)))
    assert here.outcome["status"] == "good"
    assert here.inputs[str(path.parent / "own.gtx")] is not None
    (path.parent / "own.gtx").unlink()
    there = evaluate(Task(0, str(path), parcel=parcel))
    assert (there.files, there.inputs, there.outcome) == (here.files, here.inputs, here.outcome)
    assert evaluate(Task(0, str(path))).outcome["status"] == "faulty"


@pytest.mark.slow
def test_a_parcel_of_a_project_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    (project,) = write_projects(tmp_path, 1)
    (tmp_path / "s1" / "control.csv").unlink()
    with pytest.raises(InputError, match="does not exist"):
        pack(Path(project))
