"""Workers that crash, hang and eat memory: each takes its own project along and nothing else."""

from __future__ import annotations

import hashlib
import shutil
import time
from pathlib import Path

import pytest

from photostrip.batch.evaluation import Limits, Task, evaluate, failure
from photostrip.batch.pool import LocalPool, answers, cause_of, share_of_memory
from photostrip.errors import Fault
from tests.batch import faulty
from tests.batch.projects import patience, write_projects
from tests.loops import nonempty


def tasks_of(folder: Path, names: list[str]) -> list[Task]:
    """Give tasks for copies of one small project under these names."""
    write_projects(folder, 1)
    for name in names:
        shutil.copytree(folder / "s1", folder / name)
    return [Task(n, str(folder / name / "project.yaml")) for n, name in enumerate(names)]


FAULTS = {
    "segfault": ("crashed", "died, twice in a row: killed by SIGSEGV"),
    "exit": ("crashed", "died, twice in a row: it ended with exit code 5"),
    "hang": ("timeout", "took longer than "),
    "busy": ("timeout", "took longer than "),
    "memory": ("memory", "needs more memory than a worker may have"),
    "unlucky": ("good", ""),
    "threads": ("good", ""),
}


@pytest.mark.slow
def test_every_fault_takes_only_its_own_project_along(tmp_path: Path) -> None:
    names = ["good1", *(name for fault in FAULTS for name in (fault, f"after-{fault}"))]
    tasks = tasks_of(tmp_path, names)
    good, seconds = patience(tasks[0])
    with LocalPool(2, Limits(seconds, megabytes=500.0), faulty.evaluate) as pool:
        heard = list(answers(pool, iter(tasks), lambda: False))
    assert sorted(answer.number for answer in heard) == list(range(len(tasks)))  # one for each, none twice
    outcomes = {names[answer.number]: answer for answer in heard}
    for name, answer in nonempty(outcomes.items()):
        status, message = FAULTS.get(name, ("good", ""))
        assert answer.outcome["status"] == status, (name, answer.outcome["messages"])
        assert message in "".join(answer.outcome["messages"])
        assert bool(answer.files) is (status == "good")
    assert outcomes["unlucky"].files == outcomes["good1"].files == good.files


@pytest.mark.slow
def test_workers_are_gone_when_the_pool_is(tmp_path: Path) -> None:
    (task,) = tasks_of(tmp_path, ["hang"])
    worker = tmp_path / "hang" / "worker"
    with LocalPool(1, work=faulty.evaluate) as pool:
        assert list(answers(pool, iter([task]), lambda: bool(worker.exists() and worker.read_text()))) == []
        assert Path(f"/proc/{worker.read_text()}").exists()
    for _ in range(50):
        if not Path(f"/proc/{worker.read_text()}").exists():
            return
        time.sleep(0.1)
    raise AssertionError("the worker still lives")


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0, "it ended with exit code 0"),
        (-9, "killed by SIGKILL: by somebody, or because memory ran out"),
        (-200, "killed by signal 200"),
    ],
)
def test_causes_in_words(code: int, words: str) -> None:
    assert cause_of(code) == words


def test_memory_is_shared_evenly() -> None:
    assert share_of_memory(4) == pytest.approx(share_of_memory(1) / 4)
    assert share_of_memory(1) > 100.0


@pytest.mark.parametrize(("error", "status"), [(ZeroDivisionError("by zero"), "crashed"), (MemoryError(), "memory")])
def test_an_error_of_the_work_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, status: str
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise error

    (task,) = tasks_of(tmp_path, ["good1"])
    monkeypatch.setattr("photostrip.library.project.Project.run", broken)
    answer = evaluate(task)
    assert (answer.outcome["status"], answer.outcome["exit_code"]) == (status, 70)
    if status == "crashed":
        assert answer.outcome["messages"][0].startswith("internal error (a bug): ZeroDivisionError: by zero")
        assert "in broken" in answer.trace


def test_a_weak_geometry_is_told_and_a_good_project_says_what_it_read(tmp_path: Path) -> None:
    good, weak = tasks_of(tmp_path, ["good1", "weak"])
    table = tmp_path / "weak" / "observations.csv"
    head, *rows = table.read_text(encoding="utf-8").splitlines()
    kept = [row for row in rows if row.split(",")[1] <= sorted({row.split(",")[1] for row in rows})[3]]
    table.write_text("\n".join([head, *kept]) + "\n", encoding="utf-8")
    answer, other = evaluate(good), evaluate(weak)
    assert other.outcome["exit_code"] in {2, 3}
    assert other.files == {}
    files = [path for path in (tmp_path / "good1").iterdir() if path.name != "truth.json"]
    assert answer.inputs == {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
    assert list(answer.outcome) == list(failure("faulty", Fault("no")))  # a failure has the keys of a result
