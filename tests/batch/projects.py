"""Small projects for batches, and commands that run on them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import Future
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from photostrip.batch.evaluation import evaluate
from photostrip.foreign.simulated import project_files
from photostrip.formats.files import write_files
from photostrip.simulation.simulation import simulate
from photostrip.simulation.spec import Flight, Points, Spec
from tests.source_tree import ROOT

if TYPE_CHECKING:
    from typing import Self

    from photostrip.batch.evaluation import Answer, Limits, Task

PHOTOS = 4
NOT_RESULTS = {".batch.lock"}


@cache
def _files() -> dict[str, str]:
    spec = Spec(name="small", flight=Flight(photos=PHOTOS), points=Points(rows=3, extra_per_model=2))
    return project_files(simulate(spec))


def write_projects(folder: Path, number: int) -> list[str]:
    """Write projects s1, s2, ... that differ in their control only; give their project files."""
    found = []
    for n in range(1, number + 1):
        files = dict(_files())
        head, *rows = files["control.csv"].splitlines()
        files["control.csv"] = "\n".join([head, *(_raised(row, n) for row in rows)]) + "\n"
        write_files(folder / f"s{n}", files)
        found.append(str(folder / f"s{n}" / "project.yaml"))
    return found


def _raised(row: str, metres: int) -> str:
    """Move a point of a control list up by whole metres: no two projects have the same result."""
    point, x, y, z, *rest = row.split(",")
    return ",".join([point, x, y, str(float(z) + metres), *rest])


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "photostrip", "batch", *arguments]


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), "NO_COLOR": "1", "COLUMNS": "100", **more}


def run(folder: Path, *arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:  # noqa: ANN401
    """Run ``photostrip batch`` as a process of its own."""
    given: dict[str, Any] = {"cwd": folder, "env": environment(), "capture_output": True, "text": True}
    return subprocess.run(command(*arguments), check=False, **(given | options))


def started(folder: Path, *arguments: str, mark: str = "MARK", **options: Any) -> subprocess.Popen[str]:  # noqa: ANN401
    """Start ``photostrip batch`` with a variable in its environment; its outputs are pipes if nothing else is said."""
    given: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    return subprocess.Popen(command(*arguments), cwd=folder, env=environment(**{mark: "1"}), text=True, **given)


def tree(folder: Path) -> dict[str, bytes]:
    """Give the content of every file below a folder, except the lock, which has none."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in NOT_RESULTS
    }


def patience(task: Task) -> tuple[Answer, float]:
    """Compute a good project; give its answer, and a limit that it keeps however busy the machine is, seconds."""
    begin = time.perf_counter()
    answer = evaluate(task)
    return answer, max(5.0, 30 * (time.perf_counter() - begin))


class Alone:
    """Stands in for the pool: does the same work in this process, where a test need not wait for others to start."""

    def __init__(self, jobs: int, limits: Limits) -> None:
        assert jobs > 0
        assert limits.seconds is None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...

    def room(self) -> int:
        return 1

    def submit(self, task: Task) -> Future[Answer]:
        future: Future[Answer] = Future()
        future.set_result(replace(known(task), number=task.number))
        return future

    def answer(self, future: Future[Answer], _: Task) -> Answer:
        return future.result()


def known(task: Task) -> Answer:
    """Compute a project whose files were not the same before: most of these tests are about what is done with it."""
    folder = Path(task.project).parent
    given = [*sorted(folder.iterdir()), *sorted(Path().glob("*.yaml"))] if folder.is_dir() else []
    return _evaluated(replace(task, number=0), tuple((str(path), path.read_bytes()) for path in given))


@cache
def _evaluated(task: Task, _: tuple[tuple[str, bytes], ...]) -> Answer:
    return evaluate(task)
