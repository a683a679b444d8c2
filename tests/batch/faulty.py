"""What a worker does in tests: the real work, except for projects whose folder is called after a fault."""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from photostrip.batch import evaluation
from photostrip.threads import THREAD_VARIABLES

if TYPE_CHECKING:
    from collections.abc import Callable

    from photostrip.batch.evaluation import Answer, Task


def _eat() -> None:
    hoard = []
    while True:
        hoard.append(bytearray(10_000_000))


FAULTS: dict[str, Callable[[], object]] = {
    "segfault": lambda: os.kill(os.getpid(), signal.SIGSEGV),
    "exit": lambda: os._exit(5),
    "hang": lambda: time.sleep(1000),
    "busy": lambda: sum(range(10**15)),  # one call of a library: no other thread of the process has a turn
    "memory": _eat,
    "threads": lambda: None if {os.environ.get(name) for name in THREAD_VARIABLES} == {"1"} else os._exit(6),
}


def evaluate(task: Task) -> Answer:
    folder = Path(task.project).parent
    if folder.name in FAULTS:
        with suppress(OSError):  # on another machine
            (folder / "worker").write_text(str(os.getpid()), encoding="utf-8")
        FAULTS[folder.name]()
    if folder.name == "unlucky" and not (folder / "killed").exists():  # killed by somebody else, once
        (folder / "killed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return evaluation.evaluate(task)
