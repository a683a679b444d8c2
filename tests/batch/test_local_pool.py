"""Workers that crash, hang and eat memory: each takes its own project along and nothing else."""

from __future__ import annotations

import os
import shutil
from typing import TYPE_CHECKING

import pytest

from photostrip.batch.evaluation import evaluate
from photostrip.batch.local_pool import LocalPool, cause_of
from photostrip.batch.outcomes import failure
from photostrip.batch.tasks import Answer, Limits, Task
from photostrip.batch.worker_process import WorkerProcess, share_of_memory
from photostrip.errors import Fault, InputError, PhotostripError
from tests.batch.faulty import WORK
from tests.batch.projects import write_projects
from tests.loops import nonempty

if TYPE_CHECKING:
    from pathlib import Path


def never() -> bool:
    return False


def tasks_of(folder: Path, names: list[str]) -> list[Task]:
    """Give tasks for copies of one small project under these names."""
    write_projects(folder, 1)
    for name in names:
        shutil.copytree(folder / "s1", folder / name)
    return [Task(n, str(folder / name / "project.yaml")) for n, name in enumerate(names)]


FAULTS = {
    "segfault": ("crashed", "died, 2 times in a row: killed by SIGSEGV"),
    "exit": ("crashed", "died, 2 times in a row: it ended with exit code 5"),
    "raise": ("crashed", "died, 2 times in a row: it ended with exit code 0"),
    "hang": ("timeout", "took longer than 2.5 s"),
    "memory": ("memory", "needs more memory than a worker may have"),
    "unlucky": ("good", ""),
}


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_every_fault_takes_only_its_own_project_along(tmp_path: Path) -> None:
    names = ["good1", *(name for fault in FAULTS for name in (fault, f"after-{fault}"))]
    tasks = tasks_of(tmp_path, names)
    with LocalPool(2, Limits(seconds=2.5, megabytes=500.0), WORK) as pool:
        answers = list(pool.answers(iter(tasks), never))
        assert len({worker.process.pid for worker in pool.workers}) == len(pool.workers) <= 2
    assert sorted(answer.number for answer in answers) == list(range(len(tasks)))  # one for each, none twice
    outcomes = {names[answer.number]: answer for answer in answers}
    for name, answer in nonempty(outcomes.items()):
        status, message = FAULTS.get(name, ("good", ""))
        assert answer.outcome["status"] == status, (name, answer.outcome["messages"])
        assert message in "".join(answer.outcome["messages"])
        assert bool(answer.files) is (status == "good")
    alone = evaluate(tasks[0])
    assert outcomes["unlucky"].files == alone.files
    assert outcomes["good1"].files == alone.files


@pytest.mark.slow
def test_a_worker_that_has_grown_is_replaced(tmp_path: Path) -> None:
    tasks = tasks_of(tmp_path, ["good1", "grow", "good2"])
    seen = []
    with LocalPool(1, Limits(megabytes=400.0), WORK, begun=lambda _: seen.append(pool.workers[0].process.pid)) as pool:
        answers = list(pool.answers(iter(tasks), never))
    assert [answer.outcome["status"] for answer in answers] == ["good"] * 3
    assert seen[0] == seen[1] != seen[2]
    assert answers[1].megabytes > 200.0


@pytest.mark.slow
def test_workers_are_gone_when_the_pool_is(tmp_path: Path) -> None:
    (task,) = tasks_of(tmp_path, ["hang"])
    stop: list[bool] = []
    with LocalPool(1, work=WORK, begun=lambda _: stop.append(True)) as pool:
        assert list(pool.answers(iter([task]), lambda: bool(stop))) == []
        pids = [worker.process.pid for worker in pool.workers]
        assert all(_alive(pid) for pid in nonempty(pids))
    assert pids
    assert not any(_alive(pid) for pid in pids)


