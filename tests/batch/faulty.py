"""What a worker does in tests: the real work, except for projects whose folder is called after a fault."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from photostrip.batch import evaluation

if TYPE_CHECKING:
    from collections.abc import Callable

    from photostrip.batch.tasks import Answer, Task

WORK = "tests.batch.faulty:evaluate"


def _eat() -> None:
    hoard = []
    while True:
        hoard.append(bytearray(10_000_000))


FAULTS: dict[str, Callable[[], object]] = {
    "segfault": lambda: os.kill(os.getpid(), signal.SIGSEGV),
    "exit": lambda: os._exit(5),
    "raise": lambda: sys.exit(0),
    "hang": lambda: time.sleep(1000),
    "busy": lambda: sum(range(10**15)),  # one call of a library: no other thread of the process has a turn
    "memory": _eat,
    "grow": lambda: _kept.append(bytearray(140_000_000)),
}
_kept: list[bytearray] = []


def evaluate(task: Task) -> Answer:
    folder = Path(task.project).parent
    if folder.name in FAULTS:
        FAULTS[folder.name]()
    if folder.name == "unlucky" and not (folder / "killed").exists():  # killed by somebody else, once
        (folder / "killed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return evaluation.evaluate(task)
