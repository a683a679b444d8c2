"""The same work on a Dask cluster: a real scheduler and real workers, on this machine, without a disk in common."""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import sys
import time
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from photostrip.batch import cluster as clusters
from photostrip.batch.evaluation import Limits, Task, evaluate, pack
from photostrip.batch.folder import program
from photostrip.batch.run import Run, Stop
from photostrip.batch.selection import choose
from photostrip.errors import InputError
from tests.batch import faulty
from tests.batch.projects import environment, patience, run, tree, write_projects
from tests.batch.projects import started as start_batch
from tests.geodesy.frames import write_gtx

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import IO, Any

    from tests.calls import Call
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
        command = [sys.executable, "-m", f"distributed.cli.{arguments[0]}", *arguments[1:]]
        process = subprocess.Popen(command, cwd=folder, env=environment(), stdout=log, stderr=log, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@contextmanager
def scheduler(folder: Path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Start a scheduler; give its address."""
    port = str(free_port())
    with started(folder, "dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard") as process:
        for _ in range(300):
            if "Scheduler at" in (folder / "log.txt").read_text(encoding="utf-8"):
                break
            time.sleep(0.1)
        yield f"tcp://127.0.0.1:{port}", process


def worker(folder: Path, address: str, *options: str) -> AbstractContextManager[subprocess.Popen[str]]:
    return started(folder, "dask_worker", address, "--nthreads", "1", "--no-dashboard", *options)


@contextmanager
def batch(folder: Path, *arguments: str) -> Iterator[tuple[subprocess.Popen[str], IO[str]]]:
    """Start a batch; give the process and what it says."""
    with start_batch(folder, "strips", "-o", "out", *arguments) as process:
        assert process.stderr is not None
        yield process, process.stderr


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
        folder = tmp_path_factory.mktemp("cluster")
        with (
            scheduler(folder / "scheduler") as (address, _),
            worker(folder / "w1", address, "--no-nanny"),
            worker(folder / "w2", address, "--no-nanny"),
        ):
            yield address


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_all_executors_write_the_same_bytes(tmp_path: Path, cluster: str) -> None:
    """One process, two processes, a cluster; a fault, a preset beside the projects and an absolute path among them."""
    projects = write_projects(tmp_path / "strips", 4)
    (tmp_path / "preset.yaml").write_text("processing: {relative: {grubbs_alpha: 0.02}}\n", encoding="utf-8")
    elsewhere = tmp_path / "elsewhere.csv"
    (tmp_path / "strips" / "s4" / "control.csv").rename(elsewhere)
    for n, old, new in (
        (1, "photostrip: 1", "photostrip: 1\nextends: ../../preset.yaml"),
        (2, "control.csv", "none.csv"),
        (3, "control.csv", str(elsewhere)),
    ):
        path = Path(projects[n])
        path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
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
def test_a_project_that_crashes_or_hangs_leaves_the_machine_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cluster: str
) -> None:
    names = ("segfault", "hang", "memory", "good")
    write_projects(tmp_path, 1)
    for name in names:
        shutil.copytree(tmp_path / "s1", tmp_path / "strips" / name)
    monkeypatch.chdir(tmp_path)
    statuses: dict[str, str] = {}

    def finished(outcome: dict[str, Any], _: object) -> None:
        statuses[Path(outcome["project"]).parent.name] = outcome["status"]

    _, seconds = patience(Task(0, "strips/good/project.yaml"))
    with clusters.cluster(cluster, Limits(seconds, megabytes=500.0), work=faulty.evaluate) as executor:
        Run(choose(["strips"]), (), None, force=False).go(executor, finished, Stop())
    assert statuses == {"segfault": "crashed", "hang": "timeout", "memory": "memory", "good": "good"}


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_machines_come_and_go(tmp_path: Path) -> None:
    """No machine is there at first, one is lost, another comes; in the end the scheduler is lost."""
    number = 12
    write_projects(tmp_path / "strips", number)
    with scheduler(tmp_path / "scheduler") as (address, middle), ExitStack() as stack:
        executor = "--executor", f"dask:{address}"
        with batch(tmp_path, *executor) as (process, said):
            assert said.readline() == "the cluster has no workers yet; waiting for them\n"
            with worker(tmp_path / "first", address, "--no-nanny"):
                lines = [said.readline() for _ in range(3)]
            stack.enter_context(worker(tmp_path / "second", address))
            out, err = process.communicate(timeout=60.0)
        assert process.returncode == 0
        assert f"{number} projects: {number} good" in out
        assert len({line.split()[3] for line in [*lines, *err.splitlines()]}) == number  # each is told once
        assert len([*lines, *err.splitlines()]) == number
        with batch(tmp_path, *executor, "--force") as (process, said):
            said.readline()
            middle.kill()
            out, err = process.communicate(timeout=60.0)
    assert process.returncode == 2
    assert ("the connection to the cluster is lost" in err, "Traceback" in err) == (True, False)
    assert re.search(rf"{number} projects: \d+ not run, \d+ good", out)
    assert run(tmp_path, "strips", "-o", "out", "-q").returncode == 0
    assert run(tmp_path, "strips", "-o", "whole", "-q").returncode == 0
    assert tree(tmp_path / "out") == tree(tmp_path / "whole")


# ----------------------------------------------------------------------------------------------- no cluster


@pytest.mark.slow
@pytest.mark.parametrize("port", [None, "port"])
def test_a_scheduler_that_is_not_there_is_told_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Call, port: str | None
) -> None:
    monkeypatch.setattr(clusters, "CONNECT_SECONDS", 0.5)
    write_projects(tmp_path, 1)
    address = f"tcp://127.0.0.1:{port or free_port()}"
    begin = time.perf_counter()
    code, _, err = call("batch", tmp_path, "--executor", f"dask:{address}")
    assert time.perf_counter() - begin < 15.0  # not the half minute of the library
    assert (code, f"no Dask scheduler answers at {address}" in err) == (2, True)


def test_dask_is_asked_for_when_it_is_not_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Call
) -> None:
    write_projects(tmp_path, 1)
    monkeypatch.setitem(sys.modules, "dask", None)
    code, _, err = call("batch", tmp_path, "--executor", "dask:tcp://127.0.0.1:1")
    assert (code, "Dask is not installed; pip install 'photostrip[dask]'" in err) == (2, True)


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
    crs = '"+proj=utm +zone=33 +datum=WGS84 +geoidgrids=own.gtx +type=crs"\n  height: orthometric'
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