@pytest.mark.slow
def test_a_worker_that_computes_for_ever_is_killed(tmp_path: Path) -> None:
    (task,) = tasks_of(tmp_path, ["busy"])
    pids: list[int] = []
    with LocalPool(1, Limits(seconds=1.0), WORK, begun=lambda _: pids.append(pool.workers[0].process.pid)) as pool:
        answers = pool.answers(iter([task]), never)
        assert next(answers).outcome["status"] == "timeout"
        assert not any(_alive(pid) for pid in nonempty(pids))


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_workers_that_do_not_start_are_an_error_not_a_loop(tmp_path: Path) -> None:
    with (
        LocalPool(1, work="tests.batch.faulty:nothing") as pool,
        pytest.raises(PhotostripError, match="no worker") as told,
    ):
        list(pool.answers(iter(tasks_of(tmp_path, ["good1"])), never))
    assert "has no attribute 'nothing'" in str(told.value)


@pytest.mark.slow
@pytest.mark.usefixtures("_quick_start")
def test_too_little_memory_for_anything_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(WorkerProcess, "fate", lambda worker: worker.end() and 71)
    with (
        LocalPool(1, Limits(megabytes=3.0), work="tests.batch.faulty:nothing") as pool,
        pytest.raises(InputError) as told,
    ):
        list(pool.answers(iter(tasks_of(tmp_path, ["good1"])), never))
    assert "no process of the batch can start within 3 MB of memory" in str(told.value)


@pytest.mark.slow
def test_workers_compute_with_one_thread(tmp_path: Path) -> None:
    worker = WorkerProcess(1000.0)
    try:
        assert worker.hear() == "ready"
        environ = (f"/proc/{worker.process.pid}/environ", "rb")
        with open(*environ) as stream:  # noqa: PTH123 (a file of the system)
            variables = stream.read().split(b"\0")
        assert b"OPENBLAS_NUM_THREADS=1" in variables
        worker.give(Task(7, str(tmp_path / "none.yaml")))
        answer = worker.hear()
        assert (answer.number, answer.outcome["status"]) == (7, "faulty")
    finally:
        worker.end()


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0, "it ended with exit code 0"),
        (-6, "killed by SIGABRT"),
        (-9, "killed by SIGKILL: by somebody, or because memory ran out"),
        (-200, "killed by signal 200"),
    ],
)
def test_causes_in_words(code: int, words: str) -> None:
    assert cause_of(code) == words


def test_memory_is_shared_evenly() -> None:
    assert share_of_memory(4) == pytest.approx(share_of_memory(1) / 4)
    assert share_of_memory(1) > 100.0


# ------------------------------------------------------------------------------------------------- the work


def test_an_internal_error_is_told_with_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("by zero")

    (task,) = tasks_of(tmp_path, ["good1"])
    monkeypatch.setattr("photostrip.library.project.Project.run", broken)
    answer = evaluate(task)
    assert answer.outcome["status"] == "crashed"
    assert answer.outcome["exit_code"] == 70
    assert answer.outcome["messages"][0].startswith("internal error (a bug): ZeroDivisionError: by zero")
    assert "in broken" in answer.trace


def test_a_weak_geometry_is_told(tmp_path: Path) -> None:
    (task,) = tasks_of(tmp_path, ["good1"])
    table = tmp_path / "good1" / "observations.csv"
    head, *rows = table.read_text(encoding="utf-8").splitlines()
    kept = [row for row in rows if row.split(",")[1] <= sorted({row.split(",")[1] for row in rows})[3]]
    table.write_text("\n".join([head, *kept]) + "\n", encoding="utf-8")
    answer = evaluate(task)
    assert answer.outcome["exit_code"] in {2, 3}
    assert answer.files == {}


def test_an_account_is_kept_of_every_file(tmp_path: Path) -> None:
    import hashlib

    (task,) = tasks_of(tmp_path, ["good1"])
    answer = evaluate(task)
    files = [path for path in (tmp_path / "good1").iterdir() if path.name != "truth.json"]
    assert answer.inputs == {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_out_of_memory_in_the_work_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def greedy(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr("photostrip.batch.evaluation.loaded_from", greedy)
    assert evaluate(Task(0, str(tmp_path))).outcome["status"] == "memory"


def test_a_failure_has_the_keys_of_a_result(tmp_path: Path) -> None:
    (task,) = tasks_of(tmp_path, ["good1"])
    good: Answer = evaluate(task)
    assert list(good.outcome) == list(failure("faulty", Fault("no")))
